"""Look-ahead: a constant twist whose predicted distances stay above r_min.

A row of the present constrains only the present distance. It vanishes for an obstacle
that approaches abeam of the axle, comes late for a fast one, and makes the robot crawl
along a wall given as points, since every point ahead of a corner slows it down. Here
the twist u = (v, ω) is held in a prediction, bodies keep their velocities, and at times
t_k up to the horizon the distances d_k(u) must stay above r_min:

    d_k(ū) + ∇d_k(ū)·(u − ū) ≥ r_min,   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

linearised about ū and iterated: sequential convexification in two unknowns, one QP per
iteration, by the exact solver. The choice of the passing side gives several local
optima: the iteration starts from several ū, takes the cheapest solution, and switches
only to one that is cheaper by more than the hysteresis. Of two solutions of equal cost
the one to the right is taken.

With acceleration limits u is the target twist, reached from the last twist at full
acceleration, and the first step towards it is driven.
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
"""Greatest number of linearisations, or halvings, from one start."""

HALVINGS = 2
"""Greatest number of successive halvings of the step to a solution."""

HOPELESS, PATIENT = 3, 6
"""Greatest number of iterations of a start without a feasible twist; and the same while
no start has one."""

DEAR = 4.0
"""Cost relative to the best one above which a start is abandoned."""

GAIN = 0.98
"""Cost relative to the best one above which a solution counts as no improvement."""

UNMOVED = 1e-3
"""m/s and rad/s; step below which the iteration has converged."""

IN_THE_WAY = 10.0
"""Factor of the cost of a twist that ends in the path of a moving body."""

SLACK = 1e-3
"""m; additional relaxation of an infeasible linearisation."""

PASSING = 3.0
"""m; distance after which a moving obstacle has passed."""


class Query(NamedTuple):
    """Problem of the look-ahead.

    Attributes:
        box: Limits of the target.
        desired: v and ω.
        many: Control steps per arc of a ramp, driven with their mean twist.
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
        cost: Of the QP, (m/s)²; ``inf``: none found.
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

    Cyclic, starting at row ``first``; −1 if there is none. Static bodies are checked
    for ``horizon_still``.
    """
    s, met, bodies = scene.settings[0], Meeting(-1, 0.0), scene.bodies
    watch = Watch((s.horizon, 0.0), (s.horizon_still, 0.0))
    if first >= 0:
        met = meeting_of(scene, rollout, first)
    i = next_body(scene, rollout, 0, watch)
    while i < bodies.shape[0] and (met.body < 0 or met.body != first):
        sooner = met.body < 0 or comes_first(bodies, i, met.body)
        if met.body >= 0 and first >= 0:
            # Cyclic order from `first`.
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
    """Return the violation of body i along a rollout, if any.

    A static body inside r_min may stay as near. Half of ε is left for errors between
    samples.
    """
    s = scene.settings[0]
    end = s.horizon if moves(scene, i) else s.horizon_still
    # Inside r_min the present distance suffices: else it could not be left.
    level, slack = min(body_at(scene, i).now, 0.0), 0.5 * tolerance(scene)
    # Below that: the judge's threshold, without slack.
    if level < -slack:
        level, slack = lowest(scene), 0.0
    near, time = too_near(scene, rollout, i, (0.0, end), level, slack)
    return Meeting(i if near else -1, time)


@compiled_once
def nearest_ahead(scene: Scene, query: Query, start: Pair, limit: float) -> Candidate:
    """Return a local optimum near a start, by sequential convexification.

    Each iteration linearises about the last solution. The step from a feasible twist to
    an infeasible one is halved; on the followed twist (``limit`` infinite) also a step
    that gains next to nothing, since a full step may oscillate about a curved boundary.
    A start whose cost exceeds ``limit`` is abandoned.
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
            # Feasible: linearise again only while the cost decreases.
            gains = cost <= GAIN * best.cost
            if settles or gains:
                best = Candidate(twist[0], twist[1], cost)
            if settles or not (gains or limit == math.inf):
                break
            if not gains:
                settles, twist = True, midpoint(twist, best)
                continue
        # Outside the linearisation's validity: half-way back to the feasible twist.
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
        # An infeasible twist may still become cheaper.
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
    """Return the solution of the QP linearised about a rollout."""
    s = scene.settings[0]
    m = linearised_rows(scene, rollout, met, query.tables)
    terms = Terms(query.box, query.desired, (s.weight_v, s.weight_omega), 0)
    return solve_exactly(query.tables.rows[: m + 4], terms, SLACK)


@compiled_once
def lets_pass(scene: Scene, rollout: Rollout) -> bool:
    """Return whether a robot at rest at the horizon is out of every moving body's path.

    The body sweeps :data:`PASSING` m, with its required distance. A twist that ends in
    its path may drive ahead of it indefinitely.
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
    """Return the pivot of a body at a time, in a frame, m."""
    d_x, d_y = body.x + time * body.v_x - at.x, body.y + time * body.v_y - at.y
    return at.cos * d_x + at.sin * d_y, at.cos * d_y - at.sin * d_x


@compiled_once
def refine_candidate(
    scene: Scene, query: Query, start: Pair, limit: float
) -> Candidate:
    """Return a feasible twist near the start that is out of moving bodies' paths.

    Searched from the nearest optimum back to the start. If none is, the optimum itself
    at :data:`IN_THE_WAY` times its cost. Above a cost of ``limit`` it is not searched.
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
