"""BARN worlds and rule, kinematic unicycle: who gets through, and how fast.

The Jackal's footprint (0.508 × 0.430 m) follows the published reference path, whose
clock, and that of planned ways, gains 2 m/s²; success is within 1 m of the goal in
100 s without contact. The metric is the organisers':
success · OT / clip(AT, 2 OT, 8 OT) with OT the path's length over 2 m/s and AT the time
taken. Not a BARN score, which is measured in Gazebo. The obstacles are known, or with
``--lidar`` seen by a LiDAR (270°, 720 beams, 30 Hz, σ 1 cm). ``--plant mujoco`` drives
a Jackal of rigid bodies, see ``plants.py``. Prints the published runs where they are
there.

``--data`` has ``world_N.world`` and ``path_files/path_N.npy``, or has them in its BARN,
barn/BARN or worlds/BARN; any of them can be asked for. What a world has to collide with
must be upright cylinders, as in all of BARN's: boxes, meshes and includes are refused.

    python comparisons/barn.py --data PATH --worlds 0:300:6 --out out/barn
"""

import math
import os
import warnings
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from plants import add_plant, changes_of
from qpavoid.errors import DataError
from qpavoid.files import reading
from qpavoid.lab.planning.search import length
from qpavoid.lab.worlds.barn import (
    GOAL,
    START,
    BarnWorlds,
    find_folder,
    read_cells,
    read_path,
    read_world,
)
from qpavoid.types import Array
from studies import Row, Scenes, count, main_of, make_parser, numbers, run_study

METHODS = "alone,eq5,eq7,qp,qp-ahead,qp-ahead+guide"

SHOWN, END = 5, 5.0
"""Damaged files that are named; m from a path's first and last cell to its ends."""

RATES = "success_rate", "collision_rate", "timeout_rate", "mean_metric"
"""Columns of what is published of MPPI."""

LIDAR = {
    "lidar.field_of_view_rad": 4.712388980384690,
    "lidar.beams": 720,
    "lidar.rate_hz": 30.0,
    "lidar.noise_m": 0.01,
}


@lru_cache
def optimal_time(world: int, data: Path | None) -> float:
    """Return OT in s, by the organisers' transform of the path's cells."""
    path = find_folder(data, world) / "path_files" / f"path_{world}.npy"
    cells = 0.15 * read_cells(path) + (-4.575, 5.075)
    points = np.vstack([START[:2], cells, GOAL])
    return length(points) / 2.0


def check_worlds(worlds: Sequence[int], data: Path | None) -> None:
    """Read all files of the worlds.

    Raises:
        DataError: Some are missing or damaged; the message names them.
    """
    wrong = []
    for world in worlds:
        try:
            folder = find_folder(data, world)
            discs = read_world(folder / f"world_{world}.world")
            optimal_time(world, data)
            check_path(folder / "path_files" / f"path_{world}.npy", discs)
        except DataError as error:
            wrong.append(str(error))
    if wrong:
        more = [f"and {len(wrong) - SHOWN} more"] * (len(wrong) > SHOWN)
        raise DataError("\n".join([*wrong[:SHOWN], *more]))


def check_path(path: Path, discs: Array) -> None:
    """Raise DataError if a path does not lead past the cylinders from start to goal."""
    way = read_path(path)
    for end, where in ((way[1], START), (way[-2], GOAL)):
        if math.dist(end, where[:2]) > END:
            told = f"it does not lead from {START[:2]} to {GOAL}: are its cells 0.15 m?"
            raise DataError(f"{path}: {told}")
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    places = (way[:-1] + shares * np.diff(way, axis=0)).reshape(-1, 1, 2)
    if (np.hypot(*(places - discs[:, :2]).T).T < discs[:, 2]).any():
        raise DataError(f"{path}: it leads through a cylinder: is it of another world?")


def metric(row: Row, optimal: float) -> float:
    """Return the organisers' metric of one run."""
    if not row["success"]:
        return 0.0
    return optimal / float(np.clip(row["arrived_s"], 2.0 * optimal, 8.0 * optimal))


def published(worlds: Sequence[int], data: Path | None) -> list[Row]:
    """Return what is published of these worlds in a row each, where it is.

    Raises:
        DataError: A file of it is damaged.
    """
    folder = Path(data or os.environ.get("QPAVOID_DATA", ".")) / "published"
    dwa, mppi = folder / "barn_dwa_runs.txt", folder / "barn_mppi_per_world.csv"
    rows = []
    if dwa.is_file():
        with reading(dwa), warnings.catch_warnings():
            warnings.simplefilter("error")  # of an empty file
            runs = np.loadtxt(dwa, ndmin=2)
            runs = runs[np.isin(runs[:, 0], worlds)]
            for run in runs:
                row = {"success": run[1], "arrived_s": run[4]}
                run[5] = metric(row, optimal_time(int(run[0]), data))
            rows.append(means("organisers' DWA", runs[:, [1, 2, 3, 5]]))
    if mppi.is_file():
        with reading(mppi), warnings.catch_warnings():
            warnings.simplefilter("error")
            table = np.atleast_1d(np.genfromtxt(mppi, delimiter=",", names=True))
            table = table[np.isin(table["world"], worlds)]
            values = np.column_stack([table[name] for name in RATES])
            values = np.repeat(values, table["runs"].astype(int), axis=0)
            rows.append(means("Nav2-MPPI", values))
    return [row for row in rows if row["runs"]]


def means(who: str, values: npt.NDArray[np.float64]) -> Row:
    """Return the means of published runs, (runs, 4)."""
    names = ("success", "contact", "timeout", "metric")
    numbers = values.mean(axis=0).tolist() if len(values) else [0.0] * len(names)
    shares = {key: f"{x:.3f}" for key, x in zip(names, numbers, strict=True)}
    return {"method": who, "runs": len(values), **shares}


def said(row: Row) -> str:
    """Return a row of published means in a line."""
    shares = ", ".join(f"{key} {x}" for key, x in list(row.items())[2:])
    return f"{row['method']}, {row['runs']} runs in Gazebo: {shares}"


def speeds(text: str) -> list[float]:
    """Return the speeds of ``0.5,2``, m/s."""
    found = [float(word) for word in text.split(",")]
    if not all(0.0 < speed < math.inf for speed in found):
        raise ValueError
    return found


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/barn")
    parser.add_argument("--worlds", type=numbers, default="0:300:6", metavar="A:B:STEP")
    parser.add_argument("--speed", type=speeds, default=[0.5], metavar="MPS,…")
    parser.add_argument("--lidar", action="store_true", help="see instead of knowing")
    parser.add_argument("--runs", type=count, default=1, metavar="N", help="of a world")
    add_plant(parser)
    options = parser.parse_args()
    changes = changes_of(options.plant, "skid-steer")
    changes |= LIDAR if options.lidar else {}
    plant = "kinematic unicycle"
    if options.plant != "kinematic":
        plant = f"Jackal in {options.plant}"

    def setting(speed: float) -> str:
        words = [f"v <= {speed:g} m/s", "LiDAR" if options.lidar else "known"]
        return ", ".join(words + [options.plant] * (options.plant != "kinematic"))

    def add(row: Row) -> Row:
        return {"metric": metric(row, optimal_time(row["seed"], options.data))}

    def study() -> list[Row]:
        check_worlds(options.worlds, options.data)
        others = published(options.worlds, options.data)
        scenes = [
            Scenes(BarnWorlds(v, noise), options.worlds, setting(v), changes)
            for v in options.speed
            for noise in range(options.seed, options.seed + options.runs)
        ]
        rows = run_study(f"BARN worlds and rule, {plant}", scenes, options, add)
        print(*map(said, others), sep="\n")
        return rows

    main_of(study, parser)


if __name__ == "__main__":
    main()
