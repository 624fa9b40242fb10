"""Steering laws of candidates, in the robot frame.

Pure pursuit [Coulter1992] beside the reference, at a share of its pace; and turning,
driving straight and turning again to a pose at rest, the shortest manoeuvre of a
nonholonomic robot that stays near it.
"""

import math

from qpavoid.compiled import compiled_once
from qpavoid.model.kinematics import Frame, wrap_angle
from qpavoid.model.robot import RobotLimits, limits_of
from qpavoid.types import Array, Pair, Pose, Twist

X, Y, HEADING, V, OMEGA = range(5)
"""Columns of the reference ahead, one row per tick from now on."""

PURSUIT, PURSUIT_TIME = 0.5, 0.4
"""m and s; pursuit distance ahead, plus that driven in so long."""

CATCH_UP = 1.5
"""1/s; increase of speed per m of lag behind the reference."""

TURN_ON_SPOT = 1.2
"""rad; bearing of the pursuit point from which on the robot turns on the spot."""

TOP_TWIST = 2.0
"""m/s and rad/s; limits of a robot without limits."""

PARK_GAIN, TURN_IN = 3.0, 4.0
"""1/s; v per m and ω per rad towards a pose at rest."""

AT, TURN_FROM = 0.008, 0.5
"""m; distance below which only the heading is corrected. rad; bearing above which the
robot turns on the spot."""


SAME_TURNS = 1e-9
"""rad; tolerance of equal turns of two manoeuvres: the forward one is taken."""


@compiled_once
def nearest_row(ahead: Array, row: int, at: Frame) -> int:
    """Return the row nearest to a position, searched from ``row`` on."""
    least = (ahead[row, X] - at.x) ** 2 + (ahead[row, Y] - at.y) ** 2
    while row + 1 < ahead.shape[0]:
        away = (ahead[row + 1, X] - at.x) ** 2 + (ahead[row + 1, Y] - at.y) ** 2
        if away > least:
            break
        row, least = row + 1, away
    return row


@compiled_once
def point_ahead(ahead: Array, row: int, way: float, offset: float) -> Pair:
    """Return the point ``way`` m beyond a row, at an offset; straight at the end."""
    last = ahead.shape[0] - 1
    while row < last and way > 0.0:
        d_x, d_y = ahead[row + 1, X] - ahead[row, X], ahead[row + 1, Y] - ahead[row, Y]
        way, row = way - math.sqrt(d_x * d_x + d_y * d_y), row + 1
    cos, sin = math.cos(ahead[row, HEADING]), math.sin(ahead[row, HEADING])
    way = max(way, 0.0)
    return (
        ahead[row, X] + way * cos - offset * sin,
        ahead[row, Y] + way * sin + offset * cos,
    )


@compiled_once
def follow_twist(
    robot: Array, ahead: Array, at: Frame, row: int, place: float, offset: float
) -> Twist:
    """Return the twist that follows the reference at an offset.

    Pure pursuit [Coulter1992]: ω = 2 v sin α / D to a point of the path ahead, at the
    distance D and bearing α; v is reduced with α.

    Args:
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        ahead: (n, 5) the reference, one row per tick.
        at: Frame of the robot.
        row: Nearest row of the reference.
        place: Scheduled progress of the robot, in ticks.
        offset: To its left, m.
    """
    limits = limits_of(robot)
    t = min(int(place), ahead.shape[0] - 2)
    share = min(place - t, 1.0)
    cos, sin = math.cos(ahead[t, HEADING]), math.sin(ahead[t, HEADING])
    lag = (ahead[t, X] - at.x) * cos + (ahead[t, Y] - at.y) * sin
    d_x, d_y = ahead[t + 1, X] - ahead[t, X], ahead[t + 1, Y] - ahead[t, Y]
    lag += share * (d_x * cos + d_y * sin)
    v = min(max(ahead[t, V] + CATCH_UP * lag, 0.0), min(limits.v_max, TOP_TWIST))
    x, y = point_ahead(ahead, row, PURSUIT + PURSUIT_TIME * v, offset)
    d_x, d_y = x - at.x, y - at.y
    along, aside = at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x
    angle, most = math.atan2(aside, along), min(limits.omega_max, TOP_TWIST)
    if abs(angle) > TURN_ON_SPOT:
        return 0.0, math.copysign(most, angle)
    v *= 1.0 - abs(angle) / TURN_ON_SPOT
    away = math.sqrt(d_x * d_x + d_y * d_y)
    omega = 2.0 * v * math.sin(angle) / max(away, 0.2) + angle * min(1.0, 5.0 * v)
    return v, min(max(omega, -most), most)


@compiled_once
def turn_in(turn: float, limits: RobotLimits) -> float:
    """Return ω towards a heading, rad/s, from which half the deceleration stops."""
    omega = min(TURN_IN * abs(turn), math.sqrt(limits.angular_acceleration * abs(turn)))
    return math.copysign(min(omega, limits.omega_max, TOP_TWIST), turn)


@compiled_once
def park_twist(robot: Array, goal: Pose) -> Twist:
    """Return the twist towards a pose at rest: turn to it, drive there, turn.

    Forwards or backwards, with the smaller turns.

    Args:
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        goal: Robot frame, m, m, rad.
    """
    (x, y, turn), limits = goal, limits_of(robot)
    way, ahead = math.sqrt(x * x + y * y), 1.0
    if way < AT:
        turn = wrap_angle(turn)
        if abs(turn) < AT:
            return 0.0, 0.0
        return 0.0, turn_in(turn, limits)
    bearing = math.atan2(y, x)
    behind = wrap_angle(bearing + math.pi)
    turns = abs(bearing) + abs(wrap_angle(turn - bearing))
    back = abs(behind) + abs(wrap_angle(turn - behind))
    if limits.v_min < 0.0 and back < turns - SAME_TURNS:
        bearing, ahead = behind, -1.0
    omega = turn_in(bearing, limits)
    if abs(bearing) > TURN_FROM:
        return 0.0, omega
    fastest = min(limits.v_max if ahead > 0.0 else -limits.v_min, TOP_TWIST)
    v = min(PARK_GAIN * way, math.sqrt(limits.acceleration * way), fastest)
    return ahead * v * (1.0 - abs(bearing) / TURN_FROM), omega
