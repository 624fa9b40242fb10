"""Unicycle kinematics, Eq. 1, and its exact integral over a control step."""

import math
from typing import NamedTuple

import numpy as np

from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.types import Array, Pose, Twist

STRAIGHT, TINY = 1e-4, 1e-9
"""rad of half an arc, below which sin φ/φ is 1 − φ²/6 to the last digit; least
divisor."""


@entry
@compiled
def wrap_angle(angle: float) -> float:
    """Return the angle in (−π, π] that differs from ``angle`` by whole turns."""
    # ceil, not floor: the interval is closed at π.
    return angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@entry
@compiled
def arc(
    x: float, y: float, heading: float, v: float, omega: float, dt: float
) -> tuple[float, float, float]:
    """Return the pose after driving a constant twist for ``dt``: Eq. 1 integrated.

    The chord of the arc has length v·dt·sinc(ω·dt/2) and points along γ + ω·dt/2,
    which holds, and is smooth, for every ω, zero included. The heading is not wrapped.

    Args:
        x: Position in the world frame, m.
        y: Position in the world frame, m.
        heading: γ, rad, counter-clockwise from the world's x axis.
        v: Forward speed, m/s.
        omega: Yaw rate, rad/s, counter-clockwise.
        dt: Time, s; negative times go back along the same arc.
    """
    half = 0.5 * omega * dt
    if abs(half) < STRAIGHT:
        # The next term, φ⁴/120, is below 1e-18.
        sinc = 1.0 - half * half / 6.0
    else:
        sinc = math.sin(half) / half
    chord = v * dt * sinc
    return (
        x + chord * math.cos(heading + half),
        y + chord * math.sin(heading + half),
        heading + omega * dt,
    )


@entry
@compiled
def integrate(pose: Pose, twist: Twist, lateral: float, dt: float) -> Pose:
    """Return the pose after ``dt`` of a base with a lateral velocity, m/s to its left.

    The sum of two arcs, of v along γ and of ``lateral`` along γ + π/2: exact for
    constant velocities in the frame that turns with ω. With 0 it is :func:`arc`.
    """
    heading, omega = pose[2], twist[1]
    x, y, after = arc(pose[0], pose[1], heading, twist[0], omega, dt)
    if lateral != 0.0:
        # Displacements of the body's axes add up, since both turn with the same ω.
        x, y, _ = arc(x, y, heading + 0.5 * math.pi, lateral, omega, dt)
    return x, y, after


class Frame(NamedTuple):
    """A pose with the cosine and sine of its heading.

    Attributes:
        x: m.
        y: m.
        cos: Of the heading.
        sin: Of the heading.
    """

    x: float
    y: float
    cos: float
    sin: float


@entry
@compiled_once
def moved_on(frame: Frame, v: float, omega: float, time: float) -> Frame:
    """Return the frame after a constant twist: :func:`arc` with two sines."""
    half = 0.5 * omega * time
    cos, sin = math.cos(half), math.sin(half)
    sinc = sin / half if abs(half) > STRAIGHT else 1.0 - half * half / 6.0
    chord = v * time * sinc
    d_x, d_y = chord * cos, chord * sin
    # The whole turn from its half: two sines for an arc instead of four.
    turn_cos, turn_sin = 1.0 - 2.0 * sin * sin, 2.0 * sin * cos
    return Frame(
        frame.x + frame.cos * d_x - frame.sin * d_y,
        frame.y + frame.sin * d_x + frame.cos * d_y,
        frame.cos * turn_cos - frame.sin * turn_sin,
        frame.sin * turn_cos + frame.cos * turn_sin,
    )


def to_world(points: Array, pose: Pose) -> Array:
    """Return points (n, 2) of a frame at ``pose`` in the world frame, m."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y]))


def relative(then: Pose, now: Pose) -> Pose:
    """Return the pose ``now`` in the frame of the pose ``then``."""
    x, y = now[0] - then[0], now[1] - then[1]
    cos, sin = math.cos(then[2]), math.sin(then[2])
    return cos * x + sin * y, cos * y - sin * x, wrap_angle(now[2] - then[2])
