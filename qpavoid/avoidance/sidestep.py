"""Aside: a robot that stands before something at rest is turned until it is past.

For teleoperation and foreign planners, which say where to and no more: no pose is given
here, the robot is where the twists that were driven have led it. Where it has come less
than :data:`PROGRESS` of the desired way for :data:`STALL` s, and what bars the way
straight on stands still, lanes are searched; what moves is waited for.

A *lane* is a way beside the robot along the heading that it had as it came to stand:
for :data:`ON` circumradii of the footprint it keeps :data:`SPARE` more than r_min from
everything at hand. To get there the robot backs up as little as it must, turns on the
spot, drives straight on and turns back; then the user's wish counts again. All of this
is looked at before by conservative advancement [Mirtich1996] along its arcs; what moves
counts as where it is. Of all lanes the nearest is taken, of two as near that on the
right; the robot goes on into that one until it is there, or late. The wish may be to
drive backwards: then left and right are those of the way. Another wish, to turn or to
stop, counts at once. Where there is no lane for :data:`BLOCKED_TIME` s the robot holds,
and looks on; after :data:`TRIES` lanes that led no farther, or one that the filter did
not let it come into in time, only at the way straight on.

All of it is but another desired twist: the filter has the last word. A round of looks
takes as many control steps as there are :data:`BACKS`, each some milliseconds at most
among 360 points.
"""

import math
from typing import NamedTuple

import numpy as np

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST, wanted_distance
from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.state import OMEGA, V
from qpavoid.compiled import compiled_once
from qpavoid.model.capsules import in_robot_frame, like
from qpavoid.model.contacts import contact_at, contact_table, most_contacts
from qpavoid.model.kinematics import TINY, arc
from qpavoid.model.robot import limits_of
from qpavoid.types import Array, Arrays, Pair, Pose

WANTS, STEERS = 0.02, 0.2
"""m/s that want to move; rad/s with which the user steers himself."""

STALL, PROGRESS, BLOCKED_TIME = 1.0, 0.2, 10.0
"""s without so much of the desired way are a stall; s of it until it is blocked."""

AGAIN, TRIES, PATIENCE = 1.0, 4, 3.0
"""s between two rounds of looks; lanes that may be missed; how many times as long as it
needs, and 1 s more, one may take."""

SPARE, FINE, NEARER = 0.02, 0.02, 1e-4
"""m beyond r_min; between two looks along a way, at least; that a way may come nearer
than it begins."""

ON, NEAR, FARTHEST, APART = 2.0, 0.1, 2.0, 0.1
"""Circumradii that a lane leads on; m that bar the straight way; how far aside the
farthest lane is, and the next one."""

LANE_PITCH, EQUAL = 1e-3, 1e-6
"""m to which the nearest lane is known; that make no difference between two."""

ANGLES = tuple(math.radians(a) for a in (-30, 30, -50, 50, -70, 70, -90, 90))
"""Ways into a lane; of two as near the first one, on the right."""

TURN, GAIN, ALIGNED, BACK = 1.0, 3.0, 0.2, 0.02
"""rad/s, the greatest; 1/s; rad with which it stops, and with which it is back."""

SLOW, BACKS = 0.2, (0.0, 0.2, 0.4, 0.8)
"""m/s into a lane, and to back up; m."""

HERE = (0.0, 0.0, 0.0)
"""Where the robot is."""


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
        back: How far to back up before, m.
    """

    aside: float
    angle: float
    far: float
    back: float


NONE = Lane(math.inf, 0.0, 0.0, 0.0)


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
    level, now = min(SPARE, room - NEARER), 0.0
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
def nearest_lane(course: Course, pose: Pose, heading: float, angle: float) -> float:
    """Return how far aside the nearest lane along a heading is, m; ``inf``: none.

    That is how far the robot drives at an angle to it until it :func:`leads_on`.
    """
    (x, y, _), v, toward = pose, course.v, heading + angle
    if not can_turn(course, pose, toward):
        return math.inf
    time = 1.0 / (abs(v) * math.sin(abs(angle)))
    far = FARTHEST * free_share(course, (x, y, toward), (v, 0.0), FARTHEST * time)
    aside, step, found = 0.0, APART, math.inf
    while step > LANE_PITCH and aside + step <= far:
        at = arc(x, y, toward, v, 0.0, (aside + step) * time)
        if leads_on(course, at, heading):
            found, step = aside + step, 0.5 * step
        else:
            aside += step
    return found


@compiled_once
def best_lane(course: Course, heading: float, back: float) -> Lane:
    """Return the nearest lane after backing up so far, m; the right of two as near."""
    best, v, time = NONE, course.reverse, 0.0
    if back > 0.0:
        time = back / max(abs(v), TINY)
        if v == 0.0 or free_share(course, HERE, (v, 0.0), time) < 1.0:
            return NONE
    pose = arc(0.0, 0.0, 0.0, v, 0.0, time)
    for angle in ANGLES:
        aside = nearest_lane(course, pose, heading, angle)
        if aside < best.aside - EQUAL:
            best = Lane(aside, angle, aside / math.sin(abs(angle)), back)
    return best


class Sidestep(NamedTuple):
    """What is remembered, and what is desired: a value, one follows from another.

    Attributes:
        desired: v (m/s), ω (rad/s), in place of what the user desires.
        wish: What the user desires, m/s.
        still: s since the mark: the place where the robot got on last.
        x: Way since then, along the heading there, m.
        heading: Less that of the mark, rad.
        looks: Control steps since the last round of looks began.
        tries: Lanes tried since the mark.
        acts: Whether the robot is on its way into a lane.
        lane: What is left of that; its angle is 0 while it turns back.
        left: s for it.
    """

    desired: Pair = (0.0, 0.0)
    wish: float = 0.0
    still: float = 0.0
    x: float = 0.0
    heading: float = 0.0
    looks: int = 0
    tries: int = 0
    acts: bool = False
    lane: Lane = NONE
    left: float = 0.0

    @property
    def blocked(self) -> bool:
        """Whether no way has been found for long."""
        return self.still >= BLOCKED_TIME and not self.acts

    def step(
        self, setup: Setup, wish: Pair, obstacles: Arrays, age: float, state: Array
    ) -> "Sidestep":
        """Return what follows in the next control step.

        Args:
            setup: Of the filter.
            wish: The desired twist.
            obstacles: Robot frame.
            age: Of them, s.
            state: Of the filter, before that step.
        """
        limits, dt = limits_of(setup.robot), setup.settings["dt"].item()
        v = min(max(wish[0], limits.v_min), limits.v_max)
        wants = abs(v) > WANTS and abs(wish[1]) <= STEERS
        if not wants or v * self.wish < 0.0:
            return Sidestep(wish)
        driven_v, driven_omega = state[V].item(), state[OMEGA].item()
        x, _, heading = arc(self.x, 0.0, self.heading, driven_v, driven_omega, dt)
        now = self._replace(
            desired=wish,
            wish=v,
            still=self.still + dt,
            x=x,
            heading=heading,
            looks=self.looks + 1 if self.looks * dt < AGAIN else 0,
            left=self.left - dt,
        )
        if not now.acts:
            if math.copysign(x, x * v) > PROGRESS * STALL * abs(v):
                return Sidestep(wish, wish=v)
            if now.still < STALL:
                return now._replace(looks=-1)
        course = course_of(setup, v, obstacles, age, x)
        if now.acts:
            return now._go_on(course, abs(driven_v) * dt)
        return now._look(course)

    def _hold(self) -> "Sidestep":
        """Pass the wish on for a while, then hold."""
        return self._replace(desired=(0.0, 0.0)) if self.blocked else self

    def _look(self, course: Course) -> "Sidestep":
        """Wait for what moves, else look for a lane."""
        if self.looks >= len(BACKS):
            return self._hold()
        v, time = course.v, NEAR / abs(course.v)
        share = free_share(course, HERE, (v, 0.0), time)
        _, speed = nearest(course, arc(*HERE, v, 0.0, share * time))
        if share == 1.0 or speed > SPEED_AT_REST:
            return Sidestep(self.desired, wish=self.wish)
        lane = NONE
        if self.tries < TRIES:
            lane = best_lane(course, -self.heading, BACKS[self.looks])
        return self._enter(course, lane) if lane.aside < math.inf else self._hold()

    def _enter(self, course: Course, lane: Lane) -> "Sidestep":
        """Begin to go into a lane, or to turn back."""
        time = abs(lane.angle - self.heading) / max(course.turn, TINY)
        time += lane.far / abs(course.v) + lane.back / max(abs(course.reverse), TINY)
        left = PATIENCE * (1.0 + time)
        now = self._replace(acts=True, lane=lane, left=left)
        return now._drive(course)

    def _go_on(self, course: Course, way: float) -> "Sidestep":
        """Go on, having come so far, m; turn back; or look anew."""
        lane, error, late = self.lane, self.lane.angle - self.heading, self.left <= 0.0
        now = self._replace(tries=TRIES if late else self.tries)
        if lane.angle == 0.0:
            if abs(error) > BACK and not late:
                return now._drive(course)
            return now._replace(acts=False, tries=now.tries + 1, looks=0)._look(course)
        if lane.back > 0.0:
            lane = lane._replace(back=lane.back - way)
        elif abs(error) < ALIGNED:
            lane = lane._replace(far=lane.far - way)
        if late or leads_on(course, HERE, -self.heading):
            return now._enter(course, NONE)
        return now._replace(lane=lane)._drive(course)

    def _drive(self, course: Course) -> "Sidestep":
        """Desire what leads into the lane: back up, turn, drive, turn back."""
        lane, error = self.lane, self.lane.angle - self.heading
        if lane.back > 0.0:
            return self._replace(desired=(course.reverse, 0.0))
        omega = min(max(GAIN * error, -course.turn), course.turn)
        v = min(abs(course.v), max(GAIN * lane.far, SLOW))
        share = max(1.0 - abs(error) / ALIGNED, 0.0) if lane.angle != 0.0 else 0.0
        return self._replace(desired=(math.copysign(share * v, course.v), omega))


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
