"""Whole control steps, ours and what peers do, and the floor that the machine sets."""

import math
import resource
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from time import perf_counter_ns
from typing import Any

import numpy as np

from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.compiled import compiled
from qpavoid.errors import QPAvoidError
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import ScaledProblem
from qpavoid.qp.solve import BackEnd
from qpavoid.types import Array
from timing.contenders import CONTENDERS
from timing.exported import step_times
from timing.peers import CbfpyStep
from timing.recorded import Scan, record_scans
from timing.trials import (
    FULL,
    Case,
    Contender,
    Plan,
    Row,
    quantile,
    race,
    undisturbed,
)

POINTS = (1, 10, 100, 1000, 10_000)
OURS, AHEAD, EXPORTED = "qpavoid", "qpavoid, ahead", "exported C"
TARGETS_US = {1: 2.5, 100: 5.0, 1000: 14.0, 10_000: 75.0}
"""Most that the median of :data:`OURS` should take, by number of points."""


def one_step() -> SafetyFilter:
    """Return the filter whose answers are the reference: the rows of the present."""
    return SafetyFilter(Robot.mir100(), ahead=False)


def _twist(decision: Decision) -> Array:
    failed = decision.status is Status.STOPPED
    twist: Array = np.full(2, math.nan) if failed else np.array(decision[:2])
    return twist


class NumpyStep:
    """The one-step filter as it is written with numpy and a solver, for points alone.

    The same rows and limits as :class:`SafetyFilter`'s; no relaxation, certificate,
    room to brake or status. Points must lie outside the footprint.
    """

    def __init__(self, back_end: BackEnd) -> None:
        safety = one_step()
        self._back_end = back_end
        self._edges, self._settings = safety.robot.footprint.edges, safety.settings
        self._scale = np.sqrt(safety.settings.weights)
        limits = safety.problem(0.0, 0.0)
        self._lower, self._upper = limits.lower, limits.upper

    def __call__(self, scan: Scan) -> Array:
        """Return (v, ω), or NaN."""
        A, b = self.rows(scan.points)
        target = np.array([scan.v, scan.omega])
        if not len(b):
            free: Array = np.clip(target, self._lower, self._upper)
            return free
        scale = self._scale
        normals = A / scale
        length = np.hypot(normals[:, 0], normals[:, 1])
        problem = ScaledProblem(
            target * scale,
            normals / length[:, None],
            b / length,
            self._lower * scale,
            self._upper * scale,
            scale,
            np.empty((4, 0)),
        )
        z: Array = self._back_end(problem) / scale
        return z

    def rows(self, points: Array) -> tuple[Array, Array]:
        """Return A and b of the rows that some admissible twist violates."""
        corner, length = self._edges[:, :2], self._edges[:, 4]
        tangent = self._edges[:, 3:1:-1] * (-1.0, 1.0)
        offset = points[:, None] - corner
        along = np.clip((offset * tangent).sum(axis=2), 0.0, length)
        gap = offset - along[:, :, None] * tangent
        squared = (gap**2).sum(axis=2)
        every, nearest = np.arange(len(points)), squared.argmin(axis=1)
        gap, distance = gap[every, nearest], np.sqrt(squared[every, nearest])
        n_x, n_y = (gap / distance[:, None]).T
        p_x, p_y = (points - gap).T
        A = np.column_stack([-n_x, n_x * p_y - n_y * p_x])
        b = -self._settings.gamma * (distance - self._settings.radius.r_min())
        least = np.minimum(A * self._lower, A * self._upper).sum(axis=1)
        kept = least < b
        return A[kept], b[kept]


def _ours(points: int, solver: str = "exact", ahead: bool = False) -> Contender:
    call = SafetyFilter(Robot.mir100(), solver=solver, ahead=ahead).filter
    return Contender(lambda scan: call(scan[0], scan[1], scan[2]), _twist)


def with_back_ends(names: Sequence[str]) -> Mapping[str, Callable[[int], Contender]]:
    """Return the one-step filter with each of some back ends, like :data:`STEPS`."""
    return {name: partial(_ours, solver=name) for name in names}


def _numpy(points: int, solver: str) -> Contender:
    return Contender(NumpyStep(CONTENDERS[solver].load()), np.asarray)


def _cbfpy(points: int) -> Contender:
    return Contender(CbfpyStep(one_step(), points), np.asarray)


STEPS: Mapping[str, Callable[[int], Contender]] = {
    OURS: _ours,
    AHEAD: partial(_ours, ahead=True),
    **{
        f"{OURS} + {name}": partial(_ours, solver=name)
        for name in ("osqp", "casadi:daqp", "qpsolvers:daqp")
    },
    **{f"numpy + {name}": partial(_numpy, solver=name) for name in ("osqp", "daqp")},
    "cbfpy": _cbfpy,
}
"""Who makes whole steps, by name, for a number of points."""


def step_cases(points: int, count: int) -> list[Case]:
    """Return recorded scans with the twist that :func:`one_step` gives.

    Scans at which it relaxes or stops are left out: peers have no such answer.
    """
    safety = one_step()
    decided = [(scan, safety.filter(*scan)) for scan in record_scans(points, count)]
    good = (Status.TRACKING, Status.FILTERED)
    return [
        Case(scan, np.array([decision.v, decision.omega]), np.ones(2))
        for scan, decision in decided
        if decision.status in good
    ]


def time_steps(
    sizes: Sequence[int],
    steps: Mapping[str, Callable[[int], Contender]] = STEPS,
    plan: Plan = FULL,
    progress: Callable[[str], None] = lambda what: None,
) -> list[Row]:
    """Time whole steps on recorded scans, from numpy points to the twist.

    Args:
        sizes: Numbers of points.
        steps: Who makes them; what is not installed gets an empty row.
        plan: How much is measured.
        progress: Called with what is timed next.

    Returns:
        ``step``, ``points``, ``rows`` (median number that can matter), then
        :func:`timing.trials.judge`'s columns, and ``target_us``. The
        look-ahead filter answers another question and is not judged.
    """
    table: list[Row] = []
    for points in sizes:
        progress(f"whole steps at {points} points")
        cases, contenders = step_cases(points, plan.scans), {}
        for name, make in steps.items():
            try:
                contenders[name] = make(points)
            except ImportError:
                progress(f"{name} is not installed")
        safety = one_step()
        rows = np.median([len(safety.problem(*case.question).b) for case in cases])
        for name, row in race(contenders, cases, plan, plan.calls).items():
            if name == AHEAD:
                faults = "wrong", "false_ok", "false_infeasible"
                row |= dict.fromkeys((*faults, "error_p99", "worst_error"))
            target = TARGETS_US.get(points) if name == OURS else None
            start: Row = {"step": name, "points": points, "rows": float(rows)}
            table.append(start | row | {"target_us": target})
    return table


def time_exported(sizes: Sequence[int], like: Row, plan: Plan = FULL) -> list[Row]:
    """Return rows as :func:`time_steps` does, ``like`` one of its, of exported C."""
    return [
        dict.fromkeys(like)
        | {"step": name, "points": points}
        | exported_times(step_cases(points, plan.scans), ahead)
        for name, ahead in ((EXPORTED, False), (f"{EXPORTED}, ahead", True))
        for points in sizes
    ]


def exported_times(cases: Sequence[Case], ahead: bool) -> Row:
    """Return quantiles of the exported C filter's step; nothing without a compiler.

    Every step starts from rest, so that the look-ahead takes up its search anew.
    """
    scans = [case.question for case in cases]
    try:
        times = 1e-3 * step_times(Robot.mir100(), AvoidanceSettings(), scans, ahead, 20)
    except QPAvoidError:
        return {}
    quantiles = {"median_us": 0.5, "p99_us": 0.99, "max_us": 1.0}
    found = {name: float(np.quantile(times, q)) for name, q in quantiles.items()}
    return {"calls": len(times), **found}


def row_evaluations(rows: int) -> int:
    """Return the most row evaluations of one solve; see :mod:`qpavoid.qp.exact`."""
    return (rows + 4) ** 2 + (rows + 4) * (rows + 3) // 2


def endure(points: int, calls: int, scans: int = 100) -> Row:
    """Call the one-step filter very often, and look at the slowest call and the memory.

    Returns:
        ``points``, ``rows`` (greatest number), ``row_evaluations`` (the bound for
        that), ``calls``, quantiles and maximum in µs, how often the system took the
        processor away meanwhile, and by how much the process's memory grew, MB.
    """
    safety = one_step()
    recorded = record_scans(points, scans)
    rows = max(len(safety.problem(*scan).b) for scan in recorded)
    times = np.zeros(calls, dtype=np.int64)
    with undisturbed():
        for scan in recorded * 2:
            safety.filter(*scan)
        before = resource.getrusage(resource.RUSAGE_SELF)
        for i in range(calls):
            v, omega, seen = recorded[i % scans]
            started = perf_counter_ns()
            safety.filter(v, omega, seen)
            times[i] = perf_counter_ns() - started
        after = resource.getrusage(resource.RUSAGE_SELF)
    unit = 2**20 if sys.platform == "darwin" else 2**10
    microseconds: Array = 1e-3 * times.astype(np.float64)
    return {
        "points": points,
        "rows": rows,
        "row_evaluations": row_evaluations(rows),
        "calls": calls,
        "median_us": quantile(microseconds, 0.5),
        "p99_us": quantile(microseconds, 0.99),
        "p999_us": quantile(microseconds, 0.999),
        "p9999_us": quantile(microseconds, 0.9999),
        "max_us": float(microseconds.max()),
        "switches": after.ru_nivcsw - before.ru_nivcsw,
        "growth_mb": (after.ru_maxrss - before.ru_maxrss) / unit,
    }


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
