"""Predicted positions of bodies, robot frame, and bounds of their margin and speed."""

import math
from typing import NamedTuple

from qpavoid.avoidance.body_table import MOVES, Body, body_at, is_point
from qpavoid.avoidance.prediction import Rollout
from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import Contact, point_contact, wall_contact
from qpavoid.model.kinematics import Frame
from qpavoid.model.robot import limits_of
from qpavoid.types import Array


class End(NamedTuple):
    """One end of a body's segment.

    Attributes:
        x: Robot frame, m.
        y: Robot frame, m.
        v_x: Over ground, in the robot's axes, m/s.
        v_y: Over ground, in the robot's axes, m/s.
    """

    x: float
    y: float
    v_x: float
    v_y: float


class Ends(NamedTuple):
    """Both ends of a body's segment at a time; equal for a point."""

    one: End
    other: End


@compiled_once
def ends_at(body: Body, time: float, at: Frame) -> Ends:
    """Return the ends of a body at a time, in a frame."""
    v_x, v_y, c, s = body.v_x, body.v_y, at.cos, at.sin
    p_x, p_y = body.x + time * v_x - at.x, body.y + time * v_y - at.y
    if is_point(body):
        x, y = c * p_x + s * p_y, c * p_y - s * p_x
        end = End(x, y, c * v_x + s * v_y, c * v_y - s * v_x)
        return Ends(end, end)
    x1, y1, x2, y2, spin = body.x1, body.y1, body.x2, body.y2, body.turn
    # A rotating obstacle turns its segment about the pivot, which moves straight.
    if spin != 0.0:
        cos, sin = math.cos(spin * time), math.sin(spin * time)
        x1, y1 = cos * x1 - sin * y1, sin * x1 + cos * y1
        x2, y2 = cos * x2 - sin * y2, sin * x2 + cos * y2
    v_x1, v_y1 = v_x - spin * y1, v_y + spin * x1
    v_x2, v_y2 = v_x - spin * y2, v_y + spin * x2
    x1, y1, x2, y2 = p_x + x1, p_y + y1, p_x + x2, p_y + y2
    w_x1, w_y1 = c * v_x1 + s * v_y1, c * v_y1 - s * v_x1
    w_x2, w_y2 = c * v_x2 + s * v_y2, c * v_y2 - s * v_x2
    x1, y1 = c * x1 + s * y1, c * y1 - s * x1
    x2, y2 = c * x2 + s * y2, c * y2 - s * x2
    return Ends(End(x1, y1, w_x1, w_y1), End(x2, y2, w_x2, w_y2))


@compiled_once
def line_contact(edges: Array, body: Body, ends: Ends) -> Contact:
    """Return the contact of the footprint with the segment of a body."""
    one, other = ends.one, ends.other
    if is_point(body):
        return point_contact(edges, one.x, one.y)
    return wall_contact(edges, Segment(one.x, one.y, other.x, other.y))


@compiled
def circle_room(scene: Scene, body: Body, time: float, at: Frame) -> float:
    """Return a lower bound of the margin, m: that of the circles round both."""
    # The circles are independent of the headings.
    d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
    apart = math.sqrt(d_x * d_x + d_y * d_y)
    return float(apart - limits_of(scene.robot).circumradius - body.spread)


@compiled
def growth_of(scene: Scene, body: Body) -> float:
    """Return the rate of growth of a body's required distance, m/s."""
    return float(body.growth + (scene.drift if body.kind != MOVES else 0.0))


@compiled
def passing_speed(scene: Scene, rollout: Rollout, body: Body) -> float:
    """Return the greatest closing speed of the circles round both, m/s."""
    speed = math.sqrt(body.v_x**2 + body.v_y**2)
    return float(rollout.speed + speed + growth_of(scene, body))


@compiled
def stays_away(
    scene: Scene, rollout: Rollout, i: int, end: float, level: float
) -> bool:
    """Return whether the circle of body i keeps a threshold up to a time.

    One comparison, for the many bodies that are far away.

    Args:
        scene: With the body.
        rollout: Of the robot.
        i: Number of the body.
        end: End of the check, s.
        level: Threshold, m.
    """
    body = body_at(scene, i)
    # Squares, without a root: most bodies are rejected here. With far < 0 the threshold
    # cannot be violated.
    far = limits_of(scene.robot).circumradius + body.spread + level
    far += passing_speed(scene, rollout, body) * end
    return bool(far < 0.0 or body.x * body.x + body.y * body.y > far * far)


@compiled
def closing_speed(scene: Scene, rollout: Rollout, body: Body) -> float:
    """Return the greatest closing speed of footprint and body, m/s."""
    turning = rollout.turning * limits_of(scene.robot).circumradius
    speed = body.speed + growth_of(scene, body)
    return float(rollout.speed + turning + speed)
