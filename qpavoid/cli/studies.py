"""The commands for studies: sweep, report, datasets, play."""

import sys
import webbrowser
from argparse import ArgumentTypeError, Namespace

from qpavoid.cli.output import give, progress, told_by
from qpavoid.cli.runs import names_in
from qpavoid.errors import ConfigError

FAILED_RUNS = ("failed", "died")


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
        count = sweep(study, options.out, options.workers, show)
    mine, rows = {job.run for job in study.jobs()}, read_rows(options.out)
    failed = [
        row for row in rows if row["run"] in mine and row["outcome"] in FAILED_RUNS
    ]
    lines = [f"{count} runs done, {len(rows)} in {options.out}, {len(failed)} failed"]
    if others := sum(row["run"] not in mine for row in rows):
        lines.append(f"{others} of them are of another study or code; a report has all")
    if study.trajectories == "none":
        lines.append('No logs are kept; a report draws those of trajectories = "all"')
    found = {"done": count, "rows": len(rows), "others": others, "failed": failed}
    found |= {"out": options.out}
    give(options, found, lambda: print(*lines, sep="\n"))
    for row in failed[:20]:
        what = (row[key] for key in ("run", "scenario", "seed", "controller"))
        print("  ", *what, row["error"], file=sys.stderr)
    return 1 if failed else 0


def report(options: Namespace) -> None:
    """Write the rankings and failures of a sweep as Markdown, with figures."""
    from qpavoid.lab.study.report import write_report

    print(write_report(options.results, options.out))


def play(options: Namespace) -> None:
    """Write one HTML page where robots drive live, and open it in a browser."""
    from qpavoid.lab.play.page import play_page
    from qpavoid.lab.play.program import program

    def say(step: str) -> None:
        if not options.quiet:
            print(step, file=sys.stderr)

    methods, page = options.controllers.split(","), options.out
    text = play_page(program(say), options.config, methods, options.data)
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text(text, encoding="utf-8")
    print(page)
    if not options.no_open:
        webbrowser.open(page.resolve().as_uri())
