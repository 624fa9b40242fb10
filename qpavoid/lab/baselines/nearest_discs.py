"""Discs nearest to a footprint along its path, for programs of fixed size."""

import math
from typing import Annotated

from qpavoid.compiled import compiled_once, entry, entry_if
from qpavoid.model.contact import point_contact
from qpavoid.types import Discs, Edges, Matrix, MatrixWritten, Sizes, Vector

NO_DISC = (1e3, 1e3, 0.0, 0.0, 0.0)
"""Absent obstacle: x, y, radius, m, and velocity."""


@entry
@compiled_once
def _nearest_discs_fits(
    edges: Edges,
    discs: Discs,
    poses: Annotated[Matrix, Sizes(2, 3)],
    at: Vector,
    near: Annotated[MatrixWritten, Sizes(0, 5)],
) -> bool:
    """Return whether each stage has a time."""
    all_fit: bool = at.shape[0] >= poses.shape[0] - 1
    return all_fit


@entry_if(_nearest_discs_fits)
@compiled_once
def nearest_discs(
    edges: Edges,
    discs: Discs,
    poses: Annotated[Matrix, Sizes(2, 3)],
    at: Vector,
    near: Annotated[MatrixWritten, Sizes(0, 5)],
) -> None:
    """Fill in the discs (N·n, 5) nearest to the footprint at each stage.

    Args:
        edges: Of the footprint.
        discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`.
        poses: (N + 1, 3) predicted poses of the robot; the first is the present one.
        at: (N,) times, s.
        near: Filled in; absent discs are :data:`NO_DISC`.
    """
    stages = poses.shape[0] - 1
    count = near.shape[0] // stages
    for k in range(stages):
        x, y, time = poses[k + 1, 0], poses[k + 1, 1], at[k]
        heading = poses[k + 1, 2]
        cos, sin = math.cos(heading), math.sin(heading)
        last, number = -math.inf, -1
        for j in range(k * count, (k + 1) * count):
            least, found = math.inf, -1
            near[j, 0], near[j, 1], near[j, 2], near[j, 3], near[j, 4] = NO_DISC
            for i in range(discs.shape[0]):
                radius, v_x, v_y = discs[i, 2], discs[i, 3], discs[i, 4]
                d_x = discs[i, 0] + time * v_x - x
                d_y = discs[i, 1] + time * v_y - y
                touch = point_contact(
                    edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x
                )
                gap = touch.distance - radius
                # The next after the last one found, equal ones by their number: sorts
                # without an array and without repetition.
                if gap < least and (gap > last or (gap == last and i > number)):
                    least, found = gap, i
                    near[j, 0], near[j, 1], near[j, 2] = d_x + x, d_y + y, radius
                    near[j, 3], near[j, 4] = v_x, v_y
            last, number = least, found
