"""A whole file of every kind that is read, and what reads it."""

import gzip
import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.lab.simulation.config import builtin_configs, config_folder
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.bags import BagWriter, bag_drive
from qpavoid.lab.study.compare import read_summary, save_run
from qpavoid.lab.study.replay import read_parameters
from qpavoid.lab.study.sweep.store import Store, read_provenance, read_rows, shards
from qpavoid.lab.study.sweep.study import read_study
from qpavoid.lab.worlds import barn, crowd, dynabarn
from qpavoid.lab.worlds.carmen import read_scans
from qpavoid.lab.worlds.map_server import read_image, read_map
from qpavoid.lab.worlds.points import read_points
from qpavoid.qp.problem import FilterProblem
from reliability.damage import Kind, rechunked, regzipped, rezipped

SCENARIO = """title = "Past"
duration_s = 3.0
dt_s = 0.05
robot = { preset = "jackal", v_max_mps = 1.0, footprint_m = [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]] }
reference = { kind = "spline", points_m = [[0.0, 0.0], [2.0, 0.5], [4.0, 0.0]], speed_mps = 0.5 }
lidar = { beams = 90 }
obstacles = [
  { kind = "random", count = 3, low_m = [1.0, -1.0], high_m = [3.0, 1.0] },
  { kind = "disc", position_m = [2.0, 1.0], radius_m = 0.2, velocity_mps = [0.1, 0.0] },
  { kind = "waypoints", times_s = [0.0, 2.0], positions_m = [[5.0, 1.0], [4.0, 2.0]] },
  { kind = "wall", start_m = [-2.0, 2.0], end_m = [6.0, 2.0] },
  { kind = "polygon", vertices_m = [[3.0, -2.0], [4.0, -2.0], [3.5, -1.5]] },
  { kind = "points", file = "points.csv" },
  { kind = "map", file = "map.yaml" },
]
[planner]
[filter]
gamma_per_s = 2.0
[radius]
r_min_slow_m = 0.1
r_min_fast_m = 0.1
"""  # noqa: E501

STUDY = """title = "Small"
controllers = ["eq5", "qp:osqp"]
seeds = "0:8:2"
trajectories = "all"
[settings]
"radius.r_min_slow_m" = [0.05, 0.1]
[[scenarios]]
config = "past.toml"
[[generators]]
kind = "forest"
family = 2
seeds = [1, 2]
"""

MAP = """image: map.pgm
resolution: 0.1
origin: [-5.0, 5.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""

WORLD = """<sdf version="1.6"><world name="w">{}</world></sdf>
"""
MODEL = """<model name="c{0}"><pose>{0} 5.0 0 0 0 0</pose><link><collision><geometry>
<cylinder><radius>0.075</radius><length>1</length></cylinder>
</geometry></collision></link></model>
"""

PIXELS = np.random.default_rng(0).choice([0, 128, 254], (12, 20)).astype(np.uint8)


def beside(folder: Path) -> None:
    """Write what scenarios name."""
    (folder / "points.csv").write_text("x,y\n1.5,-1.5\n1.6,-1.5\n")
    (folder / "map.yaml").write_text(MAP)
    (folder / "map.pgm").write_bytes(b"P5\n20 12\n255\n" + PIXELS.tobytes())
    (folder / "past.toml").write_text(SCENARIO)


def scenarios(folder: Path) -> list[Path]:
    """Write shipped scenarios, and one that names files."""
    beside(folder)
    names = "demo/play demo/trap fleet/random paper/test_case_1".split()
    found = [folder / "past.toml"] * 4
    for name in names:
        found.append(folder / f"{Path(name).name}.toml")
        shutil.copy(builtin_configs()[name], found[-1])
    return found


def text(name: str, content: str) -> Callable[[Path], list[Path]]:
    """Return what writes a text, with what scenarios name beside it."""

    def make(folder: Path) -> list[Path]:
        beside(folder)
        (folder / name).write_text(content)
        return [folder / name]

    return make


def dynabarn_file(folder: Path) -> list[Path]:
    """Write two worlds."""
    open_way = {"t": [0.0, 2.0, 3.0], "x": [0.0, 1.0, 2.0], "y": [0.0, 0.0, 1.0]}
    closed = {"t": [0.0, 2.0, 4.0], "x": [0.0, 1.0, 0.0], "y": [0.0, 0.0, 0.0]}
    worlds = [[open_way | {"period": 3.0}], [closed | {"period": 4.0}]]
    data = {
        "timeout_s": 100.0,
        "robot_start": [0.0, 0.0, 0.0],
        "robot_goal": [10.0, 0.0],
        "goal_radius": 1.0,
        "obstacle_radius": 0.3,
        "walls": [{"center": [0.0, 1.0], "size": [4.0, 0.1]}],
        "worlds": {str(k): world for k, world in enumerate(worlds)},
    }
    (folder / "dynabarn.json").write_text(json.dumps(data))
    return [folder / "dynabarn.json"]


def read_dynabarn(path: Path) -> None:
    for world in dynabarn.world_numbers(path)[:2]:
        dynabarn.read_world(path, world, "end")
        dynabarn.read_world(path, world, "reverse")


def short_log() -> Log:
    """Return a run of a second."""
    scene = replace(load_scenario("paper/test_case_1"), duration=1.0)
    return run(scene, "eq5")


def log_file(folder: Path) -> list[Path]:
    short_log().save(folder / "log.npz")
    return [folder / "log.npz"]


def summary_file(folder: Path) -> list[Path]:
    save_run(short_log(), folder)
    return [folder / "summary.json"]


def read_summary_of(path: Path) -> None:
    read_summary(path.parent)


def problem_file(folder: Path) -> list[Path]:
    two = np.ones(2)
    rows = np.array([[1.0, 0.0], [0.0, 1.0]])
    problem = FilterProblem(two, two, rows, 0.1 * two, -two, two, np.arange(2), 0)
    problem.save(folder / "problem.npz")
    return [folder / "problem.npz"]


def arrays(folder: Path) -> list[Path]:
    """Write cells of a path, and points."""
    cells = np.array([[30, 0], [31, 1], [31, 2], [30, 3]])
    np.save(folder / "cells.npy", cells)
    np.save(folder / "points.npy", 0.1 * cells.astype(float))
    return [folder / "cells.npy", folder / "points.npy"]


def read_npy(path: Path) -> None:
    barn.read_path(path) if path.stem == "cells" else read_points(path)


def shard(folder: Path, name: str = "") -> list[Path]:
    """Write a table of a sweep, under its own name or another."""
    row = {"run": "a" * 16, "scenario": "s", "seed": 3, "settings": "{}", "error": ""}
    Store(folder, STUDY).save([(row | {"run": f"{k:016}"}, None) for k in range(40)])
    (path,) = shards(folder)
    return [path.rename(path.with_name(name)) if name else path]


def read_shard(path: Path) -> None:
    read_rows(path.parents[1])
    read_provenance(path.parents[1])


def parameters(folder: Path) -> list[Path]:
    """Write the shipped files of the node."""
    shipped = config_folder() / "ros"
    names = "mir.yaml", "turtlebot.yaml"
    return [Path(shutil.copy(shipped / name, folder / name)) for name in names]


def images(folder: Path) -> list[Path]:
    """Write PGM as bytes and as text."""
    words = " ".join(map(str, PIXELS.ravel().tolist())).encode()
    (folder / "a.pgm").write_bytes(b"P5\n# a\n20 12\n255\n" + PIXELS.tobytes())
    (folder / "b.pgm").write_bytes(b"P2\n20 12\n255\n" + words)
    return [folder / "a.pgm", folder / "b.pgm"]


def pngs(folder: Path) -> list[Path]:
    """Write PNG in grey, in colours, with a palette."""
    from PIL import Image

    grey = Image.fromarray(PIXELS)
    found = [folder / f"{mode}.png" for mode in ("L", "RGB", "P", "RGBA")]
    for path in found:
        grey.convert(path.stem).save(path)
    Image.fromarray(PIXELS.astype(np.uint16)).save(folder / "deep.png")
    return [*found, folder / "deep.png"]


def carmen_files(folder: Path) -> list[Path]:
    """Write logs of both messages, plain and compressed."""
    beams = " ".join(["2.0"] * 180)
    lines = [
        f"FLASER 180 {beams} {0.1 * k} 0 0 {0.1 * k} 0 0 {0.2 * k} host {0.2 * k}"
        for k in range(4)
    ]
    content = "# message formats\n" + "\n".join(lines) + "\n"
    (folder / "a.log").write_text(content)
    (folder / "a.log.gz").write_bytes(gzip.compress(content.encode()))
    return [folder / "a.log", folder / "a.log.gz"]


def mend_log(content: bytes, rng: Any) -> bytes:
    """Return a compressed log that is damaged inside; a plain one as it is."""
    return regzipped(content, rng) if content[:2] == b"\x1f\x8b" else content[:-1]


def bag(folder: Path, storage: str) -> list[Path]:
    """Write a bag of four seconds; its messages and what it says of them."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    place = folder / "bag"
    with BagWriter(folder / "first") as into:
        into._writer.__exit__(None, None, None)
        plugin = StoragePlugin[storage]
        into._writer = Writer(place, version=9, storage_plugin=plugin).__enter__()
        for k in range(10):
            time = 1e9 + 0.1 * k
            kind = "sensor_msgs/msg/LaserScan"
            scan = into.stamped(kind, time, "laser")
            scan.angle_increment, scan.range_max = 0.1, 10.0
            scan.ranges = np.full(20, 2.0, dtype=np.float32)
            into.write("/scan", kind, time, scan)
            kind = "nav_msgs/msg/Odometry"
            into.write("/odom", kind, time, into.stamped(kind, time, "odom"))
            kind = "geometry_msgs/msg/TwistStamped"
            into.write("/cmd_vel", kind, time, into.stamped(kind, time, "base"))
    data = next(path for path in place.iterdir() if path.suffix != ".yaml")
    return [data, data, data, place / "metadata.yaml"]


def read_bag_of(path: Path) -> None:
    bag_drive(path.parent, None, "")
    if path.suffix != ".yaml":
        bag_drive(path, None, "")


KINDS = {
    "scenario": Kind(scenarios, load_scenario),
    "study": Kind(text("study.toml", STUDY), read_study),
    "dynabarn": Kind(dynabarn_file, read_dynabarn),
    "summary": Kind(summary_file, read_summary_of),
    "log": Kind(log_file, Log.load, False, rezipped),
    "problem": Kind(problem_file, FilterProblem.load, False, rezipped),
    "npy": Kind(arrays, read_npy, False),
    "parquet": Kind(shard, read_shard, False),
    "parquet, old name": Kind(partial(shard, name="old.parquet"), read_shard, False),
    "csv": Kind(text("points.csv", "x,y\n1.0,2.0\n-3.5,4e-1\n"), read_points),
    "map": Kind(text("map.yaml", MAP), read_map),
    "parameters": Kind(
        parameters,
        read_parameters,
    ),
    "pgm": Kind(images, read_image),
    "png": Kind(pngs, read_image, False, rechunked),
    "sdf": Kind(
        text("w.world", WORLD.format("".join(map(MODEL.format, range(5))))),
        barn.read_world,
    ),
    "carmen": Kind(
        carmen_files,
        lambda path: [*read_scans(path)],
        True,
        mend_log,
    ),
    "obsmat": Kind(
        text(
            "obsmat.txt",
            "\n".join(f"{6 * k} 1 {k} 0 0.5 0.1 0 0.2" for k in range(12)),
        ),
        lambda path: crowd.read_tracks(path, 15.0),
    ),
    "bag, sqlite3": Kind(partial(bag, storage="SQLITE3"), read_bag_of, False),
    "bag, mcap": Kind(partial(bag, storage="MCAP"), read_bag_of, False),
}
