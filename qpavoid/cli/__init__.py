"""The command line: compare, run, list, check, bench, export-c, and of studies."""

import argparse
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from qpavoid.cli.studies import add_commands
from qpavoid.errors import InvalidInputError, QPAvoidError, UnknownNameError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

    from qpavoid.lab.simulation.log import Log
    from qpavoid.lab.simulation.scenario import Scenario

PAPER = ("paper/test_case_1", "paper/test_case_2")
OK, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    0: done. 1: something that the command needs is wrong (a scenario, data, a back
    end). 2: the command itself is wrong. 130: interrupted; what is finished is kept.
    """
    options = build_parser().parse_args(arguments)
    try:
        return int(options.command(options) or OK)
    except UnknownNameError as error:
        print(f"qpavoid: {error}", file=sys.stderr)
        return USAGE
    except (QPAvoidError, OSError) as error:
        print(f"qpavoid: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("qpavoid: interrupted; finished runs are kept", file=sys.stderr)
        return INTERRUPTED


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="qpavoid",
        description="Obstacle avoidance for differential-drive robots: the paper's "
        "Eq. 5 and Eq. 7, and a QP filter, under identical conditions.",
    )
    parser.add_argument("--version", action="version", version=version("qpavoid"))
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_runs(commands)
    _add_tools(commands)
    _add_export(commands)
    add_commands(commands)
    return parser


def _add_runs(commands: Any) -> None:
    one = commands.add_parser("compare", help="run controllers on scenarios")
    one.add_argument(
        "configs",
        nargs="*",
        metavar="CONFIG",
        help="scenario file or shipped name (default: the paper's two test cases)",
    )
    one.add_argument(
        "--controllers", default="eq5,eq7,qp,qp-repulsion,qp-ahead", metavar="A,B,…"
    )
    _common(one)
    one.set_defaults(command=_compare)

    one = commands.add_parser("run", help="run one controller on one scenario")
    one.add_argument("config", metavar="CONFIG", help="scenario file or shipped name")
    one.add_argument("--controller", default="qp-ahead")
    one.add_argument("--show", action="store_true", help="show the figures on screen")
    one.add_argument("--animate", metavar="FILE", help="write a .gif or .mp4 too")
    _common(one)
    one.set_defaults(command=_run)


def _add_tools(commands: Any) -> None:
    one = commands.add_parser("list", help="list what there is")
    one.add_argument("what", choices=("controllers", "backends", "configs", "studies"))
    one.set_defaults(command=_list)

    one = commands.add_parser("check", help="check a scenario file")
    one.add_argument("config", metavar="CONFIG")
    one.add_argument("--data", metavar="PATH", help="folder of published data sets")
    one.set_defaults(command=_check)

    one = commands.add_parser("bench", help="time every installed QP solver")
    one.add_argument("--quick", action="store_true", help="fewer problems, < 20 s")
    one.add_argument(
        "--cold-start", action="store_true", help="first and second starts too"
    )
    one.add_argument("--backends", metavar="A,B,…", help="default: all installed")
    one.add_argument("--out", type=Path, default=Path("out/timing"), metavar="DIR")
    one.set_defaults(command=_bench)


def _add_export(commands: Any) -> None:
    one = commands.add_parser("export-c", help="write the filter as C99 for a robot")
    one.add_argument("folder", metavar="FOLDER")
    one.add_argument(
        "--robot",
        default="mir100",
        metavar="R",
        help="preset, or a scenario whose robot, filter and time step are taken",
    )
    for kind in ("obstacles", "points", "walls", "polygons"):
        number, what = (20, "discs") if kind == "obstacles" else (0, kind)
        one.add_argument(
            f"--{kind}",
            type=int,
            default=number,
            metavar="N",
            help=f"how many {what} at most, {number}",
        )
    one.add_argument("--no-ahead", action="store_true", help="rows of the present only")
    one.set_defaults(command=_export)


def _common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--backend", default="exact", help="QP solver, see list")
    parser.add_argument("--out", type=Path, default=Path("out"), metavar="DIR")
    parser.add_argument("--data", metavar="PATH", help="folder of published data sets")


def _compare(options: argparse.Namespace) -> None:
    names = list(dict.fromkeys(name.strip() for name in options.controllers.split(",")))
    console, _, _ = _simulate(options.configs or PAPER, names, options)
    console.print(f"Figures, tables and logs are in {options.out}", soft_wrap=True)


def _run(options: argparse.Namespace) -> None:
    if options.animate:
        from qpavoid.lab.study.animation import animate, film_writer

        film_writer(Path(options.animate))
    console, logs, figures = _simulate([options.config], [options.controller], options)
    if options.animate:
        with console.status("drawing the animation"):
            animate(logs, options.animate)
    if options.show:
        _show(figures)
    console.print(f"Figures, tables and logs are in {options.out}", soft_wrap=True)


def _simulate(
    configs: Sequence[str], names: Sequence[str], options: argparse.Namespace
) -> tuple["Console", "list[Log]", list[Path]]:
    """Check everything, then run, save, print and draw; return logs and figures."""
    from qpavoid.lab.simulation.methods import check_methods
    from qpavoid.lab.simulation.scenario import load_scenario
    from qpavoid.lab.study.compare import compare, table
    from qpavoid.lab.study.plots import save_figures
    from qpavoid.qp.solve import find_back_end

    check_methods(names)
    find_back_end(options.backend)
    scenarios = [load_scenario(config, options.data) for config in configs]
    if len({scenario.name for scenario in scenarios}) < len(scenarios):
        raise InvalidInputError("two scenarios have the same name; rename a file")
    options.out.mkdir(parents=True, exist_ok=True)
    console = _console()
    with _progress(console, len(names) * sum(s.steps for s in scenarios)) as advance:
        logs, summary = compare(scenarios, names, options.backend, options.out, advance)
    figures = []
    for scenario in scenarios:
        console.print(table(scenario, summary))
        same = [log for log in logs if log.meta["scenario"] == scenario.name]
        figures += save_figures(same, options.out)
    return console, logs, figures


def _list(options: argparse.Namespace) -> None:
    console = _console()
    if options.what == "controllers":
        from qpavoid.lab.simulation.methods import STAGES, methods

        for name, description in (*methods().items(), *STAGES.items()):
            console.print(f"{name:12} {description}", highlight=False)
    elif options.what == "backends":
        from qpavoid.errors import pip_install
        from qpavoid.qp.solve import BACK_ENDS, back_end_names, is_installed

        for name in back_end_names():
            note = "" if is_installed(name) else "not installed: "
            if note:
                note += pip_install(BACK_ENDS[name].extra)
            console.print(f"{name:20} {note}".rstrip(), highlight=False, markup=False)
    else:
        from qpavoid.lab.simulation.config import builtin_configs

        for name in builtin_configs(studies=options.what == "studies"):
            console.print(name, highlight=False)


def _check(options: argparse.Namespace) -> None:
    from qpavoid.lab.simulation.scenario import load_scenario

    scenario = load_scenario(options.config, options.data)
    obstacles = len(scenario.world.at(0.0))
    print(
        f"{options.config}: valid. {scenario.title}: {scenario.robot.name}, "
        f"obstacles: {obstacles}, {scenario.duration:g} s in {scenario.steps} steps"
    )


def _bench(options: argparse.Namespace) -> None:
    from qpavoid.cli.studies import timing_study

    names = options.backends.split(",") if options.backends else None
    timing_study().bench(
        options.out,
        quick=options.quick,
        back_ends=names,
        cold_start=options.cold_start,
    )


def _export(options: argparse.Namespace) -> None:
    from qpavoid.avoidance.settings import AvoidanceSettings
    from qpavoid.export.write import Capacity, export_c
    from qpavoid.lab.simulation.scenario import load_scenario
    from qpavoid.lab.simulation.schema import Preset
    from qpavoid.model.robot import Robot

    if options.robot in get_args(Preset):
        robot, settings = getattr(Robot, options.robot)(), AvoidanceSettings()
    else:
        scenario = load_scenario(options.robot)
        robot, settings = scenario.robot, scenario.settings
    polygons = options.polygons, 8 * options.polygons
    capacity = Capacity(options.obstacles, options.points, options.walls, *polygons)
    ahead = not options.no_ahead
    for path in export_c(options.folder, robot, settings, capacity, ahead):
        print(path)


def _console() -> "Console":
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=200)


@contextmanager
def _progress(console: "Console", steps: int) -> Iterator["Advance"]:
    """Show a bar while the steps are done; without a terminal, a line per run."""
    from rich.progress import Progress

    silent = not console.is_terminal
    with Progress(console=console, transient=True, disable=silent) as progress:
        advance = Advance(progress, steps)
        before = signal.signal(signal.SIGINT, advance.interrupt)
        try:
            yield advance
        finally:
            signal.signal(signal.SIGINT, before)


class Advance:
    """Counts steps, passes them on a hundred at a time, and names finished runs.

    An interrupt waits for the end of the step: raised inside a compiled call it would
    become an error of the interpreter. A second one does not wait.
    """

    def __init__(self, progress: "Progress", steps: int) -> None:
        self._progress = progress
        self._task = progress.add_task("simulating", total=steps)
        self._done = 0
        self._interrupted = False

    def interrupt(self, *_: object) -> None:
        """Remember that the user wants to stop."""
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True

    def __call__(self, scenario: "Scenario", controller: str, steps: int) -> None:
        """Count one step of a run."""
        if self._interrupted:
            raise KeyboardInterrupt
        self._done += 1
        if self._done % 100 == 0:
            self._progress.update(self._task, completed=self._done)
        if self._progress.disable and steps == scenario.steps:
            print(f"{scenario.name}: {controller} done", file=sys.stderr, flush=True)


def _show(paths: Sequence[Path]) -> None:
    """Open the figures with the system's viewer."""
    import webbrowser

    for path in paths:
        webbrowser.open(path.resolve().as_uri())
