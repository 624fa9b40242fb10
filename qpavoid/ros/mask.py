"""Masks of the robot's own points, and of unknown sectors.

A point is the robot's own if it lies in one of the configured boxes or, if there are
none, in the outline (grown by a margin) in a cell where a point was in the first
:data:`RECORDED` good messages of its topic, before the robot first drove. Any other
point is an obstacle, inside the outline too. Premise: no obstacle is in the outline
then.

Premise of an unknown sector: no static obstacle in it is inside the required distance
when the sector becomes unknown.
"""

import numpy as np
import numpy.typing as npt

from qpavoid.model.footprint import Footprint
from qpavoid.ros.frames import Transform
from qpavoid.ros.messages import Fan
from qpavoid.types import Array

Flags = npt.NDArray[np.bool_]

RECORDED = 10
"""Messages of a topic from which the robot's own cells are learnt."""

MASK_CELL = 0.03
"""m; size of a cell; its eight neighbours count, too."""

SHADOW = MASK_CELL * np.arange(6)[:, None, None]
"""m behind an own point along its beam, where its edges are seen."""

CELL_STRIDE = 1 << 20
"""Stride of the cell index; more cells than in any outline."""

PARALLEL_BEAM = 1e-9
"""Sine of the angle below which a beam counts as parallel to an edge."""

MITRE = 20.0
"""Greatest motion of a corner relative to that of its edges: angles above 6 degrees."""

SPACING = 0.1
"""m; grid of the points that bound an unknown sector, one per cell."""


def beyond(footprint: Footprint, points: Array) -> Array:
    """Return the margin (n,), m, by which a footprint is to grow to hold each point.

    Not above 0 inside. Edges move out by the margin, corners by :data:`MITRE` margins
    at most.
    """
    edges, reach = footprint.edges, np.hypot(*points.T) - footprint.circumradius
    reached = (edges[:, :2] * edges[:, 2:4]).sum(axis=1)
    out = edges[:, 2:4] @ points.T - reached[:, None]
    each = [part.max(axis=0) for part in np.split(out, footprint.starts[1:])]
    return np.asarray(np.maximum(np.min(each, axis=0), reach / MITRE))


class OwnPlaces:
    """Cells of the robot's own points in the messages of a topic, robot frame.

    Attributes:
        messages: Number of messages learnt from.
    """

    def __init__(self) -> None:
        self.messages, self._cells = 0, np.empty(0, dtype=np.int64)

    def learn(self, points: Array, sensor: Array, shadow: bool) -> None:
        """Add the cells of points (n, 2), m, and their shadows from a sensor (2,)."""
        if shadow:
            away = points - sensor
            length = np.maximum(np.hypot(*away.T), MASK_CELL)[:, None]
            points = (points + SHADOW * away / length).reshape(-1, 2)
        x, y = np.floor(points / MASK_CELL).astype(np.int64).T
        around = [CELL_STRIDE * (x + i) + y + j for i in (-1, 0, 1) for j in (-1, 0, 1)]
        self._cells = np.unique(np.concatenate([self._cells, *around]))
        self.messages += 1

    def hold(self, points: Array) -> Flags:
        """Return which points (n, 2), m, lie in one of the cells."""
        x, y = np.floor(points / MASK_CELL).astype(np.int64).T
        return np.isin(CELL_STRIDE * x + y, self._cells)


def in_boxes(boxes: Array, points: Array) -> Flags:
    """Return which points (n, 2) lie in a box (m, 4): x_min, y_min, x_max, y_max, m."""
    low, high = points[:, None] >= boxes[:, :2], points[:, None] <= boxes[:, 2:]
    return np.asarray(np.any(np.all(low & high, axis=2), axis=1))


def unknown_sectors(fan: Fan, place: Transform, boxes: Array, least: float) -> Flags:
    """Return which beams (n,) lie in a run of unknown ones wider than ``least`` rad.

    A beam that enters a box from outside is hidden by the robot and not unknown.
    """
    if len(fan.unknown) < 2 or not fan.unknown.any():
        return np.zeros(len(fan.unknown), dtype=np.bool_)
    start, ways = _rays(fan, place)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (boxes.reshape(-1, 1, 2, 2) - start) / ways[:, None]
    enters, leaves = ends.min(axis=2).max(axis=2), ends.max(axis=2).min(axis=2)
    masked: Flags = np.asarray((enters > 0.0) & (enters <= leaves), dtype=np.bool_)
    unknown: Flags = fan.unknown & ~masked.any(axis=0)
    many, step = len(unknown), abs(fan.step)
    known = np.flatnonzero(~unknown)
    if not len(known):
        return unknown
    closed = 2.0 * np.pi - many * step < max(1.5 * step, least)
    turned = np.roll(unknown, -known[0]) if closed else unknown
    bounds = np.flatnonzero(np.diff(turned, prepend=False, append=False))
    for begin, end in bounds.reshape(-1, 2):
        turned[begin:end] = (end - begin) * step > least
    return np.roll(turned, known[0]) if closed else turned


def border(fan: Fan, beams: Flags, place: Transform, footprint: Footprint) -> Array:
    """Return the points (m, 2) where beams (n,) leave a footprint for good."""
    (start, ways), edges, starts = _rays(fan, place), footprint.edges, footprint.starts
    along = ways[beams] @ edges[:, 2:4].T
    along = np.where(abs(along) > PARALLEL_BEAM, along, PARALLEL_BEAM)
    lengths = ((edges[:, :2] - start) * edges[:, 2:4]).sum(axis=1) / along
    out = np.where(along > 0.0, lengths, np.inf)
    into = np.where(along > 0.0, -np.inf, lengths)
    leaves = np.minimum.reduceat(out, starts, axis=1)
    enters = np.maximum.reduceat(into, starts, axis=1)
    leaves = np.where(enters <= leaves, leaves, -np.inf).max(axis=1)
    crossed = leaves > 0.0
    return np.asarray(start + leaves[crossed, None] * ways[beams][crossed])


def hidden(points: Array, fan: Fan, beams: Flags, place: Transform) -> Flags:
    """Return which points (m, 2) of the robot frame lie on one of the beams (n,)."""
    lifted = np.column_stack([points, np.full(len(points), place.translation[2])])
    x, y, _ = ((lifted - place.translation) @ place.rotation).T
    angle = (np.arctan2(y, x) - fan.first) * np.sign(fan.step)
    at = np.rint(angle % (2.0 * np.pi) / abs(fan.step)).astype(np.int64)
    at[at >= len(beams)] -= round(2.0 * np.pi / abs(fan.step))
    found: Flags = np.append(beams, False)[np.clip(at, -1, len(beams))]
    return found


def _rays(fan: Fan, place: Transform) -> tuple[Array, Array]:
    """Return the origin (2,) and the directions (n, 2) of all beams, robot frame."""
    ways = fan.directions @ place.rotation[:2, :2].T
    return place.translation[:2], ways / np.hypot(*ways.T)[:, None]
