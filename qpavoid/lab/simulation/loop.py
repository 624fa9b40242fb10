"""The closed loop of one robot, a control step at a time, in a world given to it."""

import math
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.decision import BLOCKED, Decision
from qpavoid.guide.guide import PathTracking
from qpavoid.guide.settings import GuideSettings, look_short
from qpavoid.guide.stage import NO_PATH, Stage, fresh_stage, start_stage
from qpavoid.lab.planning.planner import Planner, PlanningProblem, standing
from qpavoid.lab.scenario.methods import find_method, make_controller
from qpavoid.lab.scenario.scenario import AT_LAST, Scenario
from qpavoid.lab.sensing.lidar import Sensor, scanner
from qpavoid.lab.sensing.plant import Drive, Plant
from qpavoid.lab.simulation.clearance import (
    Motion,
    View,
    greatest_pace,
    room_on_the_way,
)
from qpavoid.lab.simulation.log import LogRow
from qpavoid.lab.simulation.outcome import differs
from qpavoid.model.capsules import greatest_speed, like
from qpavoid.model.contacts import contact_at, contact_table, empty_contacts
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import GREATEST, limit_twist, limits_of
from qpavoid.tracking.kanayama import tracking_error
from qpavoid.types import Array, Pose, Twist


def make_sensor(scenario: Scenario) -> Sensor:
    """Return the sensor of a run: a LiDAR, or obstacles known exactly within sight."""
    if scenario.sensor is not None:
        return scenario.sensor.start()
    if scenario.lidar is not None:
        return scanner(scenario.robot, scenario.lidar, scenario.perception)
    if scenario.sight == math.inf:
        return lambda time, obstacles, pose: obstacles.seen_from(pose)
    sight = scenario.sight
    return lambda time, obstacles, pose: obstacles.seen_from(pose).within(sight)


CALM = 0.5
"""m/s²; how a planned path gains and loses speed at most, if no reference says it."""


def make_planner(
    scenario: Scenario, search: str, plan: Array, goal: Pose
) -> Planner | None:
    """Return the global planner, or none where the method has no search.

    It goes as fast as the scenario's own reference ``plan`` does, and gains speed as
    its path does; where that stands, as fast as the robot may.
    """
    if not search:
        return None
    limits, half = scenario.robot.limits, abs(scenario.robot.footprint.vertices[:, 1])
    problem = PlanningProblem(
        start=scenario.start,
        goal=goal,
        keep=float(half.max()) + scenario.settings.radius.r_min(),
        speed=min(
            float(abs(plan[:, 3]).max()) or GREATEST, limits.v_max, limits.wheel_speed
        ),
        turn_rate=min(limits.omega_max, -limits.omega_min, GREATEST),
        acceleration=min(
            limits.acceleration, getattr(scenario.path, "acceleration", CALM)
        ),
        times=scenario.times,
    )
    chart = Obstacles(scenario.world.points, walls=scenario.world.walls)
    return Planner(search, problem, chart)


DENSE, EXTRA = 200, 0.1
"""Obstacles; m of the nearest of so many that are looked at more than is needed."""


class Move(NamedTuple):
    """Motion of a robot in a control step.

    Attributes:
        desired: Twist that it desires.
        blocked: Whether no way leads on.
        decision: Of the controller.
        driven: The twist within its limits.
        drive: What wheels and ground make of that.
        time: Wall time of what decided, s: planner, guide and method.
    """

    desired: Twist
    blocked: bool
    decision: Decision
    driven: Twist
    drive: Drive
    time: float

    @property
    def lateral(self) -> float:
        """How fast it moves to its left, as decided and as it slides, m/s."""
        return self.decision.lateral + self.drive.lateral


class Simulation:
    """Reference, tracking, controller, limits and exact arc, a step at a time.

    Attributes:
        scenario: What is run; its world is not looked at.
        pose: Where the robot is: x, y (m), γ (rad).
        driven: The twist that it drove last, m/s and rad/s.
        goal: Last pose of the reference.

    Args:
        scenario: What to run.
        controller: Name of the controller, or a method of one's own.
        solver: Back end of the QP filter; the closed-form laws have none.

    Raises:
        UnknownNameError: No controller or back end of that name.
        MissingExtraError: The back end's package is not installed.
    """

    def __init__(
        self, scenario: Scenario, controller: Any, solver: str = "exact"
    ) -> None:
        found = find_method(controller)
        guide = scenario.guide or (GuideSettings() if found.guided else None)
        self._yields = guide is not None and guide.yielding
        if guide is not None:
            settings, guide = look_short(scenario.settings, guide)
            scenario = replace(scenario, settings=settings, guide=guide)
        robot, settings = scenario.robot, scenario.settings
        method = make_controller(found.controller, robot, settings, solver)
        self._setup = Setup.of(robot, settings)
        self.scenario, self.pose, self.driven = scenario, scenario.start, (0.0, 0.0)
        plan = scenario.path.sample(scenario.times)
        x, y, heading = scenario.path.sample(AT_LAST)[0, :3].tolist()
        self.goal = x, y, heading
        self._replan = make_planner(scenario, found.search, plan, self.goal)
        if self._replan is not None:
            plan = standing(scenario.start, len(plan))
        tracker, waiting, guide = scenario.tracker, scenario.waiting, scenario.guide
        self._path = PathTracking(tracker, waiting, scenario.dt, guide)
        self._path.follow(plan)
        self._stage, self._step = None, method.start()
        if guide is not None:
            stage = Stage.of(robot, guide, settings, tracker.array)
            self._stage = start_stage(stage, fresh_stage())
        self._see, self._believed = make_sensor(scenario), scenario.start
        self._drive = (scenario.plant or Plant()).start(scenario.start)
        where = scenario.localisation
        self._locate = where.start(scenario.start) if where else lambda pose, *_: pose

    def step(self, time: float, obstacles: Obstacles) -> LogRow:
        """Drive for one control step among obstacles as they are now, world frame."""
        return self.advance(time, obstacles, self.decide(time, obstacles))

    def decide(self, time: float, obstacles: Obstacles) -> Move:
        """Look at obstacles, world frame, and decide what to drive."""
        seen = self._see(time, obstacles, self.pose)
        seen = seen.at_rest() if self._yields else seen
        desired, blocked, spent = self._guide(time, seen)
        here, target = self._believed, self._path.target
        error = tracking_error(here, target[:3])
        known = StepContext(here, error, target[3:], self.error(here), self.driven)
        decision = self._step(*desired, seen, known)
        driven = self._limited(decision.v, decision.omega)
        drive = self._drive(*driven, self.scenario.dt)
        spent += decision.solve_time_s
        return Move(desired, blocked, decision, driven, drive, spent)

    def advance(self, time: float, obstacles: Obstacles, move: Move) -> LogRow:
        """Drive what was decided for a control step, and return its row.

        Args:
            time: At its beginning, s.
            obstacles: As they are then, world frame, with what they drive in it.
            move: What to drive.
        """
        row = self._row(time, obstacles.seen_from(self.pose), move)
        dt, (wheels, ground, _) = self.scenario.dt, move.drive
        self.pose = integrate(self.pose, ground, move.lateral, dt)
        self.driven = move.driven
        self._believed = self._locate(self.pose, time + dt, wheels, dt)
        return row

    def error(self, pose: Pose) -> Pose:
        """Return the goal seen from a pose, m and rad."""
        return tracking_error(pose, self.goal)

    def _guide(self, time: float, seen: Obstacles) -> tuple[Twist, bool, float]:
        """Return the twist to desire among what is seen, and whether there is none.

        And the wall time of planner and guide, s: tracking is not theirs.
        """
        started = perf_counter()
        if self._replan is not None:
            plan = self._replan(time, self._believed, self.driven[0], seen)
            if plan is not None:
                self._path.follow(plan)
        wanted = perf_counter()
        tracked = self._path.step(self._believed, self.driven)
        resumed = perf_counter()
        twist, blocked = tracked.desired, False
        if self._stage is not None:
            mode, v, omega = self._stage(seen, tracked)
            twist, blocked = (v, omega), mode == NO_PATH
        return twist, blocked, wanted - started + perf_counter() - resumed

    def _limited(self, v: float, omega: float) -> Twist:
        """Return the twist that the robot can drive in the coming step."""
        return limit_twist(self._setup.robot, (v, omega), self.driven, self.scenario.dt)

    def _row(self, time: float, true: Obstacles, move: Move) -> LogRow:
        """Return the numbers of a step among obstacles as they are, robot frame."""
        decision, radius = move.decision, self.scenario.settings.radius
        edges, robot, _ = self._setup
        contacts, size = (
            empty_contacts(edges, true.arrays),
            limits_of(robot).circumradius,
        )
        _, nearest = contact_table(edges, size, true.arrays, 0.0, contacts)
        distance, speed, number, (x, y, heading) = math.inf, 0.0, -1.0, self.pose
        if nearest < 0:
            x = y = math.nan
        else:
            c = contact_at(contacts, nearest)
            cos, sin = math.cos(heading), math.sin(heading)
            x, y = x + cos * c.x - sin * c.y, y + sin * c.x + cos * c.y
            speed = math.hypot(c.v_x, c.v_y)
            distance, number = c.distance, float(c.obstacle)
        r_min = radius.r_min(speed)
        least, room = self._room(move.drive.ground, move.lateral, true, distance)
        held = move.blocked and not any(move.driven)
        return LogRow(
            time,
            *self.pose,
            self.scenario.dt * self._path.place,
            *self._path.target,
            *move.desired,
            *move.driven,
            distance,
            min(least, distance),
            min(room, distance - r_min),
            r_min,
            radius.r(speed),
            x,
            y,
            number,
            decision.slack,
            decision.residual,
            move.time,
            differs(self._limited(*move.desired), move.driven),
            BLOCKED if held else decision.status.number,
        )

    def _room(
        self, driven: Twist, lateral: float, seen: Obstacles, distance: float
    ) -> tuple[float, float]:
        """Return least clearance and least clearance less r_min within a step, m.

        Among many obstacles, ``seen`` from the robot, only those are looked at that
        can come as near as the nearest is now, less their r_min.
        """
        edges, robot, _ = self._setup
        fastest = greatest_speed(seen.capsules)
        high = self.scenario.settings.radius.r_min(math.inf)
        pace = greatest_pace(robot, *driven, fastest) + abs(lateral)
        if len(seen) > DENSE:
            near = limits_of(robot).circumradius + distance
            near = near + 2.0 * pace * self.scenario.dt
            seen = seen.within(near + high + EXTRA)
        arrays = seen.arrays
        view = View(arrays, like(arrays), empty_contacts(edges, arrays))
        return room_on_the_way(self._setup, Motion(driven, lateral, pace), view)
