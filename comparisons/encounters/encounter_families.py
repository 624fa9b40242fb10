"""The drawn worlds of the mixed and narrow families, and of movers that change.

All on the robot's side of time 0: it stands at the origin or drives straight along x.
What stands leaves the robot's own way free, so that tracking alone could drive it;
movers pass through what stands, as nobody would, which only makes it harder.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from encounter_movers import Leg, Mover, aimed, follow
from qpavoid.model.contact import point_contact
from qpavoid.model.footprint import Footprint
from qpavoid.model.given import NO_POINTS, NO_WALLS
from qpavoid.model.robot import Robot
from qpavoid.types import Array

DRIVE = 6.0
"""s that the path takes, the last of them slowing down to rest."""

NEAR, FAR = 0.8, 2.5
"""m; how far away a mover is first seen, clear of the footprint."""

PATIENCE = 30.0
"""s after which a mover has come to a robot that stands."""

BESIDE = 0.2
"""m; r_min at rest and 3 cm: what corridors and doors leave on either side at least."""

SPACING = 0.05
"""m between the points that a wall is seen as."""


@dataclass(frozen=True, eq=False)
class World:
    """What a robot meets, in its own frame at time 0.

    Attributes:
        movers: Discs and carts.
        points: (N, 2) posts, m.
        walls: (K, 4) m.
        dotted: (K,) walls that are seen as points.
    """

    movers: tuple[Mover, ...] = ()
    points: Array = field(default_factory=lambda: NO_POINTS)
    walls: Array = field(default_factory=lambda: NO_WALLS)
    dotted: tuple[bool, ...] = ()

    def seen(self) -> tuple[Array, Array]:
        """Return the points and walls that are seen."""
        points, walls = [self.points], [NO_WALLS]
        for wall, dotted in zip(self.walls, self.dotted, strict=True):
            if dotted:
                start, end = wall[:2], wall[2:]
                count = 1 + math.ceil(np.hypot(*(end - start)) / SPACING)
                points.append(np.linspace(start, end, count))
            else:
                walls.append(wall[None])
        return np.concatenate(points), np.concatenate(walls)


def inside(rng: np.random.Generator, robot: Robot) -> Array:
    """Return a random place of the footprint."""
    vertices = robot.footprint.vertices
    while True:
        place: Array = rng.uniform(vertices.min(axis=0), vertices.max(axis=0))
        if point_contact(robot.footprint.edges, *place).distance < 0.0:
            return place


def seen_at(robot: Robot, bearing: float, clear: float) -> Array:
    """Return the place in a direction that is clear of the footprint by so much."""
    ray = np.array([math.cos(bearing), math.sin(bearing)])
    low, high = 0.0, clear + 2.0 * robot.footprint.circumradius
    for _ in range(40):
        middle = 0.5 * (low + high)
        clearance = point_contact(robot.footprint.edges, *(middle * ray)).distance
        low, high = (middle, high) if clearance < clear else (low, middle)
    return low * ray


def length_of_path(speed: float) -> float:
    """Return how far the path leads, m: its last second slows down to rest."""
    return speed * (DRIVE - 0.5)


def swept(robot: Robot, speed: float) -> Footprint:
    """Return all that the footprint covers on its way."""
    vertices = robot.footprint.vertices.copy()
    vertices[vertices[:, 0] > 0.0, 0] += length_of_path(speed)
    return Footprint.polygon(vertices)


def coming(
    rng: np.random.Generator,
    robot: Robot,
    speed: float,
    legs: Sequence[Leg],
    radius: float,
    half: tuple[float, float] = (0.0, 0.0),
) -> Mover:
    """Return a mover that is aimed at a place of the footprint, wherever it is then.

    Args:
        rng: Draws where it comes from.
        robot: Whom it is aimed at.
        speed: Of the robot on its path, m/s; 0: it is parked.
        legs: Of the mover's way.
        radius: Of a disc, m; 0: it is a cart.
        half: Half length and half width of a cart, m.
    """
    size = radius + math.hypot(*half)
    bearing = rng.uniform(-math.pi, math.pi)
    place = seen_at(robot, bearing, rng.uniform(NEAR, FAR) + size)
    until = DRIVE if speed else PATIENCE
    pieces = aimed(place, inside(rng, robot), speed, legs, until)
    return Mover(pieces, radius, half)


def standing(
    rng: np.random.Generator, way: Footprint, count: int, length: float
) -> Array:
    """Return walls (n, 4) of a length (0: points), 0.3 to 1 m beside the robot's way.

    How near each comes is drawn first, so that near ones are as frequent as far ones.
    """
    low, high = way.vertices.min(axis=0) - 1.0, way.vertices.max(axis=0) + 1.0
    found = np.empty((count, 4))
    for k in range(count):
        wanted = rng.uniform(0.3, 1.0)
        while True:
            angle, place = rng.uniform(-math.pi, math.pi), rng.uniform(low, high)
            end = place + length * np.array([math.cos(angle), math.sin(angle)])
            line = np.linspace(place, end, 1 + math.ceil(length / SPACING))
            least = min(point_contact(way.edges, *p).distance for p in line)
            if abs(least - wanted) < 0.05 and least >= 0.3:
                found[k] = *place, *end
                break
    return found


def dots(rng: np.random.Generator, count: int) -> tuple[bool, ...]:
    """Return for so many walls whether they are seen as points: half of them are."""
    return tuple((rng.random(count) < 0.5).tolist())


def mixed(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """3 to 8 points, up to 2 walls of 0.5 to 2 m, 1 or 2 discs of constant velocity."""
    way = swept(robot, speed)
    points = standing(rng, way, int(rng.integers(3, 9)), 0.0)[:, :2]
    walls = [
        standing(rng, way, 1, rng.uniform(0.5, 2.0))
        for _ in range(int(rng.integers(0, 3)))
    ]
    movers = [
        coming(
            rng,
            robot,
            speed,
            [Leg(math.inf, rng.uniform(0.2, 1.2))],
            rng.uniform(0.1, 0.35),
        )
        for _ in range(int(rng.integers(1, 3)))
    ]
    solid = np.concatenate([NO_WALLS, *walls])
    return World(tuple(movers), points, solid, (False,) * len(solid))


def corridor(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """Two walls, and somebody behind or ahead who walks along between them.

    Ahead: towards the robot, or in three of ten cases away from it and slower.
    """
    body = robot.footprint.vertices
    half = body[:, 1].max() + BESIDE + rng.uniform(0.0, 0.7)
    back, front = -rng.uniform(2.0, 4.0), rng.uniform(3.0, 7.0)
    walls = np.array([[back, y, front, y] for y in (-half, half)])
    dotted = dots(rng, 2)
    radius, pace = min(rng.uniform(0.1, 0.35), half), rng.uniform(0.2, 1.4)
    clear, behind = rng.uniform(NEAR, FAR) + radius, rng.random() < 0.5
    y = rng.uniform(-1.0, 1.0) * (half - radius)
    x = body[:, 0].min() - clear if behind else body[:, 0].max() + clear
    leaving = not behind and rng.random() < 0.3
    pace = rng.uniform(0.2, 0.6) if leaving else pace
    course = 0.0 if behind or leaving else math.pi
    pieces = follow(x, y, course, [Leg(math.inf, pace)])
    return World((Mover(pieces, radius),), walls=walls, dotted=dotted)


def doorway(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """A wall with a door, and somebody who goes through it as the robot does.

    On a path the robot goes through too; parked it stands 0.25 to 1.5 m before it.
    """
    body = robot.footprint.vertices
    gap = body[:, 1].max() + BESIDE + rng.uniform(0.0, 0.4)
    x_w = body[:, 0].max() + rng.uniform(0.25, 1.5)
    walls = np.array([[x_w, -3.0, x_w, -gap], [x_w, gap, x_w, 3.0]])
    dotted = dots(rng, 2)
    while True:
        radius, pace = rng.uniform(0.1, 0.35), rng.uniform(0.2, 1.4)
        door = np.array([x_w, rng.uniform(-1.0, 1.0) * (gap - radius)])
        when = rng.uniform(0.5, 5.0)
        place = inside(rng, robot) + np.array([speed * when, 0.0])
        way = door - place if rng.random() < 0.4 else place - door
        if abs(way[1]) > 0.7 * abs(way[0]):
            continue
        velocity = pace * way / np.hypot(*way)
        first = place - when * velocity
        clear = point_contact(robot.footprint.edges, *first).distance - radius
        if NEAR <= clear <= FAR + 1.0:
            course = math.atan2(velocity[1], velocity[0])
            pieces = follow(first[0], first[1], course, [Leg(math.inf, pace)])
            return World((Mover(pieces, radius),), walls=walls, dotted=dotted)


def turning(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """A disc that turns at 0.2 to 1 rad/s from the first, by up to 2.5 rad."""
    turn, pace = rng.uniform(0.2, 1.0) * rng.choice([-1.0, 1.0]), rng.uniform(0.2, 1.2)
    bend = Leg(rng.uniform(1.0, 2.5) / abs(turn), pace, turn=turn)
    legs = [bend, Leg(math.inf, pace)]
    return World((coming(rng, robot, speed, legs, rng.uniform(0.1, 0.35)),))


def stop_and_go(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """A disc that stops and goes on, 1 to 3 times, for 0.4 to 2 s each; then it goes.

    Every other one stands when it is first seen.
    """
    pace, legs = rng.uniform(0.3, 1.2), []
    if rng.random() < 0.5:
        legs.append(Leg(rng.uniform(0.4, 2.0), 0.0))
    for _ in range(int(rng.integers(1, 4))):
        legs.append(Leg(rng.uniform(0.4, 2.0), pace))
        legs.append(Leg(rng.uniform(0.4, 2.0), 0.0))
    legs.append(Leg(math.inf, pace))
    return World((coming(rng, robot, speed, legs, rng.uniform(0.1, 0.35)),))


def accelerating(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """A disc that goes over from one speed to another at 0.2 to 1.5 m/s²."""
    first, last = rng.uniform(0.0, 1.2), rng.uniform(0.2, 1.4)
    rate = rng.uniform(0.2, 1.5)
    change = Leg(abs(last - first) / rate, first, math.copysign(rate, last - first))
    legs = [Leg(rng.uniform(0.0, 1.0), first), change, Leg(math.inf, last)]
    return World((coming(rng, robot, speed, legs, rng.uniform(0.1, 0.35)),))


def carts(rng: np.random.Generator, robot: Robot, speed: float) -> World:
    """A rectangle of 0.6 to 1.6 by 0.4 to 0.8 m that heads along its velocity."""
    half = rng.uniform(0.3, 0.8), rng.uniform(0.2, 0.4)
    legs = [Leg(math.inf, rng.uniform(0.2, 1.2))]
    return World((coming(rng, robot, speed, legs, 0.0, half),))


WORLDS: dict[str, Callable[[np.random.Generator, Robot, float], World]] = {
    "mixed": mixed,
    "corridor": corridor,
    "doorway": doorway,
    "turning": turning,
    "stop-and-go": stop_and_go,
    "accelerating": accelerating,
    "carts": carts,
}
"""The families that are drawn here."""

CHANGING = ("turning", "stop-and-go", "accelerating")
"""Families whose movers do not keep their velocity."""
