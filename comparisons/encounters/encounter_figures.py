"""Figures of the encounters: who fails where, and how much of the possible is kept."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from limit import limit_tables
from qpavoid.lab.study.style import NAMED, RED, SKY
from qpavoid.model.robot import Robot

METHODS = ("eq5", "eq7", "qp", "qp-ahead")
GREATEST = ("parked", "path", "accelerated")
"""Families whose limit is the greatest clearance, not only enough."""


def draw(runs: Sequence[dict[str, Any]], folder: Path) -> None:
    """Write ``failures.png``, and ``kept.png`` where the greatest limit is known."""
    exact = [run for run in runs if run["margins"] == "none"]
    places(exact, folder / "failures.png")
    known = [run for run in runs if run["family"] in GREATEST]
    if known:
        kept(known, folder / "kept.png")


def column(runs: Sequence[dict[str, Any]], name: str) -> np.ndarray:
    """Return one column of some runs."""
    return np.array([float(line[name]) for line in runs])


def places(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw where the discs were first seen: avoidable ones, and contacts among them."""
    figure, axes = plt.subplots(
        2, 2, figsize=(9, 9.2), sharex=True, sharey=True, layout="constrained"
    )
    outline, late = Robot.mir100().footprint.vertices, too_late(1.5)
    family = runs[0]["family"]
    for axis, name in zip(axes.flat, METHODS, strict=True):
        mine = [r for r in runs if (r["controller"], r["family"]) == (name, family)]
        x, y = column(mine, "x_m"), column(mine, "y_m")
        avoidable = column(mine, "limit_m") >= 0.02
        failed = avoidable & (column(mine, "clearance") < 0.0)
        axis.contourf(*late, levels=[-9.0, 0.02], colors=[SKY])
        axis.fill(*outline.T, color="0.35", zorder=3)
        axis.scatter(x[avoidable], y[avoidable], s=1.5, color="0.8", label="avoided")
        axis.scatter(x[failed], y[failed], s=1.5, color=RED, label="touched")
        axis.plot([], [], color=SKY, lw=6, label="too late for a point at 1.5 m/s")
        axis.set_title(
            f"{NAMED[name].label}: {failed.sum():,} of {avoidable.sum():,} avoidable"
        )
        axis.set_aspect("equal")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, markerscale=6)
    for axis in axes[-1]:
        axis.set_xlabel(f"{family}: first seen at x ahead (m)")
    for axis in axes[:, 0]:
        axis.set_ylabel("y to the left (m)")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def too_late(speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return x, y and the clearance possible from a point on its way to the axle."""
    robot = Robot.mir100()
    side = np.linspace(-2.6, 2.6, 131)
    x, y = np.meshgrid(side, side)
    far = np.maximum(np.hypot(x, y), 1e-6)
    zero = np.zeros(x.size)
    columns = (x, y, -speed * x / far, -speed * y / far)
    rows = np.column_stack([*(c.ravel() for c in columns), zero, zero])
    return x, y, limit_tables(robot, (speed,)).clearance(rows).reshape(x.shape)


def kept(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the distribution of clearance kept over clearance possible."""
    families = list(dict.fromkeys(r["family"] for r in runs))
    figure, axes = plt.subplots(
        1, len(families), figsize=(11, 3.8), sharey=True, squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for axis, family in zip(axes[0], families, strict=True):
        for name in METHODS:
            mine = [r for r in runs if (r["controller"], r["family"]) == (name, family)]
            limit, look = column(mine, "limit_m"), NAMED[name]
            far = limit >= 0.02
            share = np.clip(column(mine, "clearance")[far] / limit[far], -0.5, 1.0)
            height = np.linspace(0.0, 1.0, len(share))
            axis.plot(np.sort(share), height, color=look.color, ls=look.line,
                      label=look.label)  # fmt: skip
        axis.axvline(0.0, color="0.5", lw=0.8)
        axis.set_xlim(-0.5, 1.0)
        axis.set_title(family)
        axis.set_xlabel("clearance kept / possible")
    axes[0, 0].set_ylabel("share of avoidable encounters")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    figure.savefig(path, dpi=150)
    plt.close(figure)
