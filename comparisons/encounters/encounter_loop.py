"""Closed loops a step at a time: movers that change their velocity, and every method.

A method gets present places and velocities. How near it came is measured afterwards on
the arcs that it drove, against the movers where they really were.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from time import perf_counter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from encounter_movers import mover_at
from encounter_scenes import DT, Encounter, as_scenario
from plan_room import Scene, circumradius, room
from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.decision import RELAXED
from qpavoid.avoidance.settings import RadiusCurve, safety_radius
from qpavoid.compiled import allocating
from qpavoid.guide.guide import PathTracking
from qpavoid.lab.simulation.batch import Batch, Loop
from qpavoid.lab.simulation.loop import differs
from qpavoid.lab.simulation.methods import find_method, make_controller
from qpavoid.lab.simulation.outcome import (
    OUTCOME,
    PROGRESS,
    Goal,
    contacts_moving,
    is_over,
    mean_jerk,
    note_arrival,
)
from qpavoid.lab.simulation.simulation import make_guide
from qpavoid.model.kinematics import integrate
from qpavoid.model.robot import limit_twist
from qpavoid.tracking.clock import NEVER
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.types import Array

FINEST = 0.005
"""m that anything may move between two looks."""

STILL = 1e-3
"""m/s and rad/s; slower twists have no sign."""

Map: TypeAlias = Callable[..., Iterable[Any]]
"""``map``, or the same on other processes."""


class Met(NamedTuple):
    """What became of n encounters.

    Attributes:
        outcome: (n,) :data:`qpavoid.lab.simulation.outcome.OUTCOME`.
        chatter: (m, 2) changes of sign of v and of ω, 1/s, of those taken by steps.
        times: s, what deciding took in each of their steps.
    """

    outcome: npt.NDArray[np.void] = np.zeros(0, OUTCOME)
    chatter: Array = np.zeros((0, 2))
    times: Array = np.zeros(0)


def together(parts: Iterable[Met]) -> Met:
    """Return several as one, in order."""
    return Met(*map(np.concatenate, zip(Met(), *parts, strict=True)))


@allocating
def least_on_the_way(
    edges: Array,
    scene: Scene,
    curve: RadiusCurve,
    poses: Array,
    twists: Array,
    dt: float,
) -> tuple[Array, Array]:
    """Return least clearance and least clearance less r_min(v_o) of every step, m.

    Args:
        edges: Of the footprint.
        scene: What is there; a :class:`plan_room.Scene`.
        curve: Of the safety radius, a :class:`RadiusCurve`.
        poses: (n, 3) at the steps' starts.
        twists: (n, 3) v, ω and speed to the left, m/s and rad/s.
        dt: s.
    """
    reach, movers = circumradius(edges), scene.shapes.shape[0]
    nothing, wanted = np.zeros(movers + 1), np.zeros(movers + 1)
    least, rooms = np.empty(len(poses)), np.empty(len(poses))
    wanted[movers] = safety_radius(0.0, curve)
    for k in range(len(poses)):
        x, y, heading = poses[k]
        v, omega, lateral = twists[k]
        pace = abs(v) + abs(lateral) + reach * abs(omega) + scene.fastest
        looks = max(1, math.ceil(pace * dt / FINEST))
        least[k] = rooms[k] = math.inf
        for i in range(looks + 1):
            part = dt * i / looks
            pose = (x, y, heading)
            a, b, angle = integrate(pose, (v, omega), lateral, part)
            t = k * dt + part
            for m in range(movers):
                speed = mover_at(scene.pieces[m], t).speed
                wanted[m] = safety_radius(speed, curve)
            least[k] = min(least[k], room(edges, reach, scene, nothing, a, b, angle, t))
            rooms[k] = min(rooms[k], room(edges, reach, scene, wanted, a, b, angle, t))
    return least, rooms


def chatter(twists: Array, dt: float) -> tuple[float, float]:
    """Return how often v and ω change their sign, 1/s of the time that it moves.

    Twists below :data:`STILL` are passed over.
    """
    moving = (np.abs(twists[:, :2]) >= STILL).any(axis=1)
    seconds = dt * max(int(moving.sum()), 1)
    rates = []
    for column in (twists[:, 0], twists[:, 1]):
        signs = np.sign(column[np.abs(column) >= STILL])
        rates.append(float((np.diff(signs) != 0.0).sum() / seconds))
    return rates[0], rates[1]


def meet(method: str, batch: Batch, encounter: Encounter, loop: Loop) -> Met:
    """Return what becomes of one encounter."""
    robot, numbers, goal = batch.robot, batch.robot.limit_vector, loop.plan[-1]
    driven, name = (loop.start[3], loop.start[4]), find_method(method)
    step = make_controller(name.controller, robot, batch.settings).start(*driven)
    scenario = name.adapt(as_scenario(batch, loop))
    tracking = PathTracking(batch.tracker, NEVER, DT, scenario.guide)
    tracking.follow(loop.plan)
    led, pose = make_guide(scenario), loop.start[:3]
    near = Goal(tuple(goal[:3].tolist()), *batch.arrival)
    arrival = np.full(1, math.inf, OUTCOME)
    poses, twists, times, off, changed, relaxed = [], [], [], 0.0, 0, 0
    for k in range(round(loop.duration / DT)):
        asked, seen = tracking.step(pose, driven), encounter.at(k * DT, pose)
        started = perf_counter()
        target, (desired, _) = tracking.target, led(seen, asked)
        times.append(perf_counter() - started)
        off = max(off, math.dist(pose[:2], target[:2]))
        context = StepContext(
            pose,
            asked.error,
            target[3:],
            tracking_error(pose, near.pose),
            driven,
        )
        decision = step(*desired, seen, context)
        times[-1] += decision.solve_time_s
        free = limit_twist(numbers, desired, driven, DT)
        driven = limit_twist(numbers, (decision.v, decision.omega), driven, DT)
        changed += differs(free, driven)
        relaxed += decision.status.number == RELAXED
        poses.append(pose)
        twists.append((*driven, decision.lateral))
        pose = integrate(pose, driven, decision.lateral, DT)
        note_arrival(arrival, near, pose, (k + 1) * DT)
        if is_over(k * DT, loop.quiet, arrival):
            break
    ways = np.array([*poses, pose])
    driven_all = np.array(twists)
    first, least, rooms = measured(batch, encounter, ways, driven_all)
    pace = np.abs(driven_all[:, 0]) + np.abs(driven_all[:, 1]) * numbers[8]
    time = DT * (len(twists) - 1)
    row = (
        least.min(),
        rooms.min(),
        off,
        DT * changed,
        DT * relaxed,
        0.0,
        *(arrival[name][0] for name in ("arrived", "error", "heading_error")),
        time - last_progress(ways),
        time,
        first,
        len(contacts_moving(least, pace)),
        mean_jerk(driven_all[:, 0], DT),
        DT * np.abs(driven_all[:, 0]).sum(),
    )
    rates = np.array([chatter(driven_all, DT)])
    return Met(np.array([row], dtype=OUTCOME), rates, np.array(times))


def measured(
    batch: Batch, encounter: Encounter, ways: Array, twists: Array
) -> tuple[float, Array, Array]:
    """Return the clearance at the start, and clearance and room of every step, m."""
    edges, curve = batch.robot.footprint.edges, batch.settings.radius.curve
    among = edges, encounter.scene, curve
    first, _ = least_on_the_way(*among, ways[:1], np.zeros((1, 3)), 0.0)
    return float(first[0]), *least_on_the_way(*among, ways[:-1], twists, DT)


def last_progress(ways: Array) -> float:
    """Return when a robot last had come :data:`PROGRESS` far, s."""
    mark, marked = ways[0], 0.0
    for k in range(1, len(ways)):
        if math.dist(ways[k, :2], mark[:2]) > PROGRESS:
            mark, marked = ways[k], DT * (k - 1)
    return marked


def meet_all(
    method: str,
    batch: Batch,
    encounters: Sequence[Encounter],
    loops: Sequence[Loop],
    each: Map = map,
) -> Met:
    """Return what becomes of many encounters.

    Args:
        method: Name of the controller.
        batch: Robot, settings and tracking law.
        encounters: What the robot meets.
        loops: The same as loops.
        each: ``map``, or that of a pool of processes.
    """
    at_once = 16 if len(loops) > 200 else 1
    parts = ([method] * len(loops), [batch] * len(loops), encounters, loops)
    more = {} if each is map else {"chunksize": at_once}
    return together(each(meet, *parts, **more))
