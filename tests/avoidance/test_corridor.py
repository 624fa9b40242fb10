"""Points are walls: a corridor is driven at full speed, however it is known."""

import math
from functools import cache

import numpy as np
import pytest

from driven import driven_to, least_in_all, lines_of
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot

RADIUS, HALF, SECONDS = 0.17, 0.25, 3.0
ROBOT = Robot("cart", Footprint.rectangle(0.9, 0.5), Limits.symmetric(1.0, 1.5))
KINDS = ("points", "segments", "discs")
steps = pytest.mark.parametrize("dt", [0.02, 0.05])


def as_points(walls, pitch=0.05):
    rows = []
    for x1, y1, x2, y2 in walls:
        n = max(1, round(math.hypot(x2 - x1, y2 - y1) / pitch))
        share = np.arange(n + 1)[:, None] / n
        rows.append((1 - share) * (x1, y1) + share * (x2, y2))
    return np.vstack(rows)


def told_as(walls, kind):
    """Walls as points, as capsules without length, or as walls."""
    walls = np.array(walls, dtype=float)
    if kind == "points":
        return {"points": as_points(walls)}
    if kind == "discs":
        points = as_points(walls)
        return {"discs": np.column_stack([points, np.zeros(len(points))])}
    return {"walls": walls}


def drive(obstacles, dt, seconds=SECONDS, pose=(0.0, 0.0, 0.0)):
    """Ask for 1 m/s; return the trace, having checked that nothing came too near."""
    settings = AvoidanceSettings(SafetyRadius(RADIUS, RADIUS), dt=dt)
    safety, trace = SafetyFilter(ROBOT, settings), []
    world = Obstacles(**obstacles)
    for _ in range(round(seconds / dt)):
        decision = safety.filter(1.0, 0.0, world.seen_from(pose))
        trace.append((*pose, decision.v, decision.omega))
        pose = driven_to(pose, decision.v, decision.omega, dt)
    trace, lines = np.array(trace), lines_of(**obstacles)
    lines = lines[np.abs(lines[:, 0]) < 1e6]
    assert (
        least_in_all(ROBOT.footprint.vertices, trace, dt, lines) >= RADIUS - 1.0002e-3
    )
    return trace


@cache
def corridor(kind, side, dt):
    y = HALF + side
    return drive(told_as([(-3, y, 9, y), (9, -y, -3, -y)], kind), dt)


def speed(trace):
    """Its mean after the first second."""
    later = trace[len(trace) // 3 :]
    return (later[-1, 0] - later[0, 0]) / ((len(later) - 1) * SECONDS / len(trace))


@steps
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("side", [0.175, 0.2, 0.3])
def test_a_corridor_is_driven_at_full_speed(side, kind, dt):
    assert speed(corridor(kind, side, dt)) >= 0.98


@steps
@pytest.mark.parametrize("kind", KINDS)
def test_a_millimetre_is_enough(kind, dt):
    assert speed(corridor(kind, 0.171, dt)) > 0.05


@steps
@pytest.mark.parametrize("side", [0.171, 0.175, 0.2])
def test_it_does_not_matter_how_the_walls_are_known(side, dt):
    """Twists agree within 1 % for walls, capsules and points."""
    one, *others = (corridor(kind, side, dt) for kind in KINDS)
    for other in others:
        assert np.abs(other[:, 3:] - one[:, 3:]).max() <= 0.01


def test_whoever_drives_into_a_narrower_one_stops():
    """So that the tests above are known to bite."""
    upper = [(-3.0, 0.5, 1.5, 0.5), (1.5, 0.5, 1.5, 0.4), (1.5, 0.4, 9.0, 0.4)]
    walls = [*upper, *(np.array(upper) * (1, -1, 1, -1)).tolist()]
    trace = drive(told_as(walls, "points"), 0.05)
    assert trace[-1, 0] < 1.5 - 0.45 and abs(trace[-1, 3]) < 0.05


Y = HALF + RADIUS + 0.005
ENDS = [(1.71, Y, 1.71, Y + 2.0)]
MOUTH = [*ENDS, (1.71, Y, 9.0, Y)]
PASSED = {
    "a post": {"points": [(1.71, Y)]},
    "a round post": {"discs": [(1.71, Y + 0.1, 0.1)]},
    "the end of a wall": {"walls": ENDS},
    "the end of a wall, seen": {"points": as_points(ENDS)},
    "a mouth": {"walls": MOUTH},
    "a mouth, seen": {"points": as_points(MOUTH)},
}


def on_both_sides(obstacles):
    signs = {"points": (1, -1), "discs": (1, -1, 1), "walls": (1, -1, 1, -1)}
    return {
        name: np.vstack([rows, np.array(rows) * signs[name]])
        for name, rows in obstacles.items()
    }


@pytest.mark.parametrize("both", [False, True], ids=["one side", "both sides"])
@pytest.mark.parametrize("obstacles", PASSED.values(), ids=PASSED)
def test_nobody_who_passes_at_r_min_and_5_mm_is_slowed(obstacles, both):
    trace = drive(on_both_sides(obstacles) if both else obstacles, 0.05, 4.0)
    assert trace[:, 3].min() >= 0.98
    assert np.abs(trace[:, 1]).max() <= 0.01
