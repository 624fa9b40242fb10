"""Figures of the encounters: who fails where, and how much of the possible is kept."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from limit import limit_tables

from qpavoid.model.robot import Robot

NAMES = {
    "eq5": "Eq. 5",
    "eq7": "Eq. 7",
    "qp": "one-step QP",
    "qp-ahead": "look-ahead QP",
}


def draw(runs: Sequence[dict[str, Any]], folder: Path) -> None:
    """Write ``failures.png`` and ``kept.png``."""
    places(runs, folder / "failures.png")
    kept(runs, folder / "kept.png")


def column(runs: Sequence[dict[str, Any]], name: str) -> np.ndarray:
    """Return one column of some runs."""
    return np.array([line[name] for line in runs])


def places(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw where the discs were first seen: avoidable ones, and contacts among them."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 8.4), sharex=True, sharey=True)
    outline, late = Robot.mir100().footprint.vertices, too_late(1.5)
    for axis, name in zip(axes.flat, NAMES, strict=True):
        mine = [r for r in runs if r["controller"] == name and r["family"] == "parked"]
        if not mine:
            mine = [r for r in runs if r["controller"] == name]
        x, y = column(mine, "x_m"), column(mine, "y_m")
        avoidable = column(mine, "limit_m") >= 0.02
        failed = avoidable & (column(mine, "clearance") < 0.0)
        axis.contourf(*late, levels=[-9.0, 0.02], colors=["tab:blue"], alpha=0.35)
        axis.fill(*outline.T, color="0.35", zorder=3)
        axis.scatter(x[avoidable], y[avoidable], s=3, color="0.8", label="avoidable")
        axis.scatter(
            *(x[failed], y[failed]), s=6, color="tab:red", label="contact, avoidable"
        )
        axis.plot(
            [], [], color="tab:blue", alpha=0.35, lw=6, label="too late (1.5 m/s)"
        )
        axis.set_title(f"{NAMES[name]}: {failed.sum()} of {avoidable.sum()}")
        axis.set_aspect("equal")
    axes[0, 0].legend(loc="upper left", fontsize=8)
    figure.supxlabel("where the disc was first seen: x ahead of the robot (m)")
    figure.supylabel("y to its left (m)")
    figure.tight_layout()
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
    return x, y, limit_tables(robot).clearance(rows).reshape(x.shape)


def kept(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw the distribution of clearance kept over clearance possible."""
    families = list(dict.fromkeys(r["family"] for r in runs))
    figure, axes = plt.subplots(
        1, len(families), figsize=(3.4 * len(families), 3.6), sharey=True, squeeze=False
    )
    for axis, family in zip(axes[0], families, strict=True):
        for name, label in NAMES.items():
            mine = [
                r for r in runs if r["controller"] == name and r["family"] == family
            ]
            limit = column(mine, "limit_m")
            far = limit >= 0.02
            share = np.clip(column(mine, "clearance")[far] / limit[far], -0.5, 1.0)
            axis.plot(np.sort(share), np.linspace(0, 1, len(share)), label=label)
        axis.axvline(0.0, color="0.5", lw=0.8, ls=":")
        axis.set_xlim(-0.5, 1.0)
        axis.set_title(family)
        axis.set_xlabel("clearance kept / possible")
    axes[0, 0].set_ylabel("share of the avoidable encounters")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)
