"""Selection of the plan that is driven: the first clear one in the order of cost.

1. the command, with the separating rows;
2. the QP's proposals (:mod:`qpavoid.avoidance.proposals`);
3. the rest of the last plan;
4. plans of two twists (:mod:`qpavoid.avoidance.plans`).

If none is clear, the plan with the largest margin: of braking along the arc, the rest
of the last plan, and the best one of two twists. Only plans that are clear of static
bodies are compared with braking, unless braking is not.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.body_table import any_moves, body_at
from qpavoid.avoidance.plans import ALIKE, best_plan, is_refused
from qpavoid.avoidance.prediction import Plan, hold, whole_steps
from qpavoid.avoidance.proposals import (
    CHEAP,
    WHOLE,
    Proposal,
    Query,
    best_proposal,
    driven_on,
    nowhere,
    solved,
    twist_cost,
    violation,
)
from qpavoid.avoidance.scene import Scene, threshold
from qpavoid.avoidance.state import (
    CARRIED,
    END,
    FREE,
    NEW_PLAN,
    ROUND,
    SHARE,
    STUCK,
    TARGET_MODE,
    UNTIL,
    kept_plan,
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
    verdict,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Array

TRUST = (math.inf, 0.5, 0.25)
"""Size of the trust region per attempt of the one-step QP, relative to the step from
braking to its first solution."""


class Choice(NamedTuple):
    """Plan that is driven.

    Attributes:
        plan: Its first twist is driven.
        mode: See :mod:`qpavoid.avoidance.state`.
        until: s for which the margin of moving bodies is verified.
        margins: Of the plan; clear if both are at least −ε.
        proposal: QP whose solution the plan holds; of cost ``inf``: none.
        owner: Obstacle that the command violates, or −1.
    """

    plan: Plan
    mode: float
    until: float
    margins: Margins
    proposal: Proposal
    owner: int


@compiled_once
def select(scene: Scene, query: Query, state: Array) -> Choice:
    """Return the plan driven, with look-ahead."""
    none = nowhere(query.desired, WHOLE, False)
    command = solved(scene, query, none, query.separating)
    body = violation(scene, driven_on(scene, query, command.twist), -1).body
    if body < 0:
        plan = clear_plan(scene, command.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, FREE, command, -1)
    owner = int(body_at(scene, body).owner) if body >= 0 else -1
    best = best_proposal(scene, query, state)
    # Hysteresis: switching at every small gain would stall the robot.
    dearer = is_dearer(scene, query, best, state)
    goes_on = dearer and carries_on(scene, state)
    if best.cost < math.inf and not goes_on:
        plan = clear_plan(scene, best.twist)
        if plan.end > 0.0:
            return clear_choice(scene, plan, ROUND, best, owner)
    if goes_on or (best.cost < math.inf and carries_on(scene, state)):
        clear = Margins(threshold(scene), 0.0)
        return Choice(kept_plan(state), CARRIED, state[UNTIL], clear, none, owner)
    return fallback(scene, query, state, owner)


@compiled
def clear_choice(
    scene: Scene, plan: Plan, mode: float, proposal: Proposal, owner: int
) -> Choice:
    """Return the choice of a clear plan that holds a QP's solution."""
    clear = Margins(threshold(scene), 0.0)
    return Choice(plan, mode, scene.settings[0].horizon, clear, proposal, owner)


@compiled_once
def select_now(scene: Scene, query: Query, state: Array) -> Choice:
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
    return fallback(scene, query, state, -1)


@compiled_once
def fallback(scene: Scene, query: Query, state: Array, owner: int) -> Choice:
    """Return the choice of a plan of two twists, of the last plan, or of braking."""
    none, least = nowhere(query.desired, WHOLE, False), margins(scene, BRAKING_PLAN)
    choice = Choice(BRAKING_PLAN, STUCK, state[UNTIL], least, none, owner)
    kept, horizon = kept_plan(state), scene.settings[0].horizon
    if has_plan(scene, state):
        other = Choice(kept, NEW_PLAN, state[UNTIL], margins(scene, kept), none, owner)
        choice = better_of(scene, choice, other)
    else:
        kept = hold(0.0, 0.0, whole_steps(horizon, scene.settings[0].dt))
    if any_moves(scene):
        found = best_plan(scene, query, kept, int(state[SHARE]))
        if not is_refused(found):
            least = margins(scene, found.plan)
            other = Choice(found.plan, NEW_PLAN, horizon, least, none, owner)
            choice = better_of(scene, choice, other)
    return choice


@compiled_once
def better_of(scene: Scene, choice: Choice, other: Choice) -> Choice:
    """Return the other one of two choices if it is better.

    It has to be clear of static bodies; and of all bodies, or have the larger margin.
    """
    level, twist, least = (
        threshold(scene),
        first_twist(scene, other.plan),
        other.margins,
    )
    if least.static < level or not is_followed(scene, twist):
        return choice
    better = choice.margins.static < level or least.moving >= level
    # ALIKE: else rounding would make it switch back and forth.
    better = better or least.moving > choice.margins.moving + ALIKE
    return other if better and may_move(scene, twist, least.moving) else choice


@compiled_once
def is_dearer(scene: Scene, query: Query, best: Proposal, state: Array) -> bool:
    """Return whether the last plan is cheaper than the best proposal, if any.

    Only for a followed plan that was found within the last ``review`` seconds.
    """
    s = scene.settings[0]
    if state[TARGET_MODE] == FREE or state[UNTIL] < s.horizon - s.review:
        return False
    present = twist_cost(scene, first_target(scene, kept_plan(state)), query.desired)
    cost = twist_cost(scene, best.twist, query.desired)
    limit = (1.0 + s.hysteresis) * present + CHEAP
    return bool(best.cost == math.inf or cost > limit)


@compiled_once
def has_plan(scene: Scene, state: Array) -> bool:
    """Return whether the last plan has a rest other than braking."""
    return bool(state[END] > 0.5 * scene.settings[0].dt and not is_inexact(scene))


@compiled_once
def carries_on(scene: Scene, state: Array) -> bool:
    """Return whether the rest of the last plan is clear for as long as it was."""
    until = min(state[UNTIL], scene.settings[0].horizon)
    if until == 0.0 or not has_plan(scene, state):
        return False
    return verdict(scene, kept_plan(state), until)
