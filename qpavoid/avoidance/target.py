"""Choice of the target plan: the desired twist, another constant one, or two twists.

In this order: the desired twist if it is clear; the cheapest constant twist that is;
the rest of the verified plan; a plan of two twists, the one with the largest margin if
none is clear.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.body_table import any_moves, body_at, moves
from qpavoid.avoidance.broad_phase import UNWATCHED, Watch, first_met, keeps_all
from qpavoid.avoidance.judge import (
    clear_end,
    exact_rollout,
    first_target,
    first_twist,
    is_inexact,
    keeps_clear,
    keeps_from_standing,
    lowest,
    may_brake,
    moving_room,
    rollout_to_rest,
    standing_room,
)
from qpavoid.avoidance.lookahead import (
    Candidate,
    Query,
    cost_of,
    driven_on,
    first_near,
    refine_candidate,
    twist_cost,
)
from qpavoid.avoidance.plans import ALIKE, NO_ROOM, SHARES, best_plan, is_refused
from qpavoid.avoidance.prediction import Plan, hold, whole_steps
from qpavoid.avoidance.scene import Scene, altered
from qpavoid.avoidance.state import (
    CARRIED,
    DUE,
    END,
    FREE,
    GROUP,
    NEW_PLAN,
    ROUND,
    SHARE,
    STUCK,
    TARGET_MODE,
    UNTIL,
    kept_plan,
)
from qpavoid.compiled import compiled_once
from qpavoid.model.robot import RELATIVE_ROUNDING
from qpavoid.types import Array, Pair

CHEAP = 1e-3
"""(m/s)²; cost below which no other start is searched."""

GROUPS = 4
"""Groups of starts: ahead to either side; the desired twist and rest; straight back and
straight ahead; back to either side. Mirror images are in the same group."""


class Target(NamedTuple):
    """Target of a step.

    Attributes:
        plan: Its first twist is the target.
        mode: How it was found; see :mod:`qpavoid.avoidance.state`.
        room: Least margin of moving bodies, m; clear if at least −ε.
        owner: Obstacle that the desired twist violates, or −1.
    """

    plan: Plan
    mode: float
    room: float
    owner: int


@compiled_once
def choose_target(scene: Scene, query: Query, state: Array) -> Target:
    """Return the target plan.

    If it would hit a moving obstacle, retry with the smaller static clearance
    ``closest``, and take the result if its margin is larger.
    """
    target = look_ahead(scene, query, state)
    if target.mode == NEW_PLAN or target.mode == STUCK:
        target = come_closer(scene, query, state, target)
    state[TARGET_MODE] = target.mode
    if target.mode == ROUND:
        state[SHARE] = 0.0
    elif target.mode == NEW_PLAN or target.mode == STUCK:
        state[SHARE] = state[SHARE] % SHARES + 1.0
    return target


@compiled_once
def come_closer(scene: Scene, query: Query, state: Array, target: Target) -> Target:
    """Return the target with the smaller static clearance, if it is better."""
    room = target.room
    if target.mode == STUCK:
        brake = first_twist(scene, hold(0.0, 0.0, 0.0))
        room = moving_room(scene, rollout_to_rest(scene, brake), 0.0)
    if room >= -scene.settings[0].r_min_slow or not may_come_closer(scene):
        return target
    closest = scene.settings[0].closest
    nearer = altered(scene, scene.bodies, scene.drift, closest)
    other = look_ahead(nearer, query, state)
    rollout = exact_rollout(scene, other.plan, first_twist(scene, other.plan))
    gained = moving_room(scene, rollout, 0.0)
    if other.mode == STUCK or gained <= room + ALIKE:
        return target
    room = standing_room(scene, rollout, gained)
    mode = CARRIED if other.mode == CARRIED else NEW_PLAN
    return Target(other.plan, mode, room, other.owner)


@compiled_once
def may_come_closer(scene: Scene) -> bool:
    """Return whether a static body has an r_min above ``closest``."""
    closest = scene.settings[0].closest
    for i in range(scene.bodies.shape[0]):
        body = body_at(scene, i)
        if not moves(scene, i) and body.keep - body.inflation > closest:
            return True
    return False


@compiled_once
def look_ahead(scene: Scene, query: Query, state: Array) -> Target:
    """Return the target: desired, another constant twist, carried on, or planned."""
    s, (v, omega) = scene.settings[0], query.desired
    plan = hold(v, omega, s.horizon + s.dt)
    rollout = driven_on(scene, query, query.desired)
    body = first_near(scene, rollout, -1).body
    if body < 0:
        end = clear_end(scene, query.desired, first_twist(scene, plan), 0.0)
        if end > 0.0:
            return Target(hold(v, omega, end), FREE, 0.0, -1)
        # Clear with accelerations by ticks, but not exactly: find the exact violation.
        rollout = exact_rollout(scene, plan, first_twist(scene, plan))
        level = lowest(scene)
        watch = Watch((s.horizon, level), (rollout.rest, level))
        body = first_met(scene, rollout, watch, 0.0).body
    owner = int(body_at(scene, body).owner) if body >= 0 else -1
    best = best_candidate(scene, query, state)
    # Hysteresis: switching at every small gain would stall the robot.
    goes_on = is_dearer(scene, query, best, state) and carries_on(scene, state)
    if best.cost < math.inf and not goes_on:
        plan = hold(best.v, best.omega, s.dt)
        twist = (best.v, best.omega)
        end = clear_end(scene, twist, first_twist(scene, plan), 0.0)
        if end > 0.0:
            return Target(hold(best.v, best.omega, end), ROUND, 0.0, owner)
    if goes_on or (best.cost < math.inf and carries_on(scene, state)):
        return Target(kept_plan(state), CARRIED, 0.0, owner)
    return plan_anew(scene, query, state, owner)


@compiled_once
def plan_anew(scene: Scene, query: Query, state: Array, owner: int) -> Target:
    """Return a plan of two twists, or braking."""
    horizon = scene.settings[0].horizon
    kept = kept_plan(state)
    if not has_plan(scene, state):
        kept = hold(0.0, 0.0, whole_steps(horizon, scene.settings[0].dt))
    if not any_moves(scene):
        return Target(kept, STUCK, 0.0, owner)
    found = best_plan(scene, query, kept, int(state[SHARE]))
    twist = first_twist(scene, found.plan)
    rollout, level, room = exact_rollout(scene, found.plan, twist), lowest(scene), 0.0
    clear = keeps_all(scene, rollout, Watch((horizon, level), UNWATCHED))
    if not clear:
        room = min(moving_room(scene, rollout, 0.0), 2.0 * level)
    drivable = not is_refused(found) and keeps_from_standing(scene, rollout, level)
    drivable = drivable and (not is_inexact(scene) or may_brake(scene, twist))
    if not drivable or not (clear or not braking_keeps_clear(scene, state)):
        return Target(kept, STUCK, NO_ROOM, owner)
    return Target(found.plan, NEW_PLAN, room, owner)


@compiled_once
def is_dearer(scene: Scene, query: Query, best: Candidate, state: Array) -> bool:
    """Return whether the last plan is cheaper than the best candidate, if any.

    Only for a followed plan that was found within the last ``review`` seconds.
    """
    s = scene.settings[0]
    if state[TARGET_MODE] == FREE or state[UNTIL] < s.horizon - s.review:
        return False
    v, omega = first_target(scene, kept_plan(state))
    cost = cost_of(scene, query, best.v, best.omega)
    limit = (1.0 + s.hysteresis) * cost_of(scene, query, v, omega) + CHEAP
    return bool(best.cost == math.inf or cost > limit)


@compiled_once
def has_plan(scene: Scene, state: Array) -> bool:
    """Return whether the last plan has a rest other than braking."""
    return bool(state[END] > 0.5 * scene.settings[0].dt and not is_inexact(scene))


@compiled_once
def carries_on(scene: Scene, state: Array) -> bool:
    """Return whether the rest of the last plan is clear for as long as it was."""
    until, kept = min(state[UNTIL], scene.settings[0].horizon), kept_plan(state)
    if until == 0.0 or not has_plan(scene, state):
        return False
    return keeps_clear(scene, kept, first_twist(scene, kept), until)


@compiled_once
def braking_keeps_clear(scene: Scene, state: Array) -> bool:
    """Return whether braking is clear for as long as the last plan was."""
    s, twist = scene.settings[0], first_twist(scene, hold(0.0, 0.0, 0.0))
    until, plan = min(state[UNTIL], s.horizon), hold(twist[0], twist[1], s.dt)
    return until > 0.0 and keeps_clear(scene, plan, twist, until)


@compiled_once
def best_candidate(scene: Scene, query: Query, state: Array) -> Candidate:
    """Return the cheapest constant twist that is clear.

    The present target is refined in every step. The other starts are searched within
    ``review`` seconds, one group after the other; all at once when its own search fails
    (half of them if nothing moves: braking suffices); one group per step while there is
    none. The cost is the QP's, reduced by the hysteresis for the present target and
    increased by the cost of the change for others.
    """
    s = scene.settings[0]
    best = Candidate(0.0, 0.0, math.inf)
    due = GROUPS if any_moves(scene) else GROUPS // 2
    if state[TARGET_MODE] != FREE:
        target = first_target(scene, kept_plan(state))
        best = refine_candidate(scene, query, target, math.inf)
        if best.cost < math.inf:
            best = Candidate(best.v, best.omega, best.cost * (1.0 - s.hysteresis))
            state[DUE] -= 1.0
            due = 0 if state[DUE] >= 0.0 else 1
        elif state[TARGET_MODE] >= NEW_PLAN:
            due = 1
    if best.cost == math.inf or due > 0:
        state[DUE] = math.floor(s.review / (GROUPS * s.dt))
    # No other start can be significantly cheaper.
    if best.cost < CHEAP:
        return best
    for _ in range(due):
        group, limit = int(state[GROUP]), best.cost
        state[GROUP] = (state[GROUP] + 1.0) % GROUPS
        for member in range(2):
            start = start_twist(query, group, member)
            found = refine_candidate(scene, query, start, limit)
            cost = found.cost + s.hysteresis * change_cost(scene, state, found)
            # Mirror images cost the same but for rounding: keep the first, to the
            # right.
            if cost < best.cost * (1.0 - RELATIVE_ROUNDING):
                best = Candidate(found.v, found.omega, cost)
    return best


@compiled_once
def change_cost(scene: Scene, state: Array, found: Candidate) -> float:
    """Return the cost of a change from the present target, (m/s)²."""
    if state[TARGET_MODE] == FREE:
        return 0.0
    target = first_target(scene, kept_plan(state))
    return twist_cost(scene, (found.v, found.omega), target)


@compiled_once
def start_twist(query: Query, group: int, member: int) -> Pair:
    """Return one of the starts; of a pair the one to the right is first."""
    box = query.box
    if group == 1:
        return query.desired if member == 0 else (0.0, 0.0)
    v = box.v_max if group == 0 else box.v_min
    if group == 2:
        return box.v_min if member == 0 else box.v_max, 0.0
    return v, box.omega_min if member == 0 else box.omega_max
