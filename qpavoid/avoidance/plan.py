"""Plans, their rollouts, and the state of a filter between control steps.

A *plan* is two successive twists, each reached from the one before at full
acceleration, and then braking to rest. Its *rollout* is the exact trajectory of a robot
whose twist jumps at the start of a control step and is then held: a chain of arcs, in
the robot frame of the present. The state holds the twist driven last and its plan.
"""

import math
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import BODY, Scene, Setup
from qpavoid.avoidance.settings import MOST_PENDING, FilterSettings
from qpavoid.compiled import compiled, compiled_once, entry, entry_if
from qpavoid.model.kinematics import Frame, integrate, moved_on
from qpavoid.model.robot import (
    RELATIVE_ROUNDING,
    braking_steps,
    braking_twist,
    limit_twist,
    limits_of,
)
from qpavoid.types import (
    Array,
    MatrixWritten,
    Pair,
    Sizes,
    Table,
    Vector,
    VectorWritten,
    layout,
)

SAME_TIME = 1e-6
"""Of a control step or tick; relative tolerance of equal times."""


class Slopes(NamedTuple):
    """Heading, and derivatives by the first target, of a pose of a rollout.

    Attributes:
        cos: Of the heading γ.
        sin: Of the heading.
        x_v: ∂x/∂v, s.
        y_v: ∂y/∂v, s.
        x_omega: ∂x/∂ω, m s.
        y_omega: ∂y/∂ω, m s.
        turn: ∂γ/∂ω, s.
    """

    cos: float
    sin: float
    x_v: float
    y_v: float
    x_omega: float
    y_omega: float
    turn: float


class Arc(NamedTuple):
    """A part of a rollout: the twist is held, or braked to rest along its arc.

    Attributes:
        begin: s.
        x: Of its start, m.
        y: Of its start, m.
        cos: Of the heading there.
        sin: Of the heading there.
        v: m/s.
        omega: rad/s.
        steps: Control steps of braking; ``inf``: the twist is held.
        slope_v: ∂v/∂v of the first target.
        slope_omega: ∂ω/∂ω of it.
        x_v: Derivatives of its start, see :class:`Slopes`, s.
        y_v: s.
        x_omega: m s.
        y_omega: m s.
        turn: s.
    """

    begin: float
    x: float
    y: float
    cos: float
    sin: float
    v: float
    omega: float
    steps: float
    slope_v: float
    slope_omega: float
    x_v: float
    y_v: float
    x_omega: float
    y_omega: float
    turn: float


ARC = layout(Arc)
ARC_SIZE = ARC.itemsize // 8
"""Layout of the table of arcs, and numbers of memory per arc."""


class Plan(NamedTuple):
    """A twist, from ``switch`` on another one, then braking along the arc.

    The arc of braking begins one control step before ``end``: its first step is driven
    in full.

    Both times are whole control steps.

    Attributes:
        v: m/s, target, reached at full acceleration.
        omega: rad/s.
        switch: s.
        v_then: m/s.
        omega_then: rad/s.
        end: s; at least one control step, or 0: braking at once.
    """

    v: float
    omega: float
    switch: float
    v_then: float
    omega_then: float
    end: float


class Rollout(NamedTuple):
    """Trajectory of a plan: arcs with zero-order hold.

    Attributes:
        arcs: (n,) of :class:`Arc`; the last one has no end.
        speed: Greatest |v|, m/s.
        turning: Greatest |ω|, rad/s.
        rest: Time from which on the robot stands, s.
    """

    arcs: Table
    speed: float
    turning: float
    rest: float


@compiled
def hold(v: float, omega: float, end: float) -> Plan:
    """Return the plan of one twist."""
    return Plan(v, omega, end, v, omega, end)


@compiled
def whole_steps(time: float, dt: float) -> float:
    """Return a time rounded down to whole control steps, at least one of them, s."""
    return dt * max(float(math.floor(time / dt + RELATIVE_ROUNDING)), 1.0)


@entry
@compiled
def most_arcs(settings: FilterSettings) -> int:
    """Return the greatest number of arcs of a rollout."""
    steps: int = math.ceil(settings[0].horizon / settings[0].dt)
    return steps + 6


@compiled_once
def ramp(
    now: float, target: float, step: float, many: int
) -> tuple[float, float, float]:
    """Return a value after ``many`` steps towards a target, its mean, ∂mean/∂target.

    At the start of each step it moves by at most ``step``.
    """
    gap = target - now
    full = min(float(many), math.floor(abs(gap) / step))
    moved = math.copysign(step, gap)
    end = target if full < many else now + many * moved
    # A staircase: `full` steps of equal height, then the target for the rest.
    rest = float(many) - full
    mean = (full * now + 0.5 * full * (full + 1.0) * moved + rest * target) / many
    # Exactly the target, not many·target/many: equal values join arcs.
    return end, mean if full > 0.0 else target, rest / many


@compiled_once
def coarse_steps(scene: Scene) -> int:
    """Return the number of control steps per tick, at least 1."""
    s = scene.settings[0]
    many: int = max(1, round(s.tick / s.dt))
    return many


@compiled_once
def arc_index(arcs: Table, row: int, time: float) -> int:
    """Return the index of the arc driven at a time, searched from ``row`` on."""
    while row + 1 < arcs.shape[0] and arcs[row + 1].begin <= time:
        row += 1
    return row


@compiled
def arc_from(begin: float, at: Frame, twist: Pair, steps: float) -> Arc:
    """Return an arc that is independent of the target."""
    v, omega = twist
    z = 0.0
    # fmt: off
    return Arc(begin, at.x, at.y, at.cos, at.sin, v, omega, steps, z, z, z, z, z, z, z)
    # fmt: on


@compiled_once
def roll_out(scene: Scene, plan: Plan, many: int) -> Rollout:
    """Return the rollout of a plan, in the scene's memory: valid until the next one.

    Each arc of a ramp takes ``many`` control steps, driven with their mean twist; 1 is
    exact, and keeps the wheels' limits.
    """
    robot, dt, arcs = scene.robot, scene.settings[0].dt, scene.arcs
    limits = limits_of(robot)
    at, time, row, same = Frame(0.0, 0.0, 1.0, 0.0), 0.0, 0, SAME_TIME * dt
    speed, turning, (v, omega), last = 0.0, 0.0, scene.last, plan.end - dt
    target = (plan.v_then, plan.omega_then)
    for part in range(2):
        until, target = last, (plan.v_then, plan.omega_then)
        if part == 0:
            until, target = min(plan.switch, last), (plan.v, plan.omega)
        while time < until - same and row < arcs.shape[0] - 1:
            v_end, v_mean, v_share = ramp(v, target[0], limits.acceleration * dt, many)
            w_end, w_mean, w_share = ramp(
                omega, target[1], limits.angular_acceleration * dt, many
            )
            # The wheels' limit couples v and ω; means would not keep it.
            if many == 1:
                v_end, w_end = limit_twist(robot, target, (v, omega), dt)
                v_mean, w_mean = v_end, w_end
            # One arc to the end of this part once the twist does not change any more.
            settled = (v_mean, w_mean) == target or (v_end, w_end) == (v, omega)
            lasts = until - time if settled else min(many * dt, until - time)
            arcs[row] = arc_from(time, at, (v_mean, w_mean), math.inf)
            if part == 0:
                arcs[row].slope_v, arcs[row].slope_omega = v_share, w_share
            at, time, row = moved_on(at, v_mean, w_mean, lasts), time + lasts, row + 1
            speed, turning = max(speed, abs(v_mean)), max(turning, abs(w_mean))
            v, omega = v_end, w_end
    # The last control step still accelerates to the target; braking starts from there.
    if plan.switch > last + same:
        target = (plan.v, plan.omega)
    if last < -same:
        v, omega = braking_twist(robot, v, omega, dt)
    else:
        v, omega = limit_twist(robot, target, (v, omega), dt)
    steps = braking_steps(robot, v, omega, dt)
    arcs[row] = arc_from(time, at, (v, omega), steps)
    speed, turning = max(speed, abs(v)), max(turning, abs(omega))
    rest = time + scene.longest * steps if speed + turning > 0.0 else time
    return Rollout(arcs[: row + 1], speed, turning, rest)


@compiled
def braking_place(time: float, steps: float, dt: float) -> float:
    """Return the time for which (v, ω) covers the same arc as braking in n steps, s.

    The first step is driven in full. With n = ∞ the time itself.
    """
    if steps == math.inf:
        return time
    # k whole steps at the shares 1, 1 − 1/n, … lead k − k(k − 1)/(2n) far.
    k = min(float(math.floor(time / dt)), steps)
    place = dt * (k - 0.5 * k * (k - 1.0) / steps)
    return place + (time - dt * k) * (1.0 - k / steps)


@compiled_once
def frame_at(arc: Arc, time: float, dt: float) -> Frame:
    """Return the robot's frame at a time on an arc of a rollout."""
    at, place = Frame(arc.x, arc.y, arc.cos, arc.sin), 0.0
    if time > arc.begin:
        place = braking_place(time - arc.begin, arc.steps, dt)
    return moved_on(at, arc.v, arc.omega, place) if place != 0.0 else at


@entry
@compiled_once
def _fill_places_fits(
    setup: Setup,
    plan: Plan,
    last: Pair,
    times: Vector,
    memory: VectorWritten,
    places: Annotated[MatrixWritten, Sizes(0, 2)],
) -> bool:
    """Return whether the memory fits: rows for all arcs and places."""
    fits = places.shape[0] >= times.shape[0]
    arcs = memory.shape[0] >= most_arcs(setup.settings) * ARC_SIZE
    all_fit: bool = fits and arcs
    return all_fit


@entry_if(_fill_places_fits)
@compiled_once
def fill_places(
    setup: Setup,
    plan: Plan,
    last: Pair,
    times: Vector,
    memory: VectorWritten,
    places: Annotated[MatrixWritten, Sizes(0, 2)],
) -> float:
    """Fill in x and y (n, 2), m, at times (n,) of a plan; return when it rests, s.

    ``last`` is the twist driven last; ``memory`` holds :func:`most_arcs` arcs of
    :data:`ARC_SIZE` numbers.
    """
    (edges, robot, settings), dt = setup, setup.settings[0].dt
    none, arcs, still = memory[:0].view(BODY), memory.view(ARC), (0.0, 0.0)
    # fmt: off
    scene = Scene(edges, robot, settings, none, last, still, arcs, none, dt, 0.0,
                  math.inf)
    # fmt: on
    rollout = roll_out(scene, plan, 1)
    for k in range(times.shape[0]):
        row = arc_index(rollout.arcs, 0, times[k])
        at = frame_at(rollout.arcs[row], times[k], dt)
        places[k, 0], places[k, 1] = at.x, at.y
    return rollout.rest


def places_of(setup: Setup, plan: Plan, twist: Pair, tick: float) -> Array:
    """Return the positions (n, 2), m, until rest of a robot that drives a plan.

    At present, after a control step with ``twist``, and then one per ``tick``, s, of
    the rest of its plan.
    """
    memory, given = np.empty(most_arcs(setup.settings) * ARC_SIZE), (setup, plan, twist)
    rest = fill_places(*given, np.empty(0), memory, np.empty((0, 2)))
    times = np.append(np.arange(0.0, rest, tick), rest)
    places = np.empty((len(times), 2))
    fill_places(*given, times, memory, places)
    x, y, heading = integrate((0.0, 0.0, 0.0), twist, 0.0, setup.settings[0]["dt"])
    c, s = math.cos(heading), math.sin(heading)
    return np.vstack([(0.0, 0.0), places @ [(c, s), (-s, c)] + (x, y)])


class Kept(NamedTuple):
    """State of a filter between control steps, besides the pending twists.

    Attributes:
        v: m/s, driven last.
        omega: rad/s, driven last.
        plan_v: Its plan, see :class:`Plan`, m/s.
        plan_omega: rad/s.
        switch: s.
        v_then: m/s.
        omega_then: rad/s.
        end: s.
        until: Time up to which its margins of moving bodies were checked, s.
        mode: Of the choice, see :data:`AS_COMMANDED`.
        due: Control steps until the next review.
        group: Next group of starts.
    """

    v: float
    omega: float
    plan_v: float
    plan_omega: float
    switch: float
    v_then: float
    omega_then: float
    end: float
    until: float
    mode: int
    due: int
    group: int


KEPT = layout(Kept)
PENDING = KEPT.itemsize // 8
STATE_SIZE = PENDING + 2 * (MOST_PENDING + 1)
"""Layout of the state, and its numbers of memory. From :data:`PENDING` on the last
twists, newest first: those that may be pending, and the one before, from which the
oldest ramps."""

FilterState: TypeAlias = Annotated[Vector, Sizes(STATE_SIZE)]
FilterStateWritten: TypeAlias = Annotated[VectorWritten, Sizes(STATE_SIZE)]

AS_COMMANDED, PROPOSED, SEARCHED, BRAKED = 0, 1, 2, 3
"""Modes, how a plan was found: the command; a QP's proposal; a search of plans of two
twists, or the rest of the last plan; braking, the best one of the fallback."""


def fresh_state() -> Array:
    """Return the state of a robot at rest."""
    return np.zeros(STATE_SIZE)


@entry
@compiled_once
def kept_plan(state: FilterState) -> Plan:
    """Return the rest of the plan of the twist driven last."""
    return plan_of(state[:PENDING].view(KEPT)[0])


@compiled
def plan_of(k: Kept) -> Plan:
    """Return the rest of the last plan."""
    return Plan(k.plan_v, k.plan_omega, k.switch, k.v_then, k.omega_then, k.end)


@compiled_once
def keep_plan(
    state: Array, twist: Pair, plan: Plan, mode: int, until: float, dt: float
) -> None:
    """Store the driven twist and the rest of its plan after this step.

    Args:
        state: Updated.
        twist: Driven.
        plan: Plan that the twist begins.
        mode: How it was found.
        until: Time up to which the plan is clear of moving bodies, s.
        dt: Control step, s.
    """
    kept = state[:PENDING].view(KEPT)[0]
    (kept.v, kept.omega), kept.mode = twist, mode
    kept.plan_v, kept.plan_omega = plan.v, plan.omega
    kept.switch, kept.end = max(plan.switch - dt, 0.0), max(plan.end - dt, 0.0)
    kept.v_then, kept.omega_then = plan.v_then, plan.omega_then
    kept.until = max(until - dt, 0.0)
    # Newest first: the others move back by one, and the oldest is dropped.
    for i in range(STATE_SIZE - 1, PENDING + 1, -1):
        state[i] = state[i - 2]
    state[PENDING], state[PENDING + 1] = twist


@entry
@compiled
def set_driven(state: FilterStateWritten, v: float, omega: float) -> None:
    """Set the twist driven up to now to (v, ω)."""
    state[0], state[1] = v, omega
    for i in range(MOST_PENDING + 1):
        state[PENDING + 2 * i], state[PENDING + 2 * i + 1] = v, omega


@compiled_once
def frame_of_effect(
    robot: Array, settings: npt.NDArray[np.void], state: Array
) -> Frame:
    """Return the robot's frame when the next twist takes effect."""
    limits = limits_of(robot)
    s, at = settings[0], Frame(0.0, 0.0, 1.0, 0.0)
    many = math.ceil(s.delay / s.dt - RELATIVE_ROUNDING)
    # The oldest is driven first, for what the delay leaves of its step.
    for i in range(many - 1, -1, -1):
        lasts = s.dt if i < many - 1 else s.delay - s.dt * (many - 1)
        v, omega = state[PENDING + 2 * i], state[PENDING + 2 * i + 1]
        if s.ramps != 0:
            before_v, before_omega = (
                state[PENDING + 2 * i + 2],
                state[PENDING + 2 * i + 3],
            )
            v = ramped(before_v, v, limits.acceleration, lasts, s.dt)
            omega = ramped(
                before_omega, omega, limits.angular_acceleration, lasts, s.dt
            )
        at = moved_on(at, v, omega, lasts)
    return at


@compiled_once
def pending_sums(settings: npt.NDArray[np.void], state: Array) -> Pair:
    """Return the sums of |v|, m/s, and of |ω|, rad/s, over the pending steps."""
    s, v, omega = settings[0], 0.0, 0.0
    for i in range(math.ceil(s.delay / s.dt - RELATIVE_ROUNDING)):
        v = v + abs(state[PENDING + 2 * i])
        omega = omega + abs(state[PENDING + 2 * i + 1])
    return v, omega


@compiled_once
def ramped(before: float, after: float, rate: float, lasts: float, dt: float) -> float:
    """Return the mean of a velocity that ramps, over the last part of a control step.

    Args:
        before: Value before, m/s or rad/s.
        after: Value after, m/s or rad/s.
        rate: Of the ramp, m/s² or rad/s².
        lasts: Duration of the part, s.
        dt: Control step, s.
    """
    gap = after - before
    time = min(abs(gap) / rate, dt)
    within = min(time - (dt - lasts), time)
    if within <= 0.0:
        return after
    return after - 0.5 * gap * within * within / (time * lasts)
