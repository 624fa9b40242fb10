"""How long a guide takes for a step, at worst, in worlds that ask much of it."""

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

import qpavoid as qp
from qpavoid.model.kinematics import arc
from qpavoid.types import Array
from timing.trials import Row, quantile, undisturbed

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
