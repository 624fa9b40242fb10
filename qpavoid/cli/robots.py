"""The commands for a robot: ros, replay, identify, calibrate."""

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from qpavoid.cli.output import UsageError, give, show_table, told_by
from qpavoid.errors import InvalidInputError, QPAvoidError, UnknownNameError

WORST = 10
"""Rows of a table that are printed."""


def ros(options: Namespace) -> int:
    """Run the ROS 2 node; all after -- goes to ROS."""
    given = list(options.args)
    if options.params is not None:
        path = parameter_file(options.params)
        given = ["--ros-args", "--params-file", str(path), *given]
    try:
        from qpavoid.ros.node import main
    except ImportError as error:
        raise QPAvoidError(
            f"the node needs {error.name}: source the setup of ROS 2, or see "
            "docs/ros2.md for environments without apt"
        ) from None
    return main(given)


def parameter_file(name: str) -> Path:
    """Return a file with parameters of the node, by its path or shipped name."""
    from qpavoid.lab.scenario.config import config_folder

    shipped = {path.stem: path for path in (config_folder() / "ros").glob("*.yaml")}
    path = shipped.get(name, Path(name))
    if not path.is_file():
        raise UnknownNameError("parameter file", name, sorted(shipped))
    return path


def share(text: str) -> float:
    """Return ``2%`` or ``0.02`` as 0.02."""
    try:
        part = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        part = -1.0
    if not 0.0 <= part <= 1.0:
        raise ArgumentTypeError(f"{text!r} is no share, such as 2% or 0.02")
    return part


def replay(options: Namespace) -> int:
    """Send a recorded drive through the filter; exit code 3: it changed too much."""
    try:
        return _replayed(options)
    except QPAvoidError as error:
        if options.json:
            give(options, {"error": str(error)}, lambda: None)
        raise


def _replayed(options: Namespace) -> int:
    from qpavoid.lab.study.bags import bag_drive
    from qpavoid.lab.study.replay import (
        read_parameters,
        replay,
        robot_of,
        save,
        setup_for,
        summary,
    )

    given, written = options.bag.resolve(), (options.out / "bag").resolve()
    if written in (given, *given.parents):
        raise UsageError(f"{options.bag}: would be written over; give another --out")
    with told_by("--robot", InvalidInputError):
        robot = robot_of(options.robot)
    params = options.params
    told = None if params is None else read_parameters(parameter_file(params))
    wiring = None if told is None else told[0]
    topics = options.command_topic, options.odometry_topic
    drive, allowed = bag_drive(options.bag, wiring, *topics), options.allow_changed
    if allowed is not None and not drive.has_commands:
        raise UsageError(f"{options.bag}: no commands for --allow-changed")
    setup = told[1] if told else setup_for(drive, robot)
    if options.raw:
        raw = replace(setup.perception, enabled=False)
        setup = setup._replace(perception=raw)
    replayed = replay(drive, setup)
    found = summary(replayed)
    paths = save(replayed, options.out)
    give(options, found | {"files": paths}, lambda: _say(found, paths))
    if allowed is not None and replayed.changed > allowed:
        print(f"more than the {allowed:.2%} that are allowed", file=sys.stderr)
        return 3
    return 0


def identify(options: Namespace) -> int:
    """Fit delay, ramps, slip and wheel separation to commands and odometry."""
    from qpavoid.lab.simulation.log import Log
    from qpavoid.lab.study.identify import (
        bagged,
        drive_of,
        identify,
        rows_of,
        settings_of,
    )

    if options.log.suffix == ".npz":
        drive = drive_of(Log.load(options.log))
    else:
        drive = bagged(options.log, options.command_topic)
    base = identify(drive)

    def show() -> None:
        show_table(["", "value", "95 %", "unit"], rows_of(base))
        print(settings_of(base))

    fitted = {
        name: one._asdict() for name, one in zip(base._fields, base[:5], strict=False)
    }
    give(options, fitted | {"settings": settings_of(base)}, show)
    return 0


def calibrate(options: Namespace) -> None:
    """Fit mount, stamp delay and sweep of a LiDAR to a recording among walls."""
    from qpavoid.lab.study.calibrate import (
        EXCITED,
        calibrate,
        read_recording,
        settings_of,
    )

    recording = read_recording(options.bag, options.scan_topic, options.odometry_topic)
    found = calibrate(recording)
    values = [one.value for one in found.estimates.values()]
    settings = settings_of(recording, values)
    rows = [
        [name, f"{one.value:.4f}", f"{one.low:.4f} … {one.high:.4f}", EXCITED[name][1]]
        for name, one in found.estimates.items()
    ]

    def show() -> None:
        show_table(["", "value", "95 %", "unit"], rows)
        print(f"walls are {found.thickness:.3f} m thick", settings, sep="\n")

    fitted = {name: one._asdict() for name, one in found.estimates.items()}
    more = {"thickness": found.thickness, "settings": settings}
    give(options, fitted | more, show)


def _say(found: dict[str, Any], paths: Sequence[Path]) -> None:
    """Print the numbers of a replay, its movers, its changed stretches, its files."""
    movers = found["movers"]
    print(f"{len(movers)} movers in {found['steps']} steps, {found['seconds']:.0f} s")
    _show_most(movers, "lasts_s")
    if "commands" in found:
        print(
            f"{found['changed']} of {found['commands']} commands changed "
            f"({found['share_changed']:.2%}); "
            + ", ".join(f"{word}: {count}" for word, count in found["why"].items())
        )
        for word, reason in found["reasons"].items():
            print(f"{word}: {reason}")
        _show_most(found["episodes"], "commands")
    print(*found["notes"], *paths, sep="\n")


def _show_most(rows: Sequence[dict[str, Any]], key: str) -> None:
    """Print a table of the rows with the greatest values of a key."""
    worst = sorted(rows, key=lambda one: -one[key])[:WORST]
    if worst:
        show_table(list(worst[0]), ([*one.values()] for one in worst))
