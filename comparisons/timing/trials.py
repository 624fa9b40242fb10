"""Timed calls of solvers on the same cases, with errors of their answers.

Run: python comparisons/timing/solvers.py, or steps.py beside it
"""

import gc
import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter_ns
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.qp.backends import BackEnd
from qpavoid.types import Array

Value: TypeAlias = str | int | float | None
Row: TypeAlias = dict[str, Value]
"""One line of a table by column; None where nothing was measured."""

WRONG = 1e-5
"""m/s and rad/s; an answer that is farther from the certified one is wrong."""

BLOCK = 5
"""Successive cases that one contender answers before it is the next one's turn."""


class Plan(NamedTuple):
    """Numbers of problems and calls."""

    problems: int  # recorded for each number of rows
    passes: int  # over the feasible ones
    budget_s: float  # of call times for each size, above which a contender ends
    infeasible: int  # problems that a solver is handed, at most
    scans: int  # for each number of points
    calls: int  # passes over the scans


FULL = Plan(400, passes=6, budget_s=3.0, infeasible=40, scans=100, calls=20)
QUICK = Plan(100, passes=1, budget_s=0.04, infeasible=5, scans=20, calls=3)


class Case(NamedTuple):
    """A problem with its certified answer."""

    question: Any  # argument of a contender
    answer: Array  # (n,), certified; NaN if there is none
    scale: Array  # (n,) by which answers are divided to give m/s and rad/s


class Contender(NamedTuple):
    """A solver or filter that is timed."""

    ask: Callable[[Any], Any]  # from the question to a result; this is timed
    read: Callable[[Any], Array]  # from the result to the claimed answer; NaN: none


@dataclass
class Trials:
    """Calls of one contender on cases of one kind.

    An error is the greatest difference from the certified answer, m/s or rad/s; NaN
    without a claimed answer, infinite where one is claimed and there is none.
    """

    errors: list[float] = field(default_factory=list)
    times: list[int] = field(default_factory=list)  # ns, by the wall
    cases: set[int] = field(default_factory=set)
    spent_s: float = 0.0  # sum of the times

    def call(self, contender: Contender, case: Case) -> None:
        """Time one call and store its error; an exception is no answer."""
        question, ask = case.question, contender.ask
        started = perf_counter_ns()
        try:
            found = ask(question)
        except Exception:
            found = None
        self.times.append(perf_counter_ns() - started)
        self.spent_s += 1e-9 * self.times[-1]
        answer = math.nan if found is None else contender.read(found)
        self.cases.add(id(case))
        if not np.isfinite(answer).all():
            self.errors.append(math.nan)
            return
        off = float(np.abs((answer - case.answer) / case.scale).max())
        self.errors.append(off if off < math.inf else math.inf)

    def spend(
        self, budget_s: float, contender: Contender, cases: Sequence[Case]
    ) -> None:
        """Call on one case after the other, as long as the budget lasts."""
        for case in cases:
            if self.spent_s >= budget_s:
                break
            self.call(contender, case)


def of_back_end(back_end: BackEnd) -> Contender:
    """Return a back end as a contender for scaled problems.

    Our CasADi back ends return an answer in any case, since it is certified later; here
    it is none where CasADi reports a failure.
    """

    def read(answer: Array) -> Array:
        buffer = getattr(back_end, "buffer", None)
        failed = buffer is not None and not buffer.stats()["success"]
        return np.full_like(answer, math.nan) if failed else answer

    return Contender(back_end, read)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Disable garbage collector and warnings, and pin the process to a core."""
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if cores:
                os.sched_setaffinity(0, {max(cores)})
            yield
    finally:
        if cores:
            os.sched_setaffinity(0, cores)
        gc.unfreeze()
        gc.enable()


def race(
    contenders: Mapping[str, Contender],
    cases: Sequence[Case],
    plan: Plan = FULL,
    seed: int = 0,
) -> dict[str, Row]:
    """Time contenders on the same cases, and judge their answers.

    Cases with an answer come in blocks of :data:`BLOCK` successive ones, so that a warm
    start meets what it would meet in a loop; block by block the contenders take turns
    in random order. Each block is led in by a call on the case before it, which is not
    counted: it sets up the workspace and warms the processor's caches. A slow
    contender passes over blocks, evenly, to keep within its budget. Then the cases
    without an answer are handed over as they are, once each.

    Returns a row for each contender; see :func:`judge`.
    """
    rng = np.random.default_rng(seed)
    feasible = [case for case in cases if np.isfinite(case.answer).all()]
    infeasible = [case for case in cases if not np.isfinite(case.answer).all()]
    starts, visits = range(0, len(feasible), BLOCK), 0
    timed = {name: Trials() for name in contenders}
    raw = {name: Trials() for name in contenders}
    with undisturbed():
        for _ in range(plan.passes):
            gc.collect()
            for i in rng.permutation(starts):
                visits += 1
                share = plan.budget_s * visits / (plan.passes * len(starts))
                for name in rng.permutation(list(contenders)):
                    trials, contender = timed[name], contenders[name]
                    if trials.spent_s < share:
                        Trials().call(contender, feasible[i - 1])
                        trials.spend(math.inf, contender, feasible[i : i + BLOCK])
        for name, contender in contenders.items():
            raw[name].spend(plan.budget_s, contender, infeasible[: plan.infeasible])
    return {name: judge(timed[name], raw[name]) for name in contenders}


def judge(timed: Trials, raw: Trials) -> Row:
    """Return the numbers of a contender as one row of a table.

    ``timed``: trials on cases with an answer, ``raw``: on others. ``calls`` on
    ``problems`` different cases, and their quantiles (None where there are fewer calls
    than one takes). ``wrong``: answers that are claimed and farther than :data:`WRONG`
    from the certified one; ``false_ok``: the same, and answers to questions that have
    none; ``false_infeasible``: calls without an answer although there is one; errors of
    the answers that are claimed, m/s or rad/s.
    """
    errors = np.array(timed.errors)
    claimed = errors[~np.isnan(errors)]
    wrong = int((claimed > WRONG).sum())
    times = 1e-3 * np.array(timed.times)
    return {
        "problems": len(timed.cases),
        "calls": len(times),
        **quantiles(times),
        "wrong": wrong,
        "false_ok": wrong + int((~np.isnan(raw.errors)).sum()),
        "false_infeasible": len(errors) - len(claimed),
        "error_p99": float(np.quantile(claimed, 0.99)) if len(claimed) else None,
        "worst_error": float(claimed.max()) if len(claimed) else None,
        "infeasible_calls": len(raw.times),
        "infeasible_max_us": 1e-3 * max(raw.times) if raw.times else None,
    }


def quantiles(times: Array) -> Row:
    """Return median, high quantiles and maximum of times in µs."""
    shares = {"median_us": 0.5, "p99_us": 0.99, "p999_us": 0.999, "p9999_us": 0.9999}
    found: Row = {name: quantile(times, share) for name, share in shares.items()}
    return found | {"max_us": float(times.max()) if len(times) else None}


def quantile(times: Array, share: float) -> float | None:
    """Return a quantile, or None for fewer than 1/(1 − share) − 1 times."""
    enough = len(times) > 1.0 / (1.0 - share) - 1.5
    return float(np.quantile(times, share)) if enough else None
