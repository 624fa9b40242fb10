"""The commands for studies: sweep, report, tune, play."""

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any
from urllib.parse import urlparse
from urllib.request import url2pathname

from qpavoid.compiled import PACKAGE
from qpavoid.errors import DataError, QPAvoidError

SAID_S = 10.0
"""s between two lines about progress where there is no terminal."""


def add_commands(commands: Any) -> None:
    """Add the parsers of all commands for studies."""
    one = commands.add_parser("sweep", help="run a study, or what is missing of it")
    one.add_argument("study", metavar="STUDY", help="study file or shipped name")
    one.add_argument("--out", type=Path, required=True, metavar="DIR")
    one.add_argument("--workers", type=int, metavar="N", help="default: all cores")
    one.add_argument("--dask", metavar="ADDRESS", help="scheduler of a cluster")
    one.add_argument("--data", metavar="PATH", help="folder of published data sets")
    one.add_argument(
        "--merge",
        type=Path,
        action="append",
        default=[],
        metavar="DIR",
        help="take over the finished runs of another folder first",
    )
    one.set_defaults(command=_sweep)

    one = commands.add_parser("tune", help="search settings of a controller")
    one.add_argument("tuning", metavar="TUNING", help="tuning file or shipped name")
    one.add_argument("--out", type=Path, required=True, metavar="DIR")
    one.add_argument("--workers", type=int, metavar="N", help="default: all cores")
    one.add_argument("--data", metavar="PATH", help="folder of published data sets")
    one.set_defaults(command=_tune)

    one = commands.add_parser("datasets", help="published data: found, and where from")
    one.add_argument("--data", metavar="PATH", help="folder of published data sets")
    one.set_defaults(command=_datasets)

    one = commands.add_parser("report", help="one HTML page of a sweep or compare")
    one.add_argument("results", type=Path, metavar="RESULTS", help="folder of results")
    one.add_argument("--out", type=Path, default=Path("report.html"), metavar="FILE")
    one.set_defaults(command=_report)

    one = commands.add_parser("play", help="drag obstacles before a live robot")
    one.add_argument("config", nargs="?", default="demo/play", metavar="CONFIG")
    one.add_argument("--controller", default="qp-ahead")
    one.add_argument("--host", default="127.0.0.1")
    one.add_argument("--port", type=int, default=8008)
    one.add_argument(
        "--allow-remote", action="store_true", help="serve others than this machine"
    )
    one.add_argument("--data", metavar="PATH", help="folder of published data sets")
    one.set_defaults(command=_play)


def _sweep(options: argparse.Namespace) -> int:
    """Run a study; 1 if runs failed, which are named."""
    from qpavoid.lab.study.sweep.engine import sweep
    from qpavoid.lab.study.sweep.store import read_rows
    from qpavoid.lab.study.sweep.study import read_study

    if options.workers is not None and options.workers < 1:
        raise QPAvoidError("--workers wants 1 or more")
    study = read_study(options.study, options.data)
    with _progress(len(study), study.title) as progress:
        count = sweep(
            study, options.out, options.workers, options.dask, progress, options.merge
        )
    rows = read_rows(options.out)
    failed = [row for row in rows if row["outcome"] in ("failed", "died")]
    print(f"{count} runs done, {len(rows)} in {options.out}, {len(failed)} failed")
    for row in failed[:20]:
        what = (row[key] for key in ("run", "scenario", "seed", "controller"))
        print("  ", *what, row["error"], file=sys.stderr)
    return 1 if failed else 0


def _tune(options: argparse.Namespace) -> None:
    from qpavoid.lab.study.tune import lines, read_tuning, tune

    tuning = read_tuning(options.tuning, options.data)
    found = tune(tuning, options.out, options.workers, print)
    print(*lines(tuning, found), sep="\n")


def _datasets(options: argparse.Namespace) -> None:
    from qpavoid.lab.worlds.catalogue import lines

    print(*lines(options.data), sep="\n")


def _report(options: argparse.Namespace) -> None:
    from qpavoid.lab.study.report import write_report

    print(write_report(options.results, options.out))


def _play(options: argparse.Namespace) -> None:
    from qpavoid.lab.play.server import serve

    serve(
        options.config,
        options.controller,
        options.host,
        options.port,
        options.allow_remote,
        options.data,
    )


def installed_from() -> Path:
    """Return the folder that this package was installed from; else where it lies."""
    try:
        origin = distribution("qpavoid").read_text("direct_url.json") or ""
        return Path(url2pathname(urlparse(json.loads(origin)["url"]).path))
    except (PackageNotFoundError, ValueError, KeyError):
        return PACKAGE.parent


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


@contextmanager
def _progress(total: int, title: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar with rate and remaining time; without a terminal, a line at times."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn())
    bar = Progress(
        *columns,
        "{task.fields[rate]}",
        TimeRemainingColumn(),
        console=console,
        disable=not console.is_terminal,
    )
    started = said = perf_counter()

    def progress(count: int, skipped: int) -> None:
        nonlocal said
        done, now = count + skipped, perf_counter()
        rate = count / (now - started)
        bar.update(task, completed=done, rate=f"{rate:.1f} runs/s")
        if bar.disable and now - said > SAID_S:
            said, left = now, (total - done) / rate
            print(
                f"{done} of {total} runs, {rate:.1f} a second, {left:.0f} s to go",
                file=sys.stderr,
                flush=True,
            )

    with bar:
        task = bar.add_task(title, total=total, rate="")
        yield progress
