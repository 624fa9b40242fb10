"""Plans of two twists, by search: for where no constant one keeps its distance."""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import least_room
from qpavoid.avoidance.judge import lowest, moving_room, too_near_standing
from qpavoid.avoidance.lookahead import Query, cost_of
from qpavoid.avoidance.prediction import (
    KIND,
    MOVES,
    Plan,
    Rollout,
    Scene,
    hold,
    roll_out,
)
from qpavoid.compiled import compiled, compiled_once
from qpavoid.qp.exact import Box, Pair

SWITCHES = (1.6, 1.1, 0.7, 0.4, 0.2, 0.1)
"""s; when a plan of two twists may go over to its second."""

PLENTY = 0.01
"""m of room; of plans with as much the cheapest is taken."""

AMPLE = 0.3
"""m; of plans that cost the same the one with more room is taken, up to so much."""

ALIKE = 1e-3
"""m of room; of plans that differ by less the cheaper is taken."""

BETTER = 3e-3
"""m by which another plan must be better to be taken up."""

SHARES = 3
"""Steps over which the search is spread once it has been done in full."""

NONE = -1e9
"""m; the room of a plan that drives into what stands."""


class Found(NamedTuple):
    """A plan that has been looked at.

    Attributes:
        plan: With the twist that it begins with as its target.
        room: Least room of what moves, m, as far as it matters; :data:`NONE`: it comes
            too near to what stands.
        cost: Of its first twist, and a tenth of that of its second, (m/s)².
    """

    plan: Plan
    room: float
    cost: float


@compiled
def extreme(box: Box, number: int) -> Pair:
    """Return one of the nine twists of which either part is least, 0 or greatest."""
    v = (box[0], 0.0, box[1])[number // 3]
    return v, (box[2], 0.0, box[3])[number % 3]


@compiled
def plan_cost(scene: Scene, query: Query, plan: Plan) -> float:
    """Return the cost of a plan: see :class:`Found`."""
    cost = cost_of(scene, query, plan.v, plan.omega)
    return cost + 0.1 * cost_of(scene, query, plan.v_then, plan.omega_then)


@compiled
def is_better(one: Found, other: Found) -> bool:
    """Return whether a plan has more room, up to what is plenty, or costs less."""
    gain = min(one.room, PLENTY) - min(other.room, PLENTY)
    if gain > ALIKE or gain < -ALIKE:
        return gain > 0.0
    if abs(one.cost - other.cost) > 1e-9:
        return one.cost < other.cost
    return one.room > other.room + 1e-9


@compiled_once
def time_until_near(scene: Scene, rollout: Rollout, level: float, end: float) -> float:
    """Return when something comes nearer than a level first, s; at most ``end``."""
    for i in range(scene.bodies.shape[0]):
        wanted = level if scene.bodies[i, KIND] == MOVES else lowest(scene)
        room, when = least_room(scene, rollout, i, (0.0, end), wanted, False)
        if room < wanted:
            end = min(end, when)
    return end


@compiled_once
def looked_at(scene: Scene, query: Query, plan: Plan, best: Found) -> Found:
    """Return a plan with its room, as far as it can be better than the best so far."""
    cost = plan_cost(scene, query, plan)
    level = min(best.room, PLENTY) - ALIKE
    if best.room >= PLENTY and cost > best.cost + 1e-9:
        return Found(plan, NONE, cost)
    rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
    for i in range(scene.bodies.shape[0]):
        if scene.bodies[i, KIND] == MOVES:
            span = (0.0, scene.settings[0].horizon)
            room, _ = least_room(scene, rollout, i, span, level, False)
            if room < level:
                return Found(plan, NONE, cost)
    if too_near_standing(scene, rollout, 0.0, lowest(scene), 0) >= 0:
        return Found(plan, NONE, cost)
    return Found(plan, moving_room(scene, rollout, AMPLE), cost)


@compiled_once
def best_plan(scene: Scene, query: Query, kept: Plan, share: int) -> Found:
    """Return the plan of two extreme twists with the most room.

    The plan last followed is kept unless another is better by :data:`BETTER`. Share 0:
    all first twists are looked at, else the third of them whose turn it is; all
    constant twists in any case.
    """
    box, s = query.box, scene.settings[0]
    nothing = Found(kept, 2.0 * NONE, math.inf)
    first = looked_at(scene, query, kept, nothing)
    best, anew = Found(kept, first.room + BETTER, first.cost), False
    for i in range(9):
        twist = extreme(box, i)
        found = looked_at(scene, query, hold(twist[0], twist[1], s.horizon), best)
        if is_better(found, best):
            best, anew = found, True
    for i in range(9):
        if share > 0 and i % SHARES != share - 1:
            continue
        twist = extreme(box, i)
        rollout = roll_out(
            scene, hold(twist[0], twist[1], s.horizon), scene.last, 0.0, query.many
        )
        level = min(best.room, PLENTY) - ALIKE
        latest = time_until_near(scene, rollout, level, s.horizon)
        for switch in SWITCHES:
            if switch > latest:
                continue
            for j in range(9):
                then = extreme(box, j)
                if j == i:
                    continue
                plan = Plan(twist[0], twist[1], switch, then[0], then[1], s.horizon)
                found = looked_at(scene, query, plan, best)
                if is_better(found, best):
                    best, anew = found, True
    return best if anew else first
