"""Calls of the exported filter with any numbers whatever, under sanitizers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from export_problems import CAPACITY, hostile
from in_c import COMPILER, STRICT
from qpavoid.avoidance.settings import Actuation, AvoidanceSettings, Margins
from qpavoid.avoidance.validation import as_driven
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
from qpavoid.model.robot import Limits
from reliability.calls import CAREFUL, ENDLESS, LIMITED, MIR
from timing.exported import compile_replay, replay

REFUSED = [math.nan, math.inf, -math.inf, 1e308, -1e308, 1e200, -1e155, 1e101]
ODD = [9.9e99, -9.9e99, 1e80, 1e50, -1e30, 1e16, 1e9, 1e5, -1e3, 1e-9, 1e-160, 5e-324]
PLAIN = AvoidanceSettings()
WIDENED = replace(PLAIN, margins=Margins(0.0, 1e-3))
LATE = AvoidanceSettings(actuation=Actuation(0.05, 0.2, True))
FREE = Limits(-math.inf, math.inf, -math.inf, math.inf)
FILTERS = {
    "ahead-limited": (LIMITED, CAREFUL, True),
    "ahead-endless": (ENDLESS, WIDENED, True),
    "late": (LIMITED, LATE, True),
    "free": (FREE, PLAIN, True),
    "endless": (ENDLESS, WIDENED, False),
}
"""Limits, settings, look-ahead."""


def fuzzed(seed, count, robot):
    """Return problems some numbers of which are any, and how often a run begins.

    ``anew`` 2: the run goes on, but ``last_v`` and ``last_omega`` are driven.
    """
    rng = np.random.default_rng(seed)
    problems = hostile(rng, count, robot)
    for p in problems:
        seen = p["obstacles"]
        if rng.random() < 0.3:
            p["anew"] = rng.integers(1, 3)
        if rng.random() < 0.2:
            seen["age"] = rng.choice([1e-300, 1.0, 1e3, 1e50, 1e76, 1e155, 1e308])
        spoil(rng, p, ("v", "omega"), 0.2)
        spoil(rng, p, ("last_v", "last_omega"), 0.3)
        for name in ("points", "discs", "disc_velocities", "walls", "corners"):
            spoil(rng, seen, (name,), 0.1)
        if rng.random() < 0.1:
            spoil_one(rng, seen["polygons"][:, 1:])
        faster = rng.choice([1.0, 10.0, 1e3, 1e6], 2, p=[0.7, 0.1, 0.1, 0.1])
        with np.errstate(over="ignore"):
            seen["disc_velocities"] *= faster[0]
            seen["polygons"][:, 1:] *= faster[1]
    return problems


def spoil(rng, record, names, share):
    """Put odd numbers into some fields of a record."""
    for name in names:
        if rng.random() < share:
            if record[name].shape:
                spoil_one(rng, record[name])
            else:
                record[name] = odd(rng)


def spoil_one(rng, array):
    """Put an odd number somewhere, or everywhere in a column."""
    column = rng.integers(array.shape[1])
    rows = slice(None) if rng.random() < 0.2 else rng.integers(len(array))
    array[rows, column] = odd(rng)


def odd(rng):
    """Return a number that no robot meets."""
    return rng.choice(REFUSED if rng.random() < 0.1 else ODD)


def wrong(answers, robot, last, dt):
    """Return which answers are not finite or not within the limits.

    Args:
        answers: With fields v, omega, clearance, slack, residual, shortfall.
        robot: Its limits count.
        last: (n, 2) what was driven before.
        dt: Control step, s.
    """
    v, omega = answers["v"], answers["omega"]
    low_v, high_v, low_w, high_w, a, b, wheel, track, _ = robot.limit_vector
    numbers = [answers[n] for n in ("v", "omega", "slack", "residual", "shortfall")]
    excess = [
        low_v - v,
        v - high_v,
        low_w - omega,
        omega - high_w,
        np.abs(v) + 0.5 * track * np.abs(omega) - wheel,
        np.abs(v - last[:, 0]) - a * dt,
        np.abs(omega - last[:, 1]) - b * dt,
    ]
    bad = ~np.isfinite(numbers).all(axis=0) | np.isnan(answers["clearance"])
    return bad | (answers["clearance"] == -math.inf) | ~(np.max(excess, axis=0) < 1e-9)


def in_c(program, robot, problems):
    """Return the answers of an exported filter, and which of them are wrong."""
    answers = replay(program, problems)
    last = np.zeros((len(problems), 2))
    last[1:, 0], last[1:, 1] = answers["v"][:-1], answers["omega"][:-1]
    for before, p in zip(last, problems, strict=True):
        said = float(p["last_v"]), float(p["last_omega"])
        if p["anew"] == 1:
            before[:] = 0.0
        if p["anew"] and all(map(math.isfinite, said)):
            before[:] = as_driven(said, robot.limit_vector)
    return answers, wrong(answers, robot, last, PLAIN.dt), last


SANE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", FILTERS)
def test_no_call_breaks_the_exported_filter(name, tmp_path):
    limits, settings, ahead = FILTERS[name]
    robot = replace(MIR, limits=limits)
    export_c(tmp_path, robot, settings, CAPACITY, ahead)
    try:
        program = compile_replay(tmp_path, [*STRICT, *SANE])
    except QPAvoidError as why:
        assert "sanit" in str(why) or "asan" in str(why), why
        pytest.skip("no sanitizers")
    seen = set()
    for seed in range(3):
        problems = fuzzed([seed, len(name)], 5_000, robot)
        answers, bad, last = in_c(program, robot, problems)
        assert len(answers) == len(problems)
        assert not bad.any(), (answers[bad][:3], last[bad][:3])
        seen |= set(answers["status"].tolist())
    assert seen >= {-1, 1, 2}
