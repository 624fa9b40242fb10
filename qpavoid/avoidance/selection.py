"""Selection of the plan that is driven.

The first clear one of:

1. the command, projected onto the rows of the present;
2. the rest of the last plan, if it is recent, and not much dearer than the cheapest
   proposal;
3. the cheapest proposal of the QP (:mod:`qpavoid.avoidance.proposals`);
4. the rest of the last plan, if there is a proposal.

Else, and without a proposal, the one with the largest margin, first of static bodies,
then of moving ones, among: braking along the arc, the rest of the last plan, and among
moving obstacles the best plan of two twists. Static obstacles need only the minimum
clearance instead of r_min if a moving one would touch the robot then, or if that plan
does not keep even the minimum clearance.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import Scene, any_moves, moves, threshold, with_bodies
from qpavoid.avoidance.margin import (
    DEEPEST,
    RESOLUTION,
    UNWATCHED,
    Violation,
    Watch,
    margin_at,
    next_body,
    sampled_least,
    too_near,
    violation,
)
from qpavoid.avoidance.plan import (
    AS_COMMANDED,
    BRAKED,
    PROPOSED,
    SEARCHED,
    Plan,
    coarse_steps,
    hold,
    plan_of,
    roll_out,
    whole_steps,
)
from qpavoid.avoidance.proposals import (
    CHEAP,
    WHOLE,
    Proposal,
    Query,
    best_proposal,
    cost_of,
    rollout_of,
    solved,
    twist_cost,
    unsolved,
    violation_by,
)
from qpavoid.avoidance.verdict import (
    BRAKING_PLAN,
    PlanMargins,
    clear_plan,
    first_target,
    first_twist,
    is_clear_actuated,
    is_inexact,
    margins,
    may_move,
    verdict,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Box, Pair, Row

SWITCHES = (1.1, 0.5, 0.2, 0.1)
"""s; times of the switch to the second twist, in whole control steps."""

PLENTY = 0.01
"""m; margin from which on the cheapest plan is taken."""

BETTER = 3e-3
"""m; hysteresis of the margin for a change of the plan."""


NONE_MET = Violation(-1, 0.0)
"""No violation."""


class Found(NamedTuple):
    """A plan with its score.

    Attributes:
        plan: The plan; its first twist is the target.
        margin: Least margin of moving bodies, m, ≤ :data:`PLENTY`; ``−inf``: rejected,
            since it violates a static body, or cannot be the best.
        cost: Of its first twist, and a tenth of that of its second, (m/s)².
        met: Violation by the plan scored last, checked first for the next.
    """

    plan: Plan
    margin: float
    cost: float
    met: Violation


@compiled
def searched_twist(box: Box, i: int) -> Pair:
    """Return one of 3 × 3 twists with v and ω least, 0 or greatest, or of 5 × 5 even.

    ``i``: 0 to 8, and 9 to 33.
    """
    if i < 9:
        v = (box.v_min, 0.0, box.v_max)[i // 3]
        return v, (box.omega_min, 0.0, box.omega_max)[i % 3]
    v = box.v_min + 0.25 * ((i - 9) // 5) * (box.v_max - box.v_min)
    width = box.omega_max - box.omega_min
    return v, box.omega_min + 0.25 * ((i - 9) % 5) * width


@compiled
def quantised(margin: float) -> float:
    """Return the margin in units of :data:`RESOLUTION`, at most :data:`PLENTY`, m."""
    bounded = min(max(margin, -DEEPEST), PLENTY)
    return RESOLUTION * math.floor(bounded / RESOLUTION)


@compiled_once
def is_better(one: Found, other: Found) -> bool:
    """Return whether a plan is better: by quantised margin, then cost, then margin.

    A total order, independent of the order of the search. A plan whose margin is larger
    by less than :data:`RESOLUTION` is not preferred if it costs more.
    """
    if quantised(one.margin) != quantised(other.margin):
        return one.margin > other.margin
    if one.cost != other.cost:
        return one.cost < other.cost
    return one.margin > other.margin


@compiled_once
def better_plan(scene: Scene, query: Query, plan: Plan, best: Found) -> Found:
    """Return the score of a plan if it is better than the best so far, else that."""
    then = twist_cost(scene, (plan.v_then, plan.omega_then), query.desired)
    cost = twist_cost(scene, (plan.v, plan.omega), query.desired) + 0.1 * then
    dearer = cost > best.cost
    if dearer and best.margin >= PLENTY:
        return best
    # A dearer plan needs a larger margin.
    level = quantised(best.margin) + (RESOLUTION if dearer else 0.0)
    rollout = roll_out(scene, plan, coarse_steps(scene))
    # The last violation recurs in most of the next plans: one sample rejects them.
    (body, time), lowest = best.met, threshold(scene)
    if body >= 0:
        lowest = level if moves(scene, body) else lowest
        if margin_at(scene, rollout, body, time) < lowest:
            return best
    moving, still = (scene.settings[0].horizon, level), (rollout.rest, threshold(scene))
    # Moving bodies first: most plans violate one, and there are fewer.
    met = violation(scene, rollout, Watch(moving, UNWATCHED), RESOLUTION)
    if met.body < 0:
        met = violation(scene, rollout, Watch(UNWATCHED, still), RESOLUTION)
    if met.body >= 0:
        return Found(best.plan, best.margin, best.cost, met)
    margin = sampled_least(scene, rollout, True, PLENTY)
    found = Found(plan, margin, cost, best.met)
    return found if is_better(found, best) else best


@compiled_once
def time_until_near(scene: Scene, plan: Plan, level: float) -> float:
    """Return the time of a plan's first margin below a threshold, s, ≤ the horizon."""
    rollout = roll_out(scene, plan, coarse_steps(scene))
    until: float = scene.settings[0].horizon
    watch = Watch((until, level), (until, threshold(scene)))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        lowest = level if moves(scene, i) else threshold(scene)
        _, until = too_near(scene, rollout, i, (0.0, until), lowest, RESOLUTION)
        i = next_body(scene, rollout, i + 1, watch)
    return until


@compiled_once
def best_plan(scene: Scene, query: Query, last_plan: Plan) -> Found:
    """Return the plan of two extreme twists with the largest margin.

    The last plan is retained unless another one is better by :data:`BETTER`.
    """
    s, box = scene.settings[0], query.box
    end = whole_steps(s.horizon, s.dt)
    nothing = Found(last_plan, -math.inf, math.inf, NONE_MET)
    last = better_plan(scene, query, last_plan, nothing)
    # Hysteresis: another plan has to be better by BETTER.
    best = Found(last_plan, last.margin + BETTER, last.cost, last.met)
    for i in range(9 + 25):
        v, omega = searched_twist(box, i)
        best = better_plan(scene, query, hold(v, omega, end), best)
    for i in range(9):
        v, omega = searched_twist(box, i)
        latest = time_until_near(scene, hold(v, omega, end), quantised(best.margin))
        for time in SWITCHES:
            switch = whole_steps(time, s.dt)
            # A switch after the violation is too late for any second twist.
            for j in range(9 if switch <= latest else 0):
                then = searched_twist(box, j)
                # A constant twist has been scored.
                if j != i:
                    plan = Plan(v, omega, switch, then[0], then[1], end)
                    best = better_plan(scene, query, plan, best)
    return best


TRUST = (math.inf, 0.5, 0.25)
"""Size of the trust region per attempt of the one-step QP, relative to the step from
braking to its first solution."""


class Choice(NamedTuple):
    """Plan that is driven.

    Attributes:
        plan: Its first twist is driven.
        mode: How it was found; see :mod:`qpavoid.avoidance.plan`.
        until: Time up to which the plan was found clear of moving bodies, s.
        margins: Of the plan; clear if both are at least −ε.
        proposal: QP whose solution the plan holds; of cost ``inf``: none.
        owner: Obstacle that the command violates, or −1.
    """

    plan: Plan
    mode: int
    until: float
    margins: PlanMargins
    proposal: Proposal
    owner: int


@compiled_once
def select(scene: Scene, query: Query, kept: Row) -> Choice:
    """Return the plan driven, with look-ahead."""
    none, horizon = unsolved(query.desired, WHOLE, False), scene.settings[0].horizon
    command = solved(scene, query, none, query.present)
    body = violation_by(scene, rollout_of(scene, command.twist)).body
    if body < 0:
        plan = clear_plan(scene, command.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, AS_COMMANDED, horizon, command, -1)
    owner = scene.bodies[body].owner if body >= 0 else -1
    best = best_proposal(scene, query, kept)
    # Hysteresis: switching at every small gain would stall the robot.
    dearer = last_is_cheaper(scene, query, best, kept)
    goes_on = dearer and carries_on(scene, kept)
    if best.cost < math.inf and not goes_on:
        plan = clear_plan(scene, best.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, PROPOSED, horizon, best, owner)
    if goes_on or (best.cost < math.inf and carries_on(scene, kept)):
        plan = plan_of(kept)
        return clear_choice(scene, plan, SEARCHED, kept.until, none, owner)
    return fallback(scene, query, kept, owner)


@compiled
def clear_choice(
    scene: Scene, plan: Plan, mode: int, until: float, proposal: Proposal, owner: int
) -> Choice:
    """Return the choice of a clear plan; its margins are not computed."""
    clear = PlanMargins(threshold(scene), threshold(scene))
    return Choice(plan, mode, until, clear, proposal, owner)


@compiled_once
def select_now(scene: Scene, query: Query, kept: Row) -> Choice:
    """Return the plan driven without look-ahead: the QP's twist, then braking.

    A solution whose braking is not clear is sought again within a trust region about
    braking.
    """
    s, target = scene.settings[0], first_twist(scene, BRAKING_PLAN)
    none = unsolved(query.desired, WHOLE, False)
    first = none
    for size in TRUST:
        found, (v, omega) = none, first.twist
        if size < math.inf:
            trust = (size * abs(v - target[0]), size * abs(omega - target[1]))
            found = unsolved(target, trust, False)
        found = solved(scene, query, found, query.present)
        if found.cost == math.inf:
            break
        plan = hold(found.twist[0], found.twist[1], s.dt)
        if s.braking_room == 0 or verdict(scene, plan, 0.0):
            return clear_choice(scene, plan, PROPOSED, s.horizon, found, -1)
        if size == math.inf:
            first = found
    return fallback(scene, query, kept, -1)


@compiled_once
def fallback(scene: Scene, query: Query, kept: Row, owner: int) -> Choice:
    """Return the choice with the largest margin, see :func:`widest`.

    The choice at the minimum clearance of static bodies instead, where this one comes
    nearer than that to them; or where a moving body would touch the robot, if the
    margin of moving bodies is larger then.
    """
    choice, s = widest(scene, query, kept, owner), scene.settings[0]
    level, (static, moving) = threshold(scene), choice.margins
    touched = moving < -s.r_min_slow
    if not query.ahead or (static >= level and not touched):
        return choice
    nearer = at_min_clearance(scene, query)
    # Inside r_min, required distances differ: a larger margin may be a contact.
    clear = margins(nearer, choice.plan).static >= level
    if clear and not touched:
        return choice
    other = widest(nearer, query, kept, owner)
    if clear and other.margins.moving <= moving + RESOLUTION:
        return choice
    plan, mode, until, _, none, _ = other
    return Choice(plan, mode, until, margins(scene, plan), none, owner)


@compiled_once
def at_min_clearance(scene: Scene, query: Query) -> Scene:
    """Return the scene with the minimum clearance instead of r_min of static bodies."""
    bodies, least = scene.bodies, scene.settings[0].min_clearance
    count, closer = bodies.shape[0], query.closer
    for i in range(count):
        closer[i] = bodies[i]
        one = closer[i]
        excess = one.required - one.beyond_r_min - least
        if excess > 0.0 and not moves(scene, i):
            one.required, one.spread = one.required - excess, one.spread - excess
            one.margin_now += excess
    return with_bodies(scene, closer[:count], scene.drift)


@compiled_once
def widest(scene: Scene, query: Query, kept: Row, owner: int) -> Choice:
    """Return the choice of a plan of two twists, of the last plan, or of braking."""
    none, least = unsolved(query.desired, WHOLE, False), margins(scene, BRAKING_PLAN)
    choice = Choice(BRAKING_PLAN, BRAKED, kept.until, least, none, owner)
    plan, horizon = plan_of(kept), scene.settings[0].horizon
    if has_plan(scene, kept):
        other = Choice(plan, SEARCHED, kept.until, margins(scene, plan), none, owner)
        choice = better_of(scene, choice, other)
    else:
        plan = hold(0.0, 0.0, whole_steps(horizon, scene.settings[0].dt))
    if any_moves(scene):
        found = best_plan(scene, query, plan)
        if found.margin > -math.inf:
            least = margins(scene, found.plan)
            other = Choice(found.plan, SEARCHED, horizon, least, none, owner)
            choice = better_of(scene, choice, other)
    return choice


@compiled_once
def better_of(scene: Scene, choice: Choice, other: Choice) -> Choice:
    """Return the other one of two choices if it is better.

    With the larger margin of static bodies; if that is equal, clear of moving ones, or
    with the larger margin.
    """
    twist, least = first_twist(scene, other.plan), other.margins
    if least.static < choice.margins.static or not is_clear_actuated(scene, twist):
        return choice
    better = least.static > choice.margins.static
    better = better or least.moving >= threshold(scene)
    # RESOLUTION: else rounding would make it switch back and forth.
    better = better or least.moving > choice.margins.moving + RESOLUTION
    return other if better and may_move(scene, twist, least.moving) else choice


@compiled_once
def last_is_cheaper(scene: Scene, query: Query, best: Proposal, kept: Row) -> bool:
    """Return whether the last plan is cheaper than the best proposal, if any.

    Only for a followed plan that was found within the last ``review`` seconds.
    """
    s = scene.settings[0]
    if kept.mode == AS_COMMANDED or kept.until < s.horizon - s.review:
        return False
    present = cost_of(scene, query, first_target(scene, plan_of(kept)))
    cost = cost_of(scene, query, best.twist)
    limit = (1.0 + s.hysteresis) * present + CHEAP
    return bool(best.cost == math.inf or cost > limit)


@compiled_once
def has_plan(scene: Scene, kept: Row) -> bool:
    """Return whether the last plan has a rest other than braking."""
    return bool(kept.end > 0.5 * scene.settings[0].dt and not is_inexact(scene))


@compiled_once
def carries_on(scene: Scene, kept: Row) -> bool:
    """Return whether the rest of the last plan is clear for as long as it was."""
    until = min(kept.until, scene.settings[0].horizon)
    if until == 0.0 or not has_plan(scene, kept):
        return False
    return verdict(scene, plan_of(kept), until)
