"""Vector field histogram VFH+ [Ulrich1998]."""

import math
from dataclasses import dataclass
from typing import Annotated, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.lab.baselines.drive import Baseline, Command, line_points, reference_ahead
from qpavoid.model.kinematics import TINY, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Matrix, Sizes, Twist, Vector, VectorWritten

SECTORS = 72
"""Number of sectors, of 5° each."""

WIDE = 16
"""Sectors; a wider opening is entered along its edge instead of its middle."""

COSTS = (5.0, 2.0, 2.0)
"""Weights of the target, the present heading and the last choice: the original's."""

CELL = 0.1
"""m; spacing of points on a wall: the original's grid."""

AT_TARGET = 0.05
"""m; distance of the target below which its direction is undefined."""

Flags = npt.NDArray[np.bool_]

Cells: TypeAlias = Annotated[Matrix, Sizes(0, 3)]
"""(n, 3): x, y and radius, m."""


@entry
@compiled_once
def polar_histogram(
    cells: Cells,
    radius: float,
    window: float,
    heading: float,
    histogram: Annotated[VectorWritten, Sizes(SECTORS)],
) -> None:
    """Fill in the primary polar histogram: per sector 1 − (d/w)², d the nearest cell.

    All cells are certain (c = 1), and the worst cell of a sector counts. A cell covers
    the directions in which the robot's circle would hit it; one inside the circle
    covers half a turn. Sector k has the direction 2πk/n in a frame that does not turn
    with the robot.

    Args:
        cells: (n, 3) x, y, radius in the robot frame, m.
        radius: Of the robot with its margin, m.
        window: w, m.
        heading: Of the robot, rad.
        histogram: (:data:`SECTORS`,) filled.
    """
    for k in range(SECTORS):
        histogram[k] = 0.0
    width = 2.0 * math.pi / SECTORS
    for i in range(cells.shape[0]):
        away = math.sqrt(cells[i, 0] ** 2 + cells[i, 1] ** 2)
        distance = max(away - cells[i, 2], 0.0)
        if distance >= window:
            continue
        half = math.asin(min(1.0, (radius + cells[i, 2]) / max(away, TINY)))
        bearing = heading + math.atan2(cells[i, 1], cells[i, 0])
        magnitude = 1.0 - (distance / window) ** 2
        first = math.ceil((bearing - half) / width - TINY)
        last = math.floor((bearing + half) / width + TINY)
        for k in range(first, last + 1):
            histogram[k % SECTORS] = max(histogram[k % SECTORS], magnitude)


@entry
@compiled_once
def reachable(
    cells: Cells, radius: float, window: float, turn: float
) -> tuple[float, float]:
    """Return the greatest bearings to the left and to the right, rad, both positive.

    A cell on the tightest circle at the present speed, of radius ``turn`` (m), blocks
    all directions beyond it.
    """
    left = right = math.pi
    for i in range(cells.shape[0]):
        x, y, wide = cells[i, 0], cells[i, 1], radius + cells[i, 2]
        away = math.sqrt(x * x + y * y)
        if away <= wide or away - cells[i, 2] >= window:
            continue
        bearing = math.atan2(y, x)
        if bearing >= 0.0 and x * x + (y - turn) ** 2 < (turn + wide) ** 2:
            left = min(left, bearing)
        if bearing <= 0.0 and x * x + (y + turn) ** 2 < (turn + wide) ** 2:
            right = min(right, -bearing)
    return left, right


@compiled
def apart(one: float, other: float) -> float:
    """Return the distance of two directions in sectors."""
    return abs((one - other + 0.5 * SECTORS) % SECTORS - 0.5 * SECTORS)


@entry
@compiled_once
def choose(
    blocked: Annotated[Vector, Sizes(SECTORS)], target: float, ahead: float, last: float
) -> float:
    """Return the cheapest direction, in sectors; −1 if every one is blocked.

    Candidates are the middle of a narrow opening; of a wide one both edges, half of
    :data:`WIDE` inside, and the target if it lies between them. ``blocked``: 0 or 1.
    """
    start = -1
    for k in range(SECTORS):
        if blocked[k] != 0.0:
            start = k
    if start < 0:
        return target
    # Round the circle from a blocked sector: no opening is cut in two.
    best, least, begin = -1.0, math.inf, -1
    for k in range(start + 1, start + SECTORS + 1):
        if blocked[k % SECTORS] == 0.0:
            begin = k if begin < 0 else begin
            continue
        if begin < 0:
            continue
        right = left = middle = 0.5 * (begin + k - 1)
        if k - begin > WIDE:
            right, left = begin + 0.5 * WIDE, k - 1 - 0.5 * WIDE
            middle = min(max(begin + (target - begin) % SECTORS, right), left)
        for way in (right, middle, left):
            cost = (
                COSTS[0] * apart(way, target)
                + COSTS[1] * apart(way, ahead)
                + COSTS[2] * apart(way, last)
            )
            if cost < least:
                best, least = way % SECTORS, cost
        begin = -1
    return best


@dataclass(frozen=True)
class HistogramController(Baseline):
    """Steering for the cheapest opening between obstacles.

    VFH+ has round robots: here the circle of ``radius``, which may be less than the
    circumscribed one, and then corners may touch. Sectors are blocked from ``high`` on,
    and free again below ``low``; then cells on the tightest turn block the directions
    behind them. If both the target and the direction ahead are free the desired twist
    is driven. Else the yaw rate is proportional to the bearing of the chosen direction;
    the speed is lower for large bearings, and near obstacles ahead. The target is the
    reference in ``preview`` s, the pace the speed that reaches it in that time;
    obstacles beyond the goal are left out. Velocities are not used.

    Attributes:
        radius: Of the robot, from that of the inscribed circle (0) to that of the
            circumscribed one (1), both about the axle's middle.
        margin: Added to it, m.
        window: w, m; range of obstacles.
        low: Magnitude below which a sector is free again.
        high: Magnitude from which on a sector is blocked.
        turn: Yaw rate over angle, 1/s.
        preview: s.
    """

    radius: float = 0.75
    margin: float = 0.05
    window: float = 1.5
    low: float = 0.1
    high: float = 0.3
    turn: float = 4.0
    preview: float = 2.0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        footprint, histogram = self.robot.footprint, np.zeros(SECTORS)
        inner, outer = max(footprint.inner_radius, 0.0), footprint.circumradius
        radius = inner * (1.0 - self.radius) + self.radius * outer + self.margin
        blocked, last = np.zeros(SECTORS, dtype=np.bool_), -1.0
        width, limits = 2.0 * math.pi / SECTORS, self.robot.limits

        def plan(
            desired: Twist, obstacles: Obstacles, context: StepContext
        ) -> Command | None:
            nonlocal last
            x, y, _ = reference_ahead(context, self.robot, 1, self.preview)[0].tolist()
            away, ahead = math.hypot(x, y), context.pose[2] / width
            target = (ahead + math.atan2(y, x) / width) % SECTORS
            window = min(self.window, math.hypot(*context.goal[:2]) + radius)
            lines = line_points(obstacles, CELL)[:, :2]
            points = np.pad(np.vstack([obstacles.points, lines]), ((0, 0), (0, 1)))
            cells = np.ascontiguousarray(np.vstack([points, obstacles.discs]))
            polar_histogram(cells, radius, window, context.pose[2], histogram)
            # Hysteresis: else a robot would oscillate at the threshold.
            blocked[:] = histogram >= np.where(blocked, self.low, self.high)
            tightest = abs(context.driven[0]) / max(limits.omega_max, TINY)
            sides = reachable(cells, radius, window, tightest)
            masked = blocked | barred(context.pose[2], *sides)
            free = not (masked[sector(target)] or masked[sector(ahead)])
            if free or away < AT_TARGET:
                last = target
                return None
            last = choose(
                masked.astype(np.float64), target, ahead, target if last < 0.0 else last
            )
            if last < 0.0:
                return self.brake(context)
            angle = wrap_angle((last - ahead) * width)
            pace = min(away / self.preview, limits.v_max)
            pace *= 1.0 - float(histogram[sector(ahead)])
            return Command((pace * max(0.0, math.cos(angle)), self.turn * angle))

        return self.stepping((v, omega), plan)


def sector(direction: float) -> int:
    """Return the sector of a direction."""
    return round(direction) % SECTORS


def barred(heading: float, left: float, right: float) -> Flags:
    """Return the sectors beyond the bearings (rad) that can be reached."""
    angles = np.arange(SECTORS) * (2.0 * math.pi / SECTORS) - heading
    angles -= 2.0 * math.pi * np.ceil((angles - math.pi) / (2.0 * math.pi))
    behind = np.abs(angles) > math.pi - TINY  # reached from either side
    flags: Flags = (angles > left) | (-angles > right)
    flags[behind] = max(left, right) < math.pi
    return flags
