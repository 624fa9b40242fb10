"""Ablation: one part of the method off at a time, on the cases that the studies report.

Strangers 0 to 149, and sixty others on wheels; the 50 BARN worlds at 0.5 and 2 m/s,
known and seen by a LiDAR; the recorded crowds (every fourth task), the dense one (every
other); DynaBARN at 1 and 2 m/s, and over at the first jump (every fifth episode);
forests (every twentieth of the 1,000); strangers and forests as a LiDAR sees them, as
points, and strangers as tracks, at the base and all at once; BARN on wheels;
CrowdNav's first hundred cases of ten and of five people, replayed; parked encounters
with one disc and several; maps, behind A*; the paper's two test cases, the second with
station keeping. A part is off by another method's name, by settings, or where it has
none by an edit of the sources: of a copy of the package in the folder, which compiles
for itself (some minutes), its rows known by its own code. Edits follow each other in
the one copy, so that what they leave is compiled once.

Prints one table: parts by studies, in each the successes, the runs in which it touched
something while it moved, and the mean time of the successes. Every part has a folder
of its own with its report; ``runs.csv`` and ``table.csv`` are of all.

    python comparisons/ablation.py --data PATH --out out/ablation
    python comparisons/ablation.py --parts nothing,parking --studies strangers
"""

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from shutil import copytree, ignore_patterns
from typing import Any, NamedTuple

import crowdnav_cases
from barn import LIDAR
from crowd import TESTED
from encounter_cases import Parked
from page_runs import by, read_csv
from plants import changes_of
from qpavoid.errors import ConfigError
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.tables import markdown_table, write_csv
from qpavoid.lab.worlds.barn import BarnWorlds
from qpavoid.lab.worlds.crowd import Crowd
from qpavoid.lab.worlds.dynabarn import PHASES, DynaBarn, Restart
from qpavoid.lab.worlds.forest import Forest
from qpavoid.lab.worlds.maps import Maps
from qpavoid.lab.worlds.scenes import Sensed
from qpavoid.lab.worlds.source import Source
from qpavoid.stamps import PACKAGE
from sensing import FACTORS
from studies import Scenes, main_of, run_study, write_tables

METHOD = "qp-ahead+guide"
STUDIES = (
    "strangers",
    "barn",
    "barn-fast",
    "barn-lidar",
    "crowd",
    "dense",
    "dynabarn",
    "forest",
    "wheels",
    "barn-lidar-slow",
    "dynabarn-fast",
    "dynabarn-end",
    "points",
    "tracks",
    "crowdnav",
    "parked",
    "maps",
    "paper",
    "several",
    "barn-wheels",
    "crowdnav-5",
    "points-together",
    "tracks-together",
)
BEHIND = {"maps": "astar+"}
"""Studies in which a planner is before the method."""

ROOT = Path(__file__).resolve().parents[1]


class Edit(NamedTuple):
    """A change of a source, where a pattern matches once.

    Attributes:
        file: Below ``qpavoid/guide``.
        pattern: Regular expression of what goes, in lines.
        text: What comes in its place.
    """

    file: str
    pattern: str
    text: str


class Part(NamedTuple):
    """A part of the method, and how it is off.

    Attributes:
        method: What runs without it.
        changes: Settings by dotted key.
        edits: Of the sources.
    """

    method: str = METHOD
    changes: Mapping[str, Any] = {}
    edits: Sequence[Edit] = ()


def constant(name: str, value: str) -> Edit:
    """Return the edit that gives a constant of the choice another value."""
    return Edit("choice.py", f"^{name} = .*$", f"{name} = {value}")


PACES_ALONE, OFFSETS_ALONE = (
    "((0.0, 0.15), (0.0, -0.15))",
    "((0.15, 0.0), (-0.15, 0.0))",
)

PARTS: dict[str, Part] = {
    "nothing": Part(),
    "guide": Part("qp-ahead"),
    "guide but for the way round": Part("qp-ahead+detour"),
    "filter": Part("alone+guide"),
    "look-ahead of the filter": Part("qp+guide"),
    "way round": Part(changes={"guide.stall_time_s": 1e3, "guide.blocked_time_s": 2e3}),
    "half of the horizon": Part(changes={"guide.horizon_s": 1.5}),
    "cost of being near": Part(changes={"guide.near": 0.0}),
    "cost of the heading": Part(changes={"guide.heading_m2": 0.0}),
    "hysteresis": Part(changes={"guide.hysteresis": 0.0}),
    "preference": Part(changes={"guide.preference": 0.0}),
    "waiting reference": Part(changes={"tracking.waiting": False}),
    "room to brake": Part(
        changes={"filter.braking_room": False, "filter.passive": False}
    ),
    "station keeping": Part(changes={"tracking.station_keeping": False}),
    "parking": Part(edits=[constant("SLOW, LEFT_TO_GO", "-1.0, 0.05")]),
    "held twists": Part(edits=[constant("HOLDS", "0")]),
    "offsets": Part(
        edits=[constant("OFFSETS", "(0.0,)"), constant("FINER", PACES_ALONE)]
    ),
    "paces": Part(
        edits=[constant("PACES", "(1.0,)"), constant("FINER", OFFSETS_ALONE)]
    ),
    "finer looks": Part(edits=[constant("FINER", "((0.0, 0.0),)")]),
    "side that is kept": Part(edits=[constant("KEPT, OTHER", "30.0, 1.0")]),
    "standing without progress": Part(
        edits=[Edit("choice.py", "STANDING and not waits:", "STANDING:")]
    ),
    "tracking after a stall": Part(edits=[constant("TRACKED_TICKS", "0.0")]),
    "movement in rollouts": Part(
        edits=[
            Edit("rollout.py", "^    least, radius = enough", "    time = 0.0\n\\g<0>")
        ]
    ),
}
"""What is off, by name."""


def label(name: str) -> str:
    """Return what tables call the method without a part: ours, or another's name."""
    method = PARTS[name].method
    return method if method != METHOD or name == "nothing" else f"{METHOD} no {name}"


def scenes_of(
    study: str, every: int, changes: Mapping[str, Any], data: str | None
) -> list[Scenes]:
    """Return every so-manieth reported case of a study."""
    found: list[tuple[Source, Sequence[int | None]]]
    strangers = scenario_file("demo/strangers")
    match study:
        case "strangers":
            found = [(strangers, range(150))]
        case "wheels":
            found = [(strangers, range(1000, 1060))]
            changes = {**changes_of("mujoco-told", "differential"), **changes}
        case "points" | "tracks" | "points-together" | "tracks-together":
            kind, _, level = study.partition("-")
            found = [(Sensed(strangers, kind == "tracks"), range(60))]
            if kind == "points":
                found.append((Sensed(Forest(0), tracks=False), range(60)))
            changes = {**(FACTORS[level]["all"] if level else {}), **changes}
        case "barn" | "barn-fast" | "barn-lidar" | "barn-lidar-slow" | "barn-wheels":
            source = BarnWorlds(0.5 if study in ("barn", "barn-lidar-slow") else 2.0)
            found = [(source, range(0, 300, 6))]
            plant = "mujoco-told" if study == "barn-wheels" else "kinematic"
            seen = {} if study in ("barn", "barn-fast") else LIDAR
            changes = {**changes_of(plant, "skid-steer"), **seen, **changes}
        case "crowd":
            crowds = [Crowd(name, data) for name in TESTED.split(",")]
            found = [(crowd, range(0, len(crowd.tasks), 4)) for crowd in crowds]
        case "dense":
            dense = Crowd("students03", data)
            found = [(dense, range(0, len(dense.tasks), 2))]
        case "crowdnav" | "crowdnav-5":
            people = 5 if study.endswith("5") else 10
            found = [(crowdnav_cases.Crowd(people=people), range(100))]
        case "parked" | "several":
            step = 2 if study == "several" else 1
            found = [(Parked(study), range(0, 40 * step, step))]
        case "maps":
            names = "depot", "warehouse", "tb3_sandbox"
            found = [(Maps(name, data), range(8)) for name in names]
        case "paper":
            cases = "test_case_1", "test_case_2_station"
            found = [(scenario_file(f"paper/{name}"), [None]) for name in cases]
            every = 1
        case "forest":
            found = [(Forest(5), range(0, 1000, 20))]
        case _:
            speed = 1.0 if study == "dynabarn" else 2.0
            jumps: Restart = "end" if study == "dynabarn-end" else "reverse"
            episodes = DynaBarn(jumps, speed, data)
            found = [(episodes, range(0, 60 * PHASES, 5))]
    return [Scenes(source, seeds[::every], study, changes) for source, seeds in found]


def cut(part: Part, folder: Path) -> Path:
    """Return where the package is without a part: here, or in a copy.

    Raises:
        ConfigError: The sources are not those that the edits are of.
    """
    if not part.edits:
        return ROOT
    for name in ("qpavoid", "configs"):
        unwanted = ignore_patterns("__pycache__")
        copytree(ROOT / name, folder / name, ignore=unwanted, dirs_exist_ok=True)
    for file, pattern, text in part.edits:
        path = folder / "qpavoid" / "guide" / file
        edited, count = re.subn(pattern, text, path.read_text("utf-8"), flags=re.M)
        if count != 1:
            raise ConfigError([f"{file}: {pattern} is there {count} times"])
        path.write_text(edited, "utf-8")
    return folder


def run_here(name: str, options: argparse.Namespace) -> None:
    """Run the method without a part on all cases, with the package as it is."""
    part, data = PARTS[name], options.data and str(options.data)
    studies, folder, rows = options.studies.split(","), folder_of(name, options.out), []
    options.rows = None
    for search in sorted({BEHIND.get(study, "") for study in studies}):
        scenes = [
            scene
            for study in studies
            if BEHIND.get(study, "") == search
            for scene in scenes_of(study, options.every, part.changes, data)
        ]
        options.methods, options.out = search + part.method, folder / f"runs{search}"
        named = f"Without {name}"
        rows += run_study(named, scenes, options, lambda row: {"method": label(name)})
    write_tables(rows, folder)


def run_apart(name: str, options: argparse.Namespace) -> None:
    """Run the same in a process that has the package without the part.

    Raises:
        ConfigError: It failed.
    """
    source = cut(PARTS[name], options.out.resolve() / "source")
    command = [sys.executable, __file__, "--inside", str(source), "--parts", name]
    for key in ("data", "studies", "every", "workers", "out"):
        value = getattr(options, key)
        command += [] if value is None else [f"--{key}", str(value)]
    places = [str(source), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, places))}
    if subprocess.run(command, env=environment, check=False).returncode:
        raise ConfigError([f"without {name}: it failed"])


def folder_of(name: str, out: Path) -> Path:
    """Return the folder of a part."""
    return out / name.replace(" ", "_")


def grid(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of parts by studies, from rows of the tables of all."""
    studies = list(by(rows, "setting"))
    lines = []
    for method, mine in by(rows, "method").items():
        cells = {
            row["setting"]: f"{row['successes']} of {row['runs']}, {row['contacts']}, "
            f"{row['mean_time_s'] or '–'} s"
            for row in mine
        }
        lines.append([method, *(cells.get(study, "") for study in studies)])
    return markdown_table(["method", *studies], lines, studies)


def study(options: argparse.Namespace) -> list[dict[str, str]]:
    """Run the method without each of the parts, put all tables together."""
    names = options.parts.split(",")
    for name in names:
        run_apart(name, options)
    folders = [folder_of(name, options.out) for name in names]
    found = {}
    for table in ("runs.csv", "table.csv"):
        rows = [row for folder in folders for row in read_csv(folder / table)]
        write_csv(options.out / table, rows)
        found[table] = rows
    print(grid(found["table.csv"]), end="")
    return found["runs.csv"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("--data", type=Path, metavar="PATH", help="published data sets")
    add("--parts", default=",".join(PARTS), metavar="A,B,…")
    add("--studies", default=",".join(STUDIES), metavar="A,B,…")
    add("--every", type=int, default=1, metavar="N", help="of the cases")
    add("--out", type=Path, default=Path("out/ablation"), metavar="DIR")
    add("--workers", type=int, metavar="N", help="all cores if not given")
    add("--inside", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    for given, known in ((options.parts, PARTS), (options.studies, STUDIES)):
        if unknown := set(given.split(",")) - set(known):
            parser.error(f"unknown: {', '.join(sorted(unknown))}")
    if options.inside is None:
        main_of(lambda: study(options), parser)
    elif options.inside.resolve() == PACKAGE.parent:
        main_of(lambda: run_here(options.parts, options), parser)
    else:
        parser.error(f"{PACKAGE} is not in {options.inside}")


if __name__ == "__main__":
    main()
