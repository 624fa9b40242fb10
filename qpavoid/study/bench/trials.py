"""Trials of back ends on recorded problems: timed fairly, and judged by the answer."""

import gc
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter_ns
from typing import TypeAlias

import numpy as np

from qpavoid.model.footprint import Array
from qpavoid.qp.solve import BackEnd, back_end_names, is_installed, load_back_end
from qpavoid.study.bench.recorded import Mark, RecordedProblem

Value: TypeAlias = str | int | float | None
Row: TypeAlias = dict[str, Value]
"""One line of a table by column; None where nothing was measured."""

WRONG = 1e-5
"""m/s and rad/s; an answer that is farther from the exact optimum is wrong."""

BLOCK = 20
"""Successive problems that one back end solves before it is the next one's turn."""

NO_ANSWER = np.full(2, math.nan)


@dataclass(frozen=True)
class Plan:
    """How much is measured.

    Attributes:
        problems: Recorded problems for each number of rows.
        passes: How often the feasible ones are solved.
        budget_s: Sum of call times after which a back end gets no more problems, for
            each number of rows; once for feasible and once for infeasible ones.
        infeasible: Infeasible problems that a back end is handed, at most.
        scans: Scans for each number of points.
        calls: Filter calls on each scan.
    """

    problems: int
    passes: int
    budget_s: float
    infeasible: int
    scans: int
    calls: int


FULL = Plan(problems=400, passes=3, budget_s=10.0, infeasible=40, scans=100, calls=20)
QUICK = Plan(problems=100, passes=1, budget_s=0.15, infeasible=5, scans=30, calls=10)


def installed_back_ends() -> tuple[str, ...]:
    """Return the back ends that can be timed, each once: ``casadi`` is its qrqp."""
    return tuple(n for n in back_end_names() if n != "casadi" and is_installed(n))


@dataclass
class Trials:
    """What one back end did on problems of one kind.

    Attributes:
        problems: Those it was handed, in order, with repetitions.
        answers: (2,) z for each; NaN where it claims none.
        times: Wall time of each call, ns.
    """

    problems: list[RecordedProblem] = field(default_factory=list)
    answers: list[Array] = field(default_factory=list)
    times: list[int] = field(default_factory=list)

    def call(self, back_end: BackEnd, problem: RecordedProblem) -> None:
        """Time one call and keep what came of it; an exception is no answer."""
        scaled = problem.scaled
        started = perf_counter_ns()
        try:
            answer = back_end(scaled)
        except Exception:
            answer = NO_ANSWER
        self.times.append(perf_counter_ns() - started)
        self.answers.append(answer if claims(back_end, answer) else NO_ANSWER)
        self.problems.append(problem)

    def has_time(self, budget_s: float) -> bool:
        """Say whether the calls so far have taken less than the budget."""
        return 1e-9 * sum(self.times) < budget_s

    def spend(
        self, budget_s: float, back_end: BackEnd, problems: Sequence[RecordedProblem]
    ) -> None:
        """Call on one problem after the other, as long as the budget lasts."""
        for problem in problems:
            if not self.has_time(budget_s):
                break
            self.call(back_end, problem)


def claims(back_end: BackEnd, answer: Array) -> bool:
    """Say whether a back end claims its answer: finite, and not disowned by CasADi.

    Our CasADi back ends hand on whatever the plug-in leaves, since every answer is
    certified later; here the plug-in is asked what it says.
    """
    buffer = getattr(back_end, "_buffer", None)
    said: bool = buffer is None or buffer.stats()["success"]
    return said and bool(np.isfinite(answer).all())


@contextmanager
def undisturbed() -> Iterator[None]:
    """Keep the garbage collector and warnings out of what is timed."""
    collecting = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        if collecting:
            gc.enable()


def time_back_ends(
    problems: Sequence[RecordedProblem],
    names: Sequence[str],
    plan: Plan = FULL,
    seed: int = 0,
) -> list[Row]:
    """Time the raw call of back ends on scaled problems, numpy to numpy, and judge it.

    Feasible problems are solved in blocks of :data:`BLOCK` successive ones, so that a
    warm start meets what it would meet in a loop; block by block the back ends take
    turns in random order. Each block is led in by a call on the problem before it,
    which is not counted: it sets up the workspace and warms the processor's caches.
    Then the infeasible problems are handed over as they are, once each.

    Args:
        problems: All with the same number of rows.
        names: Back ends.
        plan: How much is measured.
        seed: Of the order.

    Returns:
        One row a back end; see :func:`judge`.
    """
    rng = np.random.default_rng(seed)
    feasible = [p for p in problems if p.mark is not Mark.INFEASIBLE]
    infeasible = [p for p in problems if p.mark is Mark.INFEASIBLE][: plan.infeasible]
    starts = range(0, len(feasible), BLOCK)
    loaded = {name: load_back_end(name) for name in names}
    timed = {name: Trials() for name in names}
    raw = {name: Trials() for name in names}
    with undisturbed():
        for _ in range(plan.passes):
            for i in rng.permutation(starts):
                gc.collect()
                for name in rng.permutation(list(names)):
                    trials, back_end = timed[name], loaded[name]
                    if trials.has_time(plan.budget_s):
                        Trials().call(back_end, feasible[i - 1])
                        trials.spend(plan.budget_s, back_end, feasible[i : i + BLOCK])
        for name, back_end in loaded.items():
            raw[name].spend(plan.budget_s, back_end, infeasible)
    rows = len(problems[0].problem.b)
    return [judge(name, rows, timed[name], raw[name]) for name in names]


def judge(name: str, rows: int, timed: Trials, raw: Trials) -> Row:
    """Return what a back end's trials are worth, as one row of the table.

    Args:
        name: Of the back end.
        rows: Of the problems.
        timed: Trials on feasible problems.
        raw: Trials on infeasible ones.

    Returns:
        ``calls`` on ``problems`` different feasible problems; ``median_us``, ``p99_us``
        and ``max_us`` of a call; ``wrong``: answers that are claimed and farther than
        :data:`WRONG` from the exact optimum; ``worst_error`` of all that are claimed,
        m/s or rad/s; ``false_infeasible``: calls without an answer although there is
        one. On ``infeasible_calls``: ``false_ok``, answers although there is none, and
        ``infeasible_max_us``.
    """
    errors = np.array(
        [
            np.abs((z - problem.optimum) / problem.scaled.scale).max()
            for problem, z in zip(timed.problems, timed.answers, strict=True)
        ]
    )
    claimed = errors[np.isfinite(errors)]
    times = 1e-3 * np.array(timed.times)
    return {
        "back_end": name,
        "rows": rows,
        "problems": len({id(problem) for problem in timed.problems}),
        "calls": len(times),
        "median_us": float(np.median(times)) if len(times) else None,
        "p99_us": float(np.quantile(times, 0.99)) if len(times) else None,
        "max_us": float(times.max()) if len(times) else None,
        "wrong": int((claimed > WRONG).sum()),
        "worst_error": float(claimed.max()) if len(claimed) else None,
        "false_infeasible": len(errors) - len(claimed),
        "infeasible_calls": len(raw.times),
        "false_ok": int(sum(np.isfinite(z).all() for z in raw.answers)),
        "infeasible_max_us": 1e-3 * max(raw.times) if raw.times else None,
    }
