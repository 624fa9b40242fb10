"""Stages between reference and controller: planner and guide of a run."""

from collections.abc import Callable
from typing import TypeAlias

from qpavoid.guide.stage import GuideStage, Tracking
from qpavoid.guide.state import Progress
from qpavoid.lab.planning.planner import Planner, PlanningProblem
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import GREATEST
from qpavoid.types import Array, Pose, Twist

Round: TypeAlias = Callable[[Obstacles, Tracking], tuple[Twist, bool]]
"""From obstacles, robot frame, and what tracking does to the twist that leads round
what is in the way, and whether there is none."""

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
    return Planner(search, problem, scenario.planner, chart)


def make_guide(scenario: Scenario) -> Round:
    """Return the guide of a run; without one the desired twist is handed on."""
    if scenario.guide is None:
        return lambda _, tracking: (tracking.desired, False)
    robot, law = scenario.robot, scenario.tracker.array
    stage = GuideStage(robot, scenario.guide, scenario.settings, law).start()

    def round_(seen: Obstacles, tracking: Tracking) -> tuple[Twist, bool]:
        progress, v, omega = stage(seen, tracking)
        return (v, omega), progress is Progress.BLOCKED

    return round_
