"""Animations of runs as GIF."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.figure import Figure
from matplotlib.text import Text

from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.scene import (
    RunPlot,
    first_of,
    fleets_of,
    legend,
    plan_panels,
    scenes_of,
    view_box,
)
from qpavoid.lab.study.style import styles

FILM_DPI = 100


def animate(
    logs: Log | Sequence[Log], path: str | os.PathLike[str], fps: int = 10
) -> Path:
    """Write the plan view of runs in real time, methods side by side; return its path.

    Args:
        logs: A run, or several runs of one scenario.
        path: Ends in ``.gif``; its folder is made.
        fps: Frames per second; a GIF counts in hundredths of a second, so 10, 20 or 25
            are kept exactly.

    Raises:
        InvalidInputError: Another suffix, no runs, or runs of several scenarios.
    """
    runs = [logs] if isinstance(logs, Log) else list(logs)
    path = film_path(path)
    first_of(runs)
    t = max((log["t_s"] for log in runs), key=len)
    figure, scenes, clock = _stage(runs)
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = PillowWriter(fps=fps)
    with writer.saving(figure, str(path), FILM_DPI):
        for time in np.arange(t[0], t[-1] + 0.5 / fps, 1.0 / fps):
            step = int(np.abs(t - time).argmin())
            for scene in scenes:
                scene.show(step)
            clock.set_text(f"t = {t[step]:.1f} s")
            writer.grab_frame()
    return path


def film_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of a film, which ends in ``.gif``; else an InvalidInputError."""
    path = Path(path)
    if path.suffix.lower() != ".gif":
        raise InvalidInputError(f"{path}: an animation ends in .gif")
    return path


def _stage(runs: Sequence[Log]) -> tuple[Figure, list[RunPlot], Text]:
    """Return the figure of a film, its scenes and clock, laid out once and for all."""
    longest = max(map(len, runs))
    box = view_box(runs, range(0, longest, max(1, longest // 50)))
    fleets = fleets_of(runs)
    looks = styles([fleet[0] for fleet in fleets])
    figure, panels = plan_panels([look.label for look in looks], box)
    scenes = [
        scene
        for axes, fleet, look in zip(panels, fleets, looks, strict=True)
        for scene in scenes_of(axes, fleet, look, box)
    ]
    for scene in scenes:
        scene.show(0)
    legend(figure)
    clock = figure.suptitle("t = 0.0 s", fontsize=10)
    for _ in range(2):  # the layout settles at the second drawing
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure, scenes, clock
