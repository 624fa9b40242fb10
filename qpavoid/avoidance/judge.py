"""Judge: a twist is driven only as the beginning of a verified plan.

A plan is the twist for the coming control step, then the rest of the plan, then braking
along the arc until the robot stands still. It is verified against all bodies in
continuous time (:mod:`qpavoid.avoidance.advancement`). It is *clear* if the margin of
every body is at least −ε: of static bodies until the robot stands, of moving ones, with
their velocities and inflation, up to the horizon H. The plan of the driven twist is
retained. If no other plan is clear, its rest is driven, and at its end the robot
brakes: a gatekeeper [Agrawal2024], with braking along the arc as the backup
[Bouraine2012].

**Theorem 1, static obstacles.** Let obstacles be at rest and measured exactly, twists
be followed at once and held for dt, the limits include 0, and the robot start at rest
with d ≥ r_min − ε. Then d ≥ r_min − ε at all times; with ε < r_min there is no contact.
For any dt and any horizon.

Proof. Every time of a plan is a number of whole control steps, at least one
(:func:`qpavoid.avoidance.prediction.whole_steps`). So a plan is a sequence of twists,
each held for dt, and without its first step it is a plan again: the same twists, from
the pose that this step leads to. Claim: after every step there is a plan, from the pose
reached on, that keeps d ≥ r_min − ε until the robot stands for good. At the start that
is standing still. Let it hold, and let p be that plan. The next step is either the
first step of a clear plan, and its rest is the plan claimed; or the first step of p,
and the rest of p is. Either way the step itself keeps d ≥ r_min − ε too. ∎

Braking is such a plan: the twists u·(1 − k/n) for k = 1 … n, with the least n for which
no step exceeds the accelerations, have all the same curvature; the robot stays on the
arc of u and comes to rest where that ends after
dt + dt·Σ_{k=1}^{n−1} (1 − k/n) = dt·(n + 1)/2, and what remains of that after a step is
braking from u·(1 − 1/n). The theorem does not depend on how a plan was found. It also
holds among moving obstacles, unless every plan found hits one: then, with the status
``relaxed`` and the shortfall, only ``closest`` of r_min is kept from static obstacles.

**Theorem 2, moving obstacles.** In addition let, from a time t_0 on at which a plan was
clear, every obstacle keep its velocity of t_0, or stay within its inflation of that
prediction. Then up to t_0 + H every step has a plan that is clear of all bodies.

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

from qpavoid.avoidance.advancement import least_room, too_near
from qpavoid.avoidance.body_table import body_at, moves
from qpavoid.avoidance.broad_phase import UNWATCHED, Watch, keeps_all, next_body
from qpavoid.avoidance.prediction import Plan, Rollout, hold, roll_out, whole_steps
from qpavoid.avoidance.scene import Scene, altered, tolerance
from qpavoid.compiled import compiled, compiled_once
from qpavoid.model.robot import braking_steps, braking_twist, limit_twist, limits_of
from qpavoid.types import Pair

REPLAY_ROUNDING = 1e-8
"""m; tolerance of a plan's margin when it is carried on."""

HOLDS = (math.inf, 1.0, 0.4, 0.0)
"""s; durations of a target twist before braking, in whole control steps and at most
the horizon."""


@compiled_once
def lowest(scene: Scene) -> float:
    """Return −ε: the threshold of a clear margin, m."""
    return -tolerance(scene) - REPLAY_ROUNDING


@compiled_once
def keeps_from_standing(scene: Scene, rollout: Rollout, level: float) -> bool:
    """Return whether a rollout is clear of all static bodies until it rests."""
    return keeps_all(scene, rollout, Watch(UNWATCHED, (rollout.rest, level)))


@compiled_once
def moving_room(scene: Scene, rollout: Rollout, enough: float) -> float:
    """Return the least margin of moving bodies up to the horizon, m, ≤ ``enough``."""
    least = enough
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i):
            span = (0.0, scene.settings[0].horizon)
            least, _ = least_room(scene, rollout, i, span, least)
    return least


@compiled
def exact_rollout(scene: Scene, plan: Plan, twist: Pair) -> Rollout:
    """Return the exact rollout of a plan whose first control step drives a twist."""
    return roll_out(scene, plan, twist, scene.settings[0].dt, 1)


@compiled
def rollout_to_rest(scene: Scene, twist: Pair) -> Rollout:
    """Return the exact rollout of a twist for one control step, then braking."""
    return exact_rollout(scene, hold(twist[0], twist[1], scene.settings[0].dt), twist)


@compiled_once
def keeps_clear(scene: Scene, plan: Plan, twist: Pair, until: float) -> bool:
    """Return whether a plan that begins with a twist is clear.

    Of moving bodies for ``until`` s, of static ones until the robot stands.
    """
    rollout, level = exact_rollout(scene, plan, twist), lowest(scene)
    return keeps_all(scene, rollout, Watch((until, level), (rollout.rest, level)))


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
def clear_end(scene: Scene, target: Pair, twist: Pair, least: float) -> float:
    """Return the duration (s) of a target for which the plan is clear.

    The first of :data:`HOLDS`, at least ``least``; 0 if none.
    """
    s = scene.settings[0]
    if is_inexact(scene) and not may_brake(scene, twist):
        return 0.0
    for lasts in HOLDS:
        end = whole_steps(min(lasts, s.horizon), s.dt)
        if end < least:
            break
        plan = hold(target[0], target[1], end)
        if keeps_clear(scene, plan, twist, s.horizon):
            return float(end)
    return 0.0


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
def may_brake(scene: Scene, twist: Pair) -> bool:
    """Return whether one step of a twist, then braking, is clear of static bodies.

    With the actuator model: jitter lengthens the arc, ramps let static bodies grow, and
    with uncertain delays the robot may be that much farther along, and turned, when the
    twist takes effect.
    """
    s = scene.settings[0]
    drift, (far, turned) = drift_of(scene, twist), scene.pending
    braced = altered(scene, scene.bodies, drift, scene.closest)
    reach = limits_of(scene.robot).circumradius + way_to_rest(scene, twist)
    # Each pending step may last longer than predicted.
    off = (scene.longest - s.dt) * (far + turned * reach)
    rollout = rollout_to_rest(braced, twist)
    return keeps_from_standing(braced, rollout, lowest(scene) + off)


@compiled_once
def standing_room(scene: Scene, rollout: Rollout, enough: float) -> float:
    """Return the least margin of static bodies until rest, m, ≤ ``enough``.

    ``enough`` is a verified lower bound, or the samples may miss the minimum.
    """
    if keeps_from_standing(scene, rollout, enough):
        return enough
    least, watch = enough - REPLAY_ROUNDING, Watch(UNWATCHED, (rollout.rest, enough))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        room, _ = least_room(scene, rollout, i, (0.0, rollout.rest), enough)
        least, i = min(least, room), next_body(scene, rollout, i + 1, watch)
    return least


@compiled_once
def no_worse_than(scene: Scene, brake: Pair, twist: Pair) -> bool:
    """Return whether a twist, then braking, has no less static margin than ``brake``.

    Only margins below the threshold are compared.
    """
    rollout, level = rollout_to_rest(scene, twist), lowest(scene)
    watch = Watch(UNWATCHED, (rollout.rest, level))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        # Both share the scene's memory: each is rolled out again after the other.
        stop = rollout_to_rest(scene, brake)
        room, _ = least_room(scene, stop, i, (0.0, stop.rest), level)
        rollout = rollout_to_rest(scene, twist)
        end = (0.0, rollout.rest)
        near, _ = too_near(scene, rollout, i, end, room - REPLAY_ROUNDING, 0.0)
        if near:
            return False
        i = next_body(scene, rollout, i + 1, watch)
    return True


@compiled_once
def rests_in_time(scene: Scene, twist: Pair) -> bool:
    """Return whether no moving body touches the robot before it has braked.

    Passive safety [Bouraine2012]: the setting ``passive``.
    """
    rollout = rollout_to_rest(scene, twist)
    for i in range(scene.bodies.shape[0]):
        if moves(scene, i) and rollout.rest > 0.0:
            body = body_at(scene, i)
            level = body.inflation - body.keep
            near, _ = too_near(scene, rollout, i, (0.0, rollout.rest), level, 0.0)
            if near:
                return False
    return True
