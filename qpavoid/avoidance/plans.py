"""Search of plans of two twists, for scenes where no constant twist is clear."""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import room_at, too_near
from qpavoid.avoidance.body_table import moves
from qpavoid.avoidance.broad_phase import UNWATCHED, Watch, first_met, next_body
from qpavoid.avoidance.prediction import Plan, Rollout, hold, roll_out, whole_steps
from qpavoid.avoidance.proposals import Query, twist_cost
from qpavoid.avoidance.scene import Scene, threshold
from qpavoid.avoidance.verdict import moving_margin
from qpavoid.compiled import compiled, compiled_once
from qpavoid.types import Box, Pair

SWITCHES = (1.6, 1.1, 0.7, 0.4, 0.2, 0.1)
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
