"""A run seen from above: world, plan, and the robot at any of its steps.

Colours and lines are those of all figures: the same for a method wherever it appears.
"""

from collections.abc import Sequence
from itertools import cycle, islice
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.methods import labelled
from qpavoid.lab.scenario.world import ABSENT
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.metrics import by_fleet
from qpavoid.model.footprint import offset_outline
from qpavoid.model.kinematics import to_world
from qpavoid.types import Array

BLACK, BLUE, RED, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"

PURPLE, ORANGE, SKY = "#CC79A7", "#E69F00", "#56B4E9"
"""Colours that the colour-blind tell apart [Okabe2008]."""

COLORS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)

MARGIN, DANGER, SOLID = "#D9D9D9", "#F6C9BC", "#404040"
"""Fill of the band from r_min to r, of what is nearer than r_min, and of obstacles."""

WIDTH = 9.0
"""Width of all figures, in."""

Line: TypeAlias = str | tuple[float, tuple[float, ...]]


class Style(NamedTuple):
    """How a method looks in every figure."""

    label: str
    color: str
    line: Line


NAMED = {
    "eq5": Style("Eq. 5", BLUE, (0, (1.2, 1.0))),
    "eq7": Style("Eq. 7", RED, (0, (6, 1.5, 1.2, 1.5))),
    "qp": Style("one-step QP", ORANGE, (0, (4, 1))),
    "qp-ahead": Style("look-ahead QP", GREEN, "-"),
    "qp-ahead+guide": Style("guided QP", PURPLE, (0, (3, 1, 1, 1, 1, 1))),
}

OTHERS = (
    (SKY, (0, (8, 2))),
    (BLACK, (0, (1, 2))),
)


def styles(logs: Sequence[Log]) -> list[Style]:
    """Return the style of every log: the same for a method wherever it appears."""
    others = cycle(OTHERS)
    chosen = []
    for log in logs:
        name = str(log.meta["controller"])
        style = NAMED[name] if name in NAMED else Style(name, *next(others))
        chosen.append(style._replace(label=labelled(log.meta, style.label)))
    return chosen


class Extent(NamedTuple):
    """Section of the world that is shown, m."""

    x_low: float
    x_high: float
    y_low: float
    y_high: float

    @property
    def shape(self) -> float:
        """Height over width."""
        return (self.y_high - self.y_low) / (self.x_high - self.x_low)


def first_of(logs: Sequence[Log]) -> Log:
    """Return the first log of runs of one scenario.

    Raises:
        InvalidInputError: No logs, or logs of several scenarios.
    """
    names = sorted({str(log.meta["scenario"]) for log in logs})
    if len(names) != 1:
        raise InvalidInputError(
            f"a figure needs runs of one scenario, not of {', '.join(names) or 'none'}"
        )
    return logs[0]


def fleets_of(logs: Sequence[Log]) -> list[list[Log]]:
    """Return logs, robot after robot, in lists of those that ran together."""
    return by_fleet(logs, lambda log: log.meta)


def pose(log: Log, step: int) -> tuple[float, float, float]:
    """Return x, y, γ at a step."""
    return log["x_m"][step], log["y_m"][step], log["heading_rad"][step]


def middles(log: Log, count: int | None = None) -> list[Array]:
    """Return the mean corner (n, 2) over time of every polygon that moves, m.

    Of the first ``count`` polygons.
    """
    polygons = zip(*map(log.polygons_at, range(len(log))), strict=True)
    tracks = [np.mean(polygon, axis=1) for polygon in islice(polygons, count)]
    return [track for track in tracks if np.ptp(track, axis=0).any()]


def corners_of(discs: Array) -> Array:
    """Return the corners (2 n, 2) of the boxes round discs (n, 3), m."""
    radii = discs[:, 2:]
    return np.vstack([discs[:, :2] - radii, discs[:, :2] + radii])


def decisive_step(fleet: Sequence[Log]) -> int:
    """Return when what moves is first touched, else nearest; the end if nothing moves.

    Args:
        fleet: Logs of those that ran together.
    """
    log = fleet[0]
    moves = len(fleet) > 1 or np.ptp(log.discs[:, :, :2], axis=0).any() or middles(log)
    if not moves:
        return len(log) - 1
    least = np.min([one["least_clearance_m"] for one in fleet], axis=0)
    touched = np.flatnonzero(least < 0.0)
    return int(touched[0] if len(touched) else least.argmin())


def view_box(
    logs: Sequence[Log], steps: Sequence[int] = (), surroundings: float = 0.0
) -> Extent:
    """Return the box around all plans and everywhere that a safety zone has been.

    Args:
        logs: Runs of one scenario.
        steps: When discs that are near a robot have to be in the box too, whole.
        surroundings: Obstacles up to so far beyond, m, are in the box too.
    """
    places = []
    for log in logs:
        reach = np.hypot(*log.vertices.T).max() + log["r_m"].max()
        driven = np.column_stack([log["x_m"], log["y_m"]])
        planned = np.column_stack([log["x_ref_m"], log["y_ref_m"]])
        corners = [f(x, axis=0) for f in (np.min, np.max) for x in (driven, planned)]
        places += [corner + side for corner in corners for side in (-reach, reach)]
        for step in np.minimum(steps, len(log) - 1).astype(int):
            discs = log.discs[step]
            away = np.hypot(*(discs[:, :2] - driven[step]).T) - discs[:, 2]
            places += [corners_of(discs[away < 2 * reach])]
    within = np.vstack(places)
    low, high = within.min(axis=0), within.max(axis=0)
    log = logs[0]
    solid = (log.points, *log.walls.reshape(-1, 2, 2), *log.polygons_at(0))
    world = np.vstack([corners_of(log.discs[0]), *solid])
    beyond = np.maximum(low - world, world - high).max(axis=1)
    shown = np.vstack([low, high, world[beyond < surroundings]])
    low, high = shown.min(axis=0) - 0.1, shown.max(axis=0) + 0.1
    return Extent(*np.column_stack([low, high]).ravel().tolist())


def draw_run(
    axes: Axes,
    log: Log,
    style: Style,
    box: Extent,
    step: int,
    zone: bool = True,
    others: int = 0,
) -> None:
    """Draw robot and world at a step, or at the last, and the way driven so far.

    Args:
        axes: Where to draw; their scales are made equal.
        log: The run.
        style: Of its method.
        box: Section of the world.
        step: Control step.
        zone: Whether to show the safety zone, P_r and the target too.
        others: Of several robots, how many have scenes of their own on these axes.
    """
    step = min(step, len(log) - 1)
    here = pose(log, step)
    axes.set(xlim=box[:2], ylim=box[2:], aspect="equal")
    axes.tick_params(labelsize=8, color="0.6")
    axes.spines[:].set_color("0.6")
    zones = ("within $r$", MARGIN, "r_m"), ("within $r_{min}$", DANGER, "r_min_m")
    for label, color, name in zones if zone else ():
        for part in log.footprint.parts:
            outline = to_world(offset_outline(part, log[name][step]), here)
            axes.add_patch(Polygon(outline, label=label, lw=0, facecolor=color))
            label = ""
    look: dict[str, Any] = {"facecolor": "white", "edgecolor": BLACK}
    for i, part in enumerate(log.footprint.outlines):
        look["label"] = "" if i else "footprint"
        axes.add_patch(Polygon(to_world(part, here), **look))
    _draw_world(axes, log, step, len(log.polygons) - others)
    plan = log["x_ref_m"], log["y_ref_m"]
    axes.plot(*plan, "--", color=BLACK, lw=0.8, zorder=2.2, label="planned")
    axes.plot([], [], color="0.5", lw=2.5, label="driven")
    driven = log["x_m"][: step + 1], log["y_m"][: step + 1]
    axes.plot(*driven, color=style.color, lw=2.5)
    arrow = np.array([(0.6, 0.25), (0.75, 0.0), (0.6, -0.25)])
    nose = arrow * log.vertices.max(axis=0)
    axes.plot(*to_world(nose, here).T, color=BLACK, lw=1)
    for label, color, name in (
        ("target", "#0050D0", "{}_ref_m"),
        ("$P_r$", "#D00000", "contact_{}_m"),
    ):
        if zone:
            place = np.array([[log[name.format(axis)][step] for axis in "xy"]])
            _dots(axes, place, label, color)


def _draw_world(axes: Axes, log: Log, step: int, count: int) -> None:
    """Draw obstacles at a step, and tracks of what moves; ``count``: of polygons."""
    centres, radii = log.discs[:, :, :2], log.discs[0, :, 2]
    moving = np.ptp(centres, axis=0).any(axis=1)
    seen = np.where(centres < ABSENT, centres, np.nan)
    tracks = [*seen[:, moving].swapaxes(0, 1), *middles(log, count)]
    solid, here = radii > 0.0, centres[step]
    size = 2 * radii[solid]
    look: dict[str, Any] = {"facecolor": SOLID, "zorder": 2.5}
    where = {"offsets": here[solid], "offset_transform": axes.transData}
    walls = list(log.walls.reshape(-1, 2, 2))
    for collection in (
        LineCollection(tracks, color="0.45", ls=":", lw=1),
        LineCollection(walls, color=SOLID, lw=2.5, zorder=2.5),
        EllipseCollection(size, size, 0.0 * size, units="xy", **where, **look),
        PolyCollection(log.polygons_at(step)[:count], **look),
    ):
        axes.add_collection(collection, autolim=False)
    points = np.vstack([log.points, here[~solid]])
    _dots(axes, points, "obstacle", SOLID, 2.0 if len(log.points) > 20 else 6.0)


def draw_way(axes: Axes, log: Log, style: Style) -> None:
    """Draw the whole way, footprints 1.5 lengths apart, and the first contact."""
    length = np.cumsum(np.hypot(np.diff(log["x_m"]), np.diff(log["y_m"])))
    spacing = 1.5 * np.ptp(log.vertices[:, 0])
    steps = np.searchsorted(length, np.arange(0.0, length[-1], spacing))
    parts = log.footprint.outlines
    outlines = [to_world(x, pose(log, step)) for step in steps for x in parts]
    axes.plot(log["x_m"], log["y_m"], color=style.color, lw=1)
    look: dict[str, Any] = {"facecolor": "none", "edgecolor": style.color, "lw": 0.7}
    axes.add_collection(PolyCollection(outlines, **look), autolim=False)
    touched = np.flatnonzero(log["least_clearance_m"] < 0.0)[:1]
    if len(touched):
        place = log["contact_x_m"][touched], log["contact_y_m"][touched]
        look = {"color": "#D00000", "ms": 9, "mew": 2.5}
        axes.plot(*place, "x", label="first contact", zorder=5, **look)


def draw_fleet(
    axes: Axes,
    fleet: Sequence[Log],
    style: Style,
    box: Extent,
    step: int,
    way: bool = False,
) -> None:
    """Draw all robots of a run; of several each in its own colour.

    Args:
        axes: Where to draw.
        fleet: Logs of those that ran together.
        style: Of their method.
        box: Section of the world.
        step: Control step.
        way: Whether to show whole ways instead of the safety zone.
    """
    alone = len(fleet) == 1
    looks = zip(fleet, [style.color] if alone else cycle(COLORS), strict=False)
    for log, color in looks:
        look, zone = style._replace(color=color), alone and not way
        draw_run(axes, log, look, box, step, zone, len(fleet) - 1)
        if way:
            draw_way(axes, log, look)


def _dots(axes: Axes, places: Array, label: str, color: str, size: float = 5.0) -> None:
    look: dict[str, Any] = {"marker": "o", "ms": size, "color": color, "mec": "white"}
    axes.plot(*places.T, ls="", mew=0.1 * size, label=label, zorder=4, **look)


def plan_grid(
    rows: Sequence[str], columns: Sequence[str], box: Extent
) -> tuple[Figure, npt.NDArray[Any]]:
    """Return a figure with (rows, columns) axes in the shape of a box of the world."""
    width = (WIDTH - 0.7 - 0.1 * len(columns)) / len(columns)
    height = min(width * box.shape, 8.0)
    size = WIDTH, len(rows) * (height + 0.1) + 1.1
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(
        len(rows), len(columns), sharex=True, sharey=True, squeeze=False
    )
    for axes, title in zip(grid[0], columns, strict=True):
        axes.set_title(title, fontsize=10)
    for axes, title in zip(grid[:, 0], rows, strict=True):
        axes.set_ylabel(f"{title}\ny (m)".strip())
    for axes in grid[-1]:
        axes.set_xlabel("x (m)")
    return figure, grid


def plan_panels(titles: Sequence[str], box: Extent) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel a method: the taller the world, the more a row."""
    shape = box.shape
    columns = min(len(titles), 4 if shape > 1.5 else 3 if shape > 0.5 else 1)
    rows = -(-len(titles) // columns)
    figure, grid = plan_grid([""] * rows, [""] * columns, box)
    for axes, title in zip(grid.flat, titles, strict=False):
        axes.set_title(title, fontsize=10)
    for axes in grid.flat[len(titles) :]:
        axes.remove()
    return figure, list(grid.flat[: len(titles)])


def legend(figure: Figure) -> None:
    """Explain everything labelled on any axes, once, below the axes."""
    found: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(str(label), handle)
    figure.legend(
        handles=found.values(), loc="outside lower center", ncols=8, fontsize=9
    )
