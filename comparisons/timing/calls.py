"""A call of the filter, from numpy points to the decision, beside a yardstick."""

from collections.abc import Callable
from functools import partial
from time import perf_counter

import numpy as np

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.robot import Robot
from timing.trials import Row

POINTS = (1, 100, 1000)
PLACES = {"nothing near": (4.0, 6.0), "all near": (0.9, 1.4)}
"""How far from the axle the points are, m, all ahead."""

BLOCKS, LASTS = 31, 1e-3
"""Of each call so many blocks, s."""

Call = Callable[[], object]


def calls() -> dict[tuple[str, int], Call]:
    """Return the calls by what they are and by their number of points."""
    found: dict[tuple[str, int], Call] = {
        ("np.hypot(1.0, 2.0), a yardstick", 0): partial(np.hypot, 1.0, 2.0)
    }
    rng = np.random.default_rng(1)
    for place, (near, far) in PLACES.items():
        for count in POINTS:
            bearing, away = rng.uniform(-1.5, 1.5, count), rng.uniform(near, far, count)
            points = np.column_stack([away * np.cos(bearing), away * np.sin(bearing)])
            for name, ahead in (("one-step", False), ("look-ahead", True)):
                safety = SafetyFilter(Robot.mir100(), ahead=ahead)
                call = partial(safety.filter, 0.5, 0.1, points)
                found[f"{name}, {place}", count] = call
    return found


def block(call: Call, times: int) -> float:
    """Return µs a call."""
    turns = range(times)
    started = perf_counter()
    for _ in turns:
        call()
    return 1e6 * (perf_counter() - started) / times


def enough(call: Call) -> int:
    """Return how often a call is made in a block."""
    takes = min(block(call, 20) for _ in range(5))
    return max(1, int(LASTS / (1e-6 * takes)))


def time_calls() -> list[Row]:
    """Return ``call``, ``points``, median and least µs of blocks, all taking turns."""
    known = calls()
    many = {what: enough(call) for what, call in known.items()}
    blocks = [
        {what: block(call, many[what]) for what, call in known.items()}
        for _ in range(BLOCKS)
    ]
    return [
        {
            "call": name,
            "points": points,
            "median_us": float(np.median([taken[name, points] for taken in blocks])),
            "least_us": min(taken[name, points] for taken in blocks),
        }
        for name, points in known
    ]
