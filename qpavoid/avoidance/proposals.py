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

from qpavoid.avoidance.barrier_rows import wheel_rows
from qpavoid.avoidance.body_table import any_moves
from qpavoid.avoidance.broad_phase import Meeting, Watch, first_met, is_met
from qpavoid.avoidance.linearisation import Tables, linearised_rows
from qpavoid.avoidance.prediction import Rollout, hold, roll_out
from qpavoid.avoidance.scene import Scene, tolerance
from qpavoid.avoidance.state import (
    DUE,
    FREE,
    GROUP,
    NEW_PLAN,
    TARGET_MODE,
    kept_plan,
)
from qpavoid.avoidance.verdict import first_target
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.robot import RELATIVE_ROUNDING, clipped, within_wheels
from qpavoid.qp.exact import Optimum, Terms, solve_exactly
from qpavoid.types import Array, Box, Pair

ITERATIONS = 8
"""Greatest number of QPs from one start."""

HALVINGS = 2
"""Greatest number of successive halvings of the trust region."""

HOPELESS, PATIENT = 3, 6
"""Greatest number of iterations of a start without a feasible twist; and the same while
no start has one."""

DEAR = 4.0
"""Cost relative to the best one above which a start is abandoned."""

GAIN = 0.98
"""Cost relative to the best one above which a solution counts as no improvement."""

UNMOVED = 1e-3
"""m/s and rad/s; step below which the iteration has converged."""

CHEAP = 1e-3
"""(m/s)²; cost below which no other start is searched."""

GROUPS = 4
"""Groups of starts: ahead to either side; the desired twist and rest; straight back and
straight ahead; back to either side. Mirror images are in the same group."""


class Query(NamedTuple):
    """Problem of the look-ahead.

    Attributes:
        box: Limits of the target.
        command: v and ω.
        desired: The same, with look-ahead within the limits.
        many: Control steps per arc of a ramp, driven with their mean twist.
        tables: Memory.
        rows: Memory of the QP; the first ``separating`` rows are filled in.
        separating: Rows of the present, of static obstacles inside r_min.
        slack_tolerance: See :func:`qpavoid.qp.exact.relaxation`.
        ahead: Whether with look-ahead.
    """

    box: Box
    command: Pair
    desired: Pair
    many: int
    tables: Tables
    rows: Array
    separating: int
    slack_tolerance: float
    ahead: bool


class Proposal(NamedTuple):
    """Solution of a QP: a constant twist.

    Attributes:
        twist: v, m/s, and ω, rad/s.
        cost: Of the QP, (m/s)²; ``inf``: none found.
        about: Twist about which the QP was linearised.
        met: Violation along the rollout of ``about``.
        trust: Half-widths of the trust region about ``about``.
        ahead: Whether the QP has linearised rows.
    """

    twist: Pair
    cost: float
    about: Pair
    met: Meeting
    trust: Pair
    ahead: bool


WHOLE, POINT = (math.inf, math.inf), (0.0, 0.0)
"""Trust regions: all twists, and one."""

SAME_TWIST = 1e-9
"""m/s and rad/s; tolerance of equal twists."""


@compiled_once
def twist_cost(scene: Scene, one: Pair, other: Pair) -> float:
    """Return (u − u')ᵀ W (u − u') of two twists, (m/s)²."""
    s, d_v, d_omega = scene.settings[0], one[0] - other[0], one[1] - other[1]
    return float(s.weight_v * d_v * d_v + s.weight_omega * d_omega * d_omega)


@compiled_once
def violation(scene: Scene, rollout: Rollout, first: int) -> Meeting:
    """Return a violation along a rollout; −1 if there is none.

    Body ``first`` is checked first, then the others in the order of their rows. Static
    bodies are checked for ``horizon_still``. Half of ε is left for errors between
    samples.
    """
    s, slack = scene.settings[0], 0.5 * tolerance(scene)
    watch = Watch((s.horizon, 0.0), (s.horizon_still, 0.0))
    if first >= 0:
        met = is_met(scene, rollout, first, watch, slack)
        if met.body >= 0:
            return met
    return first_met(scene, rollout, watch, slack)


@compiled_once
def driven_on(scene: Scene, query: Query, twist: Pair) -> Rollout:
    """Return the rollout of a constant twist, a control step beyond the horizon."""
    s = scene.settings[0]
    plan = hold(twist[0], twist[1], s.horizon + s.dt)
    return roll_out(scene, plan, scene.last, 0.0, query.many)


class Problem(NamedTuple):
    """A QP: its rows are the first of the memory.

    Attributes:
        m: Number of rows: separating, linearised, and the wheels' hard ones.
        terms: The rest of the problem.
    """

    m: int
    terms: Terms


@compiled_once
def qp_of(scene: Scene, query: Query, proposal: Proposal) -> Problem:
    """Fill in the rows of a proposal's QP."""
    count = query.separating
    if proposal.ahead:
        rollout = driven_on(scene, query, proposal.about)
        count += linearised_rows(
            scene, rollout, proposal.met, query.tables, query.rows[count:]
        )
    return with_limits(scene, query, proposal, count)


@compiled_once
def with_limits(scene: Scene, query: Query, proposal: Proposal, count: int) -> Problem:
    """Add the wheels' rows to so many, and the limits."""
    s, hard = scene.settings[0], wheel_rows(scene.robot, query.rows[count:])
    box, (d_v, d_omega) = query.box, proposal.trust
    v, omega = clipped(proposal.about, box)  # rounding may have left the box
    # fmt: off
    box = Box(max(box.v_min, v - d_v), min(box.v_max, v + d_v),
              max(box.omega_min, omega - d_omega), min(box.omega_max, omega + d_omega))
    # fmt: on
    weights = (s.weight_v, s.weight_omega)
    return Problem(count + hard, Terms(box, query.desired, weights, hard))


@compiled
def solution(query: Query, qp: Problem) -> Optimum:
    """Return the solution of a QP."""
    return solve_exactly(query.rows[: qp.m + 4], qp.terms, query.slack_tolerance)


@compiled
def nowhere(twist: Pair, trust: Pair, ahead: bool) -> Proposal:
    """Return the problem about a twist, without a solution."""
    return Proposal(twist, math.inf, twist, Meeting(-1, 0.0), trust, ahead)


@compiled
def snapped(query: Query, twist: Pair) -> Pair:
    """Return the desired twist for one that equals it but for rounding."""
    d_v, d_omega = twist[0] - query.desired[0], twist[1] - query.desired[1]
    return query.desired if max(abs(d_v), abs(d_omega)) <= SAME_TWIST else twist


@compiled_once
def solved(scene: Scene, query: Query, problem: Proposal, count: int) -> Proposal:
    """Return the solution of a problem whose first rows are filled in.

    Its cost is ``inf`` if there is none.
    """
    found = solution(query, with_limits(scene, query, problem, count))
    twist, cost = snapped(query, (found.v, found.omega)), math.inf
    if found.found:
        cost = twist_cost(scene, twist, query.desired)
    _, _, about, met, trust, ahead = problem
    return Proposal(twist, cost, about, met, trust, ahead)


@compiled_once
def proposal_near(scene: Scene, query: Query, start: Pair, limit: float) -> Proposal:
    """Return a local optimum near a start, by sequential convexification.

    Each QP is linearised about the last solution. If its solution is not feasible, the
    trust region about a feasible one is halved. The start itself, if feasible, is the
    solution in a trust region of width 0. A start whose cost exceeds ``limit`` is
    abandoned.
    """
    trial = nowhere(within_wheels(scene.robot, start), POINT, True)
    best, about, where, halved, count = trial, trial, -1, 0, 0
    tries = PATIENT if limit == math.inf else HOPELESS
    for iteration in range(ITERATIONS):
        rollout = driven_on(scene, query, trial.twist)
        met, trust = violation(scene, rollout, where), WHOLE
        where = met.body
        cost = twist_cost(scene, trial.twist, query.desired)
        if met.body < 0:
            halved, gains = 0, cost <= GAIN * best.cost
            if cost < best.cost:
                best = at_cost(trial, cost)
            if not gains:
                break
        elif best.cost < math.inf:
            if halved == HALVINGS:
                break
            halved, (v, omega) = halved + 1, trial.twist
            trust = (0.5 * abs(v - about.twist[0]), 0.5 * abs(omega - about.twist[1]))
        elif iteration >= tries:
            break
        if halved == 0:
            about = Proposal(trial.twist, cost, trial.twist, met, WHOLE, True)
            count = query.separating + linearised_rows(
                scene, rollout, met, query.tables, query.rows[query.separating :]
            )
        qp = Proposal(about.twist, cost, about.twist, about.met, trust, True)
        found = solved(scene, query, qp, count)
        d_v, d_omega = found.twist[0] - trial.twist[0], found.twist[1] - trial.twist[1]
        unmoved = met.body < 0 and abs(d_v) + abs(d_omega) < UNMOVED
        # An infeasible twist may still become cheaper.
        dearest = limit if met.body < 0 else DEAR * limit
        if unmoved or found.cost == math.inf or found.cost > dearest:
            break
        trial = found
    return best


@compiled_once
def best_proposal(scene: Scene, query: Query, state: Array) -> Proposal:
    """Return the cheapest constant twist that is clear for the horizon.

    The present target is refined in every step. The other starts are searched within
    ``review`` seconds, one group after the other; all at once when its own search fails
    (half of them if nothing moves: braking suffices); one group per step while there is
    none. The cost is the QP's, reduced by the hysteresis for the present target and
    increased by the cost of the change for others.
    """
    s, target = scene.settings[0], first_target(scene, kept_plan(state))
    best, follows = nowhere(query.desired, WHOLE, True), state[TARGET_MODE] != FREE
    due = GROUPS if any_moves(scene) else GROUPS // 2
    if follows:
        best = proposal_near(scene, query, target, math.inf)
        if best.cost < math.inf:
            best = at_cost(best, best.cost * (1.0 - s.hysteresis))
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
            found = proposal_near(scene, query, start, limit)
            cost = found.cost
            if follows:
                cost += s.hysteresis * twist_cost(scene, found.twist, target)
            # Mirror images cost the same but for rounding: keep the first, to the
            # right.
            if cost < best.cost * (1.0 - RELATIVE_ROUNDING):
                best = at_cost(found, cost)
    return best


@compiled
def at_cost(found: Proposal, cost: float) -> Proposal:
    """Return a proposal with another cost."""
    return Proposal(found.twist, cost, found.about, found.met, found.trust, found.ahead)


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
