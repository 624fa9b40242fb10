"""The whole bench: record, time, judge, report."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from qpavoid.errors import MissingExtraError, UnknownNameError
from qpavoid.qp.solve import (
    BACK_ENDS,
    BackEnd,
    back_end_names,
    find_back_end,
    is_installed,
)
from timing.calls import time_calls
from timing.cold_start import cold_starts
from timing.contenders import CONTENDERS
from timing.recorded import RecordedProblem, record_problems, softened
from timing.report import Report, summary_lines, write_report
from timing.steps import time_steps, with_back_ends
from timing.trials import (
    FULL,
    QUICK,
    Case,
    Plan,
    Row,
    of_back_end,
    race,
)

ROWS = (5, 20, 100, 1000)


def bench(
    out: Path,
    quick: bool = False,
    back_ends: Sequence[str] | None = None,
    cold_start: bool = False,
    console: Console | None = None,
) -> Report:
    """Time all solvers, alone and in whole steps, print tables, and write a report.

    Args:
        out: Folder of the report; what is finished is written at once.
        quick: Fewer problems and, unless named, the package's back ends alone: in less
            than 20 s instead of a quarter of an hour.
        back_ends: Names; without them all that are installed.
        cold_start: Time fresh processes too, which takes a minute more.
        console: Where tables and progress are printed.

    Raises:
        UnknownNameError: No such solver.
        MissingExtraError: The package of one that is named is absent.
    """
    console = console or Console(width=None if sys.stdout.isatty() else 240)
    ordinary = [n for n in back_end_names() if n in CONTENDERS and is_installed(n)]
    names = list(dict.fromkeys(back_ends or (ordinary if quick else CONTENDERS)))
    plan = QUICK if quick else FULL
    report = Report(asdict(plan))
    for name in names:
        try:
            solver = load(name)
        except MissingExtraError:
            if back_ends:
                raise
            report.absent.append(name)
        else:
            report.settings[name] = getattr(solver, "settings", {})
    names = list(report.settings)
    with console.status("") as status:
        for rows in ROWS:
            status.update(f"{rows} rows: recording {plan.problems} problems")
            problems = record_problems(rows, plan.problems)
            for unknowns in (2, 3) if rows <= plan.slack_rows else (2,):
                status.update(f"{unknowns} unknowns, {rows} rows: {len(names)} solvers")
                time_solvers(report, problems, names, plan, unknowns)
            write_report(report, out)
        steps = with_back_ends([name for name in names if name in BACK_ENDS])
        report.steps += time_steps(ROWS, steps, plan, status.update)
        status.update("calls of the filter")
        report.calls += time_calls()
        if cold_start:
            report.starts += cold_starts(status.update)
        status.update("writing the report")
        write_report(report, out)
    console.print("\n".join(summary_lines(report)), soft_wrap=True, highlight=False)
    console.print(f"Report, tables and figures are in {out}", soft_wrap=True)
    return report


def load(name: str) -> BackEnd:
    """Return a solver by name, loaded.

    Raises:
        UnknownNameError: No such solver.
        MissingExtraError: Its package, or one that it needs, is absent.
    """
    if name not in CONTENDERS:
        if not name.startswith("qpsolvers:"):
            raise UnknownNameError("back end", name, CONTENDERS)
        return find_back_end(name).load()
    try:
        return CONTENDERS[name].load()
    except (ImportError, UnknownNameError):  # qpsolvers knows what is installed alone
        raise MissingExtraError(f"solver {name!r}", CONTENDERS[name].extra) from None


def time_solvers(
    report: Report,
    problems: Sequence[RecordedProblem],
    names: Sequence[str],
    plan: Plan,
    unknowns: int,
) -> None:
    """Time solvers on problems of one size, and add that to the report.

    With three unknowns the problems are :func:`softened` and ``exact`` stays out.

    Args:
        report: Added to.
        problems: As they were recorded.
        names: Of the back ends.
        plan: How often each is timed.
        unknowns: 2, or 3 with a slack.
    """
    rows = len(problems[0].problem.b)
    if unknowns == 3:
        problems = [softened(problem) for problem in problems]
        names = [name for name in names if name != "exact"]
    report.problems += [describe(i, unknowns, p) for i, p in enumerate(problems)]
    cases = [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]
    contenders = {name: of_back_end(load(name)) for name in names}
    for name, row in race(contenders, cases, plan).items():
        start: Row = {"solver": name, "unknowns": unknowns, "rows": rows}
        report.solvers.append(start | row)


def describe(number: int, unknowns: int, recorded: RecordedProblem) -> Row:
    """Return a recorded problem as one row of ``problems.csv``."""
    return {
        "rows": len(recorded.problem.b),
        "unknowns": unknowns,
        "number": number,
        "mark": recorded.mark.value,
        "reasons": " ".join(recorded.reasons),
        "slack": recorded.slack,
        "residual": recorded.residual,
    }
