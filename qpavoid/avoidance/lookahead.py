"""Look-ahead: a constant twist, driven on, must keep its distance from what comes.

The row of the present sees only the present distance. It is empty where an obstacle
comes from abeam of the axle, and late where one is fast; and where a wall is known as
points it makes the robot crawl, since every point ahead of a corner asks it to slow
down. Here the twist u = (v, ω) is driven on in thought, bodies keep their velocities,
and at times t_k up to the horizon the distances d_k(u) must stay above r_min:

    d_k(ū) + ∇d_k(ū)·(u − ū) ≥ r_min,   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

linearised about ū and iterated: sequential convexification in two unknowns, a QP each
time, by the same exact solver. Which side to pass on makes the problem one with several
local optima, so that it starts from several ū, keeps the cheapest answer, and changes
over only to one that is cheaper by more than the hysteresis. Of two ways that cost the
same the one to the right is taken.

With acceleration limits u is the twist aimed at, reached from the twist last driven at
full acceleration, and what is driven is the first step of that way.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.advancement import too_near
from qpavoid.avoidance.body_table import Body, body_at, comes_first, moves
from qpavoid.avoidance.broad_phase import Meeting, Watch, next_body
from qpavoid.avoidance.judge import lowest
from qpavoid.avoidance.linearisation import Tables, linearised_rows
from qpavoid.avoidance.prediction import Rollout, arc_at, frame_at, hold, roll_out
from qpavoid.avoidance.scene import Scene, tolerance
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.capsules import Segment
from qpavoid.model.contact import wall_contact
from qpavoid.model.kinematics import Frame
from qpavoid.qp.exact import Optimum, Terms, solve_exactly
from qpavoid.types import Box, Pair

ITERATIONS = 8
"""How often a twist is linearised about, or halved, at most."""

HALVINGS = 2
"""How often in a row the way to an answer is halved."""

HOPELESS, PATIENT = 3, 6
"""The same for a start that has not yet kept its distance; and while none has."""

DEAR = 4.0
"""An answer so many times dearer than the best one is not followed to its end."""

GAIN = 0.98
"""An answer that costs a greater part of the best one gains next to nothing."""

UNMOVED = 1e-3
"""m/s and rad/s; an answer so near to the twist before would only come again."""

IN_THE_WAY = 10.0
"""A twist that would stand in an obstacle's way at its end costs so much more."""

SLACK = 1e-3
"""m; by so much more than needed a linearisation that nothing satisfies is relaxed."""

PASSING = 3.0
"""m; an obstacle that has come so far has passed."""


class Query(NamedTuple):
    """Problem of the look-ahead.

    Attributes:
        box: The twists to choose from.
        desired: Of them, v and ω.
        many: Control steps in which accelerations are counted at once.
        tables: Memory.
    """

    box: Box
    desired: Pair
    many: int
    tables: Tables


class Candidate(NamedTuple):
    """A constant twist.

    Attributes:
        v: m/s.
        omega: rad/s.
        cost: Of the QP, (m/s)²; ``inf``: there is none.
    """

    v: float
    omega: float
    cost: float


@compiled_once
def twist_cost(scene: Scene, one: Pair, other: Pair) -> float:
    """Return (u − u')ᵀ W (u − u') of two twists, (m/s)²."""
    s, d_v, d_omega = scene.settings[0], one[0] - other[0], one[1] - other[1]
    return float(s.weight_v * d_v * d_v + s.weight_omega * d_omega * d_omega)


@compiled_once
def cost_of(scene: Scene, query: Query, v: float, omega: float) -> float:
    """Return the cost of the QP, (m/s)²."""
    return twist_cost(scene, (v, omega), query.desired)


@compiled_once
def first_near(scene: Scene, rollout: Rollout, first: int) -> Meeting:
    """Return the first violation along a rollout, in the order of the bodies' rows.

    From ``first`` on and then from the beginning, where that is none: −1. What stands
    is looked at for ``horizon_still``.
    """
    s, met, bodies = scene.settings[0], Meeting(-1, 0.0), scene.bodies
    watch = Watch((s.horizon, 0.0), (s.horizon_still, 0.0))
    if first >= 0:
        met = meeting_of(scene, rollout, first)
    i = next_body(scene, rollout, 0, watch)
    while i < bodies.shape[0] and (met.body < 0 or met.body != first):
        sooner = met.body < 0 or comes_first(bodies, i, met.body)
        if met.body >= 0 and first >= 0:
            # The order begins at `first` and goes on from the beginning, as round a
            # ring.
            wraps = comes_first(bodies, i, first)
            if wraps != comes_first(bodies, met.body, first):
                sooner = not wraps
        if sooner and i != first:
            found = meeting_of(scene, rollout, i)
            met = found if found.body >= 0 else met
        i = next_body(scene, rollout, i + 1, watch)
    return met


@compiled_once
def meeting_of(scene: Scene, rollout: Rollout, i: int) -> Meeting:
    """Return when body i comes too near, if it does.

    Where it stands nearer than r_min it may stay so near. Half of ε is left for what
    lies between two looks.
    """
    s = scene.settings[0]
    end = s.horizon if moves(scene, i) else s.horizon_still
    # What has less than r_min now is not asked for more than it has: it could not be
    # left at all.
    level, slack = min(body_at(scene, i).now, 0.0), 0.5 * tolerance(scene)
    # Less than that: the level of the judge, and nothing left to miss.
    if level < -slack:
        level, slack = lowest(scene), 0.0
    near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
    return Meeting(i if near else -1, time)


@compiled_once
def nearest_ahead(scene: Scene, query: Query, start: Pair, limit: float) -> Candidate:
    """Return a local optimum near a start, by sequential convexification.

    Linearised about the start and on about each answer. From a twist that keeps its
    distance the way to an answer that does not is halved, and so it is at last, from
    the twist that is followed (``limit`` infinite), to one that gains next to nothing:
    where the distance bends, the whole way leads from one side to the other and back.
    An answer dearer than ``limit`` is not followed.
    """
    twist, where, halved, settles = start, -1, 0, False
    best, tries = Candidate(0.0, 0.0, math.inf), HOPELESS
    if limit == math.inf:
        tries = PATIENT
    for iteration in range(ITERATIONS):
        rollout = driven_on(scene, query, twist)
        met = first_near(scene, rollout, where)
        if met.body < 0:
            halved, cost = 0, cost_of(scene, query, twist[0], twist[1])
            # Feasible: worth another linearisation only while the cost still falls.
            gains = cost <= GAIN * best.cost
            if settles or gains:
                best = Candidate(twist[0], twist[1], cost)
            if settles or not (gains or limit == math.inf):
                break
            if not gains:
                settles, twist = True, midpoint(twist, best)
                continue
        # Linearised too far from where it holds: half-way back to what keeps its
        # distance.
        elif best.cost < math.inf and halved < HALVINGS:
            halved, where, twist = halved + 1, met.body, midpoint(twist, best)
            continue
        elif best.cost < math.inf or iteration >= tries:
            break
        before, where = twist, met.body
        solved = next_twist(scene, query, rollout, met)
        twist = (solved.v, solved.omega)
        moved = abs(twist[0] - before[0]) + abs(twist[1] - before[1])
        if not solved.found or (met.body < 0 and moved < UNMOVED):
            break
        # What still violates something may become cheaper yet.
        dearest = limit if met.body < 0 else DEAR * limit
        if cost_of(scene, query, twist[0], twist[1]) > dearest:
            break
    return best


@compiled
def midpoint(twist: Pair, best: Candidate) -> Pair:
    """Return the twist half-way to a candidate."""
    return 0.5 * (twist[0] + best.v), 0.5 * (twist[1] + best.omega)


@compiled_once
def driven_on(scene: Scene, query: Query, twist: Pair) -> Rollout:
    """Return the rollout of a constant twist, a control step beyond the horizon."""
    s = scene.settings[0]
    plan = hold(twist[0], twist[1], s.horizon + s.dt)
    return roll_out(scene, plan, scene.last, 0.0, query.many)


@compiled_once
def next_twist(scene: Scene, query: Query, rollout: Rollout, met: Meeting) -> Optimum:
    """Return the answer of the QP that is linearised about a rollout."""
    s = scene.settings[0]
    m = linearised_rows(scene, rollout, met, query.tables)
    terms = Terms(query.box, query.desired, (s.weight_v, s.weight_omega), 0)
    return solve_exactly(query.tables.rows[: m + 4], terms, SLACK)


@compiled_once
def lets_pass(scene: Scene, rollout: Rollout) -> bool:
    """Return whether a robot at rest at the horizon lets every moving body pass.

    What moves on for :data:`PASSING` sweeps a wall as wide as it wants. A twist that
    does not let an obstacle pass may drive on before it for ever.
    """
    s, last = scene.settings[0], rollout.arcs.shape[0] - 1
    at = frame_at(arc_at(rollout.arcs, last), s.horizon, s.dt)
    for i in range(scene.bodies.shape[0]):
        body = body_at(scene, i)
        speed = math.sqrt(body.v_x**2 + body.v_y**2)
        if speed > 0.0:
            x1, y1 = seen_from(at, body, s.horizon)
            x2, y2 = seen_from(at, body, s.horizon + PASSING / speed)
            swept = wall_contact(scene.edges, Segment(x1, y1, x2, y2))
            if swept.distance < body.keep:
                return False
    return True


@compiled_once
def seen_from(at: Frame, body: Body, time: float) -> Pair:
    """Return where the pivot of a body is at a time, as seen from a frame."""
    d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
    return at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x


@compiled_once
def refine_candidate(
    scene: Scene, query: Query, start: Pair, limit: float
) -> Candidate:
    """Return the twist near the start that keeps its distance and lets others pass.

    That is, on the way from the nearest one back to the start. Where none does, the
    nearest itself at :data:`IN_THE_WAY` times its cost; what costs more than ``limit``
    is not looked at so closely.
    """
    found = nearest_ahead(scene, query, start, limit)
    if found.cost >= limit:
        return found
    for quarter in range(5):
        share = 0.25 * quarter
        v = found.v + share * (start[0] - found.v)
        omega = found.omega + share * (start[1] - found.omega)
        rollout = driven_on(scene, query, (v, omega))
        if not lets_pass(scene, rollout):
            continue
        if quarter == 0:
            return found
        if first_near(scene, rollout, -1).body < 0:
            return Candidate(v, omega, cost_of(scene, query, v, omega))
    return Candidate(found.v, found.omega, IN_THE_WAY * found.cost)
