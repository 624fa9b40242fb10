"""The commands for studies: sweep, report, tune, datasets, play, bench."""

import json
import os
import sys
import webbrowser
from argparse import ArgumentTypeError, Namespace
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from types import ModuleType
from urllib.parse import urlparse
from urllib.request import url2pathname

from qpavoid.cli.output import give, make_console, told_by
from qpavoid.cli.progress import progress, waiting
from qpavoid.cli.runs import names_in
from qpavoid.errors import ConfigError, DataError

FAILED_RUNS = ("failed", "died")

PACKAGE = Path(__file__).resolve().parent.parent


def workers(text: str) -> int:
    """Return how many processes a command may use."""
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"{text!r} is no number of processes, 1 or more")
    return int(text)


def sweep(options: Namespace) -> int:
    """Run a study, or what is missing of it; exit code 1 if runs failed."""
    from qpavoid.lab.study.sweep.engine import sweep
    from qpavoid.lab.study.sweep.store import read_rows
    from qpavoid.lab.study.sweep.study import read_study

    study = read_study(options.study, options.data)
    if options.controllers is not None:
        # What is wrong now is not the file's; modules may lie beside that.
        with told_by("--controllers", ConfigError):
            names = names_in(options.controllers)
            study = read_study(options.study, options.data, names)
    with progress(len(study), study.title, "runs", options.quiet) as show:
        count = sweep(
            study, options.out, options.workers, options.dask, show, options.merge
        )
    mine, rows = {job.run for job in study.jobs()}, read_rows(options.out)
    failed = [
        row for row in rows if row["run"] in mine and row["outcome"] in FAILED_RUNS
    ]
    lines = [f"{count} runs done, {len(rows)} in {options.out}, {len(failed)} failed"]
    if others := sum(row["run"] not in mine for row in rows):
        lines.append(f"{others} of them are of another study or code; a report has all")
    if study.trajectories == "none":
        lines.append('No logs are kept; a report replays those of trajectories = "all"')
    found = {"done": count, "rows": len(rows), "others": others, "failed": failed}
    found |= {"out": options.out}
    give(options, found, lambda: print(*lines, sep="\n"))
    for row in failed[:20]:
        what = (row[key] for key in ("run", "scenario", "seed", "controller"))
        print("  ", *what, row["error"], file=sys.stderr)
    return 1 if failed else 0


def tune(options: Namespace) -> None:
    """Search settings of a controller on training seeds, judge them on others."""
    from qpavoid.lab.study.tune import read_tuning, result_table, tune

    tuning = read_tuning(options.tuning, options.data)
    say = (lambda line: None) if options.json else print
    found = tune(tuning, options.out, options.workers, say)
    data = {"best": found.best, "table": found.table}
    give(options, data, lambda: print(result_table(tuning, found)))


def datasets(options: Namespace) -> None:
    """List published data: what is found, and where the rest is from."""
    from qpavoid.lab.worlds.catalogue import lines, rows

    folder = options.data or os.environ.get("QPAVOID_DATA")
    give(options, rows(folder), lambda: print(*lines(options.data), sep="\n"))
    if folder and not Path(folder).is_dir():
        raise DataError(f"{folder} is no folder")


def report(options: Namespace) -> None:
    """Write one HTML page of a sweep, or of what compare and run left."""
    from qpavoid.lab.study.report import write_report

    print(write_report(options.results, options.out))


def play(options: Namespace) -> None:
    """Write one HTML page where robots drive live, and open it in a browser."""
    from qpavoid.lab.play.page import write_page

    methods = options.controllers.split(",")
    with waiting(options.quiet) as say:
        page = write_page(options.out, options.config, methods, options.data, say)
    print(page)
    if not options.no_open:
        webbrowser.open(page.resolve().as_uri())


def bench(options: Namespace) -> None:
    """Time every installed QP solver; needs the source tree."""
    report = timing_study().bench(
        options.out,
        quick=options.quick,
        back_ends=options.backends.split(",") if options.backends else None,
        cold_start=options.cold_start,
        console=make_console(quiet=options.json),
    )
    give(options, vars(report), lambda: None)


def timing_study() -> ModuleType:
    """Return the package ``timing`` of the tree that this one was installed from.

    Raises:
        DataError: There is none, or it is no longer where it was.
    """
    for tree in (PACKAGE.parent, installed_from()):
        scripts = tree / "comparisons"
        if (scripts / "timing").is_dir():
            sys.path.insert(0, str(scripts))
            return import_module("timing")
    raise DataError(
        "the timing study is not part of the installed package: it is "
        "comparisons/timing in the source tree, python comparisons/solver_timing.py"
    )


def installed_from() -> Path:
    """Return the folder that this package was installed from; else where it lies."""
    try:
        origin = distribution("qpavoid").read_text("direct_url.json") or ""
        return Path(url2pathname(urlparse(json.loads(origin)["url"]).path))
    except (PackageNotFoundError, ValueError, KeyError):
        return PACKAGE.parent
