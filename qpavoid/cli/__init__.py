"""The command line: every command with its options, and what ends one."""

import os
import re
import sys
from argparse import ArgumentParser, Namespace
from contextlib import nullcontext, redirect_stdout
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from qpavoid.cli import doctor, files, robots, runs, studies
from qpavoid.cli.output import UsageError
from qpavoid.errors import QPAvoidError, UnknownNameError, did_you_mean
from qpavoid.files import trusting

if TYPE_CHECKING:
    from collections.abc import Sequence

OK, FAILED, USAGE, INTERRUPTED, BROKEN_PIPE = 0, 1, 2, 130, 141


Option: TypeAlias = tuple[list[str], dict[str, Any]]
"""Names of an option, and what argparse is told of it."""


def option(name: str, what: str, default: Any = None, **how: Any) -> Option:
    """Return an option: ``CONFIG``, ``--out DIR``, ``--show``, ``--one --other X``."""
    words = name.split()
    flags = [word for word in words if word.startswith("--")]
    metavar = "" if words == flags else words[-1]
    if not flags and default is not None:
        how |= {"nargs": "?"}
    how |= {"metavar": metavar} if metavar else {"action": "store_true"}
    if default is not None:
        how = {"default": default, "type": type(default)} | how
        what += " (default: %(default)s)"
    return flags or [name.lower()], how | {"help": what}


CONFIG = option("CONFIG", "scenario file or shipped name, see list configs")
BACKEND = option("--backend NAME", "QP solver, see list backends", "exact")
OUT = option("--out DIR", "folder of results", Path("out"))
RESULTS = option("--out DIR", "folder of results", type=Path, required=True)
DATA = option("--data PATH", "published data sets (default: $QPAVOID_DATA)")
TRUST = option("--trust-paths", "files may name others outside of their folder")
WORKERS = option("--workers N", "processes (default: all cores)", type=studies.workers)
PARAMS = option("--params FILE", "parameters of the node, or a shipped name")
ONE = "--controller --controllers NAME", "see list controllers"
JSON = option("--json", "print JSON, for programs")
ODOMETRY = option("--odometry-topic T", "Odometry or PoseStamped of the robot", "")
BAG = option("BAG", "rosbag2 folder, .mcap, .db3 or .bag", type=Path)
FIGURES = option("--figures KIND", "png, svg or pdf", "png", choices=runs.FORMATS)
FILM = option("--film", "draw the runs as a film (GIF), too")
QUIET = option("--quiet", "print errors alone, and what --json asks for")
LAWS = "eq5,eq7,qp,qp-repulsion,qp-ahead,qp-ahead+guide"
PLAYED = "eq5,qp-ahead,qp-ahead+guide"

COMMANDS: dict[str, tuple[Any, ...]] = {
    "compare": (
        runs.compare,
        option(
            "CONFIG",
            "scenario files or shipped names (default: the paper's)",
            nargs="*",
        ),
        option("--controllers A,B,…", "see list controllers", LAWS),
        *(BACKEND, OUT, FIGURES, FILM, DATA, TRUST, JSON),
    ),
    "run": (
        runs.run,
        *(CONFIG, option(*ONE, "qp-ahead+guide", type=runs.one_name)),
        *(BACKEND, OUT, FIGURES, FILM, DATA, TRUST, JSON),
    ),
    "list": (
        runs.show_names,
        option("WHAT", ", ".join(runs.LISTED), choices=runs.LISTED),
        JSON,
    ),
    "check": (runs.check, option("CONFIG", "file or shipped name"), DATA, TRUST, JSON),
    "schema": (
        files.schema,
        option(
            "FILE", ", ".join(files.FILE_KINDS), "scenario", choices=files.FILE_KINDS
        ),
    ),
    "init": (
        files.init,
        option("FILE", "the scenario, such as my_robot.toml", type=Path),
        option(
            "--footprint --corners X",
            "LENGTH,WIDTH in m, or corners x,y x,y …",
            "0.9,0.6",
            nargs="+",
        ),
        option("--v-max X", "greatest speed, m/s", 1.0),
        option("--v-min X", "least speed, m/s: 0 never backs up", -0.5),
        option("--omega-max X", "greatest yaw rate, rad/s", 1.5),
        option("--acceleration X", "greatest acceleration, m/s²", 1.5),
        option("--force", "write over a file that is there"),
    ),
    "doctor": (
        doctor.doctor,
        option("--all", "list all parts, optional ones too"),
        JSON,
    ),
    "export-c": (
        runs.export_c,
        option("FOLDER", "where the files go"),
        option(
            "--robot R",
            "see list robots; or a scenario, of which robot, filter, "
            "time step and LiDAR are taken",
            "mir100",
        ),
        option("--obstacles N", "discs at most", 20),
        option("--points N", "points at most", 0),
        option("--walls N", "walls at most", 0),
        option("--polygons N", "polygons at most", 0),
        option("--edges N", "of all convex parts of a changed footprint at most", 0),
        option("--beams N", "of a LiDAR's scan: perception is written, too", 0),
        option("--no-ahead", "rows of the present only"),
        option("--wasm", "a WebAssembly module instead, for any robot; needs zig"),
    ),
    "sweep": (
        studies.sweep,
        option("STUDY", "study file or shipped name, see list studies"),
        *(RESULTS, WORKERS, DATA, TRUST, JSON),
        option("--controllers A,B,…", "instead of those of the study"),
    ),
    "report": (
        studies.report,
        option("RESULTS", "folder of sweep", type=Path),
        option("--out FILE", "the report", Path("report.md")),
    ),
    "play": (
        studies.play,
        option(
            "CONFIG", "scenario file or shipped name, see list configs", "demo/play"
        ),
        option("--controllers A,B,…", "that drive at first", PLAYED),
        option("--out FILE", "the page", Path("play.html")),
        option("--no-open", "do not open it in a browser"),
        DATA,
    ),
    "ros": (
        robots.ros,
        PARAMS,
        option("ARGS", "after --: for ROS, such as --ros-args -r …", nargs="*"),
    ),
    "identify": (
        robots.identify,
        option("LOG", "log of a run (.npz), or what replay takes of ROS", type=Path),
        option("--command-topic T", "of the recorded commands", ""),
        JSON,
    ),
    "calibrate": (
        robots.calibrate,
        BAG,
        option("--scan-topic T", "of the scans (default: the first)", ""),
        ODOMETRY,
        JSON,
    ),
    "replay": (
        robots.replay,
        BAG,
        PARAMS,
        option("--robot R", "see list robots; or LENGTH,WIDTH in m", "mir100"),
        option("--command-topic T", "of the recorded commands", ""),
        ODOMETRY,
        option("--raw", "without perception: all echoes at rest"),
        option(
            "--allow-changed SHARE",
            "exit code 3 where more is changed, such as 2%%",
            type=robots.share,
        ),
        option("--out DIR", "folder of results", Path("out/replay")),
        JSON,
    ),
}


def main(arguments: "Sequence[str] | None" = None) -> int:
    """Run the command line and return its exit code.

    0: done. 1: something that the command needs is wrong (a scenario, data, a back
    end). 2: the command itself is wrong. 3: a gate is not passed. 130: interrupted;
    what is finished is kept. 141: nobody reads on, as after ``| head``.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # not every terminal has an ω
            stream.reconfigure(errors="replace")
    given = sys.argv[1:] if arguments is None else arguments
    # Behind a space, numbers that begin with a minus are no option of argparse.
    given = [re.sub(r"^(?=-[\d.]+,)", " ", one) for one in given]
    options = build_parser().parse_args(given)
    try:
        return _run(options)
    except (UnknownNameError, UsageError) as error:
        return _ended(error, USAGE)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except (QPAvoidError, OSError) as error:
        return _ended(error, FAILED)
    except EOFError:
        return _ended("the input ended before all was answered", FAILED)
    except KeyboardInterrupt:
        return _ended("interrupted; finished runs are kept", INTERRUPTED)


def _run(options: Namespace) -> int:
    silent = getattr(options, "quiet", False) and not getattr(options, "json", False)
    with (
        redirect_stdout(StringIO()) if silent else nullcontext(),
        trusting(getattr(options, "trust_paths", False)),
    ):
        code = int(options.command(options) or OK)
        sys.stdout.flush()
        return code


def _ended(why: object, code: int) -> int:
    print(f"qpavoid: {why}", file=sys.stderr)
    return code


class Parser(ArgumentParser):
    """A parser that suggests the nearest choice."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the command, and end with exit code 2."""
        found = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message)
        if found:
            choices = [choice.strip(" '") for choice in found[2].split(",")]
            message += did_you_mean(found[1], choices).rstrip(".")
        super().error(message)


def build_parser() -> ArgumentParser:
    """Return the parser of all commands; without one it prints its help."""
    parser = Parser(
        prog="qpavoid",
        description="Obstacle avoidance for differential-drive robots: the paper's "
        "Eq. 5 and Eq. 7, and a QP filter, under identical conditions.",
    )
    said = f"qpavoid {version('qpavoid')}"
    parser.add_argument("--version", action="version", version=said)
    parser.set_defaults(command=lambda options: parser.print_help())
    commands = parser.add_subparsers(metavar="COMMAND")
    for name, (command, *options) in COMMANDS.items():
        what = str(command.__doc__)
        one = commands.add_parser(name, help=what, description=what)
        for flags, how in (*options, QUIET):
            one.add_argument(*flags, **how)
        one.set_defaults(command=command, parser=parser)
    return parser
