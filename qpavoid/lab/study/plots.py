"""Figures of runs: pure functions of logs, without any global state of matplotlib.

All logs of a figure are runs of one scenario. Figures are as wide as a README's text:
their letters have the size of the text around them.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.metrics import metrics, run_name, tally
from qpavoid.lab.study.scene import (
    BLACK,
    DANGER,
    MARGIN,
    WIDTH,
    decisive_step,
    draw_fleet,
    first_of,
    fleets_of,
    legend,
    plan_grid,
    plan_panels,
    styles,
    view_box,
)

DPI = 200

NEAR = {"color": "#E6E6E6", "zorder": 0, "label": "an obstacle is nearer than $r$"}

FILM_STEP, FILM_PAUSE, FILM_DPI, FILM_COLORS = 0.25, 125, 50, 32
"""Of a film: s of the run, and ms of the film, per frame; dots per inch; colours."""

CROWDED = 20
"""With more obstacles than this the whole path is shown, instead of frames."""


def save_figures(
    logs: Sequence[Log],
    folder: str | os.PathLike[str],
    kind: str = "png",
    film: bool = False,
) -> list[Path]:
    """Draw every figure that fits a scenario, save each, return the paths.

    Files are called ``<scenario>-<figure>.png``, those of a single run
    ``<scenario>-<controller>-<figure>.png``. Of several robots there is the plan view,
    with all of them. The plan view is :func:`frames` where the
    scenario names times for them and has few obstacles, else :func:`paths`.

    Args:
        logs: Runs of one scenario.
        folder: Where they go; it is made.
        kind: ``png``, ``svg`` or ``pdf``.
        film: Whether to draw a film (GIF), too.
    """
    first, fleets = first_of(logs), fleets_of(logs)
    others = len(first.points) + len(first.walls) + len(first.polygons)
    obstacles = first.discs.shape[1] + others
    plan_view = frames if first.meta["frames_s"] and obstacles <= CROWDED else paths
    stem = run_name(dict(first.meta) | {"number": None})
    if len(fleets) > 1:
        stem = str(first.meta["scenario"]).replace("/", "-")
    Path(folder).mkdir(parents=True, exist_ok=True)
    saved = []
    over_time = (poses, twists, distance) if len(fleets) == len(logs) else ()
    for draw in (plan_view, *over_time):
        path = Path(folder) / f"{stem}-{draw.__name__}.{kind}"
        draw(logs).savefig(path, dpi=DPI)
        saved.append(path)
    if film:
        saved.append(Path(folder) / f"{stem}-film.gif")
        save_film(logs, saved[-1])
    return saved


def frames(logs: Sequence[Log]) -> Figure:
    """Draw moments of a scenario as the paper's Fig. 4, 8 and 9 do.

    Footprint, safety zone, planned path and path driven so far, obstacles, P_r and the
    target on the plan, all with the same axes. One row a method and one column a time,
    or the other way round where that leaves fewer columns and larger robots.
    """
    first = first_of(logs)
    steps = [int(np.abs(first["t_s"] - x).argmin()) for x in first.meta["frames_s"]]
    fleets = fleets_of(logs)
    looks = styles([fleet[0] for fleet in fleets])
    methods = [style.label for style in looks]
    moments = [f"t = {first['t_s'][step]:.1f} s" for step in steps]
    across = len(steps) <= max(4, len(fleets))
    rows, columns = (methods, moments) if across else (moments, methods)
    box = view_box(logs, steps)
    figure, grid = plan_grid(rows, columns, box)
    cells = grid if across else grid.T
    for row, fleet, style in zip(cells, fleets, looks, strict=True):
        for axes, step in zip(row, steps, strict=True):
            draw_fleet(axes, fleet, style, box, step)
    legend(figure)
    return figure


def paths(logs: Sequence[Log]) -> Figure:
    """Draw all that each method drove through a world, one panel a method.

    Footprints stand along the way; a cross marks the first contact. Where something
    moves, robot and obstacles are shown when they are nearest, or first touch: the way
    up to then is thick.
    """
    length = float(np.ptp(first_of(logs).vertices[:, 0]))
    fleets = fleets_of(logs)
    steps = [decisive_step(fleet) for fleet in fleets]
    box = view_box(logs, steps, surroundings=4.0 * length)
    looks = styles([fleet[0] for fleet in fleets])
    figure, panels = plan_panels([style.label for style in looks], box)
    for axes, fleet, style, step in zip(panels, fleets, looks, steps, strict=True):
        words = [metrics(log)["outcome"] for log in fleet]
        became = words[0] if len(fleet) == 1 else tally(words)
        when = f"\nshown: t = {fleet[0]['t_s'][step]:.1f} s" * (
            step < len(fleet[0]) - 1
        )
        axes.set_title(f"{style.label}: {became}{when}", fontsize=10)
        draw_fleet(axes, fleet, style, box, step, way=True)
    legend(figure)
    return figure


def save_film(logs: Sequence[Log], path: str | os.PathLike[str]) -> None:
    """Draw runs of one scenario as a GIF, one panel a method, at twice the speed."""
    first, fleets = first_of(logs), fleets_of(logs)
    looks = styles([fleet[0] for fleet in fleets])
    box = view_box(logs, surroundings=4.0 * float(np.ptp(first.vertices[:, 0])))
    figure, panels = plan_panels([style.label for style in looks], box)
    figure.set_dpi(FILM_DPI)
    canvas: Any = FigureCanvasAgg(figure)
    images = []
    for time in np.arange(0.0, max(log["t_s"][-1] for log in logs), FILM_STEP):
        for axes, fleet, style in zip(panels, fleets, looks, strict=True):
            axes.clear()
            step = int(np.searchsorted(fleet[0]["t_s"], time))
            draw_fleet(axes, fleet, style, box, step)
            axes.set(title=f"{style.label}, t = {time:.1f} s", xticks=[], yticks=[])
        canvas.draw()
        rgba = np.asarray(canvas.buffer_rgba())
        images.append(Image.fromarray(rgba).convert("RGB"))
    palette = images[len(images) // 2].quantize(FILM_COLORS, dither=Image.Dither.NONE)
    shown = [x.quantize(palette=palette, dither=Image.Dither.NONE) for x in images]
    more: dict[str, Any] = {"append_images": shown[1:], "duration": FILM_PAUSE}
    shown[0].save(path, save_all=True, loop=0, **more)


def poses(logs: Sequence[Log]) -> Figure:
    """Draw x, y and heading of every method over time against the plan (Fig. 5, 10)."""
    first = first_of(logs)
    figure, grid = _time_grid(first, 3, 1, 6.5, sharey="row")
    quantities = (("x", "x", "m"), ("y", "y", "m"), ("heading", "heading γ", "rad"))
    for axes, (name, label, unit) in zip(grid.flat, quantities, strict=True):
        plan = first["t_s"], first[f"{name}_ref_{unit}"]
        for log, look in _lines(logs):
            axes.plot(log["t_s"], log[f"{name}_{unit}"], **look)
        axes.plot(*plan, "--", color=BLACK, lw=1, zorder=3, label="planned")
        axes.set_ylabel(f"{label} ({unit})")
    figure.align_ylabels()
    legend(figure)
    return figure


def twists(logs: Sequence[Log]) -> Figure:
    """Draw v and ω of every method over time, one row a method (Fig. 6, 11).

    Dotted: what the plan asks for. Shaded: an obstacle is nearer than r.
    """
    first = first_of(logs)
    figure, grid = _time_grid(first, len(logs), 2, 1.9 * len(logs) + 0.9, sharey="col")
    for row, log, style in zip(grid, logs, styles(logs), strict=True):
        near = log["clearance_m"] < log["r_m"]
        for axes, name in zip(row, ("v{}_mps", "omega{}_radps"), strict=True):
            planned = log["t_s"], log[name.format("_ref")]
            axes.plot(log["t_s"], log[name.format("")], color=style.color, lw=1)
            axes.plot(*planned, ":", color=BLACK, lw=1.3, label="planned")
            look = {"transform": axes.get_xaxis_transform(), **NEAR}
            axes.fill_between(log["t_s"], 0.0, 1.0, where=near, step="post", **look)
        row[0].set_ylabel(f"{style.label}\nv (m/s)")
        row[1].set_ylabel("ω (rad/s)")
    legend(figure)
    return figure


def distance(logs: Sequence[Log]) -> Figure:
    """Draw the least distance over time (Fig. 7, 12).

    Grey: r_min to r. Red: below r_min. Triangles: the zone is entered and left. All
    methods share a panel, unless r differs: it follows the speed of what is nearest.
    """
    first = first_of(logs)
    same = all(np.array_equal(log["r_m"], first["r_m"]) for log in logs)
    pairs = _lines(logs)
    groups = [pairs] if same else [[pair] for pair in pairs]
    figure, grid = _time_grid(first, len(groups), 1, 2.2 * len(groups) + 2.4)
    least = min(float(log["least_clearance_m"].min()) for log in logs)
    lowest = min(0.0, 1.1 * least)
    highest = max(max(3.0 * float(log["r_m"].max()) for log in logs), -0.6 * lowest)
    for axes, group in zip(grid.flat, groups, strict=True):
        t, r_min, r = (group[0][0][name] for name in ("t_s", "r_min_m", "r_m"))
        axes.fill_between(t, r_min, r, step="post", color=MARGIN, lw=0)
        axes.fill_between(t, lowest, r_min, step="post", color=DANGER, lw=0)
        for log, look in group:
            _draw_distance(axes, log, look)
        axes.set(ylabel="least distance (m)", ylim=(lowest, highest))
        if lowest < 0.0:
            axes.axhline(0.0, color=BLACK, lw=0.8)
    bands = [
        Patch(color=MARGIN, label=f"nearer than $r${_value(logs, 'r_m')}"),
        Patch(color=DANGER, label=f"nearer than $r_{{min}}${_value(logs, 'r_min_m')}"),
    ]
    lines = [x for axes in grid.flat for x in axes.get_legend_handles_labels()[0]]
    figure.legend(handles=[*lines, *bands], loc="outside lower center", ncols=2)
    return figure


def _draw_distance(axes: Axes, log: Log, look: dict[str, Any]) -> None:
    found = metrics(log)
    entry, exit_, least = (
        found[key] for key in ("zone_entry_s", "zone_exit_s", "min_clearance_m")
    )
    label = f"{look['label']}: no obstacle"
    if least is not None:
        label = f"{look['label']}: least {least:.3f} m".replace("-", "−")
    if isinstance(entry, float) and isinstance(exit_, float):
        label += f", zone {entry:.2f} to {exit_:.2f} s"
        edge = np.interp([entry, exit_], log["t_s"], log["r_m"])
        mark: dict[str, Any] = {"color": look["color"], "mec": "white", "ms": 9}
        for time, r, marker in zip((entry, exit_), edge, "v^", strict=True):
            axes.plot(time, r, marker, **mark, zorder=4, clip_on=False)
    axes.plot(log["t_s"], log["least_clearance_m"], **look | {"label": label})


def _time_grid(
    log: Log,
    rows: int,
    columns: int,
    height: float,
    sharey: Literal["all", "row", "col"] = "all",
) -> tuple[Figure, npt.NDArray[Any]]:
    """Return a figure with (rows, columns) axes over the time of a run."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False)
    for axes in grid.flat:
        axes.grid(color="0.9", lw=0.8)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlim(0.0, log.meta["duration_s"])
    for axes in grid[-1]:
        axes.set_xlabel("t (s)")
    return figure, grid


def _lines(logs: Sequence[Log]) -> list[tuple[Log, dict[str, Any]]]:
    """Return each log with the look of its lines, the first on top of the others."""
    return [
        (
            log,
            {
                "color": style.color,
                "ls": style.line,
                "lw": 2,
                "label": style.label,
                "zorder": 3 - rank / len(logs),
            },
        )
        for rank, (log, style) in enumerate(zip(logs, styles(logs), strict=True))
    ]


def _value(logs: Sequence[Log], name: str) -> str:
    """Return `` = 0.17 m`` for a column that is the same at all times."""
    low, high = (float(f([f(log[name]) for log in logs])) for f in (np.min, np.max))
    return f" = {low:.3g} m" if low == high else ""
