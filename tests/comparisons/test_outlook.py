"""The paper's outlook: radius by closing speed, variable coefficients, the study."""

import csv
import math
import sys

import numpy as np
import pytest

outlook = pytest.importorskip("outlook", reason="needs qpavoid[study]")

import outlook_laws as laws
from places import COMPARISONS
from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot

ROBOT, SETTINGS = Robot.mir100(), AvoidanceSettings()
FRONT = max(x for x, _ in ROBOT.footprint.vertices)


def step(law, gap, velocity=(0.0, 0.0), driven=(0.0, 0.0), wanted=(0.5, 0.0), e=0.0):
    """The twist among one disc of 0.2 m ahead of the apex, ``gap`` m away."""
    discs, context = (
        [(FRONT + gap + 0.2, 0.0, 0.2)],
        StepContext((0.0,) * 3, (e, 0.0, 0.0), (0.2, 0.0), (9.0, 0.0, 0.0), driven),
    )
    seen = Obstacles(discs=discs, disc_velocities=[velocity])
    return law(*wanted, seen, context)


def made(arm="closing-radius", constants=(0.5, 1.0), law=5):
    return laws.law_of(law, arm, constants)(ROBOT, SETTINGS)


@pytest.mark.parametrize("arm", ["closing-radius", "variable-coefficients"])
@pytest.mark.parametrize("law", [5, 7])
@pytest.mark.parametrize("case", ["paper/test_case_1", "paper/test_case_2"])
def test_the_plain_law_where_nothing_varies(arm, law, case):
    """What is slow in both cases has the paper's least radius, whoever drives."""
    scenario, same = load_scenario(case), (SafetyRadius.r_min_slow, 0.5)
    if arm == "variable-coefficients":
        same = 1.0, 0.0
    mine = run(scenario, laws.law_of(law, arm, same))
    plain = run(scenario, f"eq{law}")
    for name in ("x_m", "y_m", "heading_rad", "v_mps", "omega_radps"):
        np.testing.assert_array_equal(mine[name], plain[name])


@pytest.mark.parametrize("speed", [-0.8, 0.0, 0.1, 0.3, 0.7, 1.0, 1.6])
def test_the_radius_grows_with_the_closing_speed(speed):
    """Found by bisection: the gap from which on the law changes the desired twist."""
    law, (near, far) = made(), (0.0, 2.0)
    for _ in range(40):
        gap = 0.5 * (near + far)
        twist = step(law, gap, velocity=(-0.6 * speed, 0.0), driven=(0.4 * speed, 0.0))
        near, far = (gap, far) if tuple(twist[:2]) != (0.5, 0.0) else (near, gap)
    expected = np.interp(speed, [0.1, 1.0], [0.17, 0.5]) * 4.0 / 3.0
    assert near == pytest.approx(expected, abs=1e-6)


def test_what_passes_is_not_closing_in():
    aside = Obstacles(discs=[(0.0, 0.9, 0.2)], disc_velocities=[(1.5, 0.0)])
    here, twist = (0.0, 0.0, 0.0), (0.5, 0.0)
    context = StepContext(here, here, twist, (9.0, 0.0, 0.0), twist)
    gap = 0.9 - 0.2 - 0.29
    assert 4.0 / 3.0 * 0.17 < gap < 4.0 / 3.0 * 0.5
    assert tuple(made()(*twist, aside, context)[:2]) == twist


@pytest.mark.parametrize("seed", range(20))
def test_the_closing_speed_is_the_rate_of_the_distance(seed):
    rng = np.random.default_rng(seed)
    centre = rng.uniform(1.2, 2.0) * np.array([math.cos(seed), math.sin(seed)])
    velocity, (v, omega) = rng.uniform(-1.0, 1.0, 2), rng.uniform(-1.0, 1.0, 2)
    law, tick = made(), 1e-6

    def contact(t):
        cos, sin = math.cos(omega * t), math.sin(omega * t)
        moved = centre + t * velocity - (v * t, 0.0)
        here = cos * moved[0] + sin * moved[1], cos * moved[1] - sin * moved[0]
        disc = Obstacles(discs=[(*here, 0.2)], disc_velocities=[velocity])
        return law._nearest(disc)

    rate = (contact(tick).distance - contact(0.0).distance) / tick
    assert laws.closing_speed(contact(0.0), (v, omega)) == pytest.approx(
        -rate, abs=1e-4
    )


def test_the_coefficients_at_their_limits():
    """Half way between r_min and r: ẋ_0/2 pushes, and half of κ is lost."""
    gap, s, kappa = 0.17 * 7.0 / 6.0, 0.1, 0.8
    law = made("variable-coefficients", (s, kappa))
    for closing, share in ((-0.5, s), (0.0, s), (0.25, 0.55), (0.5, 1.0), (0.9, 1.0)):
        assert law.push(closing) == pytest.approx(share)
        v = step(law, gap, driven=(closing, 0.0), wanted=(1.2, 0.0), e=1.0)[0]
        recovery = (1.2 - 0.2) * (1.0 - 0.5 * kappa)
        plain = step(made(constants=(0.17, 0.5)), gap, wanted=(0.0, 0.0))[0]
        assert v == pytest.approx(0.2 + recovery + share * plain)
    far = step(law, 1.0, wanted=(1.2, 0.0))
    assert tuple(far[:2]) == (1.2, 0.0)


def test_the_smallest_study(tmp_path, monkeypatch):
    command = ["outlook.py", "--scenes", "1", "--workers", "1", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    outlook.main()
    with (tmp_path / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = ["", *(f" {arm}" for arm in outlook.SPACE)]
    assert [row["method"] for row in rows] == [
        f"eq{k}{x}" for k in (5, 7) for x in names
    ]
    assert not any(row["error"] for row in rows)
    for row in rows:
        least = float(row["min_clearance_m"])
        assert float(row["min_room_m"]) == pytest.approx(least - 0.17)


def test_what_is_chosen_is_what_was_found_best():
    with (COMPARISONS / "results" / "outlook" / "tuned.csv").open() as file:
        rows = list(csv.DictReader(file))
    for law, arms in laws.CHOSEN.items():
        for arm, chosen in arms.items():
            found = [r for r in rows if (int(r["law"]), r["arm"]) == (law, arm)]
            assert len(found) == len(outlook.SPACE[arm]) == 8
            best = min(found, key=lambda row: float(row["loss"]))
            assert tuple(map(float, best["constants"].split())) == chosen
