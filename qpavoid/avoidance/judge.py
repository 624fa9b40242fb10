"""The judge: a twist is driven only as the beginning of a plan that has been looked at.

A plan is judged as what it is: the twist for the coming control step, then the rest of
the plan, then braking along the arc until the robot stands; against everything in view,
in continuous time (:mod:`qpavoid.avoidance.advancement`). It *keeps clear* if the room
of every body is at least −ε: of what stands until the robot does, of what moves, with
its velocity and its margins, up to the horizon H. The plan of the twist that is driven
is remembered. Where no other keeps clear its rest is driven, and where nothing is left
of it the robot brakes: what [Agrawal2024] calls a gatekeeper, with braking along the
arc as the backup of [Bouraine2012].

**Theorem 1, static obstacles.** Let obstacles be at rest and measured exactly, twists
follow at once and be held for dt, the limits hold 0, and the robot start at rest with
d ≥ r_min − ε. Then d ≥ r_min − ε at all times; with ε < r_min there is no contact. For
any dt and any horizon.

Proof. Every time of a plan is a number of whole control steps, at least one
(:func:`qpavoid.avoidance.prediction.whole_steps`). So a plan is a sequence of twists,
each held for dt, and without its first step it is a plan again: the same twists, from
the pose that this step leads to. Claim: after every step there is a plan, from the pose
reached on, that keeps d ≥ r_min − ε until the robot stands for good. At the start that
is standing still. Let it hold, and let p be that plan. The next step is either the
first step of a plan that keeps clear, and its rest is the plan claimed; or the first
step of p, and the rest of p is. Either way the step itself keeps it too. ∎

Braking is such a plan: the twists u·(1 − k/n) for k = 1 … n, with the least n for which
no step exceeds the accelerations, have all the same curvature; the robot stays on the
arc of u and comes to rest where that ends after
dt + dt·Σ_{k=1}^{n−1} (1 − k/n) = dt·(n + 1)/2, and what is left of that after a step is
what braking from u·(1 − 1/n) does. Nothing depends on how a plan was
found. Among what moves, too, unless every plan that was found touches that: then, with
the status ``relaxed`` and the shortfall, ``closest`` of r_min is kept from what stands.

**Theorem 2, moving obstacles.** Let besides, from a time t_0 on at which a plan kept
clear, every obstacle keep the velocity it had then, or at least stay within its margin
of where that takes it. Then up to t_0 + H there is at every step a plan that keeps
clear of everything: a robot that had a way at its last step has one now.

Proof. The rest of that plan is the same way through the same places at the same times:
its rooms are among those looked at at t_0. ∎

**Not guaranteed**: anything about what comes into view later, or changes its velocity
by more than its margin; anything after t_0 + H about what moves, so that a robot which
stands may be driven at; that the way is driven to its end: where it meets something
after its H, a plan with more room over the next H may be driven instead, with a
``shortfall`` where that meets something sooner;
and, with margins, that the rest of a plan is found to keep clear although it does: what
is measured anew is widened anew.
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
"""m; by which a plan may have less room when it is carried on than when judged."""

HOLDS = (math.inf, 1.0, 0.4, 0.0)
"""s; for so long a twist is held before the robot brakes, in whole control steps and at
most for the horizon."""


@compiled_once
def lowest(scene: Scene) -> float:
    """Return −ε: the least room that keeps clear, m."""
    return -tolerance(scene) - REPLAY_ROUNDING


@compiled_once
def keeps_from_standing(scene: Scene, rollout: Rollout, level: float) -> bool:
    """Return whether a rollout keeps clear of all static bodies until it rests."""
    return keeps_all(scene, rollout, Watch(UNWATCHED, (rollout.rest, level)))


@compiled_once
def moving_room(scene: Scene, rollout: Rollout, enough: float) -> float:
    """Return the least room of all that moves up to the horizon, m, or ``enough``."""
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
    """Return whether a plan that begins with a twist keeps clear.

    Of what moves for ``until`` s, of what stands until the robot does.
    """
    rollout, level = exact_rollout(scene, plan, twist), lowest(scene)
    return keeps_all(scene, rollout, Watch((until, level), (rollout.rest, level)))


@compiled_once
def first_target(scene: Scene, plan: Plan) -> Pair:
    """Return the twist that a plan aims at in the coming control step."""
    if plan.switch < 0.5 * scene.settings[0].dt:
        return plan.v_then, plan.omega_then
    return plan.v, plan.omega


@compiled_once
def first_twist(scene: Scene, plan: Plan) -> Pair:
    """Return what a plan drives in the coming control step."""
    s = scene.settings[0]
    if plan.end < 0.5 * s.dt:
        return braking_twist(scene.robot, scene.last[0], scene.last[1], s.dt)
    return limit_twist(scene.robot, first_target(scene, plan), scene.last, s.dt)


@compiled_once
def clear_end(scene: Scene, target: Pair, twist: Pair, least: float) -> float:
    """Return for how long (s) a target may be held so that the plan keeps clear.

    The first of :data:`HOLDS`, and no less than ``least``; 0: none.
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
    """Return whether only braking along the arc is known to be followed."""
    s = scene.settings[0]
    return bool(s.jitter > 0.0 or s.ramps != 0)


@compiled_once
def way_to_rest(scene: Scene, twist: Pair) -> float:
    """Return the stopping distance after one control step of a twist, m."""
    n = braking_steps(scene.robot, twist[0], twist[1], scene.settings[0].dt)
    return 0.5 * abs(twist[0]) * scene.longest * (n + 1.0)


@compiled_once
def drift_of(scene: Scene, twist: Pair) -> float:
    """Return how fast a robot whose velocities ramp leaves the arc as it brakes, m/s.

    While a part of the twist is still on its way the robot's velocity is off by at most
    the change Δ of a step, the present one or one of braking, u/n; and so is a point
    of the footprint: |Δv| + |Δω|(R + L), where L is the way still to go, which a wrong
    heading turns. Braking on from there is off no faster, so that the proof holds.
    """
    s, robot, (v, omega) = scene.settings[0], scene.robot, twist
    if s.ramps == 0:
        return 0.0
    n, way = braking_steps(robot, v, omega, s.dt), way_to_rest(scene, twist)
    # This step changes the twist by u less the last one, every step of braking by u/n.
    d_v = max(abs(v - scene.last[0]), abs(v) / n)
    d_omega = max(abs(omega - scene.last[1]), abs(omega) / n)
    return float(d_v + d_omega * (limits_of(robot).circumradius + way))


@compiled_once
def may_brake(scene: Scene, twist: Pair) -> bool:
    """Return whether one control step of a twist, then braking, keeps clear of statics.

    With all that the base does to it: steps that last longer lengthen the arc, ramps
    let what stands grow, and where twists are on their way for an uncertain time the
    robot may be that much farther along, and turned, when this one takes effect.
    """
    s = scene.settings[0]
    drift, (far, turned) = drift_of(scene, twist), scene.pending
    braced = altered(scene, scene.bodies, drift, scene.closest)
    reach = limits_of(scene.robot).circumradius + way_to_rest(scene, twist)
    # Each step on its way may last so much longer than the arc it was reckoned with.
    off = (scene.longest - s.dt) * (far + turned * reach)
    rollout = rollout_to_rest(braced, twist)
    return keeps_from_standing(braced, rollout, lowest(scene) + off)


@compiled_once
def standing_room(scene: Scene, rollout: Rollout, enough: float) -> float:
    """Return the least room of what stands until the robot does, m, or ``enough``.

    ``enough`` is what is kept for certain: looks at times may miss by how much it is
    not.
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
    """Return whether a twist, braked away next, leaves what stands no less room.

    Than ``brake`` does; as far as that is less than what keeps clear.
    """
    rollout, level = rollout_to_rest(scene, twist), lowest(scene)
    watch = Watch(UNWATCHED, (rollout.rest, level))
    i = next_body(scene, rollout, 0, watch)
    while i < scene.bodies.shape[0]:
        # Both live in the one memory of the scene: each is made anew after the other.
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
    """Return whether nothing that moves touches the robot before it has braked.

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
