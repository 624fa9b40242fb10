"""Animations of runs: GIF, or MP4 where ffmpeg is installed."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.figure import Figure
from matplotlib.text import Text

from qpavoid.errors import InvalidInputError, QPAvoidError
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
    logs: Log | Sequence[Log],
    path: str | os.PathLike[str],
    fps: int = 10,
    speed: float = 1.0,
    progress: Callable[[float], None] = lambda share: None,
) -> Path:
    """Write the plan view of runs as a film, methods side by side; return its path.

    Args:
        logs: A run, or several runs of one scenario.
        path: Ends in ``.gif`` or ``.mp4``; its folder is made.
        fps: Frames per second; a GIF counts in hundredths of a second, so 10, 20 or 25
            are kept exactly.
        speed: 1 shows the run in real time, 2 twice as fast.
        progress: Called after every frame with the share that is done.

    Raises:
        InvalidInputError: Another suffix, a rate that is not positive, no runs, or runs
            of several scenarios.
        QPAvoidError: No ffmpeg for an MP4.
    """
    runs = [logs] if isinstance(logs, Log) else list(logs)
    if not (fps > 0 and 0.0 < speed < np.inf):
        raise InvalidInputError("an animation needs fps > 0 and speed > 0")
    path = Path(path)
    writer = film_writer(path, fps)
    first_of(runs)
    t = max((log["t_s"] for log in runs), key=len)
    times = np.arange(t[0], t[-1] + 0.5 * speed / fps, speed / fps)
    figure, scenes, clock = _stage(runs)
    path.parent.mkdir(parents=True, exist_ok=True)
    with writer.saving(figure, str(path), FILM_DPI):
        for number, time in enumerate(times, start=1):
            step = int(np.abs(t - time).argmin())
            for scene in scenes:
                scene.show(step)
            clock.set_text(f"t = {t[step]:.1f} s")
            writer.grab_frame()
            progress(number / len(times))
    return path


def film_writer(path: Path, fps: int = 10) -> AbstractMovieWriter:
    """Return what writes a film of that suffix, or raise as :func:`animate` does."""
    suffix = path.suffix.lower()
    if suffix == ".gif":
        return PillowWriter(fps=fps)
    if suffix != ".mp4":
        raise InvalidInputError(f"{path}: an animation ends in .gif or .mp4")
    if not FFMpegWriter.isAvailable():
        raise QPAvoidError(
            f"{path}: writing .mp4 needs the program ffmpeg, which is not installed; "
            "a .gif needs nothing"
        )
    return FFMpegWriter(fps=fps)


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
