"""What the studies of this folder share: their options, their runs, their tables.

A study is a sweep: started again it does what is missing. Its folder holds
``table.csv`` with one row a method and setting, ``runs.csv`` with one row a run, and
``report.html``, which ``qpavoid report`` makes.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple, TypeAlias, cast

from qpavoid.errors import DataError, MissingExtraError, QPAvoidError
from qpavoid.lab.worlds.source import Source

try:
    from qpavoid.lab.study.report import write_report
    from qpavoid.lab.study.report.ranking import who
    from qpavoid.lab.study.sweep.engine import sweep
    from qpavoid.lab.study.sweep.job import Job
    from qpavoid.lab.study.sweep.store import read_rows
    from qpavoid.lab.study.sweep.study import Study, find_controller
    from qpavoid.lab.study.tables import write_csv
except MissingExtraError as error:
    if Path(__file__).resolve().parent in Path(sys.argv[0]).resolve().parents:
        sys.exit(str(error))
    raise

Row: TypeAlias = dict[str, Any]


class Scenes(NamedTuple):
    """Scenes of a study.

    Attributes:
        source: Where they come from.
        seeds: Which of them.
        setting: What the table calls them.
        changes: Settings by dotted key, the same for all methods.
    """

    source: Source
    seeds: Sequence[int | None]
    setting: str = ""
    changes: Mapping[str, Any] = {}


class Together(NamedTuple):
    """Studies that are swept as one, so that the workers start once.

    Attributes:
        studies: Of one title; whose logs are kept is said by the first.
    """

    studies: Sequence[Study]

    @property
    def text(self) -> str:
        """The study file of the first."""
        return self.studies[0].text

    @property
    def controllers(self) -> tuple[tuple[str, str], ...]:
        """Controllers and back ends of all."""
        every = chain.from_iterable(study.controllers for study in self.studies)
        return tuple(dict.fromkeys(every))

    @property
    def trajectories(self) -> str:
        """Whose logs are kept."""
        return self.studies[0].trajectories

    def jobs(self) -> Iterator[Job]:
        """Yield every run."""
        return chain.from_iterable(study.jobs() for study in self.studies)


def make_parser(doc: str, methods: str, out: str) -> argparse.ArgumentParser:
    """Return a parser with the options that every study has.

    Args:
        doc: Its first line says what the study asks.
        methods: That run if no others are named.
        out: Its folder.
    """
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH", help="published data sets")
    names = "--methods", "--controllers"
    parser.add_argument(*names, default=methods, metavar="A,B,…")
    parser.add_argument("--seed", type=natural, default=0, metavar="S")
    parser.add_argument("--out", type=Path, default=Path(out), metavar="DIR")
    parser.add_argument(
        "--workers", type=count, metavar="N", help="all cores if not given"
    )
    return parser


def chosen_methods(options: argparse.Namespace) -> list[tuple[str, str]]:
    """Return methods and back ends of ``--methods``, ``module:Name`` among them.

    Raises:
        UnknownNameError: No such method or back end.
        ConfigError: One of one's own cannot be loaded.
    """
    return list(dict.fromkeys(map(find_controller, options.methods.split(","))))


def run_study(
    title: str,
    scenes: Iterable[Scenes],
    options: argparse.Namespace,
    add: Callable[[Row], Row] = lambda row: {},
) -> list[Row]:
    """Run every method on every scene, write and print the tables, return the rows.

    Args:
        title: Of the report.
        scenes: Where the runs take place.
        options: What the parser made: data, methods, out, workers.
        add: From the row of a run to what the study knows of it beside: ``metric``.

    Raises:
        QPAvoidError: An unknown method, or data that are not there or damaged: they
            are read before anything runs.
    """
    controllers = chosen_methods(options)
    chosen = list(scenes)
    studies = [
        Study(
            title=title,
            text=f"title = {title!r}\n",
            controllers=controllers,
            sources=[(source, seeds)],
            variations=[changes],
            trajectories="none",
            data=None if options.data is None else str(options.data),
        )
        for source, seeds, _, changes in chosen
    ]
    for scene in chosen:
        scene.source.identity(studies[0].data)
    together = Together(studies)
    if next(together.jobs(), None) is None:
        raise DataError("no run is asked for: there is no such seed")
    sweep(cast(Study, together), options.out, options.workers)
    done, rows = read_rows(options.out), []
    for scene, study in zip(chosen, studies, strict=True):
        place = {
            job.run: controllers.index((job.controller, job.solver))
            for job in study.jobs()
        }
        found = [row for row in done if row["run"] in place]
        found.sort(key=lambda row: place[row["run"]])
        named = [{"method": who(row), "setting": scene.setting, **row} for row in found]
        rows += [row | added(row, add) for row in named]
    write_tables(rows, options.out)
    if find_spec("plotly"):
        write_report(options.out, options.out / "report.html")
    return rows


def added(row: Row, add: Callable[[Row], Row]) -> Row:
    """Return what a study knows of a run beside; a failed run has no metric."""
    more = add(row)
    if not row["error"]:
        return more
    return {k: None if k.startswith("metric") else x for k, x in more.items()}


def write_tables(rows: Sequence[Row], out: Path) -> None:
    """Write ``runs.csv`` and ``table.csv``, and print the latter."""
    groups: defaultdict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row["method"], row["setting"]].append(row)
    table = [table_row(*key, group) for key, group in groups.items()]
    for line in table:
        print(" ".join(f"{k}={v}" for k, v in line.items() if v != ""), flush=True)
    for row in rows:
        if row["error"]:
            print(f"{row['method']}, {row['scenario']} {row['seed']}: {row['error']}")
    write_csv(out / "table.csv", table)
    write_csv(out / "runs.csv", rows)


def table_row(method: str, setting: str, rows: Sequence[Row]) -> Row:
    """Return the line of one method and setting.

    ``began`` are runs that begin in contact, which say nothing of a method and count
    as nothing else; ``contacts`` those in which one began while it moved,
    ``contacts_standing`` those in which it was touched only while it stood,
    ``timeouts`` the rest that did not arrive, ``failed`` those that broke off with an
    error: where all did, nothing is counted. The mean time is over its successes.
    """
    every = rows
    rows = [row for row in every if (row.get("start_clearance_m") or 0.0) >= 0.0]
    touched = [row for row in rows if row["contact"]]
    moving = sum(bool(row["contacts_moving"]) for row in touched)
    times = [row["arrived_s"] for row in rows if row["success"]]
    failed = sum(bool(row["error"]) for row in rows)
    counts: Row = {
        "successes": len(times),
        "contacts": moving,
        "contacts_standing": len(touched) - moving,
        "timeouts": len(rows) - len(times) - len(touched) - failed,
    }
    none_left = 0 < failed == len(rows)
    return {
        "method": method,
        "runs": len(every),
        "began": len(every) - len(rows),
        **(dict.fromkeys(counts, "") if none_left else counts),
        "failed": failed,
        "mean_time_s": round(fmean(times), 2) if times else "",
        **{key: _mean(rows, key) for key in every[0] if key.startswith("metric")},
        "setting": setting,
    }


def _mean(rows: Sequence[Row], key: str) -> float | str:
    """Return the mean of a number over the runs that have it."""
    values = [row[key] for row in rows if row[key] is not None]
    return round(fmean(values), 4) if values else ""


def natural(text: str) -> int:
    """Return a whole number that is not negative; others raise ValueError."""
    if int(text) < 0:
        raise ValueError
    return int(text)


def count(text: str) -> int:
    """Return a whole number of 1 or more; others raise ValueError."""
    return 1 + natural(str(int(text) - 1))


def main_of(
    study: Callable[[], Sequence[Row] | None], parser: argparse.ArgumentParser
) -> None:
    """Run a study; what is wrong with its options or data is said in a line.

    Of the rows that it returns, one a run, none may have failed: else the exit status
    is 1.
    """
    try:
        rows = study() or ()
    except (QPAvoidError, OSError) as error:
        parser.error(str(error))
    failed = sum(bool(row["error"]) for row in rows)
    if failed:
        parser.exit(1, f"{failed} of {len(rows)} runs failed\n")
