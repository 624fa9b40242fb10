"""The figures of the bench: time against size, and time against accuracy."""

import math
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

from timing.trials import WRONG, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "exact": "black",
    "qpavoid": "black",
    "osqp": "#D55E00",
    "daqp": "#E69F00",
    "qrqp": "#009E73",
    "piqp": "#56B4E9",
    "proxqp": "#CC79A7",
    "clarabel": "#0072B2",
    "highs": "#7A7A7A",
    "quadprog": "#8A5A00",
    "scs": "#5D3A9B",
    "qpoases": "#A02C5A",
    "elastiqp": "#6B8E23",
    "cbfpy": "#6B8E23",
    "qpax": "#2F4F4F",
}
"""Okabe and Ito's colours, which readers with any colour vision can tell apart, then
more; a solver keeps its colour however it is called."""

MARKERS = {
    "": "o",
    "casadi": "D",
    "qpsolvers": "s",
    "cvxpy": "^",
    "cbfpy": "v",
    "numpy": "s",
}
"""By the interface through which a solver is called, or who makes the step."""

OURS = "exact"
FINEST = 1e-16
"""An error below is drawn here."""


def save_times(solvers: Sequence[Row], machine: str, path: Path) -> None:
    """Draw median and p99 of all solvers against the rows, two unknowns."""
    rows = [row for row in solvers if row["unknowns"] == 2]
    names = list(dict.fromkeys(str(row["solver"]) for row in rows))
    panels = {
        "Called directly": {""},
        "Through CasADi (dashed: DM)": {"casadi"},
        "Through qpsolvers, cvxpy and cbfpy": {"qpsolvers", "cvxpy", "cbfpy"},
    }
    figure = _figure(13.5, 6.8)
    every = figure.subplots(1, 3, sharey=True)
    for axes, (title, interfaces) in zip(every, panels.items(), strict=True):
        _draw_times(axes, rows, [n for n in names if interface(n) in interfaces])
        axes.set_title(title, loc="left", fontsize=11)
        axes.set_xlabel("rows of the QP")
    every[0].set_ylabel("time of one call, µs (line: median, whisker: up to p99)")
    _caption(
        figure,
        f"Two unknowns. Hollow: some answers off by more than {WRONG:g}, or missing, "
        f"on feasible problems.\n{machine}",
    )
    figure.savefig(path, dpi=160)


def _draw_times(axes: "Axes", rows: Sequence[Row], names: Sequence[str]) -> None:
    ends: list[tuple[float, str, str]] = []
    sizes = sorted({_number(row["rows"]) for row in rows})
    shown = [OURS, *(name for name in names if name != OURS)]
    for i, name in enumerate(shown):
        own = [r for r in rows if r["solver"] == name and r["median_us"]]
        if own:
            shift = 1.05 ** (i - (len(shown) - 1) / 2)
            _draw_line(axes, own, [_number(r["rows"]) * shift for r in own], name)
            ends.append((_number(own[-1]["median_us"]), name, colour(name)))
    _frame(axes, sizes)
    axes.set_xlim(sizes[0] / 1.8, sizes[-1] * 22.0)
    _label_ends(axes, ends, sizes[-1] * 1.8)


def _draw_line(
    axes: "Axes", rows: Sequence[Row], x: Sequence[float], name: str
) -> None:
    median = [_number(row["median_us"]) for row in rows]
    p99 = [_number(row["p99_us"]) for row in rows]
    above = [max(high - low, 0.0) for low, high in zip(median, p99, strict=True)]
    axes.errorbar(
        x,
        median,
        yerr=([0.0] * len(x), [a if a > 0.0 else 0.0 for a in above]),
        color=colour(name),
        linestyle="--" if name.endswith((" DM", ", ahead")) else "-",
        linewidth=2.6 if name in (OURS, "qpavoid") else 1.3,
        elinewidth=0.5,
        capsize=2.0,
    )
    for place, value, row in zip(x, median, rows, strict=True):
        _mark(axes, place, value, name, row)


def _mark(axes: "Axes", x: float, y: float, name: str, row: Row) -> None:
    flawless = not row["wrong"] and not row["false_infeasible"]
    axes.plot(
        x,
        y,
        MARKERS.get(interface(name), "o"),
        color=colour(name),
        markerfacecolor=colour(name) if flawless else "white",
        markersize=6,
        zorder=4,
    )


def save_accuracy(solvers: Sequence[Row], machine: str, path: Path) -> None:
    """Draw the error of all solvers' answers against their time, at a middle size."""
    sizes = sorted({_number(row["rows"]) for row in solvers})
    size = sizes[(len(sizes) - 1) // 2]
    shown = [r for r in solvers if r["rows"] == size and r["error_p99"] is not None]
    kinds = sorted({int(_number(row["unknowns"])) for row in shown})
    figure = _figure(11.0, 6.3 * len(kinds))
    every = figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0]
    for axes, unknowns in zip(every, kinds, strict=True):
        spots = []
        for row in (row for row in shown if row["unknowns"] == unknowns):
            name, time = str(row["solver"]), _number(row["median_us"])
            error = max(_number(row["error_p99"]), FINEST)
            _mark(axes, time, error, name, row)
            spots.append((time, error, name))
        axes.set(xscale="log", yscale="log", ylim=(FINEST / 3, 1.0))
        axes.set_xlabel("median time of one call, µs")
        axes.set_ylabel("error of the answer, m/s or rad/s (99th percentile)")
        slack = ", one of them a penalised slack" if unknowns == 3 else ""
        axes.set_title(f"{unknowns} unknowns{slack}; {size:g} rows", loc="left")
        axes.axhline(WRONG, color="#888888", linewidth=0.8, linestyle=":")
        axes.grid(True, color="#EEEEEE", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.margins(x=0.14)
        _label_spots(figure, axes, spots)
    _caption(
        figure,
        "Down and left is better. Round: called directly, diamond: CasADi, square: "
        "qpsolvers, triangle up: cvxpy, down: cbfpy.\nHollow: some answers off by more "
        f"than {WRONG:g} (dotted), or missing.   {machine}",
    )
    figure.savefig(path, dpi=160)


def save_steps(rows: Sequence[Row], limits: Row, machine: str, path: Path) -> None:
    """Draw whole steps against the number of points, and the machine's limits."""
    from timing.steps import POINT_BYTES, POINT_OPERATIONS, floors

    figure = _figure(11.0, 7.0)
    axes = figure.subplots()
    ends: list[tuple[float, str, str]] = []
    sizes = sorted({_number(row["points"]) for row in rows})
    for name in dict.fromkeys(str(row["step"]) for row in rows):
        own = [row for row in rows if row["step"] == name and row["median_us"]]
        _draw_line(axes, own, [_number(row["points"]) for row in own], name)
        ends.append((_number(own[-1]["median_us"]), name, colour(name)))
    work = [floors(int(size), limits) for size in sizes]
    lines = {
        f"arithmetic: {POINT_OPERATIONS} operations a point": [a for a, _ in work],
        f"bandwidth: {POINT_BYTES} bytes a point": [b for _, b in work],
        "one call into compiled code": [_number(limits["call_us"])] * len(sizes),
    }
    for (name, y), style in zip(lines.items(), ("-.", ":", "--"), strict=True):
        axes.plot(sizes, y, style, color="#888888", linewidth=1.2)
        ends.append((y[-1], name, "#666666"))
    for row in rows:
        if row["target_us"] is not None:
            place, target = _number(row["points"]), _number(row["target_us"])
            axes.plot(place, target, "_", color="red", markersize=22, zorder=5)
    _frame(axes, sizes)
    axes.set_ylim(0.05, None)
    axes.set_xlim(sizes[0] / 1.8, sizes[-1] * 60.0)
    _label_ends(axes, ends, sizes[-1] * 1.5)
    axes.set_xlabel("points of the scan")
    axes.set_ylabel("time of one whole step, µs (line: median, whisker: up to p99)")
    _caption(
        figure,
        f"Limits of one core: {_number(limits['gflops']):.0f} Gflop/s, "
        f"{_number(limits['gb_per_s']):.0f} GB/s (cache). Red: target of qpavoid's "
        f"median. Hollow: some answers off by more than {WRONG:g}, or missing.\n"
        + machine,
    )
    figure.savefig(path, dpi=160)


def interface(name: str) -> str:
    """Return through what a solver is called; empty: its own interface."""
    head = name.replace(" + ", ":").partition(":")[0]
    return head if head in MARKERS else ""


def colour(name: str) -> str:
    """Return the colour of a solver by its full name, or of a whole step."""
    last = name.split(" + ")[-1].split(":")[-1]
    return COLOURS.get(last.split(" ")[0].strip(","), "#444444")


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _caption(figure: "Figure", words: str) -> None:
    figure.supxlabel(words, fontsize=9, color="#444444")


def _frame(axes: "Axes", ticks: Sequence[float]) -> None:
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(ticks, [f"{tick:,.0f}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(True, axis="y", color="#DDDDDD", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _label_ends(axes: "Axes", ends: Iterable[tuple[float, str, str]], x: float) -> None:
    """Write each name beside the end of its line, moved apart if they would touch."""
    low, high = (math.log10(limit) for limit in axes.get_ylim())
    gap, height = (high - low) / 34.0, -math.inf
    for value, name, paint in sorted(ends):
        height = max(math.log10(value), height + gap)
        weight = "bold" if name in (OURS, "qpavoid") else "normal"
        where = x, 10**height
        axes.text(*where, name, color=paint, va="center", fontsize=9, weight=weight)


def _label_spots(
    figure: "Figure", axes: "Axes", spots: Iterable[tuple[float, float, str]]
) -> None:
    """Write each name near its spot, where nothing stands yet."""
    figure.draw_without_rendering()
    centres = {spot: axes.transData.transform(spot[:2]) for spot in sorted(spots)}
    taken = [(x - 6, y - 6, x + 6, y + 6) for x, y in centres.values()]
    for (time, error, name), (x, y) in centres.items():
        width, height = 6.0 * len(name) + 3, 12.0
        for radius, turn in product(range(9, 200, 9), range(16)):
            angle = math.pi * turn / 8
            left = x + radius * math.cos(angle) - (width if 4 < turn < 12 else 0.0)
            low = y + radius * math.sin(angle) - height / 2
            box = left, low, left + width, low + height
            if not any(_overlap(box, other) for other in taken):
                break
        taken.append(box)
        axes.annotate(
            name,
            (time, error),
            (0.72 * (left + 1 - x), 0.72 * (low + 2 - y)),
            textcoords="offset points",
            fontsize=8,
            color=colour(name),
            weight="bold" if name == OURS else "normal",
            arrowprops={"arrowstyle": "-", "color": "#AAAAAA", "linewidth": 0.5}
            if radius > 18
            else None,
        )


def _overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
