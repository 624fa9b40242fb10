"""Look-ahead: a constant twist whose predicted distances stay above r_min.

A row of the present constrains only the present distance. It vanishes for an obstacle
that approaches abeam of the axle, comes late for a fast one, and makes the robot crawl
along a wall given as points, since every point ahead of a corner slows it down. Here
the twist u = (v, ω) is held in a prediction, bodies keep their velocities, and at times
t_k up to the horizon the distances d_k(u) must stay above r_min:

    d_k(ū) + ∇d_k(ū)·(u − ū) ≥ r_min,   ∇d_k = d̂_oᵀ ∂P_r(t_k)/∂u,

with P_r the footprint point nearest then, linearised about ū and iterated: sequential
convexification in two unknowns, one QP per iteration, by the exact solver. The choice
of the passing side gives several local optima: the iteration starts from several ū,
takes the cheapest solution, and switches only to one that is cheaper by more than the
hysteresis. Of two solutions of equal cost the one to the right is taken.

With acceleration limits u is the target twist, reached from the last twist at full
acceleration, and the first step towards it is driven.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import (
    Body,
    Scene,
    any_moves,
    ends_at,
    moves,
    part_contact,
    precedes,
    tolerance,
)
from qpavoid.avoidance.cbf_rows import wheel_rows
from qpavoid.avoidance.margin import (
    Violation,
    Watch,
    circle_margin,
    closing_speed,
    next_body,
    passing_speed,
    violation,
)
from qpavoid.avoidance.plan import (
    AS_COMMANDED,
    SAME_TIME,
    SEARCHED,
    Arc,
    Rollout,
    Slopes,
    arc_index,
    braking_place,
    coarse_steps,
    frame_at,
    hold,
    plan_of,
    roll_out,
)
from qpavoid.avoidance.verdict import first_target
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.contact import part_at
from qpavoid.model.kinematics import TINY, Frame, moved_on
from qpavoid.model.robot import RELATIVE_ROUNDING, clipped, within_wheels
from qpavoid.qp.exact import A_OMEGA, A_V, ROW_OWNER, B, Optimum, Terms, solve_exactly
from qpavoid.qp.solve import RESIDUAL_TOLERANCE
from qpavoid.types import Array, Box, Pair, Row, Table, layout

ROW_ROOM = 2e-3
"""m; added to r_min in the linearised rows, so that the true distance keeps r_min."""

BARELY_TURNED = 1e-3
"""rad; turn of an arc below which its slopes are those of a line, to 1e-6 of them."""

ROW_WITHIN = 0.25
"""m; margin above which a distance gets no row in this iteration."""

STRIDE, OCTANTS = 4, 8
"""Ticks, and directions of the normal, that share one row each."""

DIAGONAL = math.tan(math.pi / 8.0)
"""tan 22.5°: sectors are centred on axes and diagonals, where flat sides lie."""


class Query(NamedTuple):
    """Problem of the look-ahead.

    Attributes:
        box: Limits of the target.
        command: v and ω as requested.
        desired: The command; with look-ahead clipped to the limits.
        predicted: Memory of the predicted contacts.
        frames: Memory of the robot's frames at the ticks.
        closer: Memory of :func:`qpavoid.avoidance.selection.at_min_clearance`.
        rows: Memory of the QP; the first ``present`` rows are filled in.
        present: Number of rows of the present: with look-ahead of static obstacles
            inside r_min only, without it of all obstacles in reach.
        slack_tolerance: See :func:`qpavoid.qp.exact.relaxation`.
        ahead: Whether with look-ahead.
    """

    box: Box
    command: Pair
    desired: Pair
    predicted: Table
    frames: Table
    closer: Table
    rows: Array
    present: int
    slack_tolerance: float
    ahead: bool


class Predicted(NamedTuple):
    """A future contact that gets a row.

    Attributes:
        x: P_r in the robot frame of that time, m.
        y: Of P_r, m.
        n_x: Outward normal of the footprint there, in the same frame.
        n_y: Of the normal.
        margin: Margin, m.
        time: s.
        body: Its number.
    """

    x: float
    y: float
    n_x: float
    n_y: float
    margin: float
    time: float
    body: int


PREDICTED, FRAME = layout(Predicted), layout(Frame)
PREDICTED_SIZE, FRAME_SIZE = PREDICTED.itemsize // 8, FRAME.itemsize // 8
"""Layouts of the tables of predicted contacts and frames, and numbers per row."""


@entry
@compiled
def most_predicted(ticks: int) -> int:
    """Return the greatest number of predicted contacts within so many ticks."""
    return (ticks + STRIDE - 1) // STRIDE * OCTANTS


@compiled_once
def sector(n_x: float, n_y: float) -> int:
    """Return the octant of a direction, 0 to 7."""
    if abs(n_y) <= DIAGONAL * abs(n_x):
        return 0 if n_x > 0.0 else 4
    if abs(n_x) < DIAGONAL * abs(n_y):
        return 2 if n_y > 0.0 else 6
    if n_x > 0.0:
        return 1 if n_y > 0.0 else 7
    return 3 if n_y > 0.0 else 5


@compiled_once
def note_contact(
    scene: Scene, i: int, body: Body, time: float, at: Frame, predicted: Table
) -> float:
    """Store the contacts with a body at a time that get a row; return the least margin.

    One contact per convex part. Of a static body the margin that is missing now is
    added, up to :data:`ROW_ROOM`.

    Args:
        scene: Of the step.
        i: Number of the body.
        body: The body.
        time: s.
        at: Frame of the robot then.
        predicted: Updated.
    """
    ends, tick, stop = ends_at(body, time, at), scene.settings[0].tick, 0
    least, missing = math.inf, max(ROW_ROOM - body.margin_now, 0.0)
    while stop < scene.edges.shape[0]:
        part = part_at(scene.edges, stop)
        contact, stop = part_contact(scene.edges, part, body, ends), part.end
        margin = contact.distance - body.required + missing
        least = min(least, margin)
        if margin < ROW_WITHIN:
            # Ticks 1 to STRIDE share slot 0, the next ones slot 1, independent of
            # rounding.
            slot = max(math.ceil(time / tick - SAME_TIME) - 1, 0) // STRIDE
            row = slot * OCTANTS + sector(contact.n_x, contact.n_y)
            one = predicted[row]
            # Of equal margins the first row's: independent of the order of points.
            if margin < one.margin or (
                margin == one.margin and precedes(scene.bodies, i, one.body)
            ):
                p_x, p_y, n_x, n_y = contact.x, contact.y, contact.n_x, contact.n_y
                predicted[row] = Predicted(p_x, p_y, n_x, n_y, margin, time, i)
    return least


@compiled_once
def predict_contacts(
    scene: Scene, rollout: Rollout, predicted: Table, frames: Table
) -> None:
    """Fill in the contacts that get a row of the linearisation.

    Contacts with similar normals at about the same time give similar rows; the one with
    the least margin gets the row of its :data:`STRIDE` and sector. A body is sampled
    again when its margin may have changed by its value. A missed contact costs at most
    an iteration, since the solution is verified in full.
    """
    s, arcs = scene.settings[0], rollout.arcs
    for k in range(frames.shape[0]):
        frames[k].cos = math.inf
    for row in range(predicted.shape[0]):
        # Empty: no smaller margin yet.
        predicted[row].margin = ROW_WITHIN
    watch = Watch((s.horizon, ROW_WITHIN), (s.horizon_still, ROW_WITHIN))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        body, end = scene.bodies[i], s.horizon if moves(scene, i) else s.horizon_still
        last, k = round(end / s.tick), 1
        pace = s.tick * closing_speed(scene, rollout, body) + TINY
        passing = s.tick * passing_speed(scene, rollout, body) + TINY
        while k <= last:
            time = s.tick * k
            # An impossible cosine marks a frame not filled in for this rollout.
            if frames[k].cos > 1.0:
                frames[k] = frame_at(arcs[arc_index(arcs, 0, time)], time, s.dt)
            at = Frame(frames[k].x, frames[k].y, frames[k].cos, frames[k].sin)
            margin = circle_margin(scene, body, time, at)
            if margin > 2.0 * ROW_WITHIN:
                k += 2 + int(min((margin - ROW_WITHIN) / passing, last))
                continue
            margin = note_contact(scene, i, body, time, at, predicted)
            # At least every other tick: neighbouring rows are nearly equal.
            k += 2 + int(min(abs(margin) / pace, last))
        i = next_body(scene, rollout, i + 1, watch)


@compiled_once
def bend_by_turning(v: float, omega: float, time: float, one: Frame) -> Pair:
    """Return ∂(x, y)/∂ω after driving (v, ω) for a time; ``one``: after (1 m/s, ω)."""
    if abs(omega * time) < BARELY_TURNED:
        # The closed form is ill-conditioned for small ω: its series instead.
        return -v * omega * time**3 / 3.0, 0.5 * v * time**2
    radius = v / omega
    return radius * (time * one.cos - one.x), radius * (time * one.sin - one.y)


@compiled_once
def slopes_at(arc: Arc, time: float, dt: float) -> Slopes:
    """Return the slopes at a time on an arc from those at its start.

    With p the position on the arc, s_v and s_ω the derivatives of its twist by the
    target: ∂p/∂v = s_v p/v; a turn of the arc's frame rotates p, and ω bends it.
    """
    place, turn = braking_place(time - arc.begin, arc.steps, dt), arc.turn
    one = moved_on(Frame(0.0, 0.0, 1.0, 0.0), 1.0, arc.omega, place)
    b_x, b_y = bend_by_turning(arc.v, arc.omega, place, one)
    # Bending by ω on this arc, and rotation of its chord with the initial heading.
    l_x = arc.slope_omega * b_x - turn * arc.v * one.y
    l_y = arc.slope_omega * b_y + turn * arc.v * one.x
    return Slopes(
        arc.cos * one.cos - arc.sin * one.sin,
        arc.sin * one.cos + arc.cos * one.sin,
        arc.x_v + arc.slope_v * (arc.cos * one.x - arc.sin * one.y),
        arc.y_v + arc.slope_v * (arc.sin * one.x + arc.cos * one.y),
        arc.x_omega + arc.cos * l_x - arc.sin * l_y,
        arc.y_omega + arc.sin * l_x + arc.cos * l_y,
        turn + arc.slope_omega * place,
    )


@compiled_once
def fill_slopes(rollout: Rollout, dt: float) -> None:
    """Fill in the slopes at the start of every arc."""
    arcs = rollout.arcs
    for row in range(1, arcs.shape[0]):
        slopes = slopes_at(arcs[row - 1], arcs[row].begin, dt)
        arcs[row].x_v, arcs[row].y_v = slopes.x_v, slopes.y_v
        arcs[row].x_omega, arcs[row].y_omega = slopes.x_omega, slopes.y_omega
        arcs[row].turn = slopes.turn


@compiled_once
def linearised_rows(
    scene: Scene, query: Query, rollout: Rollout, about: Pair, met: Violation
) -> int:
    """Fill in the rows margin + ∇d·(u − ū) ≥ :data:`ROW_ROOM`, m; return all rows.

    Their number includes those of the present. ū is ``about``, of the rollout. One row
    per side with a margin below :data:`ROW_WITHIN`, including that of the violation
    ``met``, which may lie between two ticks.
    """
    predicted, rows = query.predicted, query.rows
    predict_contacts(scene, rollout, predicted, query.frames)
    if met.body >= 0:
        arc = rollout.arcs[arc_index(rollout.arcs, 0, met.time)]
        then = frame_at(arc, met.time, scene.settings[0].dt)
        body = scene.bodies[met.body]
        note_contact(scene, met.body, body, met.time, then, predicted)
    fill_slopes(rollout, scene.settings[0].dt)
    arcs, dt, count = rollout.arcs, scene.settings[0].dt, query.present
    for i in range(predicted.shape[0]):
        one = predicted[i]
        if one.margin >= ROW_WITHIN:
            continue
        arc = arcs[arc_index(arcs, 0, one.time)]
        n_x, n_y, at = one.n_x, one.n_y, slopes_at(arc, one.time, dt)
        # d shrinks as P_r moves along t, the outward normal: ∇d = −tᵀ ∂P_r/∂u.
        t_x, t_y = at.cos * n_x - at.sin * n_y, at.sin * n_x + at.cos * n_y
        a_v = -t_x * at.x_v - t_y * at.y_v
        # P_r turns with the robot, as in J_0 of Eq. 4.
        a_omega = (n_x * one.y - n_y * one.x) * at.turn
        a_omega = a_omega - t_x * at.x_omega - t_y * at.y_omega
        rows[count, A_V], rows[count, A_OMEGA] = a_v, a_omega
        rows[count, B] = a_v * about[0] + a_omega * about[1] + ROW_ROOM - one.margin
        rows[count, ROW_OWNER] = scene.bodies[one.body].owner
        count += 1
    return count


ITERATIONS = 8
"""Greatest number of QPs from one start."""

HALVINGS = 2
"""Greatest number of successive halvings of the trust region."""

PATIENT = 6
"""Greatest number of QPs from one start without a feasible twist."""

DEAR = 4.0
"""Cost relative to the best one above which an infeasible twist is abandoned; its
square is that of a start."""

GAIN = 0.98
"""Cost relative to the best one above which a solution counts as no improvement."""

UNMOVED = 1e-3
"""m/s and rad/s; step below which the iteration has converged."""

CHEAP = 1e-3
"""(m/s)²; cost below which no other start is searched."""

SEPARATION, UNSEPARATED = 1e-3, 100.0
"""s; factor of the rows of the present in a QP with look-ahead, where other rows are in
metres: small, so that of conflicting rows these are relaxed. And m/s; cost per
violation of them."""

GROUPS = 3
"""Groups of starts: the desired twist and rest; ahead to either side; back to either
side. Mirror images are in the same group."""


class Proposal(NamedTuple):
    """A QP linearised about a twist, and its solution: a constant twist.

    Attributes:
        twist: v, m/s, and ω, rad/s.
        cost: Of the QP, (m/s)²; ``inf``: none found.
        about: Twist about which the QP was linearised.
        met: Violation along the rollout of ``about``.
        trust: Half-widths of the trust region about ``about``.
        linearised: Whether the QP has rows of future distances.
    """

    twist: Pair
    cost: float
    about: Pair
    met: Violation
    trust: Pair
    linearised: bool


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
def row_violation(query: Query, twist: Pair) -> float:
    """Return the greatest violation of the rows of the present, m/s; 0: by rounding."""
    rows, least = query.rows, RESIDUAL_TOLERANCE * SEPARATION
    missing = least
    for i in range(query.present if query.ahead else 0):
        given = rows[i, A_V] * twist[0] + rows[i, A_OMEGA] * twist[1]
        missing = max(missing, rows[i, B] - given)
    return missing / SEPARATION if missing > least else 0.0


@compiled_once
def cost_of(scene: Scene, query: Query, twist: Pair) -> float:
    """Return the cost of a twist, (m/s)²: the QP's, and of rows that it violates."""
    cost = twist_cost(scene, twist, query.desired)
    return cost + UNSEPARATED * row_violation(query, twist)


@compiled_once
def violation_by(scene: Scene, rollout: Rollout) -> Violation:
    """Return the first violation by a constant twist; body −1: none.

    Static bodies are checked for ``horizon_still``. Half of ε is left for errors
    between samples.
    """
    s, slack = scene.settings[0], 0.5 * tolerance(scene)
    watch = Watch((s.horizon, 0.0), (s.horizon_still, 0.0))
    return violation(scene, rollout, watch, slack)


@compiled_once
def rollout_of(scene: Scene, twist: Pair) -> Rollout:
    """Return the rollout of a constant twist, a control step beyond the horizon."""
    s = scene.settings[0]
    plan = hold(twist[0], twist[1], s.horizon + s.dt)
    return roll_out(scene, plan, coarse_steps(scene))


class Problem(NamedTuple):
    """A QP: its rows are the first of the memory.

    Attributes:
        m: Number of rows: of the present, linearised, and the wheels' hard ones.
        terms: The rest of the problem.
    """

    m: int
    terms: Terms


@compiled_once
def qp_of(scene: Scene, query: Query, proposal: Proposal) -> Problem:
    """Fill in the rows of a proposal's QP."""
    count = query.present
    if proposal.linearised:
        rollout = rollout_of(scene, proposal.about)
        count = linearised_rows(scene, query, rollout, proposal.about, proposal.met)
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
def unsolved(twist: Pair, trust: Pair, ahead: bool) -> Proposal:
    """Return the problem about a twist, without a solution."""
    return Proposal(twist, math.inf, twist, Violation(-1, 0.0), trust, ahead)


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
        cost = cost_of(scene, query, twist)
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
    best = unsolved(within_wheels(scene.robot, start), POINT, True)
    trial = at_cost(best, cost_of(scene, query, best.twist))
    about, halved, count = best, 0, 0
    if trial.cost > DEAR * DEAR * limit:
        return best
    for iteration in range(ITERATIONS):
        rollout = rollout_of(scene, trial.twist)
        met, trust = violation_by(scene, rollout), WHOLE
        if met.body < 0:
            halved, gains = 0, trial.cost <= GAIN * best.cost
            if trial.cost < best.cost:
                best = trial
            if not gains:
                break
        elif best.cost < math.inf:
            if halved == HALVINGS:
                break
            halved, (v, omega) = halved + 1, trial.twist
            trust = (0.5 * abs(v - about.twist[0]), 0.5 * abs(omega - about.twist[1]))
        elif iteration == PATIENT:
            break
        if halved == 0:
            about = Proposal(trial.twist, trial.cost, trial.twist, met, WHOLE, True)
            count = linearised_rows(scene, query, rollout, trial.twist, met)
        qp = Proposal(about.twist, about.cost, about.twist, about.met, trust, True)
        found = solved(scene, query, qp, count)
        d_v, d_omega = found.twist[0] - trial.twist[0], found.twist[1] - trial.twist[1]
        unmoved = abs(d_v) + abs(d_omega) < UNMOVED
        # An infeasible twist may still become cheaper.
        dearest = limit if met.body < 0 else DEAR * limit
        if unmoved or found.cost == math.inf or found.cost > dearest:
            break
        trial = found
    return best


@compiled_once
def best_proposal(scene: Scene, query: Query, kept: Row) -> Proposal:
    """Return the cheapest constant twist that is clear for the horizon.

    The present target is refined in every step. The other starts are searched within
    ``review`` seconds, one group after the other; all at once when its own search fails
    (two groups if nothing moves: braking suffices); one group per step while there is
    none. The cost is the QP's, reduced by the hysteresis for the present target and
    increased by the cost of the change for others.
    """
    s, target = scene.settings[0], first_target(scene, plan_of(kept))
    best, follows = unsolved(query.desired, WHOLE, True), kept.mode != AS_COMMANDED
    due = GROUPS if any_moves(scene) else 2
    if follows:
        best = proposal_near(scene, query, target, math.inf)
        if best.cost < math.inf:
            best = at_cost(best, best.cost * (1.0 - s.hysteresis))
            kept.due -= 1
            due = 0 if kept.due >= 0 else 1
        elif kept.mode >= SEARCHED:
            due = 1
    if best.cost == math.inf or due > 0:
        kept.due = math.floor(s.review / (GROUPS * s.dt))
    # No other start can be significantly cheaper.
    if best.cost < CHEAP:
        return best
    for _ in range(due):
        group, limit = int(kept.group), best.cost
        kept.group = (kept.group + 1) % GROUPS
        for member in range(2):
            # Mirror images have the same limit.
            limit = best.cost if group == 0 else limit
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
    return Proposal(
        found.twist, cost, found.about, found.met, found.trust, found.linearised
    )


@compiled_once
def start_twist(query: Query, group: int, member: int) -> Pair:
    """Return one of the starts; of a pair the one to the right is first."""
    box = query.box
    if group == 0:
        return query.desired if member == 0 else (0.0, 0.0)
    v = box.v_max if group == 1 else box.v_min
    return v, box.omega_min if member == 0 else box.omega_max
