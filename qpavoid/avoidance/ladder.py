"""The ladder: what the judge says of a twist, and what is driven where none passes."""

from typing import NamedTuple

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.barrier_rows import BARRIER
from qpavoid.avoidance.bodies import KEEP, KIND, MOVES, TOLERANCE, TOUCH, Scene
from qpavoid.avoidance.decision import BRAKING, FILTERED, HOLDING, PLANNED, STOPPED
from qpavoid.avoidance.judge import (
    clear_end,
    first_twist,
    follow,
    is_inexact,
    keeps_from_standing,
    lowest,
    may_brake,
    moving_room,
    rests_in_time,
    room_to_brake,
)
from qpavoid.avoidance.plans import ALIKE
from qpavoid.avoidance.prediction import Plan, hold
from qpavoid.avoidance.target import END, UNTIL, Target, keep_plan, kept_plan
from qpavoid.avoidance.target import PLANNED as BY_PLAN
from qpavoid.compiled import compiled_once
from qpavoid.model.footprint import Array
from qpavoid.model.robot import braking_twist
from qpavoid.qp.exact import Box, Pair

ROUNDING = 1e-9
"""m/s; what the rows of the look-ahead leave to a twist that just keeps them."""


READY, AGAIN, WORKSPACE_TOO_SMALL = 100, -3, -2
"""Codes beside those of the statuses: the QP is written; a smaller trust region is
wanted; the memory is too small, see :func:`memory_size`."""


class Prepared(NamedTuple):
    """What is known before the QP is solved.

    Attributes:
        code: :data:`READY`, or why not.
        clearance: Of the nearest obstacle, m.
        most: Contacts for which the memory is carved.
        bodies: How many of them are in reach.
        last: Twist driven last.
        m: How many rows the QP has.
        hard: How many of them, the last, are never relaxed.
        box: Twists that can be driven next.
        wish: The twist that is desired.
        desired: The same, for the QP: less by ``rest``.
        rest: Of the way to the twist aimed at, what is left after this step.
        anchor: A twist that is good enough, the middle of the trust regions.
        target: What is aimed at.
        ahead: Whether it was looked ahead.
    """

    code: int
    clearance: float
    most: int
    bodies: int
    last: Pair
    m: int
    hard: int
    box: Box
    wish: Pair
    desired: Pair
    rest: Pair
    anchor: Pair
    target: Target
    ahead: bool


class Outcome(NamedTuple):
    """What a control step gives.

    Attributes:
        code: Number of the status.
        v: m/s.
        omega: rad/s.
        clearance: Of the nearest obstacle, m.
        slack: By which rows were relaxed, m/s.
        residual: Of the check of the answer.
        shortfall: By how much r_min will be undercut by what moves, m.
        first: Obstacle that holds the twist; −1: none.
        second: Another one.
    """

    code: int
    v: float
    omega: float
    clearance: float
    slack: float
    residual: float
    shortfall: float
    first: int
    second: int


class Verdict(NamedTuple):
    """What the judge says of a twist.

    Attributes:
        passes: Whether it may be driven.
        plan: That it begins.
        room: Least room of what moves, m; 0 for a plan that keeps clear.
    """

    passes: bool
    plan: Plan
    room: float


@compiled_once
def judged(scene: Scene, prepared: Prepared, twist: Pair) -> Verdict:
    """Judge a twist with the rest of what it is the beginning of."""
    s, target, (v, omega) = scene.settings[0], prepared.target, twist
    plan, room = hold(v, omega, s.dt), 0.0
    if s.bound != BARRIER or not s.braking_room:
        return Verdict(True, plan, room)
    aimed = (v + prepared.rest[0], omega + prepared.rest[1])
    if not prepared.ahead:
        passes = may_brake(scene, twist)
    elif target.mode < BY_PLAN:
        end = clear_end(scene, aimed, twist)
        plan, passes = hold(aimed[0], aimed[1], max(end, s.dt)), end > 0.0
    else:
        plan = target.plan
        rollout, level = follow(scene, plan, twist), lowest(scene)
        passes = keeps_from_standing(scene, rollout, 0.0, level)
        passes = passes and (not is_inexact(scene) or may_brake(scene, twist))
        if target.room < level:
            room = moving_room(scene, rollout, 1.0)
            passes = passes and room >= target.room - ALIKE
    if passes and prepared.clearance <= 0.0:
        passes = leaves_contact(scene, twist)
    if passes and s.passive and (room < -s.low or prepared.clearance <= 0.0):
        passes = rests_in_time(scene, twist) or not rests_in_time(
            scene, braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
        )
    return Verdict(passes, plan, room)


@compiled_once
def leaves_contact(scene: Scene, twist: Pair) -> bool:
    """Return whether a twist leads out of what stands and is touched, or stays."""
    if twist == (0.0, 0.0):
        return True
    s = scene.settings[0]
    rollout = follow(scene, hold(twist[0], twist[1], s.dt), twist)
    for i in range(scene.bodies.shape[0]):
        touched = scene.bodies[i, KEEP] - TOLERANCE < scene.bodies[i, TOUCH]
        if scene.bodies[i, KIND] != MOVES and touched:
            span = (s.dt, max(rollout.rest, s.dt))
            near, _ = too_near(scene, rollout, i, span, ROUNDING - TOLERANCE)
            if near:
                return False
    return True


@compiled_once
def fall_back(
    scene: Scene, prepared: Prepared, rejected: Pair, code: int, state: Array
) -> Outcome:
    """Return the last rungs of the ladder.

    The rest of the last plan where that keeps clear of what stands, and braking either
    does not or meets sooner what moves; braking where that keeps clear. Else, where
    what stands has come nearer than it was, ``rejected`` if it leaves no less room than
    braking, and braking.
    """
    s, level, kept = scene.settings[0], lowest(scene), kept_plan(state)
    brake = braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
    stop = hold(brake[0], brake[1], s.dt)
    braked = room_to_brake(scene, brake)
    room = moving_room(scene, follow(scene, stop, brake), 0.0)
    twist, plan = brake, stop
    if state[END] > 0.5 * s.dt and not is_inexact(scene):
        u = first_twist(scene, kept)
        rollout = follow(scene, kept, u)
        if keeps_from_standing(scene, rollout, 0.0, level):
            other = moving_room(scene, rollout, 0.0)
            if braked < level or other > room + ALIKE:
                twist, plan, room = u, kept, other
                code = PLANNED if code != STOPPED else code
                braked = level
    if braked < level and code != STOPPED and not is_inexact(scene):
        if room_to_brake(scene, rejected) >= braked - ROUNDING:
            twist, plan, code = rejected, hold(rejected[0], rejected[1], s.dt), FILTERED
    if code == AGAIN:
        code = HOLDING if twist == (0.0, 0.0) else BRAKING
    shortfall = -room if room < level else 0.0
    keep_plan(state, twist, plan, state[UNTIL], s.dt)
    return Outcome(
        code,
        twist[0],
        twist[1],
        prepared.clearance,
        0.0,
        0.0,
        shortfall,
        prepared.target.owner,
        -1,
    )
