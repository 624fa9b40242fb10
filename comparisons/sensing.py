"""Sensing and localisation: what noise, latency, dropouts and slip cost each method.

Static forests, and six strangers that move at constant velocities, seen by a LiDAR (180
beams, 10 Hz): as points, which have no velocity, and the strangers also as tracked
discs with estimated ones. From a base (σ 1 cm, all round, no latency, no dropouts,
exact localisation and plant) one factor is changed at a time, and at last all of them,
to what a robot with a cheap LiDAR and radio beacons has; every level has the same
scenes. A run succeeds if it is within 0.3 m and 0.3 rad of the goal pose in time,
without contact; ``metric_least`` is its least clearance in m.

``factors.csv`` has a row a method, scene, factor and level: successes with Wilson's
interval, and the median least clearance with a bootstrap interval; the figures show
both.

    python comparisons/sensing.py --out out/sensing
    python comparisons/sensing.py --factors localisation,plant,together --points
"""

import math
from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, TypeAlias

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from qpavoid.errors import UnknownNameError
from qpavoid.lab.study.statistics import bootstrap, wilson
from qpavoid.lab.study.style import NAMED, OTHERS, Style
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.forest import Forest
from qpavoid.lab.worlds.scenes import Sensed
from studies import Row, Scenes, main_of, make_parser, run_study

METHODS = "eq5,eq7,vfh,qp-ahead+guide"

BASE = "base"
UWB = {"localisation.kind": "uwb", "localisation.sigma_m": 0.1}
WHEELS = {"plant.kind": "mujoco", "plant.base": "differential"}
ALL = {"lidar.noise_m": 0.02, "lidar.latency_s": 0.05, "lidar.dropout": 0.05}


def levels(key: str, values: Sequence[float], base: float) -> dict[str, dict[str, Any]]:
    """Return the changes of every level by its label; the base changes nothing."""
    return {f"{x:g}": {} if x == base else {key: x} for x in values}


Factors: TypeAlias = Mapping[str, Mapping[str, Mapping[str, Any]]]

FACTORS: Factors = {
    "noise (m)": levels("lidar.noise_m", (0.0, 0.01, 0.03, 0.1), 0.01),
    "latency (s)": levels("lidar.latency_s", (0.0, 0.1, 0.2, 0.4), 0.0),
    "dropout": levels("lidar.dropout", (0.0, 0.1, 0.3, 0.6), 0.0),
    "rate (Hz)": levels("lidar.rate_hz", (20.0, 10.0, 5.0, 2.0), 10.0),
    "view (°)": {
        "360": {},
        "270": {"lidar.field_of_view_rad": 1.5 * math.pi},
        "180": {"lidar.field_of_view_rad": math.pi},
    },
    "localisation": {
        "exact": {},
        "mocap": {"localisation.kind": "motion_capture"},
        "UWB": UWB,
    },
    "plant": {
        "exact": {},
        "slip": {"plant.slip": 0.05},
        "lag": {"plant.lag_v_s": 0.1, "plant.lag_omega_s": 0.1},
        "wheels": WHEELS,
    },
    "together": {"none": {}, "all": ALL | UWB | WHEELS},
}
"""Factor, label of the level, settings by dotted key. *Wheels* are rigid bodies that
slip, driven by motors with delay, lag and ramps of acceleration."""


def setting_of(source: Sensed, factor: str, label: str) -> str:
    """Return what tables call a level."""
    changes = FACTORS[factor][label]
    return f"{source.name}: {f'{factor} {label}' if changes else BASE}"


def chosen_factors(text: str) -> Factors:
    """Return the factors of ``noise,view``: each by the first word of its name.

    Raises:
        UnknownNameError: There is no such factor.
    """
    known = {name.partition(" ")[0]: name for name in FACTORS}
    names = dict.fromkeys(text.split(",")) if text else known
    for name in names:
        if name not in known:
            raise UnknownNameError("factor", name, known)
    return {known[name]: FACTORS[known[name]] for name in names}


def make_scenes(
    strangers: range,
    forests: range,
    family: int,
    factors: Factors = FACTORS,
    tracked: bool = True,
) -> list[Scenes]:
    """Return every level of every factor once.

    Args:
        strangers: Seeds of the scenes in which discs move.
        forests: Numbers of those in which nothing does.
        family: Of the forests.
        factors: Levels by factor.
        tracked: Whether there are strangers seen as tracked discs, too.
    """
    known = scenario_file("demo/strangers")
    parts = (
        (Sensed(known, tracks=False), strangers),
        (Sensed(known, tracks=True), strangers if tracked else ()),
        (Sensed(Forest(family), tracks=False), forests),
    )
    scenes = {
        setting_of(source, factor, label): Scenes(
            source, seeds, setting_of(source, factor, label), changes
        )
        for source, seeds in parts
        if seeds
        for factor, found in factors.items()
        for label, changes in found.items()
    }
    return list(scenes.values())


def factor_rows(
    rows: Sequence[Row], sources: Sequence[Sensed], factors: Factors = FACTORS
) -> list[Row]:
    """Return a row a method, scene, factor and level that ran."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    return [
        {"method": method, "scene": source.name, "factor": factor, "level": label}
        | spread(some)
        for source in sources
        for factor, found in factors.items()
        for method in methods
        for label in found
        for key in [(method, setting_of(source, factor, label))]
        if (some := [row for row in rows if (row["method"], row["setting"]) == key])
    ]


def spread(rows: Sequence[Row]) -> Row:
    """Return successes and median least clearance of some runs, with intervals."""
    won = sum(bool(row["success"]) for row in rows)
    values = [row["min_clearance_m"] for row in rows]
    clearance = bootstrap(np.array([x for x in values if x is not None]))
    names = ("", "_low", "_high")
    success = zip(names, wilson(won, len(rows)), strict=True)
    median = zip(names, clearance or ("", "", ""), strict=True)
    return {
        "runs": len(rows),
        **{f"success{name}": x for name, x in success},
        **{f"clearance_m{name}": x for name, x in median},
    }


def draw(rows: Sequence[Row], source: Sensed, path: Path) -> None:
    """Draw success and clearance over every factor for one kind of scene."""
    mine = [row for row in rows if row["scene"] == source.name]
    factors = list(dict.fromkeys(row["factor"] for row in mine))
    others = cycle(OTHERS)
    looks = {
        name: NAMED[name] if name in NAMED else Style(name, *next(others))
        for name in dict.fromkeys(row["method"] for row in mine)
    }
    figure, grid = plt.subplots(
        2,
        len(factors),
        figsize=(1.0 + 2.0 * len(factors), 5.6),
        sharey="row",
        squeeze=False,
        layout="constrained",
    )
    for axes, factor in zip(grid.T, factors, strict=True):
        found = [row for row in mine if row["factor"] == factor]
        for axis, key in zip(axes, ("success", "clearance_m"), strict=True):
            for k, (name, look) in enumerate(looks.items()):
                aside = 0.06 * (k - 0.5 * (len(looks) - 1))
                line = [row for row in found if row["method"] == name]
                plot_line(axis, line, key, look, aside)
            axis.set_xticks(range(len(FACTORS[factor])), list(FACTORS[factor]))
        axes[1].set_xlabel(factor)
    for axis in grid[1]:
        axis.axhline(0.0, color="0.5", lw=0.8, zorder=0)
    grid[0, 0].set_ylabel("success")
    grid[0, 0].set_ylim(-0.03, 1.03)
    grid[1, 0].set_ylabel("median least clearance (m)")
    figure.suptitle(f"{source.name}, {mine[0]['runs']} scenes a level (95 %)")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=len(looks),
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def plot_line(
    axis: Axes, rows: Sequence[Row], key: str, look: Style, aside: float
) -> None:
    """Draw one method over the levels of a factor, with its intervals.

    Args:
        axis: Drawn into.
        rows: Of the method, one a level.
        key: The column; its bounds are ``key_low`` and ``key_high``.
        look: Colour, line and label.
        aside: By how much it is moved, so that intervals do not cover each other.
    """
    known = [
        (list(FACTORS[row["factor"]]).index(row["level"]) + aside, row)
        for row in rows
        if row[key] != ""
    ]
    if not known:
        return
    places = np.array([place for place, _ in known])
    middle, low, high = (
        np.array([row[key + name] for _, row in known], dtype=float)
        for name in ("", "_low", "_high")
    )
    axis.vlines(places, low, high, color=look.color, lw=0.8, alpha=0.7)
    axis.plot(
        places, middle, color=look.color, ls=look.line, marker=".", label=look.label
    )


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/sensing")
    parser.add_argument("--strangers", type=int, default=60, metavar="N")
    parser.add_argument("--forests", type=int, default=60, metavar="N")
    parser.add_argument("--factors", default="", metavar="A,B", help="all if not given")
    parser.add_argument("--points", action="store_true", help="strangers as such alone")
    options = parser.parse_args()
    if min(options.strangers, options.forests, options.seed) < 0:
        parser.error("--strangers, --forests and --seed want 0 or more")
    if not options.strangers + options.forests:
        parser.error("there are no scenes")

    def study() -> list[Row]:
        strangers = range(options.seed, options.seed + options.strangers)
        forests, factors = range(options.forests), chosen_factors(options.factors)
        tracked = not options.points
        scenes = make_scenes(strangers, forests, options.seed, factors, tracked)
        rows = run_study(
            "Sensing and localisation",
            scenes,
            options,
            lambda row: {"metric_least": row["min_clearance_m"]},
        )
        chosen = dict.fromkeys(scene.source for scene in scenes)
        sources = [source for source in chosen if isinstance(source, Sensed)]
        found = factor_rows(rows, sources, factors)
        write_csv(options.out / "factors.csv", found)
        ran = {row["scene"] for row in found}
        for source in (one for one in sources if one.name in ran):
            name = source.name.replace(" ", "-")
            draw(found, source, options.out / f"{name}.png")
        return rows

    main_of(study, parser)


if __name__ == "__main__":
    main()
