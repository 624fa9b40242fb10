"""Aside: a robot that stands before something at rest is turned until it is past.

For teleoperation and foreign planners, which say where to and no more. There is no pose
here: where the robot is follows from the twists that were driven. A *lane* is a way
straight on beside the robot, along the heading that it had as it came to stand: for
:data:`ON` circumradii of the footprint it keeps :data:`SPARE` more than r_min from
everything at hand. To get there the robot backs up as little as it must, turns on the
spot, drives straight on and turns back. All of this is looked at before by conservative
advancement [Mirtich1996] along its arcs; what moves counts as where it is. It is but
another desired twist: the filter has the last word.
"""

import math
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.barrier_rows import STILL, wanted_distance
from qpavoid.avoidance.bodies import Setup
from qpavoid.compiled import compiled_once
from qpavoid.model.capsules import in_robot_frame, like
from qpavoid.model.contacts import contact_at, contact_table, most_contacts
from qpavoid.model.kinematics import TINY, arc
from qpavoid.model.robot import limits_of
from qpavoid.types import Array, Arrays, Pair, Pose

WANTS, STEERS = 0.02, 0.3
"""m/s that want to move; rad/s with which the user steers himself."""

STALL, PROGRESS, BLOCKED_TIME = 1.0, 0.1, 10.0
"""s without so much of the desired way are a stall; s of it until it is blocked."""

AGAIN, TRIES, PATIENCE = 0.5, 3, 3.0
"""s between two looks; lanes that may be missed; the time that one may take, as a
multiple of what it takes, and in s."""

SPARE, FINE, HARDLY = 0.01, 0.02, 1e-4
"""m beyond r_min; between two looks along a way, at least; that a way may come nearer
than it begins."""

ON, NEAR, FARTHEST, APART = 2.0, 0.1, 2.0, 0.1
"""Circumradii that a lane leads on; m that bar the straight way; how far aside the
farthest lane is, and the next one."""

ANGLES = tuple(math.radians(angle) for angle in (30, 50, 70, 90))
REFINEMENTS, EQUAL = 8, 1e-6
"""How often the nearest lane is bisected; m that make no difference between sides."""

TURN, GAIN, ALIGNED, BACK = 1.0, 3.0, 0.2, 0.02
"""rad/s, the greatest; 1/s; rad with which it stops, and with which it is back."""

SLOW, BACKS = 0.2, (0.0, 0.2, 0.4, 0.8)
"""m/s into a lane, and to back up; m."""

HERE = (0.0, 0.0, 0.0)


class Course(NamedTuple):
    """What is driven, among what.

    Attributes:
        edges: Of the footprint.
        obstacles: Robot frame.
        seen: The same from a pose: memory.
        contacts: Memory.
        radius: Circumradius, m.
        keep: Distance to keep, m.
        v: m/s.
        turn: rad/s.
        reverse: m/s of backing up.
        ahead: How far lanes lead at least, from the robot along their heading, m.
    """

    edges: Array
    obstacles: Arrays
    seen: Arrays
    contacts: Array
    radius: float
    keep: float
    v: float
    turn: float
    reverse: float
    ahead: float


class Lane(NamedTuple):
    """A way into a lane.

    Attributes:
        aside: How far the lane is from the robot, m; ``inf``: there is none.
        angle: Of the way there from the lane, rad.
        far: How long that is, m.
    """

    aside: float
    angle: float
    far: float


NONE = Lane(math.inf, 0.0, 0.0)


@compiled_once
def nearest(course: Course, pose: Pose) -> Pair:
    """Return the room of a pose, m, and the speed of what is nearest, m/s."""
    in_robot_frame(pose, 0.0, course.obstacles, course.seen)
    contacts = course.contacts
    edges, radius = course.edges, course.radius
    _, row = contact_table(edges, radius, course.seen, 0.0, contacts)
    if row < 0:
        return math.inf, 0.0
    c = contact_at(contacts, row)
    return c.distance - course.keep, math.sqrt(c.v_x * c.v_x + c.v_y * c.v_y)


@compiled_once
def free_share(course: Course, pose: Pose, twist: Pair, time: float) -> float:
    """Return the share of a time for which a twist may be held from a pose.

    It may come as near as :data:`SPARE`, or as it is at first.
    """
    (x, y, heading), (v, omega) = pose, twist
    room, _ = nearest(course, pose)
    level, now = min(SPARE, room - HARDLY), 0.0
    fastest = abs(v) + abs(omega) * course.radius
    while now < time:
        before = now
        now = min(now + max(room - level, FINE) / fastest, time)
        room, _ = nearest(course, arc(x, y, heading, v, omega, now))
        if room < level:
            return before / time
    return 1.0


@compiled_once
def can_turn(course: Course, pose: Pose, heading: float) -> bool:
    """Return whether the robot can turn to a heading at a pose."""
    angle = heading - pose[2]
    if course.turn == 0.0:
        return angle == 0.0
    time, omega = abs(angle) / course.turn, math.copysign(course.turn, angle)
    return free_share(course, pose, (0.0, omega), time) == 1.0


@compiled_once
def leads_on(course: Course, pose: Pose, heading: float) -> bool:
    """Return whether the robot can turn to a heading at a pose, and drive on."""
    (x, y, _), v = pose, course.v
    there = (x, y, heading)
    if nearest(course, there)[0] < SPARE or not can_turn(course, pose, heading):
        return False
    come = math.copysign(1.0, v) * (x * math.cos(heading) + y * math.sin(heading))
    time = max(course.ahead - come, course.radius) / abs(v)
    return free_share(course, there, (v, 0.0), time) == 1.0


@compiled_once
def nearest_lane(course: Course, pose: Pose, heading: float, side: float) -> Lane:
    """Return the nearest lane along a heading on a side, 1 or −1; or :data:`NONE`."""
    best, (x, y, _), v = NONE, pose, course.v
    for angle in ANGLES:
        sin, toward = math.sin(angle), heading + side * angle
        there, time = (x, y, toward), FARTHEST / math.sin(angle) / abs(v)
        if not can_turn(course, pose, toward):
            continue
        far = FARTHEST * free_share(course, there, (v, 0.0), time)
        for k in range(1, int(min(far, best.aside) / APART) + 1):
            at = arc(x, y, toward, v, 0.0, k * APART / sin / abs(v))
            if leads_on(course, at, heading):
                low, high = (k - 1) * APART, k * APART
                for _ in range(REFINEMENTS):
                    middle = 0.5 * (low + high)
                    at = arc(x, y, toward, v, 0.0, middle / sin / abs(v))
                    if leads_on(course, at, heading):
                        high = middle
                    else:
                        low = middle
                if high < best.aside - FINE:
                    best = Lane(high, side * angle, high / sin)
                break
    return best


class Sidestep(NamedTuple):
    """What is remembered, and what is desired: a value, one follows from another.

    Attributes:
        desired: v (m/s), ω (rad/s), in place of what the user desires.
        blocked: Whether there is no way.
        wish: What the user desires, m/s.
        still: s since the mark: the place where the robot got on last.
        x: Way since then, along the heading there, m.
        heading: Less that of the mark, rad.
        due: s until the next look.
        looks: How many there were since the mark.
        tries: Lanes missed since the mark.
        side: On which the robot goes aside, −1 or 1; 0: it does not.
        back: m to back up first.
        lane: The way there; its angle is 0 on the way back.
        left: s for that.
    """

    desired: Pair = (0.0, 0.0)
    blocked: bool = False
    wish: float = 0.0
    still: float = 0.0
    x: float = 0.0
    heading: float = 0.0
    due: float = 0.0
    looks: int = 0
    tries: int = 0
    side: float = 0.0
    back: float = 0.0
    lane: Lane = NONE
    left: float = 0.0

    def step(
        self, setup: Setup, wish: Pair, driven: Pair, obstacles: Arrays, age: float
    ) -> "Sidestep":
        """Return what follows in the next control step.

        Args:
            setup: Of the filter.
            wish: The desired twist.
            driven: Twist in the last control step.
            obstacles: Robot frame.
            age: Of them, s.
        """
        limits, dt = limits_of(setup.robot), setup.settings["dt"].item()
        v = min(max(wish[0], limits.v_min), limits.v_max)
        wants = abs(v) > WANTS and abs(wish[1]) <= STEERS
        if not wants or v * self.wish < 0.0:
            return Sidestep(wish)
        x, _, heading = arc(self.x, 0.0, self.heading, *driven, dt)
        now = self._replace(
            desired=wish,
            wish=v,
            still=self.still + dt,
            x=x,
            heading=heading,
            due=self.due - dt,
            left=self.left - dt,
        )
        if now.side == 0.0:
            if math.copysign(x, x * v) > PROGRESS * STALL * abs(v):
                return Sidestep(wish, wish=v)
            if now.still < STALL:
                return now
        course = course_of(setup, v, obstacles, age, x)
        if now.side != 0.0:
            return now._go_on(course, abs(driven[0]) * dt)
        return now._look(course) if now.due <= 0.0 else now._hold()

    def _hold(self) -> "Sidestep":
        if self.still < BLOCKED_TIME:
            return self
        return self._replace(desired=(0.0, 0.0), blocked=True)

    def _look(self, course: Course) -> "Sidestep":
        """Wait for what moves, else look for a lane on both sides."""
        now, v = self._replace(due=AGAIN, looks=self.looks + 1), course.v
        time = NEAR / abs(v)
        share = free_share(course, HERE, (v, 0.0), time)
        ahead = arc(*HERE, v, 0.0, share * time)
        moves = nearest(course, ahead)[1] > STILL
        if share == 1.0 or moves:
            return Sidestep(self.desired, wish=self.wish)
        if self.tries >= TRIES:
            return now._hold()
        back = BACKS[self.looks % len(BACKS)]
        lane = best_lane(course, -self.heading, back)
        if lane.aside == math.inf:
            return now._hold()
        side = math.copysign(1.0, lane.angle)
        now = now._replace(side=side, back=back, blocked=False)
        return now._into(lane, course)._drive(course)

    def _into(self, lane: Lane, course: Course) -> "Sidestep":
        time = abs(lane.angle - self.heading) / max(course.turn, TINY)
        time += lane.far / abs(course.v) + self.back / max(abs(course.reverse), TINY)
        return self._replace(lane=lane, left=PATIENCE * (time + 1.0), due=AGAIN)

    def _go_on(self, course: Course, way: float) -> "Sidestep":
        """Go on to the lane, along it, or give it up."""
        now, lane = self, self.lane
        if self.back > 0.0 and self.left > 0.0:
            return self._replace(back=self.back - way)._drive(course)
        if lane.angle == 0.0:
            if abs(self.heading) < BACK:
                return Sidestep(self.desired, wish=self.wish)
            if self.left <= 0.0:
                return self._replace(side=0.0, tries=self.tries + 1)._hold()
            return self._drive(course)
        if abs(lane.angle - self.heading) < ALIGNED:
            now = now._replace(lane=lane._replace(far=lane.far - way))
        if self.left <= 0.0:
            return now._into(NONE._replace(far=0.0), course)._drive(course)
        if leads_on(course, HERE, -self.heading):
            return now._into(NONE, course)._drive(course)
        return now._drive(course)

    def _drive(self, course: Course) -> "Sidestep":
        error = self.lane.angle - self.heading
        omega = min(max(GAIN * error, -course.turn), course.turn)
        v = 0.0
        if self.back > 0.0:
            v, omega = course.reverse, 0.0
        elif self.lane.angle != 0.0:
            v = min(abs(course.v), max(GAIN * self.lane.far, SLOW))
            v = math.copysign(v * max(1.0 - abs(error) / ALIGNED, 0.0), course.v)
        return self._replace(desired=(v, omega))


def best_lane(course: Course, heading: float, back: float) -> Lane:
    """Return the nearest lane after backing up so far, m; the right of two as near."""
    v, time = course.reverse, 0.0
    if back > 0.0:
        time = back / max(abs(v), TINY)
        if v == 0.0 or free_share(course, HERE, (v, 0.0), time) < 1.0:
            return NONE
    pose = arc(*HERE, v, 0.0, time)
    sides = (-1.0, 1.0) if course.v > 0.0 else (1.0, -1.0)
    right, left = (nearest_lane(course, pose, heading, side) for side in sides)
    return right if right.aside <= left.aside + EQUAL else left


def course_of(
    setup: Setup, v: float, obstacles: Arrays, age: float, come: float
) -> Course:
    """Return what is driven, and among what.

    Args:
        setup: Of the filter.
        v: m/s.
        obstacles: Robot frame.
        age: Of them, s.
        come: Way since the mark, m.
    """
    limits, edges = limits_of(setup.robot), setup.edges
    turn = min(TURN, limits.omega_max, -limits.omega_min)
    turn = min(turn, limits.angular_acceleration / GAIN)
    return Course(
        edges,
        obstacles,
        like(obstacles),
        np.empty((most_contacts(edges, obstacles), 9)),
        limits.circumradius,
        wanted_distance(setup.settings, 0.0, age)[1],
        v,
        turn,
        min(max(-math.copysign(SLOW, v), limits.v_min), limits.v_max),
        ON * limits.circumradius - math.copysign(come, come * v),
    )
