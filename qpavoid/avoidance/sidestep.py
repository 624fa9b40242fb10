"""Aside: a robot that stands before something at rest is turned until it is past.

For teleoperation and foreign planners, which say where to and no more: no pose is given
here, the robot is where the twists that were driven have led it. Where it has come less
than :data:`PROGRESS` of the desired way for :data:`STALL` s, and what bars the way
straight on stands still, lanes are searched; what moves is waited for.

Lanes (:mod:`qpavoid.avoidance.lanes`) are along the heading that the robot had as it
came to stand. It goes on into the nearest until it is there, or late; then the user's
wish counts again. The wish may be to drive backwards: then left and right are those of
the way. Another wish, to turn or to stop, counts at once. Where there is no lane for
:data:`BLOCKED_TIME` s the robot holds, and looks on; after :data:`TRIES` lanes that led
no farther, or one that the filter did not let it come into in time, only at the way
straight on.

All of it is but another desired twist: the filter has the last word. A round of looks
takes as many control steps as there are :data:`BACKS`, each some milliseconds at most
among 360 points.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.barrier_rows import SPEED_AT_REST, wanted_distance
from qpavoid.avoidance.lanes import (
    BARRED_WITHIN,
    HERE,
    NO_LANE,
    ON,
    Lane,
    LaneSearch,
    best_lane,
    free_share,
    leads_on,
    nearest,
)
from qpavoid.avoidance.scene import Setup
from qpavoid.avoidance.state import OMEGA, V
from qpavoid.model.capsules import like
from qpavoid.model.contacts import empty_contacts
from qpavoid.model.kinematics import TINY, arc
from qpavoid.model.robot import limits_of
from qpavoid.types import Array, Arrays, Pair

WANTS, STEERS = 0.02, 0.2
"""m/s that want to move; rad/s with which the user steers himself."""

STALL, PROGRESS, BLOCKED_TIME = 1.0, 0.2, 10.0
"""s without so much of the desired way are a stall; s of it until it is blocked."""

AGAIN, TRIES, PATIENCE = 1.0, 4, 3.0
"""s between two rounds of looks; lanes that may be missed; how many times as long as it
needs, and 1 s more, one may take."""

TURN, GAIN, ALIGNED, BACK = 1.0, 3.0, 0.2, 0.02
"""rad/s, the greatest; 1/s; rad with which it stops, and with which it is back."""

SLOW, BACKS = 0.2, (0.0, 0.2, 0.4, 0.8)
"""m/s into a lane, and to back up; m."""


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
    lane: Lane = NO_LANE
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
        # Another wish: what was remembered was about the last one.
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
            # It gets on: the mark is here.
            if math.copysign(x, x * v) > PROGRESS * STALL * abs(v):
                return Sidestep(wish, wish=v)
            if now.still < STALL:
                return now._replace(looks=-1)
        search = lane_search(setup, v, obstacles, age, x)
        if now.acts:
            return now._go_on(search, abs(driven_v) * dt)
        return now._look(search)

    def _hold(self) -> "Sidestep":
        """Pass the wish on for a while, then hold."""
        return self._replace(desired=(0.0, 0.0)) if self.blocked else self

    def _look(self, search: LaneSearch) -> "Sidestep":
        """Wait for what moves, else look for a lane."""
        if self.looks >= len(BACKS):
            return self._hold()
        v, time = search.v, BARRED_WITHIN / abs(search.v)
        share = free_share(search, HERE, (v, 0.0), time)
        _, speed = nearest(search, arc(*HERE, v, 0.0, share * time))
        # The way is free, or barred by what will go away.
        if share == 1.0 or speed > SPEED_AT_REST:
            return Sidestep(self.desired, wish=self.wish)
        lane = NO_LANE
        if self.tries < TRIES:
            lane = best_lane(search, -self.heading, BACKS[self.looks])
        return self._enter(search, lane) if lane.aside < math.inf else self._hold()

    def _enter(self, search: LaneSearch, lane: Lane) -> "Sidestep":
        """Begin to go into a lane, or to turn back."""
        time = abs(lane.angle - self.heading) / max(search.turn, TINY)
        time += lane.far / abs(search.v) + lane.back / max(abs(search.reverse), TINY)
        left = PATIENCE * (1.0 + time)
        now = self._replace(acts=True, lane=lane, left=left)
        return now._drive(search)

    def _go_on(self, search: LaneSearch, way: float) -> "Sidestep":
        """Go on, having come so far, m; turn back; or look anew."""
        lane, error, late = self.lane, self.lane.angle - self.heading, self.left <= 0.0
        now = self._replace(tries=TRIES if late else self.tries)
        if lane.angle == 0.0:
            if abs(error) > BACK and not late:
                return now._drive(search)
            return now._replace(acts=False, tries=now.tries + 1, looks=0)._look(search)
        if lane.back > 0.0:
            lane = lane._replace(back=lane.back - way)
        elif abs(error) < ALIGNED:
            lane = lane._replace(far=lane.far - way)
        if late or leads_on(search, HERE, -self.heading):
            return now._enter(search, NO_LANE)
        return now._replace(lane=lane)._drive(search)

    def _drive(self, search: LaneSearch) -> "Sidestep":
        """Desire what leads into the lane: back up, turn, drive, turn back."""
        lane, error = self.lane, self.lane.angle - self.heading
        if lane.back > 0.0:
            return self._replace(desired=(search.reverse, 0.0))
        omega = min(max(GAIN * error, -search.turn), search.turn)
        v = min(abs(search.v), max(GAIN * lane.far, SLOW))
        share = max(1.0 - abs(error) / ALIGNED, 0.0) if lane.angle != 0.0 else 0.0
        return self._replace(desired=(math.copysign(share * v, search.v), omega))


def lane_search(
    setup: Setup, v: float, obstacles: Arrays, age: float, come: float
) -> LaneSearch:
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
    return LaneSearch(
        edges,
        obstacles,
        like(obstacles),
        empty_contacts(edges, obstacles),
        limits.circumradius,
        wanted_distance(setup.settings, 0.0, age)[1],
        v,
        turn,
        min(max(-math.copysign(SLOW, v), limits.v_min), limits.v_max),
        ON * limits.circumradius - math.copysign(come, come * v),
    )
