"""State of a filter between control steps."""

import math
from typing import Annotated, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.prediction import Plan
from qpavoid.avoidance.settings import MOST_PENDING
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.model.robot import RELATIVE_ROUNDING, limits_of
from qpavoid.types import Array, Pair, Sizes, Vector, VectorWritten

PAST_V, PAST_OMEGA, PLAN_V, PLAN_OMEGA, SWITCH, THEN_V, THEN_OMEGA, END = range(8)

UNTIL, TARGET_MODE, DUE, GROUP, SHARE, PENDING = range(8, 14)

STATE_SIZE = PENDING + 2 * (MOST_PENDING + 1)
"""Columns and size of the state: twist driven last; its plan, and the time up to which
that is clear of moving bodies (s); its mode; steps until the next review, next group of
starts, next share of the plans; the last twists, newest first: those that may be
pending, and the one before, from which the oldest ramps."""

FilterState: TypeAlias = Annotated[Vector, Sizes(STATE_SIZE)]
FilterStateWritten: TypeAlias = Annotated[VectorWritten, Sizes(STATE_SIZE)]

FREE, ROUND, NEW_PLAN, CARRIED, STUCK = 0.0, 1.0, 2.0, 3.0, 4.0
"""Modes: the desired twist, another constant one, a new plan, the rest of the last one,
no plan that is clear of static bodies but braking."""


def fresh_state() -> Array:
    """Return the state of a robot at rest."""
    return np.zeros(STATE_SIZE)


@entry
@compiled_once
def kept_plan(state: FilterState) -> Plan:
    """Return the rest of the plan of the twist driven last."""
    return Plan(
        state[PLAN_V],
        state[PLAN_OMEGA],
        state[SWITCH],
        state[THEN_V],
        state[THEN_OMEGA],
        state[END],
    )


@compiled_once
def keep_plan(state: Array, twist: Pair, plan: Plan, until: float, dt: float) -> None:
    """Store the driven twist and the rest of its plan after this step.

    Args:
        state: Updated.
        twist: Driven.
        plan: Plan that the twist begins.
        until: Time up to which the plan is clear of moving bodies, s.
        dt: Control step, s.
    """
    state[PAST_V], state[PAST_OMEGA] = twist
    state[PLAN_V], state[PLAN_OMEGA] = plan.v, plan.omega
    state[SWITCH], state[END] = max(plan.switch - dt, 0.0), max(plan.end - dt, 0.0)
    state[THEN_V], state[THEN_OMEGA] = plan.v_then, plan.omega_then
    state[UNTIL] = max(until - dt, 0.0)
    # Newest first: the others move back by one, and the oldest is dropped.
    for i in range(STATE_SIZE - 1, PENDING + 1, -1):
        state[i] = state[i - 2]
    state[PENDING], state[PENDING + 1] = twist


@entry
@compiled
def set_driven(state: FilterStateWritten, v: float, omega: float) -> None:
    """Set the twist driven up to now to (v, ω)."""
    state[PAST_V], state[PAST_OMEGA] = v, omega
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
def pending_pace(settings: npt.NDArray[np.void], state: Array) -> Pair:
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
