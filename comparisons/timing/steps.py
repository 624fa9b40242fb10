"""Computing time of whole control steps by the number of points of a scan.

The steps go from numpy points to the twist: our one-step and look-ahead filters, the
one-step filter with other back ends, the exported C, and the same rows written with
numpy and a solver. Also: a million calls of the one-step filter, the slowest call and
the growth of memory; the look-ahead among ten discs that it has not seen before.

    python comparisons/timing/steps.py --out out/steps
"""

import argparse
import math
import resource
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from time import perf_counter_ns

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import qpavoid as qp
from qpavoid.qp.backends import BackEnd
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array
from timing import trials
from timing.exported import step_times
from timing.peers import CONTENDERS
from timing.recorded import Scan, record_scans
from timing.tables import FAULTS, pivot, write_tables
from timing.trials import FULL, QUICK, Case, Contender, Plan, Row

POINTS = (1, 10, 100, 1000, 10_000)
OURS, AHEAD = "qpavoid", "qpavoid, ahead"
EXPORTED = {"exported C": False, "exported C, ahead": True}


def one_step() -> qp.SafetyFilter:
    """Return the one-step filter, the reference of the answers."""
    return qp.SafetyFilter(qp.Robot.mir100(), ahead=False)


def _twist(decision: qp.Decision) -> Array:
    failed = decision.status is qp.Status.STOPPED
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
        v, omega, points = scan
        A, b = self.rows(points)
        target, scale = np.array([v, omega]), self._scale
        if not len(b):
            free: Array = np.clip(target, self._lower, self._upper)
            return free
        normals = A / scale
        length = np.hypot(normals[:, 0], normals[:, 1])
        rows = normals / length[:, None], b / length
        box = self._lower * scale, self._upper * scale
        problem = ScaledProblem(target * scale, *rows, *box, scale, np.empty((4, 0)))
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


def _ours(solver: str = "exact", ahead: bool = False) -> Contender:
    call = qp.SafetyFilter(qp.Robot.mir100(), solver=solver, ahead=ahead).filter
    return Contender(lambda scan: call(scan[0], scan[1], scan[2]), _twist)


def _numpy(solver: str) -> Contender:
    return Contender(NumpyStep(CONTENDERS[solver].load()), np.asarray)


STEPS: Mapping[str, Callable[[], Contender]] = {
    OURS: _ours,
    AHEAD: partial(_ours, ahead=True),
    **{
        f"{OURS} + {name}": partial(_ours, name)
        for name in ("osqp", "casadi:daqp", "qpsolvers:daqp")
    },
    **{f"numpy + {name}": partial(_numpy, name) for name in ("osqp", "daqp")},
}
"""Control steps by name."""


def step_cases(points: int, count: int) -> list[Case]:
    """Return recorded scans with the twist that :func:`one_step` gives.

    Scans at which it relaxes or stops are left out: peers have no such answer.
    """
    safety, cases = one_step(), []
    for scan in record_scans(points, count):
        decision = safety.filter(*scan)
        if decision.status in (qp.Status.TRACKING, qp.Status.FILTERED):
            cases.append(Case(scan, np.array(decision[:2]), np.ones(2)))
    return cases


def time_steps(sizes: Sequence[int], names: Iterable[str], plan: Plan) -> list[Row]:
    """Time some of :data:`STEPS` at numbers of points, from numpy points to the twist.

    ``rows`` is the median number that can matter. The look-ahead filter has other
    answers, so that its errors are left out.
    """
    table: list[Row] = []
    for points in sizes:
        print(f"whole steps at {points} points", flush=True)
        cases, contenders = step_cases(points, plan.scans), {}
        for name in names:
            try:
                contenders[name] = STEPS[name]()
            except ImportError:
                print(f"{name} is not installed")
        safety = one_step()
        rows = np.median([len(safety.problem(*case.question).b) for case in cases])
        found = trials.race(contenders, cases, plan._replace(passes=plan.calls))
        for name, row in found.items():
            if name == AHEAD:
                row |= dict.fromkeys((*FAULTS, "error_p99", "worst_error"))
            start: Row = {"step": name, "points": points, "rows": float(rows)}
            table.append(start | row)
    return table


def time_exported(sizes: Sequence[int], plan: Plan) -> list[Row]:
    """Return quantiles of the exported C filter's step; nothing without a compiler.

    Every step starts from rest, so that the look-ahead repeats its whole search.
    """
    table: list[Row] = []
    setup = qp.Robot.mir100(), qp.AvoidanceSettings()
    for (name, ahead), points in product(EXPORTED.items(), sizes):
        scans = [case.question for case in step_cases(points, plan.scans)]
        try:
            times = 1e-3 * step_times(*setup, scans, ahead, 20)
        except qp.QPAvoidError as error:
            print(error)
            return []
        row: Row = {"step": name, "points": points, "calls": len(times)}
        table.append(row | trials.quantiles(times))
    return table


def discs_of(rng: np.random.Generator) -> tuple[float, float, qp.Obstacles]:
    """Return a desired twist among ten discs, 1 to 5 m away, of 0.5 m/s an axis (σ)."""
    course, away = rng.uniform(-math.pi, math.pi, 10), rng.uniform(1.0, 5.0, 10)
    radius, velocities = rng.uniform(0.15, 0.4, 10), rng.normal(0.0, 0.5, (10, 2))
    discs = np.column_stack([away * np.cos(course), away * np.sin(course), radius])
    seen = qp.Obstacles(discs=discs, disc_velocities=velocities)
    return rng.uniform(0.0, 1.0), rng.uniform(-0.5, 0.5), seen


def endure(safety: qp.SafetyFilter, cases: Sequence[tuple], calls: int) -> Row:
    """Return times of calls at 0.3 m/s, growth of memory, switches of the process."""
    times, usage = np.zeros(calls, dtype=np.int64), resource.getrusage
    with trials.undisturbed():
        for case in cases[:200]:
            safety.filter(*case)
        before = usage(resource.RUSAGE_SELF)
        for i in range(calls):
            v, omega, seen = cases[i % len(cases)]
            safety.reset(0.3)
            started = perf_counter_ns()
            safety.filter(v, omega, seen)
            times[i] = perf_counter_ns() - started
        after = usage(resource.RUSAGE_SELF)
    grown, switches = after.ru_maxrss / before.ru_maxrss, after.ru_nivcsw
    row: Row = {"growth": grown - 1.0, "switches": switches - before.ru_nivcsw}
    return {"calls": calls} | trials.quantiles(1e-3 * times) | row


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/steps"), metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="few calls")
    options = parser.parse_args()
    plan = QUICK if options.quick else FULL
    steps = time_steps(POINTS, STEPS, plan) + time_exported(POINTS, plan)
    calls, rng = 10_000 if options.quick else 1_000_000, np.random.default_rng(1)
    discs = [discs_of(rng) for _ in range(calls // 100)]
    long_run = endure(one_step(), record_scans(100, 100), calls)
    fresh = endure(qp.SafetyFilter(qp.Robot.mir100()), discs, len(discs))
    tables = {"steps": steps, "endurance": [long_run], "fresh discs": [fresh]}
    write_tables(options.out, tables, plan)
    print(pivot(steps, "step", "points", "numpy + daqp"), long_run, fresh, sep="\n")


if __name__ == "__main__":
    main()
