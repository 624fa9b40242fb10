"""Rollouts: the way of a plan.

A *plan* is two twists, one after the other, each reached from the one before at full
acceleration, and then braking to rest. Its *rollout* is the way that a robot goes whose
twist jumps at the start of a control step and is then held: arcs, one after the other,
exact. Robot frame of the present.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Scene
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import Frame, moved_on
from qpavoid.model.robot import braking_steps, limit_twist
from qpavoid.qp.exact import Pair

BEGIN, POSE_X, POSE_Y, COS, SIN, DRIVE_V, DRIVE_OMEGA, STEPS = range(8)


SHARE_V, SHARE_OMEGA, X_BY_V, Y_BY_V, X_BY_OMEGA, Y_BY_OMEGA, TURN_BY_OMEGA = range(
    8, 15
)


ARC = 15
"""Columns of an arc: when it begins, s; the pose there; its twist; in how many control
steps that is braked away (``inf``: it is kept); derivatives of twist and pose by the
first target."""


class Plan(NamedTuple):
    """A twist, from ``switch`` on another, from ``end`` on braking along the arc.

    Attributes:
        v: m/s, driven towards at full acceleration, as all parts.
        omega: rad/s.
        switch: s.
        v_then: m/s.
        omega_then: rad/s.
        end: s; at least one control step.
    """

    v: float
    omega: float
    switch: float
    v_then: float
    omega_then: float
    end: float


class Rollout(NamedTuple):
    """The way of a plan.

    Attributes:
        arcs: (n, :data:`ARC`); the last one goes on to its end.
        speed: Greatest |v|, m/s.
        turning: Greatest |ω|, rad/s.
        rest: From when on the robot stands, s.
    """

    arcs: Array
    speed: float
    turning: float
    rest: float


@compiled
def hold(v: float, omega: float, end: float) -> Plan:
    """Return the plan of one twist."""
    return Plan(v, omega, end, v, omega, end)


@compiled
def most_arcs(settings: npt.NDArray[np.void]) -> int:
    """Return how many arcs a rollout has at most."""
    steps: int = math.ceil(settings[0].horizon / settings[0].dt)
    return steps + 6


@compiled_once
def ramp(
    now: float, target: float, step: float, many: int
) -> tuple[float, float, float]:
    """Return a value after ``many`` steps towards the target, its mean, ∂mean/∂target.

    It moves by ``step`` at the start of each, as far as to the target.
    """
    gap = target - now
    full = min(float(many), math.floor(abs(gap) / step))
    moved = math.copysign(step, gap)
    end = target if full < many else now + many * moved
    rest = float(many) - full
    mean = (full * now + 0.5 * full * (full + 1.0) * moved + rest * target) / many
    return end, mean if full > 0.0 else target, rest / many


@compiled
def set_arc(
    arcs: Array, row: int, begin: float, at: Frame, twist: Pair, steps: float
) -> None:
    """Write an arc that does not depend on the target."""
    arcs[row, BEGIN], arcs[row, STEPS] = begin, steps
    arcs[row, POSE_X], arcs[row, POSE_Y] = at.x, at.y
    arcs[row, COS], arcs[row, SIN] = at.cos, at.sin
    arcs[row, DRIVE_V], arcs[row, DRIVE_OMEGA] = twist
    arcs[row, SHARE_V] = arcs[row, SHARE_OMEGA] = 0.0


@compiled_once
def roll_out(scene: Scene, plan: Plan, now: Pair, lead: float, many: int) -> Rollout:
    """Return the way of a plan: ``now`` is driven for ``lead`` s, then on from there.

    It lives in the memory of the scene, until the next one is rolled out. With a lead
    of a control step ``now`` is the twist to be driven next; with none it
    is the one driven last. Accelerations are counted in ``many`` control steps at
    once, by their mean; 1 is exact, and keeps the wheels' limits.
    """
    robot, dt, arcs = scene.robot, scene.settings[0].dt, scene.arcs
    at, time, row, hardly = Frame(0.0, 0.0, 1.0, 0.0), 0.0, 0, 1e-6 * dt
    speed, turning = 0.0, 0.0
    (twist_v, twist_omega), last = now, plan.end - dt
    if 0.0 < lead <= last + hardly:
        set_arc(arcs, 0, 0.0, at, now, math.inf)
        at, time, row = moved_on(at, now[0], now[1], lead), lead, 1
        speed, turning = abs(now[0]), abs(now[1])
    for part in range(2):
        until, v, omega = last, plan.v_then, plan.omega_then
        if part == 0:
            until, v, omega = min(plan.switch, last), plan.v, plan.omega
        while time < until - hardly and row < arcs.shape[0] - 1:
            lasts = min(many * dt, until - time)
            v_end, v_mean, v_share = ramp(twist_v, v, robot[4] * dt, many)
            w_end, w_mean, w_share = ramp(twist_omega, omega, robot[5] * dt, many)
            if many == 1:
                v_end, w_end = limit_twist(robot, v, omega, twist_v, twist_omega, dt)
                v_mean, w_mean = v_end, w_end
            if v_mean == v and w_mean == omega:
                lasts = until - time
            set_arc(arcs, row, time, at, (v_mean, w_mean), math.inf)
            if part == 0:
                arcs[row, SHARE_V], arcs[row, SHARE_OMEGA] = v_share, w_share
            at, time, row = moved_on(at, v_mean, w_mean, lasts), time + lasts, row + 1
            speed, turning = max(speed, abs(v_mean)), max(turning, abs(w_mean))
            twist_v, twist_omega = v_end, w_end
    if row > 0 or lead == 0.0:
        v, omega = plan.v_then, plan.omega_then
        if plan.switch > last + hardly:
            v, omega = plan.v, plan.omega
        twist_v, twist_omega = limit_twist(robot, v, omega, twist_v, twist_omega, dt)
    steps = braking_steps(robot, twist_v, twist_omega, dt)
    set_arc(arcs, row, time, at, (twist_v, twist_omega), steps)
    speed, turning = max(speed, abs(twist_v)), max(turning, abs(twist_omega))
    rest = time + scene.longest * steps if speed + turning > 0.0 else time
    return Rollout(arcs[: row + 1], speed, turning, rest)


@compiled
def braking_place(time: float, steps: float, dt: float) -> float:
    """Return how long (v, ω) drives to where braking in n steps has come by a time, s.

    The first of the steps is driven in full. With n = ∞ the time itself.
    """
    if steps == math.inf:
        return time
    k = min(float(math.floor(time / dt)), steps)
    place = dt * (k - 0.5 * k * (k - 1.0) / steps)
    return place + (time - dt * k) * (1.0 - k / steps)


@compiled
def braking_share(time: float, steps: float, dt: float) -> float:
    """Return the share of the twist that is driven at a time after its arc began."""
    if steps == math.inf:
        return 1.0
    return max(1.0 - math.floor(time / dt + 1e-9) / steps, 0.0)


@compiled_once
def frame_at(arcs: Array, row: int, time: float, dt: float) -> Frame:
    """Return where the robot is at a time on an arc of a rollout."""
    at = Frame(arcs[row, POSE_X], arcs[row, POSE_Y], arcs[row, COS], arcs[row, SIN])
    place = braking_place(time - arcs[row, BEGIN], arcs[row, STEPS], dt)
    return moved_on(at, arcs[row, DRIVE_V], arcs[row, DRIVE_OMEGA], place)
