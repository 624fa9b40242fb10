"""A call of the filter beside a yardstick, and a step of the guide at worst."""

from collections.abc import Callable
from functools import partial
from time import perf_counter, perf_counter_ns

import numpy as np

import qpavoid as qp
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Robot
from qpavoid.types import Array
from timing.trials import Row, quantile, undisturbed

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


TRAP = np.array(
    [(4.5, -1.0, 4.5, 1.0), (2.5, 1.0, 4.5, 1.0), (2.5, -1.0, 4.5, -1.0)],
)
GOAL = 9.0, 0.0, 0.0


def empty(time: float) -> qp.Obstacles:
    """Return nothing."""
    return qp.Obstacles()


def trap(time: float) -> qp.Obstacles:
    """Return a dead end, which must be left backwards: ways are searched."""
    return qp.Obstacles(walls=TRAP)


def scan(time: float) -> qp.Obstacles:
    """Return the same as some 300 points."""
    along = np.linspace(0.0, 1.0, 100)[:, None]
    points = [wall[:2] + along * (wall[2:] - wall[:2]) for wall in TRAP]
    return qp.Obstacles(np.vstack(points))


def people(time: float) -> qp.Obstacles:
    """Return ten discs that cross the way."""
    k = np.arange(10.0)
    velocities = np.column_stack([-0.3 + 0.03 * k, 0.4 * (-1.0) ** k])
    places = np.column_stack([1.5 + k, -0.4 * (k + 2.0) * (-1.0) ** k])
    discs = np.column_stack([places + time * velocities, np.full(10, 0.25)])
    return qp.Obstacles(discs=discs, disc_velocities=velocities)


WORLDS = {"nothing": empty, "dead end": trap, "300 points": scan, "10 people": people}


def time_guide(seconds: float, rounds: int) -> list[Row]:
    """Return a row a world: quantiles and maximum of a step, µs, in a closed loop.

    Args:
        seconds: Of each run.
        rounds: How often each is driven; the first one warms up.
    """
    rows = []
    for name, world in WORLDS.items():
        times = np.concatenate([drive(world, seconds) for _ in range(rounds + 1)][1:])
        rows.append(
            {
                "world": name,
                "steps": len(times),
                "median_us": quantile(times, 0.5),
                "p99_us": quantile(times, 0.99),
                "max_us": float(times.max()),
            }
        )
    return rows


def drive(world: Callable[[float], qp.Obstacles], seconds: float) -> Array:
    """Return the time, µs, of each step of a run to the goal."""
    guide, pose = qp.Guide(qp.Robot.mir100()), (0.0, 0.0, 0.0)
    dt = guide.settings.dt
    times = np.zeros(round(seconds / dt))
    guide.go_to(pose, GOAL)
    with undisturbed():
        for i in range(len(times)):
            seen = world(i * dt).seen_from(pose)
            started = perf_counter_ns()
            decision = guide.step(pose, seen)
            times[i] = 1e-3 * (perf_counter_ns() - started)
            pose = arc(*pose, decision.v, decision.omega, dt)
    return times
