"""The timed elastic band: its plans against oracles, and what it does when it fails."""

import numpy as np
import pytest

from guided import HERE, SETTINGS, SLOW_ROBOT, make, towards
from qpavoid.avoidance.decision import Status
from qpavoid.lab.baselines.drive import wide_discs
from qpavoid.lab.baselines.predictive import Situation
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, clearance

METHOD = make("teb")
END = (2.8, 0.0, 0.0)


def planned(obstacles, method=METHOD, driven=(0.5, 0.0), end=END):
    """Return the bands that a first step finds, the cheapest first."""
    discs = wide_discs(obstacles, SETTINGS)
    to = Situation((0.5, 0.0), towards(driven=driven), discs)
    bands = [method.solve(x, end, to) for x in method.starts(None, end, to)]
    return sorted(bands, key=lambda band: band.cost)


def where(disc, velocity, time):
    x, y, radius = disc
    return x + time * velocity[0], y + time * velocity[1], radius


def test_a_free_way_is_driven_in_the_least_time():
    (band,) = planned(Obstacles())
    assert band.steps.sum() == pytest.approx(END[0] / ROBOT.limits.v_max, abs=0.05)
    assert band.twists[:, 0] == pytest.approx(ROBOT.limits.v_max, abs=0.02)
    assert band.poses[-1] == pytest.approx(END, abs=0.05)


def test_a_band_is_a_motion_of_the_unicycle():
    band = planned(Obstacles(discs=[(1.5, 0.1, 0.3)]))[0]
    pose = HERE
    for (v, omega), time, there in zip(
        band.twists, band.steps, band.poses[1:], strict=True
    ):
        pose = arc(*pose, v, omega, time)
        assert there == pytest.approx(pose, abs=0.02)


@pytest.mark.parametrize(
    ("disc", "velocity"),
    [((1.5, 0.1, 0.3), (0.0, 0.0)), ((1.6, -1.2, 0.3), (0.0, 0.6))],
    ids=["stands", "crosses"],
)
def test_every_way_round_keeps_r_min(disc, velocity):
    bands = planned(Obstacles(discs=[disc], disc_velocities=[velocity]))
    wide = wide_discs(Obstacles(discs=[disc], disc_velocities=[velocity]), SETTINGS)
    sides = set()
    for band in bands:
        assert band.slack.max() < 1e-3
        times = np.cumsum(band.steps)
        for pose, time in zip(band.poses[1:], times, strict=True):
            there = Obstacles(discs=[where(disc, velocity, time)])
            assert clearance(there, tuple(pose)) > wide[0, 2] - disc[2] - 5e-3
        sides.add(np.sign(band.poses[:, 1].sum()))
    assert sides == {1.0, -1.0}


def test_limits_hold_from_the_twist_driven_last_to_rest():
    obstacles, driven = Obstacles(discs=[(1.5, 0.1, 0.3)]), (0.2, 0.1)
    band, limits = (
        planned(obstacles, make("teb", SLOW_ROBOT), driven)[0],
        SLOW_ROBOT.limits,
    )
    v, omega = band.twists.T
    assert limits.v_min - 1e-6 <= v.min() and v.max() <= limits.v_max + 1e-6
    assert np.abs(omega).max() <= limits.omega_max + 1e-6
    wheels = np.abs(v) + 0.5 * limits.track * np.abs(omega)
    assert wheels.max() <= limits.wheel_speed + 1e-3
    changes = np.abs(np.diff(np.vstack([driven, band.twists, (0.0, 0.0)]), axis=0))
    steps = band.steps
    times = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    most = limits.acceleration, limits.angular_acceleration
    assert (changes <= times[:, None] * most + 1e-3).all()


def test_where_no_band_keeps_clear_it_relaxes_or_brakes():
    both = [(1.3, 0.0, 0.3), (-1.3, 0.0, 0.3)]
    closing = Obstacles(discs=both, disc_velocities=[(-1.5, 0.0), (1.5, 0.0)])
    decision = METHOD.start(0.5)(0.5, 0.0, closing, towards())
    assert decision.status in (Status.RELAXED, Status.STOPPED)
    assert np.isfinite(decision[:2]).all()
