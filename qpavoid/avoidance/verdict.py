"""Verdict: a twist is driven as the beginning of a verified plan, if there is one.

A plan is the twist for the coming control step, then the rest of the plan, then braking
along the arc until the robot stands still. It is verified against all bodies in
continuous time (:mod:`qpavoid.avoidance.margin`). It is *clear* if the margin of every
body is at least −ε: of static bodies until the robot stands, of moving ones, with their
velocities and inflation, up to the horizon H from now. The plan of the driven twist is
retained. If no other plan is clear, its rest is driven, and at its end the robot
brakes: a gatekeeper [Agrawal2024], with braking along the arc as the backup
[Bouraine2012].

**Theorem 1, static obstacles.** Let obstacles be at rest and measured exactly, twists
be followed at once and held for dt, the limits include 0, and the robot start at rest
with d ≥ r_min − ε. Then d ≥ r_min − ε at all times; with ε < r_min there is no contact.
For any dt and any horizon. Premises of the settings: the bound ``barrier``, with
``braking_room``, and r_min independent of the closing speed (``closing_gain`` 0).
ε includes :data:`~qpavoid.avoidance.bodies.REPLAY_ROUNDING`, 1e-8 m.

Proof. Every time of a plan is a number of whole control steps, at least one
(:func:`qpavoid.avoidance.plan.whole_steps`). So a plan is a sequence of twists,
each held for dt, and without its first step it is a plan again: the same twists, from
the pose that this step leads to. Claim: after every step there is a plan, from the pose
reached on, that keeps d ≥ r_min − ε until the robot stands for good. At the start that
is standing still. Let it hold, and let p be that plan. The next step is either the
first step of a clear plan, and its rest is the plan claimed; or the first step of p,
and the rest of p is. Either way the step itself keeps d ≥ r_min − ε too. ∎

Braking is such a plan: the twists u·(1 − k/n) for k = 1 … n, with the least n for which
no step exceeds the accelerations, have all the same curvature; the robot stays on the
arc of u and comes to rest at the place that u reaches in
dt + dt·Σ_{k=1}^{n−1} (1 − k/n) = dt·(n + 1)/2; and what remains of that after a step is
braking from u·(1 − 1/n). The theorem does not depend on how a plan was found. It also
holds among moving obstacles, with the minimum clearance, if that is less, in the place
of r_min (:func:`qpavoid.avoidance.selection.fallback`). But not with ``passive``: a
robot about to be hit may brake although that comes nearer to static obstacles.

**Theorem 2, moving obstacles.** In addition let, from a time t_0 on at which a plan was
clear, every obstacle keep its velocity of t_0, or stay within its inflation of that
prediction. Then every step up to t_0 + H has a plan that is clear of static bodies, and
of moving ones up to t_0 + H.

Proof. The rest of the plan of t_0 has the same poses at the same times: its margins are
among those verified at t_0. ∎

**Not guaranteed**: anything about obstacles that appear later, or change their velocity
by more than their inflation; anything about moving obstacles after t_0 + H, so that a
standing robot may be hit; that a plan is driven to its end: if it meets an obstacle
after its H, a plan with a larger margin over the next H may be driven instead, with a
``shortfall`` if that one meets an obstacle sooner; and, with inflation, that the rest
of a plan is verified although it is clear, since a new measurement is inflated anew.
"""

import math
from typing import NamedTuple

from qpavoid.avoidance.bodies import (
    Scene,
    moves,
    threshold,
    tolerance,
    with_bodies,
)
from qpavoid.avoidance.margin import (
    Watch,
    keeps,
    keeps_all,
    least_margin,
    too_near,
)
from qpavoid.avoidance.plan import Plan, hold, roll_out, whole_steps
from qpavoid.avoidance.settings import least_radius
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.robot import braking_steps, braking_twist, limit_twist, limits_of
from qpavoid.types import Pair

CONTACT_ROUNDING = 1e-9
"""m; tolerance of the margin of a contact that is being resolved."""

BRAKING_PLAN = Plan(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Braking along the arc of the last twist."""

HOLDS = (math.inf, 1.0, 0.4, 0.0)
"""s; durations of a target twist before braking, in whole control steps and at most
the horizon."""


@compiled_once
def verdict(scene: Scene, plan: Plan, until: float) -> bool:
    """Return whether a plan is clear.

    Of moving bodies for ``until`` s, of static ones until the robot stands. With an
    inexact actuator, also one control step and then braking under the actuator model. A
    robot in contact has to resolve it.
    """
    twist, level = first_twist(scene, plan), threshold(scene)
    if not (is_clear_actuated(scene, twist) and may_move(scene, twist, 0.0)):
        return False
    rollout = roll_out(scene, plan, 1)
    watch = Watch((until, level), (rollout.rest, level))
    return keeps_all(scene, rollout, watch)


class PlanMargins(NamedTuple):
    """Least margins of a plan, m: −ε, or less.

    Attributes:
        static: Of static bodies until the robot stands.
        moving: Of moving bodies up to the horizon.
    """

    static: float
    moving: float


@compiled_once
def margins(scene: Scene, plan: Plan) -> PlanMargins:
    """Return the least margins of a plan."""
    rollout, level = roll_out(scene, plan, 1), threshold(scene)
    static = least_margin(scene, rollout, False, level)
    return PlanMargins(static, least_margin(scene, rollout, True, level))


@compiled_once
def first_target(scene: Scene, plan: Plan) -> Pair:
    """Return the target twist of a plan in the coming control step."""
    if plan.switch < 0.5 * scene.settings[0].dt:
        return plan.v_then, plan.omega_then
    return plan.v, plan.omega


@compiled_once
def first_twist(scene: Scene, plan: Plan) -> Pair:
    """Return the twist of a plan in the coming control step, within the limits."""
    s = scene.settings[0]
    if plan.end < 0.5 * s.dt:
        return braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
    return limit_twist(scene.robot, first_target(scene, plan), scene.last, s.dt)


@compiled_once
def clear_plan(scene: Scene, target: Pair) -> Plan:
    """Return the clear plan of a target twist held for the longest of :data:`HOLDS`.

    Its ``end`` is 0 if none is clear.
    """
    s = scene.settings[0]
    for lasts in HOLDS:
        plan = hold(target[0], target[1], whole_steps(min(lasts, s.horizon), s.dt))
        if verdict(scene, plan, s.horizon):
            return plan
    return hold(target[0], target[1], 0.0)


@compiled
def is_inexact(scene: Scene) -> bool:
    """Return whether actuation is inexact: only braking along the arc is followed."""
    s = scene.settings[0]
    return bool(s.jitter > 0.0 or s.ramps != 0)


@compiled_once
def way_to_rest(scene: Scene, twist: Pair) -> float:
    """Return the stopping distance after one control step of a twist, m."""
    n = braking_steps(scene.robot, twist[0], twist[1], scene.settings[0].dt)
    return 0.5 * abs(twist[0]) * scene.longest * (n + 1.0)


@compiled_once
def drift_of(scene: Scene, twist: Pair) -> float:
    """Return the bound of the velocity error of a base that ramps while braking, m/s.

    While a ramp lasts the robot's velocity is off by at most the change Δ of a step,
    the present one or one of braking, u/n; a point of the footprint by
    |Δv| + |Δω|(R + L), where L is the remaining distance, which a wrong heading
    rotates. Later braking is off no faster, so that the proof holds.
    """
    s, robot, (v, omega) = scene.settings[0], scene.robot, twist
    if s.ramps == 0:
        return 0.0
    n, way = braking_steps(robot, v, omega, s.dt), way_to_rest(scene, twist)
    # This step changes the twist by u minus the last one, each braking step by u/n.
    d_v = max(abs(v - scene.last[0]), abs(v) / n)
    d_omega = max(abs(omega - scene.last[1]), abs(omega) / n)
    return float(d_v + d_omega * (limits_of(robot).circumradius + way))


@compiled_once
def is_clear_actuated(scene: Scene, twist: Pair) -> bool:
    """Return whether one step of a twist, then braking, is clear with the actuator.

    Of static bodies. Jitter lengthens the arc, ramps let static bodies grow, and with
    uncertain delays the robot may be that much farther along, and turned, when the
    twist takes effect. True for an exact actuator.
    """
    if not is_inexact(scene):
        return True
    s = scene.settings[0]
    braced, (far, turned) = (
        with_bodies(scene, scene.bodies, drift_of(scene, twist)),
        scene.pending,
    )
    reach = limits_of(scene.robot).circumradius + way_to_rest(scene, twist)
    # Each pending step may last longer than predicted.
    off = (scene.longest - s.dt) * (far + turned * reach)
    rollout, level = roll_out(braced, hold(twist[0], twist[1], s.dt), 1), off
    level += threshold(scene)
    return keeps(braced, rollout, False, level)


@compiled_once
def may_move(scene: Scene, twist: Pair, margin: float) -> bool:
    """Return whether a twist resolves contacts, or is rest.

    And, with ``passive`` and a contact, present or predicted by the least margin of
    moving bodies, whether it brakes in time.
    """
    s, touches = scene.settings[0], scene.clearance <= 0.0
    if touches and not leaves_contacts(scene, twist):
        return False
    caught = s.passive != 0 and (touches or margin < -least_radius(scene.settings))
    return not caught or rests_in_time(scene, twist)


@compiled_once
def leaves_contacts(scene: Scene, twist: Pair) -> bool:
    """Return whether a twist resolves contacts with static bodies, or is rest."""
    if twist == (0.0, 0.0):
        return True
    s = scene.settings[0]
    rollout = roll_out(scene, hold(twist[0], twist[1], s.dt), 1)
    for i in range(scene.bodies.shape[0]):
        body = scene.bodies[i]
        touched = body.required - tolerance(scene) < body.beyond_r_min
        # cap_now has removed all of r_min: the surfaces are in contact.
        if not moves(scene, i) and touched:
            span = (s.dt, max(rollout.rest, s.dt))
            level = CONTACT_ROUNDING - tolerance(scene)
            near, _ = too_near(scene, rollout, i, span, level, 0.0)
            if near:
                return False
    return True


@compiled_once
def rests_in_time(scene: Scene, twist: Pair) -> bool:
    """Return whether no moving body touches the robot before it has braked.

    Passive safety [Bouraine2012]: the setting ``passive``.
    """
    rollout = roll_out(scene, hold(twist[0], twist[1], scene.settings[0].dt), 1)
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i) and rollout.rest > 0.0:
            body = scene.bodies[i]
            level = body.beyond_r_min - body.required
            near, _ = too_near(scene, rollout, i, (0.0, rollout.rest), level, 0.0)
            if near:
                return False
    return True
