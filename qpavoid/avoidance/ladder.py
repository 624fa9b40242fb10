"""Fallback policy: the twist driven if no solution of the QP is verified."""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.barrier_rows import BARRIER
from qpavoid.avoidance.body_table import body_at, moves
from qpavoid.avoidance.decision import BRAKING, HOLDING, PLANNED, RELAXED, STOPPED
from qpavoid.avoidance.judge import (
    HOLDS,
    clear_end,
    exact_rollout,
    first_twist,
    is_inexact,
    keeps_from_standing,
    lowest,
    may_brake,
    moving_room,
    no_worse_than,
    rests_in_time,
    rollout_to_rest,
    standing_room,
)
from qpavoid.avoidance.plans import ALIKE
from qpavoid.avoidance.prediction import Plan, hold, whole_steps
from qpavoid.avoidance.scene import Scene, tolerance
from qpavoid.avoidance.state import (
    CARRIED,
    END,
    ROUND,
    STUCK,
    UNTIL,
    keep_plan,
    kept_plan,
)
from qpavoid.avoidance.target import Target
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.robot import braking_twist
from qpavoid.types import Array, Box, Pair

ROW_ROUNDING = 1e-9
"""m/s; tolerance of the look-ahead rows for a twist that just satisfies them."""

READY, AGAIN, WORKSPACE_TOO_SMALL = 100, -3, -2
"""Codes other than statuses: the QP is ready; a smaller trust region is required; the
memory is too small, see :func:`qpavoid.avoidance.workspace.memory_size`."""


class Prepared(NamedTuple):
    """State of a control step before its QP is solved.

    Attributes:
        code: :data:`READY`, or the reason why not.
        clearance: Of the nearest obstacle, m.
        most: Contacts for which the memory is laid out.
        bodies: Number of bodies in reach.
        m: Number of rows of the QP.
        n_hard: Number of rows, the last ones, that are never relaxed.
        last: Twist driven last.
        box: Twists that can be driven next.
        wish: Desired twist.
        desired: Desired twist of the QP: ``wish`` − ``rest``.
        rest: Target twist − ``anchor``: what remains after this step.
        anchor: Feasible twist, centre of the trust regions.
        target: Target plan.
        ahead: Whether with look-ahead.
    """

    code: int
    clearance: float
    most: int
    bodies: int
    m: int
    n_hard: int
    last: Pair
    box: Box
    wish: Pair
    desired: Pair
    rest: Pair
    anchor: Pair
    target: Target
    ahead: bool


class Outcome(NamedTuple):
    """Result of a control step.

    Attributes:
        code: Number of the status.
        v: m/s.
        omega: rad/s.
        clearance: Of the nearest obstacle, m.
        slack: Relaxation of the rows, m/s.
        residual: Of the certificate.
        shortfall: Predicted violation of r_min of moving obstacles, m.
        first: Obstacle of an active constraint, or −1.
        second: Another one, or −1.
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


@entry
@compiled
def unsolved(code: int, twist: Pair, residual: float) -> Outcome:
    """Return the outcome of a step without a solution."""
    v, omega = twist
    return Outcome(code, v, omega, math.inf, 0.0, residual, 0.0, -1, -1)


@compiled_once
def judged(scene: Scene, prepared: Prepared, twist: Pair) -> Plan:
    """Return the verified plan of a twist; of 0 s if it is rejected."""
    s, (v, omega), end = scene.settings[0], twist, scene.settings[0].dt
    if s.bound == BARRIER and s.braking_room:
        target = prepared.target
        if prepared.ahead and twist == prepared.anchor and target.mode <= ROUND:
            # Verified when the target was chosen.
            v, omega, end = target.plan.v, target.plan.omega, target.plan.end
        elif prepared.ahead:
            # The QP is stated for the first step; the target it leads to is verified.
            v, omega = v + prepared.rest[0], omega + prepared.rest[1]
            least = 0.0
            if target.mode == ROUND and not is_rest(target.plan):
                least = whole_steps(min(target.plan.end, HOLDS[1]), s.dt)
            end = clear_end(scene, (v, omega), twist, least)
        elif not may_brake(scene, twist):
            end = 0.0
        if end > 0.0 and not leaves_contact(scene, prepared, twist, 0.0):
            end = 0.0
    return hold(v, omega, end)


@compiled_once
def leaves_contact(scene: Scene, prepared: Prepared, twist: Pair, room: float) -> bool:
    """Return whether a twist resolves contacts, or is rest.

    And, with ``passive`` and a predicted contact, whether it brakes in time.
    """
    s = scene.settings[0]
    touches = prepared.clearance <= 0.0
    if touches and not leaves_standing(scene, twist):
        return False
    caught = s.passive != 0 and (touches or room < -s.r_min_slow)
    return not caught or rests_in_time(scene, twist)


@compiled_once
def leaves_standing(scene: Scene, twist: Pair) -> bool:
    """Return whether a twist resolves contacts with static bodies, or is rest."""
    if twist == (0.0, 0.0):
        return True
    s = scene.settings[0]
    rollout = rollout_to_rest(scene, twist)
    for i in range(scene.bodies.shape[0]):
        body = body_at(scene, i)
        touched = body.keep - tolerance(scene) < body.inflation
        # keep_at_most has removed all of r_min: the surfaces are in contact.
        if not moves(scene, i) and touched:
            span = (s.dt, max(rollout.rest, s.dt))
            level = ROW_ROUNDING - tolerance(scene)
            near, _ = too_near(scene, rollout, i, span, level, 0.0)
            if near:
                return False
    return True


class Choice(NamedTuple):
    """A fallback: plan driven instead of the QP's solution.

    Attributes:
        code: Of the status.
        twist: v, m/s, and ω, rad/s: the beginning of ``plan``.
        plan: The plan.
        room: Least margin, m; clear if at least −ε.
        until: s for which the margin of moving bodies is verified.
        residual: Of the certificate of the QP's solution.
    """

    code: int
    twist: Pair
    plan: Plan
    room: float
    until: float
    residual: float


@compiled
def is_rest(plan: Plan) -> bool:
    """Return whether a plan is standing still."""
    first, then = (plan.v, plan.omega), (plan.v_then, plan.omega_then)
    return first == (0.0, 0.0) and then == (0.0, 0.0)


@compiled_once
def fall_back(
    scene: Scene, prepared: Prepared, rejected: Outcome, state: Array
) -> Outcome:
    """Return the outcome of the fallbacks: plan found, plan retained, braking.

    First the plan that the look-ahead found. Second the rest of the last plan, if it is
    clear of static bodies and braking is not, or hits a moving body sooner. Last
    braking; or the rejected twist, if static bodies are nearer than predicted and it
    leaves no smaller margin than braking.
    """
    s, level, target = scene.settings[0], lowest(scene), prepared.target
    code, residual = rejected.code, rejected.residual
    solved = code != STOPPED
    if prepared.ahead and target.mode != STUCK and solved:
        if leaves_contact(scene, prepared, prepared.anchor, target.room):
            rests = prepared.anchor == (0.0, 0.0) and is_rest(target.plan)
            code = HOLDING if rests else PLANNED
            if target.room < level:
                code = RELAXED
            until = state[UNTIL] if target.mode == CARRIED else s.horizon
            found = Choice(code, prepared.anchor, target.plan, target.room, until, 0.0)
            return driven(scene, prepared, found, state)
    brake = braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
    plan = hold(brake[0], brake[1], s.dt)
    stop = rollout_to_rest(scene, brake)
    braked, met = standing_room(scene, stop, level), moving_room(scene, stop, 0.0)
    if solved:
        code = HOLDING if brake == (0.0, 0.0) else BRAKING
    # Static bodies count only if braking is not clear of them.
    room = min(met, braked if braked < level else 0.0)
    choice = Choice(code, brake, plan, room, state[UNTIL], residual)
    # The robot is not exactly on the last plan: only braking along the arc is exact.
    if is_inexact(scene):
        return driven(scene, prepared, choice, state)
    kept = kept_plan(state)
    if state[END] > 0.5 * s.dt:
        twist = first_twist(scene, kept)
        rollout = exact_rollout(scene, kept, twist)
        room = moving_room(scene, rollout, 0.0)
        # ALIKE: else rounding would make it switch back and forth.
        better = braked < level or room > met + ALIKE
        if better and keeps_from_standing(scene, rollout, level):
            if leaves_contact(scene, prepared, twist, room):
                if solved:
                    code = PLANNED if room >= level else RELAXED
                choice = Choice(code, twist, kept, room, state[UNTIL], residual)
                return driven(scene, prepared, choice, state)
    twist = (rejected.v, rejected.omega)
    if braked < level and solved and no_worse_than(scene, brake, twist):
        plan = hold(twist[0], twist[1], s.dt)
        choice = Choice(RELAXED, twist, plan, choice.room, state[UNTIL], residual)
    return driven(scene, prepared, choice, state)


@compiled_once
def driven(scene: Scene, prepared: Prepared, choice: Choice, state: Array) -> Outcome:
    """Retain the plan of a fallback; return the outcome."""
    keep_plan(state, choice.twist, choice.plan, choice.until, scene.settings[0].dt)
    shortfall = -choice.room if choice.room < lowest(scene) else 0.0
    owner, (v, omega) = prepared.target.owner, choice.twist
    clearance, residual = prepared.clearance, choice.residual
    return Outcome(
        choice.code, v, omega, clearance, 0.0, residual, shortfall, owner, -1
    )
