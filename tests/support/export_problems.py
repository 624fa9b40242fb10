"""Problems for the exported filter: hostile, degenerate, invalid."""

import math

import numpy as np

from qpavoid import InvalidInputError
from qpavoid.export.write import Capacity
from timing.exported import problem_type

CAPACITY = Capacity(discs=8, points=5, walls=3, polygons=3, corners=14)
KINDS = 14


def hostile(rng, count, robot):
    """Return problems of every kind that went wrong somewhere, in random order."""
    problems = np.zeros(count, problem_type(CAPACITY))
    corners = robot.footprint.vertices
    for i, p in enumerate(problems):
        seen, size = p["obstacles"], rng.choice([0.7, 1.5, 4.0])
        for name in ("points", "discs", "walls"):
            seen[name] = rng.uniform(-size, size, seen[name].shape)
            seen[f"n_{name}"] = rng.integers(0, getattr(CAPACITY, name) + 1)
        seen["discs"][:, 2] = rng.uniform(0.0, 0.5, CAPACITY.discs)
        moving = rng.random((CAPACITY.discs, 1)) < 0.6
        seen["disc_velocities"] = moving * rng.uniform(-1, 1, (CAPACITY.discs, 2))
        some_polygons(rng, seen, size)
        seen["age"] = rng.choice([0.0, 0.1])
        p["v"], p["omega"], p["last_v"], p["last_omega"] = rng.uniform(-1.5, 1.5, 4)
        p["anew"] = i == 0 or rng.random() < 0.2
        spoil(rng, p, seen, corners, i % KINDS)
    return problems


def some_polygons(rng, seen, size):
    """Put polygons round the robot, moving, turning, and on top of it."""
    count, first = rng.integers(0, CAPACITY.polygons + 1), 0
    seen["n_polygons"] = count
    for i in range(count):
        n = int(rng.integers(3, 5))
        angles = (np.arange(n) + rng.uniform(0, 0.8, n)) * 2 * math.pi / n
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        corners = rng.uniform(-size, size, 2) + rng.uniform(0.05, 1) * circle
        seen["corners"][first : first + n] = corners
        motion = rng.uniform(-1, 1, 3) * rng.choice([0, 1], 3)
        seen["polygons"][i] = n, *motion
        first += n


def polygons_of(seen):
    """Return the polygons of a problem, and their motions."""
    corners, chosen = seen["corners"], seen["polygons"][: seen["n_polygons"]]
    if not ((chosen[:, 0] >= 3) & (chosen[:, 0] <= CAPACITY.corners)).all():
        raise InvalidInputError("no polygons")
    ends = np.cumsum(chosen[:, 0]).astype(int)
    if ends.max(initial=0) > CAPACITY.corners:
        raise InvalidInputError("too many corners")
    return np.split(corners[: ends.max(initial=0)], ends)[:-1], chosen[:, 1:]


def spoil(rng, p, seen, corners, kind):
    """Make one problem degenerate, infeasible or invalid."""
    if kind == 0:  # obstacles at a corner, also at distance 0
        seen["points"][:5] = corners[rng.integers(len(corners))] * rng.choice(
            [1, 1.001]
        )
        seen["n_points"] = 5
    elif kind == 1:  # duplicates
        seen["discs"][1:3], seen["n_discs"] = seen["discs"][0], CAPACITY.discs
    elif kind == 2:  # abeam of the axle: no twist moves away
        half = corners[:, 1].max()
        seen["points"][:2] = (0.0, half + 0.1), (0.0, -half - 0.1)
        seen["n_points"], seen["n_discs"], seen["n_walls"] = 2, 0, 0
    elif kind == 3:  # inside the footprint
        seen["points"][0], seen["n_points"] = rng.uniform(-0.1, 0.1, 2), 1
    elif kind == 4:  # walls of no length, and through the robot
        seen["walls"][0, 2:], seen["n_walls"] = seen["walls"][0, :2], 3
        seen["walls"][1] = -2.0, 0.1, 2.0, 0.1
    elif kind == 5:  # surrounded
        radius = np.hypot(*seen["discs"][:, :2].T)
        seen["discs"][:, :2] *= (1.05 / radius)[:, None]
        seen["n_discs"] = CAPACITY.discs
    elif kind == 6:  # nothing there
        seen["n_points"] = seen["n_discs"] = seen["n_walls"] = seen["n_polygons"] = 0
    elif kind == 7:
        p["v"] = rng.choice([math.nan, math.inf, 1e300])
    elif kind == 8:
        seen["discs"][0, 2], seen["n_discs"] = rng.choice([-1e-9, math.nan, 1e101]), 3
    elif kind == 9:
        name = rng.choice(["points", "discs", "walls", "polygons"])
        seen[f"n_{name}"] = rng.choice([-1, getattr(CAPACITY, name) + 1])
    elif kind == 10:
        seen["age"] = rng.choice([-1e-9, math.nan, math.inf, 1e155, 1e6, 0.5])
    elif kind == 11:  # no polygon: dented, not finite, of two or too many corners
        seen["n_polygons"], seen["polygons"][0, 0] = 1, 4
        seen["corners"][:4] = (2, 0), (3, 0), (2.1, 0.1), (2, 1)
        how = rng.integers(4)
        if how == 1:
            seen["corners"][2] = rng.choice([math.nan, math.inf, 1e200]), 1
        elif how > 1:
            seen["polygons"][0, 0] = rng.choice([2, 99, -1e30, math.nan])
    elif kind == 12:  # a polygon round everything
        seen["n_polygons"], seen["polygons"][0] = 1, (4, 0.1, 0.2, 0.3)
        seen["corners"][:4] = (-3, -3), (3, -3), (3, 2), (-3, 2.5)
