"""Computing time of whole control steps by the number of points of a scan.

The steps go from numpy points to the twist: our one-step and look-ahead filters, the
one-step filter with other back ends, the exported C, and the same rows written with
numpy and a solver. Also: a million calls of the one-step filter, the slowest call and
the growth of memory.

    python comparisons/timing/steps.py --out out/steps
"""

import argparse
import math
import resource
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from time import perf_counter_ns

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import QPAvoidError
from qpavoid.model.robot import Robot
from qpavoid.qp.problem import ScaledProblem
from qpavoid.qp.solve import BackEnd
from qpavoid.types import Array
from timing.contenders import CONTENDERS
from timing.exported import step_times
from timing.recorded import Scan, record_scans
from timing.tables import origins, pivot, table_text, write_tables
from timing.trials import (
    FULL,
    QUICK,
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


def one_step() -> SafetyFilter:
    """Return the one-step filter, the reference of the answers."""
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


def _numpy(points: int, solver: str) -> Contender:
    return Contender(NumpyStep(CONTENDERS[solver].load()), np.asarray)


STEPS: Mapping[str, Callable[[int], Contender]] = {
    OURS: _ours,
    AHEAD: partial(_ours, ahead=True),
    **{
        f"{OURS} + {name}": partial(_ours, solver=name)
        for name in ("osqp", "casadi:daqp", "qpsolvers:daqp")
    },
    **{f"numpy + {name}": partial(_numpy, solver=name) for name in ("osqp", "daqp")},
}
"""Control steps by name, for a number of points."""


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
        :func:`timing.trials.judge`'s columns. The look-ahead filter has
        other answers, so that its errors are left out.
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
            start: Row = {"step": name, "points": points, "rows": float(rows)}
            table.append(start | row)
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

    Every step starts from rest, so that the look-ahead repeats its whole search.
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


ENDURANCE = {
    "points": "points",
    "rows": "rows ≤",
    "row_evaluations": "row evaluations ≤",
    "calls": "calls",
    "median_us": "median µs",
    "p99_us": "p99",
    "p9999_us": "p99.99",
    "max_us": "max",
    "switches": "processor taken away",
    "growth_mb": "growth of memory, MB",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/steps"), metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="few calls")
    options = parser.parse_args()
    plan = QUICK if options.quick else FULL
    steps = time_steps(POINTS, plan=plan, progress=print)
    steps += time_exported(POINTS, steps[0], plan)
    long_run = [endure(100, 10_000 if options.quick else 1_000_000)]
    tables = {"steps": steps, "endurance": long_run}
    write_tables(options.out, tables, origins(asdict(plan)))
    print(pivot(steps, "step", "points", "numpy + daqp"))
    print(table_text(ENDURANCE, long_run))


if __name__ == "__main__":
    main()
