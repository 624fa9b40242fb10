"""One run: reference, tracking, controller, limits, exact arc, log."""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from qpavoid.avoidance.controllers import make_controller
from qpavoid.avoidance.decision import BLOCKED
from qpavoid.avoidance.rows import greatest_speed
from qpavoid.detour.stage import Detour
from qpavoid.detour.state import Progress
from qpavoid.model.contacts import contact_table, most_contacts
from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles, like
from qpavoid.model.robot import limit_twist
from qpavoid.motion.path import Pose
from qpavoid.motion.tracking import Reference, tracking_error
from qpavoid.qp.solve import find_back_end
from qpavoid.simulation.clearance import greatest_pace, room_on_the_way
from qpavoid.simulation.log import COLUMNS, Log, provenance, read_only
from qpavoid.simulation.scenario import Scenario

Twist: TypeAlias = tuple[float, float]
Lead: TypeAlias = Callable[
    [Twist, Pose, Reference, Obstacles, Twist], tuple[Twist, bool]
]

AT_LAST: Array = np.array([1e9])
"""s; by then every path has come to its goal."""


def run(
    scenario: Scenario,
    controller: str,
    solver: str = "exact",
    progress: Callable[[int], None] = lambda steps: None,
) -> Log:
    """Simulate one controller on a scenario.

    Deterministic: two runs of the same scenario give the same columns bit for bit, but
    for ``solve_time_s``. All controllers get the same desired twist and observation,
    and all twists are cut to the same limits.

    Args:
        scenario: What to run.
        controller: Name of the controller.
        solver: Back end of the QP filter; the closed-form laws have none.
        progress: Called after every step with the number of steps done.

    Raises:
        UnknownNameError: No controller or back end of that name.
        MissingExtraError: The back end's package is not installed.
    """
    find_back_end(solver)
    method = make_controller(controller, scenario.robot, scenario.settings, solver)
    times: Array = scenario.dt * np.arange(scenario.steps + 1, dtype=np.float64)
    follow = scenario.waiting.start(scenario.path.sample(times))
    pose, driven = scenario.start, (0.0, 0.0)
    edges, numbers = scenario.robot.footprint.edges, scenario.robot.numbers
    record = scenario.settings.record()
    method.start()(0.0, 0.0, scenario.world.at(0.0).seen_from(pose))  # compiles
    step, track = method.start(), scenario.tracker.start()
    observe, lead = _observer(scenario.estimation), _leader(scenario)
    rows = np.empty((scenario.steps, len(COLUMNS)))
    discs = []
    for k in range(scenario.steps):
        obstacles = scenario.world.at(times[k])
        known = observe(times[k], obstacles)
        seen = known.seen_from(pose)
        true = seen if known is obstacles else obstacles.seen_from(pose)
        target, place = follow(pose)
        tracked = track(pose, target)
        desired, blocked = lead(tracked, pose, target, seen, driven)
        decision = step(*desired, seen)
        driven = limit_twist(numbers, decision.v, decision.omega, *driven, scenario.dt)
        contact = _contact(scenario, pose, true)
        motion = *pose, *driven, 0.0
        arrays = obstacles.arrays
        least, _ = room_on_the_way(
            edges,
            numbers,
            record,
            motion,
            scenario.dt,
            greatest_pace(numbers, *driven, greatest_speed(obstacles.disc_velocities)),
            arrays,
            -math.inf,
            like(arrays),
            np.empty((most_contacts(edges, arrays), 9)),
        )
        rows[k] = (
            times[k],
            *pose,
            scenario.dt * place,
            *target,
            *desired,
            *driven,
            contact[0],
            min(least, contact[0]),
            *contact[1:],
            decision.slack,
            decision.residual,
            decision.solve_time_s,
            BLOCKED if blocked and not any(driven) else decision.status.number,
        )
        discs.append(obstacles.discs)
        pose = arc(*pose, *driven, scenario.dt)
        progress(k + 1)
    return Log(
        meta=_meta(scenario, controller, solver),
        columns={name: read_only(rows[:, i]) for i, name in enumerate(COLUMNS)},
        final=read_only(pose),
        final_reference=read_only(scenario.path.sample(AT_LAST)[0]),
        discs=read_only(discs),
        points=scenario.world.points,
        walls=scenario.world.walls,
        vertices=scenario.robot.footprint.vertices,
    )


def _observer(
    estimation: EstimatorSettings | None,
) -> Callable[[float, Obstacles], Obstacles]:
    """Return what is known of the obstacles: all, or estimated velocities."""
    if estimation is None:
        return lambda time, obstacles: obstacles
    estimator = VelocityEstimator(estimation)

    def observe(time: float, obstacles: Obstacles) -> Obstacles:
        ids = range(len(obstacles.discs))
        motion = estimator.update(time, ids, obstacles.discs[:, :2])
        discs = np.column_stack([motion.positions, obstacles.discs[:, 2]])
        return Obstacles(obstacles.points, discs, motion.velocities, obstacles.walls)

    return observe


def _leader(scenario: Scenario) -> Lead:
    """Return what leads round obstacles: the twist to desire, and whether blocked."""
    if scenario.detour is None:
        return lambda desired, *_: (desired, False)
    stage = Detour(scenario.robot, scenario.detour, scenario.settings.radius).start()

    def lead(
        desired: Twist, pose: Pose, target: Reference, seen: Obstacles, driven: Twist
    ) -> tuple[Twist, bool]:
        error = tracking_error(*pose, *target[:3])
        progress, v, omega = stage(desired, error, target[3], seen, driven, scenario.dt)
        return (v, omega), progress is Progress.BLOCKED

    return lead


def _contact(
    scenario: Scenario, pose: tuple[float, float, float], seen: Obstacles
) -> tuple[float, float, float, float, float, float]:
    """Return clearance, r_min, r, P_r (world frame) and obstacle of the nearest."""
    footprint, radius = scenario.robot.footprint, scenario.settings.radius
    contacts = np.empty((most_contacts(footprint.edges, seen.arrays), 9))
    _, nearest = contact_table(
        footprint.edges, footprint.circumradius, seen.arrays, 0.0, contacts
    )
    if nearest < 0:
        return math.inf, radius.r_min(), radius.r(), math.nan, math.nan, -1.0
    p_x, p_y, _, _, distance, v_x, v_y, obstacle, _ = contacts[nearest].tolist()
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    speed = math.hypot(v_x, v_y)
    return (
        distance,
        radius.r_min(speed),
        radius.r(speed),
        pose[0] + cos * p_x - sin * p_y,
        pose[1] + sin * p_x + cos * p_y,
        obstacle,
    )


def _meta(scenario: Scenario, controller: str, solver: str) -> dict[str, object]:
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "controller": controller,
        "solver": solver if controller.startswith("qp") else "closed form",
        "robot": scenario.robot.name,
        "dt_s": scenario.dt,
        "duration_s": scenario.duration,
        "seed": scenario.seed,
        "arrival": list(scenario.arrival),
        "frames_s": list(scenario.frames),
        "settings": repr(scenario.settings),
        "digest": scenario.digest,
        **provenance(),
    }
