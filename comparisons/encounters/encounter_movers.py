"""What moves in an encounter: a disc or a cart, and its way, known piece by piece.

A piece holds from its start on until the next one begins:

    start s, x m, y m, course rad, speed m/s, acceleration m/s², turn rad/s

and either its acceleration or its turn is zero, so that the motion has a closed form.
The last piece never ends. A cart is a rectangle that heads along its course.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from qpavoid.compiled import compiled
from qpavoid.model.kinematics import arc
from qpavoid.types import Array

PIECE = 7
"""Numbers of a piece."""


class Motion(NamedTuple):
    """Where a mover is: x, y (m), course (rad), and its speed (m/s)."""

    x: float
    y: float
    course: float
    speed: float


@compiled
def mover_at(pieces: Array, t: float) -> Motion:
    """Return where a mover is at a time, s."""
    k = 0
    while k + 1 < pieces.shape[0] and pieces[k + 1, 0] <= t:
        k += 1
    left = t - pieces[k, 0]
    v, a = pieces[k, 4], pieces[k, 5]
    x, y, course = arc(
        pieces[k, 1], pieces[k, 2], pieces[k, 3], v + 0.5 * a * left, pieces[k, 6], left
    )
    return Motion(x, y, course, v + a * left)


@dataclass(frozen=True)
class Leg:
    """A part of a way: how long it lasts, and what the speed does meanwhile.

    Attributes:
        duration: s; ``inf`` for the last one.
        speed: At its start, m/s.
        acceleration: m/s².
        turn: rad/s.
    """

    duration: float
    speed: float
    acceleration: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True, eq=False)
class Mover:
    """A disc or a cart on its way.

    Attributes:
        pieces: (P, 7) as above.
        radius: Of the disc, m; 0 for a cart.
        half: Half length and half width of the cart, m; 0 for a disc.
    """

    pieces: Array
    radius: float
    half: tuple[float, float] = (0.0, 0.0)

    @property
    def is_cart(self) -> bool:
        """Whether it is a rectangle."""
        return self.half[0] > 0.0

    @property
    def size(self) -> float:
        """Radius of the circle round its middle that holds it, m."""
        return self.radius + math.hypot(*self.half)

    @property
    def fastest(self) -> float:
        """Its greatest speed at the beginning or end of a piece, m/s."""
        ends = np.append(self.pieces[1:, 0] - 1e-9, self.pieces[-1, 0])
        return float(max(*self.pieces[:, 4], *(self.at(t).speed for t in ends)))

    def at(self, t: float) -> Motion:
        """Return where it is at a time, s."""
        return mover_at(self.pieces, t)

    def velocity(self, t: float) -> Array:
        """Return its velocity (2,) over ground at a time, m/s."""
        _, _, course, speed = self.at(t)
        return speed * np.array([math.cos(course), math.sin(course)])

    def turn(self, t: float) -> float:
        """Return how fast its course turns at a time, rad/s."""
        return float(self.pieces[self.pieces[:, 0] <= t][-1, 6])

    def corners(self, t: float) -> Array:
        """Return the corners (4, 2) of a cart at a time, counter-clockwise, m."""
        x, y, course, _ = self.at(t)
        cos, sin = math.cos(course), math.sin(course)
        along = self.half[0] * np.array([-1.0, 1.0, 1.0, -1.0])
        across = self.half[1] * np.array([-1.0, -1.0, 1.0, 1.0])
        return np.column_stack(
            [x + cos * along - sin * across, y + sin * along + cos * across]
        )


def follow(x: float, y: float, course: float, legs: Sequence[Leg]) -> Array:
    """Return the pieces of a way that begins at a place with a course."""
    pieces, start = np.zeros((len(legs), PIECE)), 0.0
    for k, leg in enumerate(legs):
        pieces[k] = (start, x, y, course, leg.speed, leg.acceleration, leg.turn)
        if k + 1 < len(legs):
            start += leg.duration
            x, y, course, _ = mover_at(pieces[: k + 1], start)
    return pieces


def aimed(
    place: Array, target: Array, speed: float, legs: Sequence[Leg], until: float
) -> Array:
    """Return the pieces of a way from a place that meets a target on the move.

    Args:
        place: (2,) where it begins, m.
        target: (2,) at time 0, m.
        speed: Of the target along x, m/s.
        legs: Of the way; its first course is what is looked for.
        until: s; a target that cannot be met before is missed by as little as possible.
    """
    pieces = follow(0.0, 0.0, 0.0, legs)
    times = np.linspace(0.0, until, 601)
    local = np.array([mover_at(pieces, t)[:2] for t in times])
    ways = target + np.outer(speed * times, (1.0, 0.0)) - place
    late = np.hypot(*ways.T) - np.hypot(*local.T)
    k = int(np.argmax(late <= 0.0) if (late <= 0.0).any() else np.argmin(late))
    course = math.atan2(*ways[k, ::-1]) - math.atan2(*local[k, ::-1])
    return follow(place[0], place[1], course, legs)


def straight(disc: Array, velocity: Array) -> Mover:
    """Return a disc (x, y, radius) that keeps its velocity."""
    course, speed = math.atan2(velocity[1], velocity[0]), float(np.hypot(*velocity))
    pieces = np.array([[0.0, disc[0], disc[1], course, speed, 0.0, 0.0]])
    return Mover(pieces, float(disc[2]))


def last_near(mover: Mover, way: Array, near: float) -> float:
    """Return when a mover is for the last time nearer than ``near`` to a way, s.

    Args:
        mover: Looked at every 0.1 s before its last piece; from then on exactly.
        way: (n, 2) places, m.
        near: m, of its middle.
    """
    start, x, y, course, speed, acceleration, _ = mover.pieces[-1]
    last = 0.0
    for t in np.arange(0.0, start, 0.1):
        if (np.hypot(*(way - mover.at(t)[:2]).T) < near).any():
            last = float(t)
    speed += max(acceleration, 0.0)
    velocity = speed * np.array([math.cos(course), math.sin(course)])
    if speed == 0.0:
        return last
    places = np.array([x, y]) - way
    half = places @ velocity
    root = half**2 - speed**2 * ((places**2).sum(axis=1) - near * near)
    if (root > 0.0).any():
        leaves = (np.sqrt(root[root > 0.0]) - half[root > 0.0]).max() / speed**2
        last = max(last, start + float(leaves)) if leaves > 0.0 else last
    return last
