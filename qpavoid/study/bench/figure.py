"""The figure of the bench: call time against the size of the problem."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpavoid.study.bench.trials import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe and Ito's colours, which readers with any colour vision can tell apart, then
# two more; a solver keeps its colour and marker however it is called.
STYLES = {
    "exact": ("black", "o"),
    "osqp": ("#D55E00", "s"),
    "daqp": ("#E69F00", "v"),
    "qrqp": ("#009E73", "D"),
    "piqp": ("#56B4E9", "P"),
    "proxqp": ("#CC79A7", "^"),
    "clarabel": ("#0072B2", "X"),
    "highs": ("#7A7A7A", "<"),
    "quadprog": ("#8A5A00", "p"),
    "scs": ("#5D3A9B", "*"),
}
OURS = "exact"


def save_figure(
    solvers: Sequence[Row],
    calls: Sequence[Row],
    origin: Mapping[str, Any],
    path: Path,
) -> None:
    """Draw median and p99 of all back ends and of the filter call.

    Args:
        solvers: One row a back end and number of rows.
        calls: One row a number of points.
        origin: CPU and versions, for the caption.
        path: Of the PNG.
    """
    from matplotlib.figure import Figure

    names = list(dict.fromkeys(str(row["back_end"]) for row in solvers))
    wrapped = [name for name in names if name.startswith("qpsolvers:")]
    direct = [name for name in names if name not in wrapped and name != OURS]
    ours = [name for name in names if name == OURS]
    figure = Figure(figsize=(15.0, 6.2), layout="constrained")
    first, second, third = figure.subplots(
        1, 3, sharey=True, width_ratios=(1.0, 1.0, 0.75)
    )
    _draw_back_ends(
        first, solvers, ours + direct, "Called directly, and through CasADi"
    )
    _draw_back_ends(second, solvers, ours + wrapped, "Called through qpsolvers")
    _draw_calls(third, calls)
    first.set_ylabel("time of one call, µs (line: median, whisker: up to p99)")
    versions = origin["versions"]
    figure.supxlabel(
        "Hollow marker: some answers wrong by more than 1e-5, or missing, on feasible "
        f"problems.   {origin['cpu']}, Python {origin['python']}, "
        f"numpy {versions['numpy']}, numba {versions['numba']}.   "
        "All versions, settings and limits: report.md",
        fontsize=8,
        color="#444444",
    )
    figure.savefig(path, dpi=160)


def _draw_back_ends(
    axes: "Axes", solvers: Sequence[Row], names: Sequence[str], title: str
) -> None:
    ends: list[tuple[float, str, str]] = []
    sizes = sorted({_number(row["rows"]) for row in solvers})
    for i, name in enumerate(names):
        rows = [r for r in solvers if r["back_end"] == name and r["calls"]]
        if not rows:
            continue
        is_ours = name == OURS
        colour, marker = STYLES[name.split(":")[-1]]
        shift = 1.07 ** (i - (len(names) - 1) / 2)
        x = [_number(row["rows"]) * shift for row in rows]
        median = [_number(row["median_us"]) for row in rows]
        p99 = [_number(row["p99_us"]) for row in rows]
        above = [max(high - low, 0.0) for low, high in zip(median, p99, strict=True)]
        axes.errorbar(
            x,
            median,
            yerr=([0.0] * len(x), above),
            color=colour,
            linestyle="--" if name.startswith("casadi:") else "-",
            linewidth=2.6 if is_ours else 1.4,
            elinewidth=1.0,
            capsize=2.5,
            zorder=3 if is_ours else 2,
        )
        for place, value, row in zip(x, median, rows, strict=True):
            flawless = row["wrong"] == 0 and row["false_infeasible"] == 0
            axes.plot(
                place,
                value,
                marker,
                color=colour,
                markerfacecolor=colour if flawless else "white",
                markersize=6,
                zorder=4,
            )
        ends.append((median[-1], name.removeprefix("qpsolvers:"), colour))
    _frame(axes, title, "rows of the QP", sizes)
    axes.set_xlim(sizes[0] / 1.6, sizes[-1] * 9.0)
    _label_ends(axes, ends, sizes[-1] * 1.7)


def _draw_calls(axes: "Axes", calls: Sequence[Row]) -> None:
    x = [_number(row["points"]) for row in calls]
    median = [_number(row["median_us"]) for row in calls]
    p99 = [_number(row["p99_us"]) for row in calls]
    above = [max(high - low, 0.0) for low, high in zip(median, p99, strict=True)]
    axes.errorbar(
        x,
        median,
        yerr=([0.0] * len(x), above),
        color="black",
        linewidth=2.6,
        elinewidth=1.0,
        capsize=2.5,
        marker="o",
        markersize=6,
    )
    for place, value in zip(x, median, strict=True):
        axes.annotate(
            f"{value:.3g}",
            (place, value),
            xytext=(6, -13),
            textcoords="offset points",
            ha="center",
            fontsize=9,
        )
    targets = [row for row in calls if row["target_us"] is not None]
    for row in targets:
        place, target = _number(row["points"]), _number(row["target_us"])
        axes.plot(place, target, "_", color="#D55E00", markersize=26, markeredgewidth=2)
        axes.annotate(
            f"≤ {target:g}",
            (place, target),
            xytext=(-16, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            color="#D55E00",
            fontsize=9,
        )
    if targets:
        note = "orange: target of the median"
        axes.text(0.03, 0.95, note, color="#D55E00", transform=axes.transAxes)
    _frame(axes, "Whole SafetyFilter.filter call, exact", "points of the scan", x)
    axes.set_xlim(min(x) / 6.0, max(x) * 3.0)


def _frame(axes: "Axes", title: str, label: str, ticks: Sequence[float]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title(title, loc="left", fontsize=11)
    axes.set_xlabel(label)
    axes.set_xticks(ticks, [f"{tick:,.0f}" for tick in ticks])
    axes.minorticks_off()
    axes.grid(True, axis="y", color="#DDDDDD", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _label_ends(axes: "Axes", ends: Sequence[tuple[float, str, str]], x: float) -> None:
    """Write each name beside the end of its line, moved apart if they would touch."""
    gap = 0.2
    heights: list[float] = []
    for value, name, colour in sorted(ends):
        height = math.log10(value)
        if heights:
            height = max(height, heights[-1] + gap)
        heights.append(height)
        weight = "bold" if name == OURS else "normal"
        axes.text(
            x, 10**height, name, color=colour, va="center", fontsize=9, weight=weight
        )


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else math.nan
