"""What the machine can do, measured with the same compiler: the floor of a step."""

from collections.abc import Callable
from time import perf_counter_ns
from typing import Any

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.types import Array
from timing.steps import one_step
from timing.trials import Row, undisturbed

POINT_BYTES = 16
"""x and y of a point are read once."""

POINT_OPERATIONS = 45
"""Additions and multiplications for a point that is near: signed distances from five
edges (5 each), contact (9), its row and bound (7), the row's violation (4)."""


@compiled
def triad(a: Array, b: Array, c: Array) -> None:
    """Set a = b + 3 c: 24 bytes an element."""
    for i in range(a.shape[0]):
        a[i] = b[i] + 3.0 * c[i]


@compiled
def horner(x: Array, y: Array) -> None:
    """Evaluate a polynomial of degree 8: 16 operations an element."""
    for i in range(x.shape[0]):
        value = x[i]
        for _ in range(8):
            value = value * x[i] + 0.5
        y[i] = value


@compiled
def nothing(
    edges: Array, robot: Array, settings: Any, points: Array, v: float, omega: float
) -> tuple[float, float]:
    """Return the twist: what a call into compiled code takes.

    Args:
        edges: Handed over, as to the filter.
        robot: The same.
        settings: The same.
        points: The same.
        v: m/s.
        omega: rad/s.
    """
    return v, omega


def best(seconds: float, call: Callable[..., Any], *arguments: Any) -> float:
    """Return the shortest time of a call, s."""
    shortest, spent = np.inf, 0.0
    call(*arguments)
    while spent < seconds:
        started = perf_counter_ns()
        call(*arguments)
        last = 1e-9 * (perf_counter_ns() - started)
        shortest, spent = min(shortest, last), spent + last
    return float(shortest)


def machine_limits(seconds: float = 0.2) -> Row:
    """Measure arithmetic, bandwidth, and a call's floor, on one core.

    Args:
        seconds: That each of them takes.

    Returns:
        ``gflops``: multiply and add in vectors, as compiled here (not fused);
        ``gb_per_s`` in the second-level cache, ``memory_gb_per_s`` beyond the caches;
        ``call_us``: a compiled function of four arrays that does nothing, by Python.
    """
    safety = one_step()
    arguments = safety.robot.footprint.edges, safety.robot.limit_vector
    record, points = safety.settings.record(), np.ones((1, 2))
    near, far = np.ones((3, 8_000)), np.ones((3, 4_000_000))
    with undisturbed():
        return {
            "gflops": 16e-9
            * 4096
            / best(seconds, horner, np.full(4096, 0.5), np.empty(4096)),
            "gb_per_s": 24e-9 * near.shape[1] / best(seconds, triad, *near),
            "memory_gb_per_s": 24e-9 * far.shape[1] / best(seconds, triad, *far),
            "call_us": 1e6
            * best(seconds, nothing, *arguments, record, points, 0.5, 0.0),
        }


def floors(points: int, limits: Row) -> tuple[float, float]:
    """Return the least µs that a point's operations, and its bytes, take."""
    gflops, bandwidth = limits["gflops"], limits["gb_per_s"]
    assert isinstance(gflops, float) and isinstance(bandwidth, float)
    operations = 1e-3 * points * POINT_OPERATIONS / gflops
    return operations, 1e-3 * points * POINT_BYTES / bandwidth
