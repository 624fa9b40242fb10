"""Plans of two twists, by search: for where no constant one keeps its distance."""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import room_at, too_near
from qpavoid.avoidance.body_table import moves
from qpavoid.avoidance.broad_phase import UNWATCHED, Watch, first_met, next_body
from qpavoid.avoidance.judge import lowest, moving_room
from qpavoid.avoidance.lookahead import Query, cost_of
from qpavoid.avoidance.prediction import Plan, Rollout, hold, roll_out, whole_steps
from qpavoid.avoidance.scene import Scene
from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Box, Pair

SWITCHES = (1.6, 1.1, 0.7, 0.4, 0.2, 0.1)
"""s; when a plan of two twists may go over to its second, in whole control steps."""

PLENTY = 0.01
"""m of room; of plans with as much the cheapest is taken."""

MOST_ROOM = 3.0
"""m; of plans that cost the same the one with more room is taken, up to so much."""

ALIKE = 1e-3
"""m of room; of plans with as many of them the cheaper is taken."""

BETTER = 3e-3
"""m by which another plan must be better to be taken up."""

SHARES = 3
"""Steps over which the search is spread once it has been done in full."""

NO_ROOM = -1e9
"""m; the room of a plan that is refused: it drives into what stands, or it cannot be
the best."""

NOTHING_YET = 2.0 * NO_ROOM
"""m; less than of any plan: what the first one is compared with."""


class Found(NamedTuple):
    """A plan with its evaluation.

    Attributes:
        plan: With the twist that it begins with as its target.
        room: Least room of what moves, m, as far as it matters; :data:`NO_ROOM`: it
            comes too near to what stands.
        cost: Of its first twist, and a tenth of that of its second, (m/s)².
        body: That is met, and where the next plan is looked at first; −1: none.
        time: When, s.
    """

    plan: Plan
    room: float
    cost: float
    body: int
    time: float


@compiled
def is_refused(found: Found) -> bool:
    """Return whether a plan has :data:`NO_ROOM`, whatever was added to that."""
    return not found.room > 0.5 * NO_ROOM


@compiled
def evenly(box: Box, number: int) -> Pair:
    """Return one of twenty-five twists, five by five from limit to limit."""
    v = box.v_min + 0.25 * (number // 5) * (box.v_max - box.v_min)
    width = box.omega_max - box.omega_min
    return v, box.omega_min + 0.25 * (number % 5) * width


@compiled
def extreme(box: Box, number: int) -> Pair:
    """Return one of the nine twists of which either part is least, 0 or greatest."""
    v = (box.v_min, 0.0, box.v_max)[number // 3]
    return v, (box.omega_min, 0.0, box.omega_max)[number % 3]


@compiled_once
def plan_cost(scene: Scene, query: Query, plan: Plan) -> float:
    """Return the cost of a plan: see :class:`Found`."""
    cost = cost_of(scene, query, plan.v, plan.omega)
    return cost + 0.1 * cost_of(scene, query, plan.v_then, plan.omega_then)


@compiled
def worth(room: float) -> float:
    """Return the room that counts, m: in whole :data:`ALIKE`, up to what is plenty."""
    # In steps: less than a millimetre more of room is worth no dearer plan.
    return ALIKE * math.floor(min(room, PLENTY) / ALIKE)


@compiled_once
def is_better(one: Found, other: Found) -> bool:
    """Return whether a plan is worth more, or costs less, or has more room.

    An order of all plans, whatever the order in which they are looked at.
    """
    if worth(one.room) != worth(other.room):
        return one.room > other.room
    if one.cost != other.cost:
        return one.cost < other.cost
    return one.room > other.room


@compiled
def level_of(scene: Scene, i: int, level: float) -> float:
    """Return the room that a body must leave to a plan, m."""
    return level if moves(scene, i) else lowest(scene)


@compiled_once
def time_until_near(scene: Scene, rollout: Rollout, level: float, end: float) -> float:
    """Return when something comes nearer than a level first, s; at most ``end``."""
    watch = Watch((end, level), (end, lowest(scene)))
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
    """Evaluate a plan, as far as it can be better than the best so far.

    Args:
        scene: Of the step.
        query: What is desired.
        plan: To be looked at.
        best: So far.
        last: Looked at before; where that failed is looked first.
    """
    cost, body, time = plan_cost(scene, query, plan), last.body, last.time
    failed = Found(plan, NO_ROOM, cost, body, time)
    level = worth(best.room)
    if best.room >= PLENTY and cost > best.cost:
        return failed
    rollout = roll_out(scene, plan, scene.last, 0.0, query.many)
    # What stopped the last plan stops most of the next ones: one look there refuses
    # them.
    if body >= 0 and room_at(scene, rollout, body, time) < level_of(scene, body, level):
        return failed
    moving, still = (scene.settings[0].horizon, level), (rollout.rest, lowest(scene))
    met = first_met(scene, rollout, Watch(moving, UNWATCHED), ALIKE)
    if met.body < 0:
        met = first_met(scene, rollout, Watch(UNWATCHED, still), ALIKE)
    if met.body >= 0:
        return Found(plan, NO_ROOM, cost, met.body, met.time)
    return Found(plan, moving_room(scene, rollout, MOST_ROOM), cost, body, time)


@compiled_once
def best_plan(scene: Scene, query: Query, kept: Plan, share: int) -> Found:
    """Return the plan of two extreme twists with the most room.

    The plan last followed is kept unless another is better by :data:`BETTER`. Share 0:
    all first twists are looked at, else the third of them whose turn it is; all
    constant twists in any case.
    """
    box, s, anew = query.box, scene.settings[0], False
    end = whole_steps(s.horizon, s.dt)
    nothing = Found(kept, NOTHING_YET, math.inf, -1, 0.0)
    first = looked_at(scene, query, kept, nothing, nothing)
    # As if it had so much more room: another one has to be better by that.
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
        # To switch over after the violation is too late for every second twist.
        latest, before = time_until_near(scene, rollout, level, s.horizon), 0.0
        for time in SWITCHES:
            switch = whole_steps(time, s.dt)
            if switch > latest or switch == before:
                continue
            before = switch
            for j in range(9):
                then = extreme(box, j)
                # A constant twist, looked at above.
                if j == i:
                    continue
                plan = Plan(twist[0], twist[1], switch, then[0], then[1], end)
                last = looked_at(scene, query, plan, best, last)
                if is_better(last, best):
                    best, anew = last, True
    return best if anew else first
