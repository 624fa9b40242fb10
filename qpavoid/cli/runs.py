"""The commands for single runs: compare, run, list, check, export-c."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from qpavoid.cli.output import between_steps, give, make_console, progress, told_by
from qpavoid.errors import (
    ConfigError,
    InvalidInputError,
    QPAvoidError,
    UnknownNameError,
    pip_install,
)

if TYPE_CHECKING:
    from qpavoid.model.robot import Robot

PAPER = ("paper/test_case_1", "paper/test_case_2")


def names_in(text: str) -> list[str]:
    """Return the names of ``A,B,…``, each once."""
    return list(dict.fromkeys(name.strip() for name in text.split(",")))


def check_named(names: Sequence[str]) -> None:
    """Raise UsageError for the first name of the command that is no controller."""
    from qpavoid.lab.scenario.methods import check_methods

    with told_by("--controllers", ConfigError):
        check_methods(names)


def one_name(text: str) -> str:
    """Return a controller's name, of a command that drives one."""
    if "," in text:
        raise ArgumentTypeError(f"{text!r} is several; compare and sweep take them")
    return text


def compare(options: Namespace) -> None:
    """Run controllers on scenarios: tables, figures, logs."""
    _simulate(options.config or PAPER, names_in(options.controllers), options)


def run(options: Namespace) -> None:
    """Run one controller on one scenario."""
    _simulate([options.config], [options.controller], options)


def _simulate(configs: Sequence[str], names: Sequence[str], options: Namespace) -> None:
    """Check everything, then run, save, print and draw."""
    from qpavoid.lab.scenario.scenario import load_scenario
    from qpavoid.lab.study.compare import compare, table
    from qpavoid.lab.study.plots import save_figures
    from qpavoid.qp.backends import find_back_end

    check_named(names)
    find_back_end(options.backend)
    scenarios = [load_scenario(config, options.data) for config in configs]
    if len({scenario.name for scenario in scenarios}) < len(scenarios):
        raise InvalidInputError("two scenarios have the same name; rename a file")
    options.out.mkdir(parents=True, exist_ok=True)
    console = make_console()
    steps = len(names) * sum(scenario.steps for scenario in scenarios)
    bar = progress(steps, "simulating", "steps", options.quiet)
    with bar as show, between_steps(show) as call:
        logs, summary = compare(scenarios, names, options.backend, options.out, call)
    for scenario in scenarios:
        same = [log for log in logs if log.meta["scenario"] == scenario.name]
        if not options.json:
            console.print(table(scenario, summary))
        save_figures(same, options.out, options.figures, options.film)
    where = f"Figures, tables and logs are in {options.out}"
    give(options, summary, lambda: console.print(where, soft_wrap=True))


FORMATS = ("png", "svg", "pdf")
"""File formats of figures."""

LISTED = ("controllers", "backends", "robots", "configs", "studies")


def show_names(options: Namespace) -> None:
    """List controllers, back ends, robots, scenarios (configs) or studies."""
    found = _listed(options.what)
    lines = [f"{name:20} {what}".rstrip() for name, what in found.items()]
    give(options, found, lambda: print(*lines, sep="\n"))


def _listed(kind: str) -> dict[str, str]:
    """Return what there is of a kind, and what to say of each."""
    if kind == "controllers":
        from qpavoid.lab.scenario.methods import STAGES, methods, missing_extra

        every = (methods() | STAGES).items()
        return {k: text + _wanted(missing_extra(k)) for k, text in every}
    if kind == "backends":
        from qpavoid.qp.backends import BACK_ENDS, back_end_names, is_installed

        there = {name: is_installed(name) for name in back_end_names()}
        return {
            k: "" if here else f"not installed: {pip_install(BACK_ENDS[k].extra)}"
            for k, here in there.items()
        }
    if kind == "robots":
        return {name: _described(robot) for name, robot in _presets().items()}
    from qpavoid.lab.scenario.config import builtin_configs

    return dict.fromkeys(builtin_configs(studies=kind == "studies"), "")


def _wanted(extra: str) -> str:
    return f" (not installed: {pip_install(extra)})" if extra else ""


def _presets() -> "dict[str, Robot]":
    from qpavoid.lab.scenario.schema import Preset
    from qpavoid.model.robot import Robot

    return {name: getattr(Robot, name)() for name in get_args(Preset)}


def _described(robot: "Robot") -> str:
    """Return name, size and limits of a robot in a line."""
    vertices, limits = robot.footprint.vertices, robot.limits
    length, width = vertices.max(axis=0) - vertices.min(axis=0)
    return (
        f"{robot.name}: {length:.3f} x {width:.3f} m, "
        f"{limits.v_min:g} to {limits.v_max:g} m/s, "
        f"{limits.omega_min:g} to {limits.omega_max:g} rad/s"
    )


def check(options: Namespace) -> int:
    """Check a scenario or study file: all that is wrong with it."""
    found = {"config": options.config, "valid": True}
    try:
        found["what"] = what = _checked(options)
    except QPAvoidError as error:
        if not options.json:
            raise
        problems = getattr(error, "problems", [str(error)])
        give(options, found | {"valid": False, "problems": problems}, lambda: None)
        return 1
    give(options, found, lambda: print(f"{options.config}: valid. {what}"))
    return 0


def _checked(options: Namespace) -> str:
    """Return what the file is; raise what is wrong with it."""
    from qpavoid.lab.scenario.config import find_config, read_document
    from qpavoid.lab.scenario.methods import check_methods
    from qpavoid.lab.scenario.scenario import load_scenario
    from qpavoid.lab.study.sweep.study import read_study

    shipped = options.config.removeprefix("configs/").startswith("studies/")
    document, _ = read_document(find_config(options.config, shipped)[1])
    if "controllers" in document:
        study = read_study(options.config, options.data)
        return f"{study.title}: {len(study)} runs"
    scenario = load_scenario(options.config, options.data)
    robots = scenario.robots or (scenario,)
    check_methods(one.controller for one in robots if one.controller)
    many = f"{len(scenario.robots)} robots, " if scenario.robots else ""
    return (
        f"{scenario.title}: {many}{scenario.robot.name}, "
        f"obstacles: {len(scenario.world.at(0.0))}, "
        f"{scenario.duration:g} s in {scenario.steps} steps"
    )


def export_c(options: Namespace) -> None:
    """Write the filter as C99 for a robot."""
    if options.wasm:
        from qpavoid.lab.play.program import build

        print(*build(Path(options.folder)), sep="\n")
        return
    from qpavoid.avoidance.settings import AvoidanceSettings
    from qpavoid.export.write import Capacity, export_c
    from qpavoid.lab.scenario.scenario import load_scenario

    given = options.obstacles, options.points, options.walls, options.polygons
    most = options.beams, options.edges // 3, options.edges
    with told_by("--obstacles, --points, … or --edges", InvalidInputError):
        capacity = Capacity(*given, 8 * options.polygons, *most)
    presets, settings = _presets(), AvoidanceSettings()
    robot, lidar, bodies = presets.get(options.robot), None, None
    if robot is None:
        try:
            scenario = load_scenario(options.robot)
        except UnknownNameError as error:
            every = (*presets, *error.known)
            raise UnknownNameError("robot or scenario", error.name, every) from None
        robot, settings = scenario.robot, scenario.settings
        if scenario.lidar is not None:
            lidar, bodies = scenario.lidar.geometry, scenario.perception
            capacity = replace(capacity, beams=scenario.lidar.beams)
    known = robot, settings, capacity, not options.no_ahead, lidar, bodies
    for path in export_c(options.folder, *known):
        print(path)
