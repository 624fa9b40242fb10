"""One run from beginning to end, of one robot or of several, and its logs."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.lab.planning.planner import inverse
from qpavoid.lab.scenario.methods import name_of, solver_of
from qpavoid.lab.scenario.scenario import AT_LAST, Scenario
from qpavoid.lab.simulation.log import COLUMNS, Log, LogRow, provenance, read_only
from qpavoid.lab.simulation.loop import Simulation
from qpavoid.lab.simulation.outcome import Goal
from qpavoid.model.capsules import OWNER, PIVOT_X, PIVOT_Y, TURN, V_X, X1, Y1
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import NO_POINTS, Obstacles
from qpavoid.types import Array, Pose, Twist


class RobotObstacle:
    """A robot as the others meet it: the convex parts of its footprint under way.

    Args:
        footprint: Of the robot.
        number: Of the robot, to tell it from others.
    """

    def __init__(self, footprint: Footprint, number: int) -> None:
        self._outline, self._number = Obstacles(polygons=footprint.parts), number

    def at(
        self,
        pose: Pose,
        twist: Twist = (0.0, 0.0),
        lateral: float = 0.0,
        dt: float = 0.0,
    ) -> Array:
        """Return its capsules at a pose, world frame.

        Their velocity, of the centroid, is the mean while it drives for ``dt`` s as it
        does: at their end the polygon is just where the robot is. With 0 s it is that
        of now.

        Args:
            pose: World frame.
            twist: v (m/s), ω (rad/s).
            lateral: Speed to the left, m/s.
            dt: s
        """
        capsules, (v, omega) = self._outline.capsules.copy(), twist
        c_x, c_y = capsules[:, PIVOT_X], capsules[:, PIVOT_Y]
        velocity = v - omega * c_y, lateral + omega * c_x
        if dt > 0.0:
            x, y, turned = integrate((0.0, 0.0, 0.0), twist, lateral, dt)
            cos, sin = math.cos(turned), math.sin(turned)
            # The way of the centroid, by which capsules are moved: that of the axle's
            # middle, and what the turn about it adds.
            d_x, d_y = x + cos * c_x - sin * c_y - c_x, y + sin * c_x + cos * c_y - c_y
            velocity = d_x / dt, d_y / dt
        capsules[:, V_X : TURN + 1] = np.column_stack([*velocity, omega + 0.0 * c_x])
        placed = Obstacles.of(NO_POINTS, capsules).seen_from(inverse(pose)).capsules
        placed[:, OWNER] = self._number + placed[:, OWNER] / len(placed)
        return placed


def among(world: Obstacles, bodies: Sequence[Array]) -> Iterator[Obstacles]:
    """Yield what there is for each of several robots: the world, and all the others.

    Of no bodies, for one robot alone: the world.
    """
    for i in range(len(bodies) or 1):
        others = [*bodies[:i], *bodies[i + 1 :]]
        if others:
            yield world.joined(Obstacles.of(NO_POINTS, np.vstack(others)))
        else:
            yield world


def run(
    scenario: Scenario,
    controller: Any,
    solver: str = "exact",
    progress: Callable[[int], None] = lambda steps: None,
) -> Log:
    """Simulate one controller on a scenario.

    Deterministic: two runs of the same scenario give the same columns bit for bit, but
    for ``solve_time_s``. All controllers get the same desired twist and observation,
    and all twists are cut to the same limits.

    Args:
        scenario: What to run.
        controller: Name of the controller, see
            :mod:`qpavoid.lab.scenario.methods`; or one's own: a function
            (v, ω, obstacles, context) → (v, ω), or a class, see
            :class:`~qpavoid.lab.baselines.own.OwnController`.
        solver: Back end of the QP filter; other methods have none.
        progress: Called after every step with the number of steps done.

    Raises:
        UnknownNameError: No controller or back end of that name.
        MissingExtraError: The back end's package is not installed.
        ConfigError: A method of one's own cannot be loaded.
        InvalidInputError: It cannot drive, or returns what is no finite twist.
    """
    if scenario.robots:
        many = len(scenario.robots)
        raise InvalidInputError(f"{scenario.name} has {many} robots: see run_fleet")
    (log,) = run_fleet(scenario, controller, solver, progress)
    return log


def run_fleet(
    scenario: Scenario,
    controller: Any,
    solver: str = "exact",
    progress: Callable[[int], None] = lambda steps: None,
) -> list[Log]:
    """Simulate all robots of a scenario in lockstep, and return the log of each.

    Each sees the others as it sees all that moves: convex polygons, numbered after the
    other obstacles, with what they drove in the step before. How near they come within
    a step is judged by what they drive in it. The run ends when all have arrived. A
    scenario of one robot is run as :func:`run` runs it.

    Args:
        scenario: What to run.
        controller: Of every robot to which the scenario gives none of its own.
        solver: As :func:`run` takes it.
        progress: The same.

    Raises:
        QPAvoidError: As :func:`run` does.
    """
    robots = enumerate(scenario.robots or (scenario,))
    fleet = [_Robot(i, one, controller, solver) for i, one in robots]
    meeting = fleet if len(fleet) > 1 else []
    times = scenario.times
    for k, time in enumerate(times[:-1].tolist()):
        world = scenario.world.at(time)
        bodies = [one.body() for one in meeting]
        for one, others in zip(fleet, among(world, bodies), strict=True):
            one.decide(time, others)
        # All decide on what is known, then all move: the order of the robots must not
        # matter. Now the others' velocities are those of the arcs that they do drive.
        bodies = [one.body(scenario.dt) for one in meeting]
        for one, others in zip(fleet, among(world, bodies), strict=True):
            one.advance(time, times[k + 1], others)
        progress(k + 1)
        if scenario.ends_at_goal and all(one.is_over(time) for one in fleet):
            break
    several = {"robots": len(fleet), "seed": scenario.seed}
    return [one.log(several if scenario.robots else {}) for one in fleet]


class _Robot:
    """One robot of a run, and what is recorded of it."""

    def __init__(
        self,
        number: int,
        scenario: Scenario,
        controller: Any,
        solver: str,
    ) -> None:
        driver = scenario.controller or controller
        simulation = Simulation(scenario, driver, solver)
        first = Simulation(scenario, driver, solver)
        # Of a simulation that is thrown away, since a step changes its state.
        first.step(0.0, scenario.world.at(0.0))  # compiles, before the clock runs
        self._number, self._how = number, (scenario, controller, solver)
        self._scenario, self._simulation = scenario, simulation
        self._body = RobotObstacle(scenario.robot.footprint, number)
        self._drives = (0.0, 0.0), 0.0
        self._goal = Goal(simulation.goal, *scenario.arrival)
        self._arrived = math.inf
        self._rows: list[LogRow] = []
        self._discs: list[Array] = []
        self._corners: list[Array] = []

    def body(self, dt: float = 0.0) -> Array:
        """Return it as the others meet it, as it drives on for ``dt`` s."""
        return self._body.at(self._simulation.pose, *self._drives, dt)

    def decide(self, time: float, obstacles: Obstacles) -> None:
        """Look at obstacles, world frame, and decide what to drive."""
        self._move = self._simulation.decide(time, obstacles)
        self._drives = self._move.drive.ground, self._move.lateral

    def advance(self, time: float, after: float, obstacles: Obstacles) -> None:
        """Drive it among obstacles, world frame, and take it down."""
        self._rows.append(self._simulation.advance(time, obstacles, self._move))
        self._discs.append(obstacles.discs)
        sizes = obstacles.sizes
        edges = obstacles.capsules[np.repeat(sizes, sizes) > 1]
        self._corners.append(edges[:, X1 : Y1 + 1])
        self._sizes = sizes[sizes > 1]
        there = self._goal.holds(self._simulation.pose)
        self._arrived = min(self._arrived, after) if there else math.inf

    def is_over(self, time: float) -> bool:
        """Return whether nothing more is expected to happen."""
        return time > self._arrived + self._scenario.settled

    def log(self, fleet: dict[str, int]) -> Log:
        """Return its log, with what is said of the fleet that it is in, if it is."""
        scenario, rows = self._scenario, zip(*self._rows, strict=True)
        which = fleet | {"number": self._number} if fleet else {}
        return Log(
            meta=_meta(*self._how) | which,
            columns=dict(zip(COLUMNS, map(read_only, rows), strict=True)),
            final=read_only(self._simulation.pose),
            final_reference=read_only(scenario.path.sample(AT_LAST)[0]),
            discs=read_only(self._discs),
            corners=read_only(self._corners),
            polygons=read_only(self._sizes),
            points=scenario.world.points,
            walls=scenario.world.walls,
            vertices=scenario.robot.footprint.vertices,
            outlines=np.array([len(x) for x in scenario.robot.footprint.outlines])
            * 1.0,
        )


def _meta(scenario: Scenario, controller: Any, solver: str) -> dict[str, object]:
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "controller": name_of(controller),
        "solver": solver_of(scenario.controller or controller, solver),
        "robot": scenario.robot.name,
        "dt_s": scenario.dt,
        "duration_s": scenario.duration,
        "seed": scenario.seed,
        "arrival": list(scenario.arrival),
        "frames_s": list(scenario.frames),
        "settings": repr(scenario.settings),
        "digest": scenario.digest,
        **({"driver": scenario.controller} if scenario.controller else {}),
        **provenance(),
    }
