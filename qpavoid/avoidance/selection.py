"""Selection of the plan that is driven: the first clear one in the order of cost.

1. the command, with the separating rows;
2. the QP's proposals (:mod:`qpavoid.avoidance.proposals`);
3. the rest of the last plan;
4. plans of two twists, among moving obstacles.

If none is clear, the plan with the largest margin, first of static bodies, then of
moving ones: of braking along the arc, the rest of the last plan, and the best one of
two twists.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import Scene, any_moves, moves, threshold
from qpavoid.avoidance.clearance import (
    UNWATCHED,
    Watch,
    first_met,
    next_body,
    room_at,
    too_near,
)
from qpavoid.avoidance.plan import (
    CARRIED,
    FREE,
    NEW_PLAN,
    ROUND,
    STUCK,
    Plan,
    Rollout,
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
    driven_on,
    nowhere,
    solved,
    twist_cost,
    violation,
)
from qpavoid.avoidance.verdict import (
    BRAKING_PLAN,
    Margins,
    clear_plan,
    first_target,
    first_twist,
    is_followed,
    is_inexact,
    margins,
    may_move,
    moving_margin,
    verdict,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Box, Pair, Row

SWITCHES = (1.1, 0.5, 0.2)
"""s; times of the switch to the second twist, in whole control steps."""

PLENTY = 0.01
"""m; margin from which on the cheapest plan is taken."""

MOST_ROOM = 3.0
"""m; bound of the margin that decides between plans of equal cost."""

ALIKE = 1e-3
"""m; resolution of the margin: of plans that are equal in it the cheaper is taken."""

BETTER = 3e-3
"""m; hysteresis of the margin for a change of the plan."""

SHARES = 3
"""Control steps over which the search is spread after it has been done in full."""

NO_ROOM = -1e9
"""m; margin of a rejected plan: it violates a static body, or cannot be the best."""

NOTHING_YET = 2.0 * NO_ROOM
"""m; initial margin of the search, less than of any plan."""


class Found(NamedTuple):
    """A plan with its score.

    Attributes:
        plan: The plan; its first twist is the target.
        room: Least margin of moving bodies, m, or :data:`NO_ROOM`.
        cost: Of its first twist, and a tenth of that of its second, (m/s)².
        body: Violated body, checked first for the next plan; −1: none.
        time: Of the violation, s.
    """

    plan: Plan
    room: float
    cost: float
    body: int
    time: float


@compiled
def is_refused(found: Found) -> bool:
    """Return whether a plan is rejected: its margin is about :data:`NO_ROOM`."""
    return not found.room > 0.5 * NO_ROOM


@compiled
def evenly(box: Box, number: int) -> Pair:
    """Return one of 5 × 5 twists, evenly spaced within the limits."""
    v = box.v_min + 0.25 * (number // 5) * (box.v_max - box.v_min)
    width = box.omega_max - box.omega_min
    return v, box.omega_min + 0.25 * (number % 5) * width


@compiled
def extreme(box: Box, number: int) -> Pair:
    """Return one of 3 × 3 twists with v and ω least, 0 or greatest."""
    v = (box.v_min, 0.0, box.v_max)[number // 3]
    return v, (box.omega_min, 0.0, box.omega_max)[number % 3]


@compiled_once
def plan_cost(scene: Scene, query: Query, plan: Plan) -> float:
    """Return the cost of a plan: see :class:`Found`."""
    then = twist_cost(scene, (plan.v_then, plan.omega_then), query.desired)
    return twist_cost(scene, (plan.v, plan.omega), query.desired) + 0.1 * then


@compiled
def worth(room: float) -> float:
    """Return the margin in units of :data:`ALIKE`, at most :data:`PLENTY`, m."""
    # Quantised: a margin larger by less than a millimetre is worth no higher cost.
    return ALIKE * math.floor(min(room, PLENTY) / ALIKE)


@compiled_once
def is_better(one: Found, other: Found) -> bool:
    """Return whether a plan is better: by worth, then cost, then margin.

    A total order, independent of the order of the search.
    """
    if worth(one.room) != worth(other.room):
        return one.room > other.room
    if one.cost != other.cost:
        return one.cost < other.cost
    return one.room > other.room


@compiled
def level_of(scene: Scene, i: int, level: float) -> float:
    """Return the threshold of a body's margin for a plan, m."""
    return level if moves(scene, i) else threshold(scene)


@compiled_once
def time_until_near(scene: Scene, rollout: Rollout, level: float, end: float) -> float:
    """Return the time of the first margin below a threshold, s; at most ``end``."""
    watch = Watch((end, level), (end, threshold(scene)))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        _, end = too_near(
            scene, rollout, i, (0.0, end), level_of(scene, i, level), ALIKE
        )
        i = next_body(scene, rollout, i + 1, watch)
    return end


@compiled_once
def looked_at(
    scene: Scene, query: Query, plan: Plan, best: Found, last: Found
) -> Found:
    """Return the score of a plan, as far as it can be better than the best so far.

    Args:
        scene: Of the step.
        query: Desired twist.
        plan: To be scored.
        best: Best so far.
        last: Scored before; its violation is checked first.
    """
    cost, body, time = plan_cost(scene, query, plan), last.body, last.time
    failed = Found(plan, NO_ROOM, cost, body, time)
    level = worth(best.room)
    if best.room >= PLENTY and cost > best.cost:
        return failed
    rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
    # The last violation recurs for most of the next plans: one check rejects them.
    if body >= 0 and room_at(scene, rollout, body, time) < level_of(scene, body, level):
        return failed
    moving, still = (scene.settings[0].horizon, level), (rollout.rest, threshold(scene))
    met = first_met(scene, rollout, Watch(moving, UNWATCHED), ALIKE)
    if met.body < 0:
        met = first_met(scene, rollout, Watch(UNWATCHED, still), ALIKE)
    if met.body >= 0:
        return Found(plan, NO_ROOM, cost, met.body, met.time)
    return Found(plan, moving_margin(scene, rollout, MOST_ROOM), cost, body, time)


@compiled_once
def best_plan(scene: Scene, query: Query, kept: Plan, share: int) -> Found:
    """Return the plan of two extreme twists with the largest margin.

    The last plan is retained unless another one is better by :data:`BETTER`. ``share``
    0: all first twists are searched, else the third of them whose turn it is; all
    constant twists in any case.
    """
    box, s, anew = query.box, scene.settings[0], False
    end = whole_steps(s.horizon, s.dt)
    nothing = Found(kept, NOTHING_YET, math.inf, -1, 0.0)
    first = looked_at(scene, query, kept, nothing, nothing)
    # Hysteresis: another plan has to be better by BETTER.
    best, last = Found(kept, first.room + BETTER, first.cost, -1, 0.0), first
    for i in range(9 + 25):
        twist = extreme(box, i) if i < 9 else evenly(box, i - 9)
        plan = hold(twist[0], twist[1], end)
        last = looked_at(scene, query, plan, best, last)
        if is_better(last, best):
            best, anew = last, True
    for i in range(9):
        if share > 0 and i // 3 != share - 1:
            continue
        twist = extreme(box, i)
        plan = hold(twist[0], twist[1], end)
        rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
        level = worth(best.room)
        # A switch after the violation is too late for any second twist.
        latest, before = time_until_near(scene, rollout, level, s.horizon), 0.0
        for time in SWITCHES:
            switch = whole_steps(time, s.dt)
            if switch > latest or switch == before:
                continue
            before = switch
            for j in range(9):
                then = extreme(box, j)
                # A constant twist, scored above.
                if j == i:
                    continue
                plan = Plan(twist[0], twist[1], switch, then[0], then[1], end)
                last = looked_at(scene, query, plan, best, last)
                if is_better(last, best):
                    best, anew = last, True
    return best if anew else first


TRUST = (math.inf, 0.5, 0.25)
"""Size of the trust region per attempt of the one-step QP, relative to the step from
braking to its first solution."""


class Choice(NamedTuple):
    """Plan that is driven.

    Attributes:
        plan: Its first twist is driven.
        mode: See :mod:`qpavoid.avoidance.plan`.
        until: s for which the margin of moving bodies is verified.
        margins: Of the plan; clear if both are at least −ε.
        proposal: QP whose solution the plan holds; of cost ``inf``: none.
        owner: Obstacle that the command violates, or −1.
    """

    plan: Plan
    mode: int
    until: float
    margins: Margins
    proposal: Proposal
    owner: int


@compiled_once
def select(scene: Scene, query: Query, kept: Row) -> Choice:
    """Return the plan driven, with look-ahead."""
    none = nowhere(query.desired, WHOLE, False)
    command = solved(scene, query, none, query.separating)
    body = violation(scene, driven_on(scene, query, command.twist), -1).body
    if body < 0:
        plan = clear_plan(scene, command.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, FREE, command, -1)
    owner = scene.bodies[body].owner if body >= 0 else -1
    best = best_proposal(scene, query, kept)
    # Hysteresis: switching at every small gain would stall the robot.
    dearer = is_dearer(scene, query, best, kept)
    goes_on = dearer and carries_on(scene, kept)
    if best.cost < math.inf and not goes_on:
        plan = clear_plan(scene, best.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, ROUND, best, owner)
    if goes_on or (best.cost < math.inf and carries_on(scene, kept)):
        clear = Margins(threshold(scene), 0.0)
        return Choice(plan_of(kept), CARRIED, kept.until, clear, none, owner)
    return fallback(scene, query, kept, owner)


@compiled
def clear_choice(
    scene: Scene, plan: Plan, mode: int, proposal: Proposal, owner: int
) -> Choice:
    """Return the choice of a clear plan that holds a QP's solution."""
    clear = Margins(threshold(scene), 0.0)
    return Choice(plan, mode, scene.settings[0].horizon, clear, proposal, owner)


@compiled_once
def select_now(scene: Scene, query: Query, kept: Row) -> Choice:
    """Return the plan driven without look-ahead: the QP's twist, then braking.

    A solution whose braking is not clear is sought again within a trust region about
    braking.
    """
    s, target = scene.settings[0], first_twist(scene, BRAKING_PLAN)
    none = nowhere(query.desired, WHOLE, False)
    first = none
    for share in TRUST:
        qp, (v, omega) = none, first.twist
        if share < math.inf:
            trust = (share * abs(v - target[0]), share * abs(omega - target[1]))
            qp = nowhere(target, trust, False)
        qp = solved(scene, query, qp, query.separating)
        if qp.cost == math.inf:
            break
        plan = hold(qp.twist[0], qp.twist[1], s.dt)
        if s.braking_room == 0 or verdict(scene, plan, 0.0):
            return clear_choice(scene, plan, ROUND, qp, -1)
        if share == math.inf:
            first = qp
    return fallback(scene, query, kept, -1)


@compiled_once
def fallback(scene: Scene, query: Query, kept: Row, owner: int) -> Choice:
    """Return the choice of a plan of two twists, of the last plan, or of braking."""
    none, least = nowhere(query.desired, WHOLE, False), margins(scene, BRAKING_PLAN)
    choice = Choice(BRAKING_PLAN, STUCK, kept.until, least, none, owner)
    plan, horizon = plan_of(kept), scene.settings[0].horizon
    if has_plan(scene, kept):
        other = Choice(plan, NEW_PLAN, kept.until, margins(scene, plan), none, owner)
        choice = better_of(scene, choice, other)
    else:
        plan = hold(0.0, 0.0, whole_steps(horizon, scene.settings[0].dt))
    if any_moves(scene):
        found = best_plan(scene, query, plan, kept.share)
        if not is_refused(found):
            least = margins(scene, found.plan)
            other = Choice(found.plan, NEW_PLAN, horizon, least, none, owner)
            choice = better_of(scene, choice, other)
    return choice


@compiled_once
def better_of(scene: Scene, choice: Choice, other: Choice) -> Choice:
    """Return the other one of two choices if it is better.

    With the larger margin of static bodies; if that is equal, clear of moving ones, or
    with the larger margin.
    """
    twist, least = first_twist(scene, other.plan), other.margins
    if least.static < choice.margins.static or not is_followed(scene, twist):
        return choice
    better = least.static > choice.margins.static
    better = better or least.moving >= threshold(scene)
    # ALIKE: else rounding would make it switch back and forth.
    better = better or least.moving > choice.margins.moving + ALIKE
    return other if better and may_move(scene, twist, least.moving) else choice


@compiled_once
def is_dearer(scene: Scene, query: Query, best: Proposal, kept: Row) -> bool:
    """Return whether the last plan is cheaper than the best proposal, if any.

    Only for a followed plan that was found within the last ``review`` seconds.
    """
    s = scene.settings[0]
    if kept.mode == FREE or kept.until < s.horizon - s.review:
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
