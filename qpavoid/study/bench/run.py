"""The whole bench: record, time, judge, report."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter_ns

import numpy as np
from rich.console import Console

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.model.robot import Robot
from qpavoid.qp.solve import find_back_end
from qpavoid.study.bench.cold_start import cold_starts
from qpavoid.study.bench.recorded import RecordedProblem, record_problems, record_scans
from qpavoid.study.bench.report import Report, print_report, write_report
from qpavoid.study.bench.trials import (
    FULL,
    QUICK,
    Plan,
    Row,
    installed_back_ends,
    time_back_ends,
    undisturbed,
)

ROWS = (5, 20, 100, 1000)
POINTS = (1, 10, 100, 1000, 10_000)
TARGETS_US = {1: 5.0, 1000: 20.0}
"""Most that the median filter call should take, by number of points."""


def bench(
    out: Path,
    quick: bool = False,
    back_ends: Sequence[str] | None = None,
    cold_start: bool = False,
    console: Console | None = None,
) -> Report:
    """Time all back ends and the filter, print tables, and write a report.

    Args:
        out: Folder of the report; what is finished is written at once.
        quick: Fewer problems: in less than 20 s instead of a few minutes.
        back_ends: Names; without them all that are installed.
        cold_start: Time fresh processes too, which takes a minute more.
        console: Where tables and progress are printed.

    Raises:
        UnknownNameError: No such back end.
        MissingExtraError: Its package is absent.
    """
    console = console or Console(width=None if sys.stdout.isatty() else 140)
    names = tuple(dict.fromkeys(back_ends or installed_back_ends()))
    for name in names:
        find_back_end(name)
    plan = QUICK if quick else FULL
    report = Report(names, asdict(plan))
    with console.status("") as status:

        def say(what: str) -> None:
            status.update(what)

        for rows in ROWS:
            say(f"{rows} rows: recording {plan.problems} problems in closed loops")
            problems = record_problems(rows, plan.problems)
            report.problems += [describe(i, p) for i, p in enumerate(problems)]
            say(f"{rows} rows: timing {len(names)} back ends")
            report.solvers += time_back_ends(problems, names, plan)
            write_report(report, out)
        report.filter += time_filter(POINTS, plan, say)
        if cold_start:
            report.starts += cold_starts(say)
        say("writing the report")
        write_report(report, out)
    print_report(report, console)
    console.print(f"Report, tables and figure are in {out}", soft_wrap=True)
    return report


def describe(number: int, recorded: RecordedProblem) -> Row:
    """Return a recorded problem as one row of ``problems.csv``."""
    return {
        "rows": len(recorded.problem.b),
        "number": number,
        "mark": recorded.mark.value,
        "reasons": " ".join(recorded.reasons),
        "slack": recorded.slack,
        "residual": recorded.residual,
    }


def time_filter(
    points: Sequence[int],
    plan: Plan = FULL,
    progress: Callable[[str], None] = lambda what: None,
) -> list[Row]:
    """Time ``SafetyFilter.filter`` with the exact back end on recorded scans.

    Every call is timed alone, from numpy points to the Decision. The scans follow each
    other as in their loop, and all of them come round ``plan.calls`` times.

    Returns:
        ``points``, ``rows`` (median number that can matter), ``calls``, ``median_us``,
        ``p99_us``, ``max_us``, ``target_us`` (of the median).
    """
    safety = SafetyFilter(Robot.mir100(), ahead=False)
    table: list[Row] = []
    for number in points:
        progress(f"SafetyFilter.filter at {number} points")
        scans = record_scans(number, plan.scans)
        rows = [len(safety.problem(*scan).b) for scan in scans]
        times = []
        with undisturbed():
            safety.filter(*scans[0])
            for _ in range(plan.calls):
                for v, omega, echoes in scans:
                    started = perf_counter_ns()
                    safety.filter(v, omega, echoes)
                    times.append(perf_counter_ns() - started)
        microseconds = 1e-3 * np.array(times)
        table.append(
            {
                "points": number,
                "rows": float(np.median(rows)),
                "calls": len(times),
                "median_us": float(np.median(microseconds)),
                "p99_us": float(np.quantile(microseconds, 0.99)),
                "max_us": float(microseconds.max()),
                "target_us": TARGETS_US.get(number),
            }
        )
    return table
