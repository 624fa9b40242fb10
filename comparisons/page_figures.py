"""Figures of the page: success of every method, and our filter less each other one."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine

from page_parts import Part
from qpavoid.lab.study.statistics import Interval
from qpavoid.lab.study.style import BLACK, GREEN, RED

COLUMNS = 3
MARGIN = 3.0
"""Points beyond what is drawn."""

PAD = 0.15
"""Inches about a panel with its labels."""

OTHERS = "0.45"
VERDICT = {1: GREEN, 0: OTHERS, -1: RED}
"""Colours of a difference: ours clearly better, not known, clearly worse."""


class Panel(NamedTuple):
    """What one study shows.

    Attributes:
        title: Of the study and its setting.
        values: Share and interval by method, the best method first.
        colors: Of the methods that have one.
    """

    title: str
    values: Mapping[str, Interval]
    colors: Mapping[str, str]


def draw(parts: Sequence[tuple[str, Part]], folder: Path) -> None:
    """Write both figures for parts and their titles."""
    shown = [(title, part) for title, part in parts if part.scenes > 1]
    success = [
        Panel(title, {x: part.success(x) for x in part.runs}, {part.ours: GREEN})
        for title, part in shown
    ]
    less = [
        Panel(
            title,
            {x: pair.differences["success"].value for x, pair in part.pairs.items()},
            {
                x: VERDICT[pair.differences["success"].clear]
                for x, pair in part.pairs.items()
            },
        )
        for title, part in shown
        if part.pairs
    ]
    label = "success, % (Wilson, 95 %)"
    all_shares = -MARGIN, 100.0 + MARGIN
    plot(success, label, all_shares, folder / "comparisons-success.png")
    label = "ours less theirs on the same scenes, points (bootstrap, 95 %)"
    plot(less, label, span(less), folder / "comparisons-differences.png")


def span(panels: Sequence[Panel]) -> tuple[float, float]:
    """Return limits that hold all intervals and 0, so that panels can be compared."""
    every = [x for panel in panels for value in panel.values.values() for x in value]
    ends = [100.0 * x for x in (*every, 0.0)]
    return min(ends) - MARGIN, max(ends) + MARGIN


def plot(
    panels: Sequence[Panel], label: str, limits: tuple[float, float], path: Path
) -> None:
    """Draw a panel a study: one row a method, a dot with its interval; 0 is marked."""
    if not panels:
        return
    rows = [panels[k : k + COLUMNS] for k in range(0, len(panels), COLUMNS)]
    most = [max(len(panel.values) for panel in row) for row in rows]
    heights = [0.19 * count + 0.9 for count in most]
    figure, grid = plt.subplots(
        len(rows),
        COLUMNS,
        figsize=(3.6 * COLUMNS, sum(heights) + 0.5),
        height_ratios=heights,
        dpi=110,
        layout=ConstrainedLayoutEngine(w_pad=PAD),
        squeeze=False,
    )
    for axes in grid.flat[len(panels) :]:
        axes.set_visible(False)
    for k, (axes, panel) in enumerate(zip(grid.flat, panels, strict=False)):
        plot_panel(axes, panel)
        axes.set_ylim(most[k // COLUMNS] - 0.5, -0.5)
        axes.set_xlim(*limits)
        axes.axvline(0.0, color=BLACK, lw=0.8)
    figure.supxlabel(label, fontsize=9)
    figure.savefig(path, metadata={"Software": ""})
    plt.close(figure)


def plot_panel(axes: Axes, panel: Panel) -> None:
    """Draw the methods of one study, the best on top."""
    for k, (name, value) in enumerate(panel.values.items()):
        middle, low, high = (100.0 * x for x in value)
        color = panel.colors.get(name, OTHERS)
        axes.plot([low, high], [k, k], color=color, lw=2.0, solid_capstyle="butt")
        axes.plot(middle, k, "o", color=color, ms=4.5)
    axes.set_yticks(range(len(panel.values)), list(panel.values), fontsize=8)
    for text in axes.get_yticklabels():
        text.set_color(panel.colors.get(text.get_text(), BLACK))
    axes.set_title(fill(panel.title, 31), fontsize=9, loc="left")
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(axis="x", color="0.9", lw=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
