"""Timed calls of solvers on the same cases, with errors of their answers."""

import gc
import math
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter_ns
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.qp.solve import BackEnd
from qpavoid.types import Array

Value: TypeAlias = str | int | float | None
Row: TypeAlias = dict[str, Value]
"""One line of a table by column; None where nothing was measured."""

WRONG = 1e-5
"""m/s and rad/s; an answer that is farther from the certified one is wrong."""

BLOCK = 5
"""Successive cases that one contender answers before it is the next one's turn."""


@dataclass(frozen=True)
class Plan:
    """Numbers of problems and calls.

    Attributes:
        problems: Recorded problems for each number of rows.
        passes: How often the feasible ones are solved.
        budget_s: Sum of call times for each size above which a contender gets no more
            blocks of cases; and no more infeasible ones.
        infeasible: Infeasible problems that a solver is handed, at most.
        scans: Scans for each number of points.
        calls: Passes over the scans.
    """

    problems: int
    passes: int
    budget_s: float
    infeasible: int
    scans: int
    calls: int


FULL = Plan(400, passes=6, budget_s=3.0, infeasible=40, scans=100, calls=20)
QUICK = Plan(100, passes=1, budget_s=0.04, infeasible=5, scans=20, calls=3)


class Case(NamedTuple):
    """A problem with its certified answer.

    Attributes:
        question: Argument of a contender.
        answer: (n,) the certified answer; NaN if there is none.
        scale: (n,) by which answers are divided to give m/s and rad/s.
    """

    question: Any
    answer: Array
    scale: Array


class Contender(NamedTuple):
    """A solver or filter that is timed.

    Attributes:
        ask: From the question to the solver's result; this is timed.
        read: From the result to the claimed answer (n,); NaN: none.
    """

    ask: Callable[[Any], Any]
    read: Callable[[Any], Array]


@dataclass
class Trials:
    """Calls of one contender on cases of one kind.

    Attributes:
        errors: Greatest difference from the certified answer, m/s or rad/s; NaN where
            it claims none, infinite where it claims one and there is none.
        times: Wall time of each call, ns.
        cases: Which ones.
        spent_s: Sum of the times, s.
    """

    errors: list[float] = field(default_factory=list)
    times: list[int] = field(default_factory=list)
    cases: set[int] = field(default_factory=set)
    spent_s: float = 0.0

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
    """Return a back end as a contender for scaled problems."""
    return Contender(back_end, partial(_claimed, back_end))


def _claimed(back_end: BackEnd, answer: Array) -> Array:
    """Return the answer, or NaN where CasADi reports a failure.

    Our CasADi back ends return the answer in any case, since it is certified later.
    """
    program = getattr(back_end, "last", None)
    failed = program is not None and not program.buffer.stats()["success"]
    return np.full_like(answer, math.nan) if failed else answer


@contextmanager
def undisturbed() -> Iterator[None]:
    """Disable garbage collector and warnings, and pin the process to a core."""
    collecting = gc.isenabled()
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
        if collecting:
            gc.enable()


def race(
    contenders: Mapping[str, Contender],
    cases: Sequence[Case],
    plan: Plan = FULL,
    passes: int | None = None,
    seed: int = 0,
) -> dict[str, Row]:
    """Time contenders on the same cases, and judge their answers.

    Cases with an answer come in blocks of :data:`BLOCK` successive ones, so that a warm
    start meets what it would meet in a loop; block by block the contenders take turns
    in random order. Each block is led in by a call on the case before it, which is not
    counted: it sets up the workspace and warms the processor's caches. A slow
    contender passes over blocks, evenly, to keep within its budget. Then the cases
    without an answer are handed over as they are, once each.

    Args:
        contenders: By name.
        cases: All of one size.
        plan: How much is measured.
        passes: If not those of the plan.
        seed: Of the order.

    Returns:
        One row a contender; see :func:`judge`.
    """
    rng = np.random.default_rng(seed)
    feasible = [case for case in cases if np.isfinite(case.answer).all()]
    infeasible = [case for case in cases if not np.isfinite(case.answer).all()]
    starts = range(0, len(feasible), BLOCK)
    passes = plan.passes if passes is None else passes
    visits = 0
    timed = {name: Trials() for name in contenders}
    raw = {name: Trials() for name in contenders}
    with undisturbed():
        for _ in range(passes):
            gc.collect()
            for i in rng.permutation(starts):
                visits += 1
                share = plan.budget_s * visits / (passes * len(starts))
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

    Args:
        timed: Trials on cases with an answer.
        raw: Trials on cases without one.

    Returns:
        ``calls`` on ``problems`` different cases; ``median_us``, ``p99_us``,
        ``p999_us`` and ``max_us`` of a call (None where there are fewer calls than a
        quantile takes); ``wrong``: answers that are claimed and farther than
        :data:`WRONG` from the certified one; ``false_ok``: the same, and answers to
        questions that have none; ``false_infeasible``: calls without an answer although
        there is one; ``error_p99`` and ``worst_error`` of answers that are claimed, m/s
        or rad/s; ``infeasible_calls``, and their ``infeasible_max_us``.
    """
    errors = np.array(timed.errors)
    claimed = errors[~np.isnan(errors)]
    wrong = int((claimed > WRONG).sum())
    times = 1e-3 * np.array(timed.times)
    return {
        "problems": len(timed.cases),
        "calls": len(times),
        "median_us": quantile(times, 0.5),
        "p99_us": quantile(times, 0.99),
        "p999_us": quantile(times, 0.999),
        "max_us": float(times.max()) if len(times) else None,
        "wrong": wrong,
        "false_ok": wrong + int((~np.isnan(raw.errors)).sum()),
        "false_infeasible": len(errors) - len(claimed),
        "error_p99": float(np.quantile(claimed, 0.99)) if len(claimed) else None,
        "worst_error": float(claimed.max()) if len(claimed) else None,
        "infeasible_calls": len(raw.times),
        "infeasible_max_us": 1e-3 * max(raw.times) if raw.times else None,
    }


def quantile(times: Array, share: float) -> float | None:
    """Return a quantile, or None for fewer than 1/(1 − share) − 1 times."""
    enough = len(times) > 1.0 / (1.0 - share) - 1.5
    return float(np.quantile(times, share)) if enough else None
