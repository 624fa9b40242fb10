"""A robot on its way: reference, guide and filter in one call, without a scenario."""

import math

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import Decision, blocked_if
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.guide.rollout import ROWS, TICK, fill_ahead
from qpavoid.guide.settings import DetourSettings, GuideSettings
from qpavoid.guide.stage import Detour, Tracking
from qpavoid.guide.state import Progress
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.validation import as_number, as_pose, as_rows
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains, Tracker, tracking_error
from qpavoid.tracking.path import Path, SplinePath
from qpavoid.tracking.station import StationKeeping, StationTracker
from qpavoid.types import Array, Pose, Twist

TURN_ONLY_WITHIN = 1e-6
"""m; a goal so near is turned to, no more."""

MOST_STEPS = 1_000_000
"""Control steps of a path: 5.5 h at 0.02 s, 40 MB."""


def as_speed(value: float) -> float:
    """Return a speed, m/s.

    Raises:
        InvalidInputError: Not a finite number above 0.
    """
    speed = as_number(value, "speed")
    if speed <= 0.0:
        raise InvalidInputError(f"speed must be above 0, not {speed:g}")
    return speed


def memory_ahead(settings: DetourSettings | None) -> Array:
    """Return memory for the reference ahead: rows for a guide, none for others."""
    return np.empty((ROWS if isinstance(settings, GuideSettings) else 0, 5))


def rows_of(path: Path, dt: float) -> Array:
    """Return the rows of a path, (n, 5), one a control step.

    Raises:
        InvalidInputError: It lasts less than 0 s or more than :data:`MOST_STEPS`, or
            does not sample as many rows of finite numbers.
    """
    duration = as_number(getattr(path, "duration", 0.0), "a path's duration")
    if not 0.0 <= duration <= MOST_STEPS * dt:
        raise InvalidInputError(f"a path must last 0 to {MOST_STEPS * dt:g} s")
    times: Array = dt * np.arange(math.ceil(duration / dt) + 2, dtype=np.float64)
    rows = as_rows(path.sample(times), 5, "what a path samples")
    if len(rows) != len(times) or not np.isfinite(rows).all():
        raise InvalidInputError("a path must sample (n, 5) finite numbers for n times")
    return rows


class PathTracking:
    """A tracker on its way along a plan: what a stage is told at every step.

    Attributes:
        plan: (n, 5) the reference, world frame, a row a control step.
        target: Where the robot was to be in the last step, world frame.
        place: Progress there, in control steps.
    """

    def __init__(
        self, tracker: Tracker, clock: Waiting, dt: float, stage: DetourSettings | None
    ) -> None:
        self._track, self._waiting, self._dt = tracker.start(), clock, dt
        self._ahead = memory_ahead(stage)

    def follow(self, plan: Array) -> None:
        """Follow a plan from its first row on."""
        self.plan, self._follow = plan, self._waiting.start(plan)

    def take_over(self, other: "PathTracking") -> None:
        """Go on where another one is, with its plan, clock and law."""
        self.plan, self._follow, self._track = other.plan, other._follow, other._track

    def step(self, pose: Pose, driven: Twist) -> Tracking:
        """Return what tracking does for one control step, and move the clock on."""
        target, self.place = self._follow(pose)
        fill_ahead(self.plan, self.place, pose, TICK / self._dt, self._ahead)
        self.target, desired = target, self._track(pose, target)
        error = tracking_error(pose, target[:3])
        return Tracking(desired, error, target.v, driven, self._dt, self._ahead)


class Guide:
    """Follows a path, or goes to a pose, among obstacles: one filter for one robot.

    The path's clock waits for the robot. Where it is, and where it will be in the
    seconds to come, is weighed against what stands and moves there
    (:mod:`qpavoid.guide.stage`), and what is chosen goes through the safety filter,
    which has the last word: its promises hold, whatever the guide wants.

    Args:
        robot: Footprint and limits.
        settings: Of the filter; its ``dt`` is the control step.
        guide: What is weighed, and when the robot is stalled and blocked.

    Attributes:
        robot: Footprint and limits.
        settings: Of the filter.
    """

    def __init__(
        self,
        robot: Robot,
        settings: AvoidanceSettings | None = None,
        guide: GuideSettings | None = None,
    ) -> None:
        self.robot = robot
        self.settings = settings if settings is not None else AvoidanceSettings()
        tracker = StationTracker(Gains(), StationKeeping(), robot.limits)
        self._detour = Detour(
            robot, guide or GuideSettings(), self.settings, tracker.array
        )
        self._tracker, self._safety = tracker, SafetyFilter(robot, self.settings)
        self._driven = 0.0, 0.0
        self.stay((0.0, 0.0, 0.0))

    def follow(self, path: Path | npt.ArrayLike, speed: float = 0.5) -> None:
        """Follow a path from its beginning.

        Args:
            path: World frame; or (n, 2) way-points, m, of a smooth one.
            speed: Greatest on way-points, m/s.

        What was chosen before is forgotten, so call it when the path changes, not every
        step. A path of way-points begins with the speed that was driven last.

        Raises:
            InvalidInputError: Fewer than two distinct way-points, numbers that are not
                finite, or a path that lasts more than :data:`MOST_STEPS`. The path
                before stays.
        """
        self._begin(self._planned(path, as_speed(speed)))

    def _planned(
        self, path: Path | npt.ArrayLike, speed: float, turn: float = 0.0
    ) -> Array:
        """Return the rows of a path, one a control step; it begins at an angle."""
        dt = self.settings.dt
        if isinstance(path, Path):
            return rows_of(path, dt)
        begin = min(max(self._driven[0] * math.cos(turn), 0.0), speed)
        points = as_rows(path, 2, "a path")
        return rows_of(SplinePath(points, speed, begin=begin), dt)

    def go_to(self, pose: Pose, goal: Pose, speed: float = 0.5) -> None:
        """Go from a pose to another one, straight where that is free; world frame.

        Raises:
            InvalidInputError: A pose is not three finite numbers, or the speed not
                positive. The path before stays.
        """
        start, end = as_pose(pose, "pose"), as_pose(goal, "goal")
        speed = as_speed(speed)
        if math.dist(start[:2], end[:2]) <= TURN_ONLY_WITHIN:
            return self.stay(end)
        turn = math.atan2(end[1] - start[1], end[0] - start[0]) - start[2]
        plan = self._planned([start[:2], end[:2]], speed, turn)
        plan[-1] = (*end, 0.0, 0.0)
        return self._begin(plan)

    def stay(self, pose: Pose) -> None:
        """Stay at a pose, world frame, and come back to it."""
        self._begin(np.tile([*as_pose(pose, "pose"), 0.0, 0.0], (2, 1)))

    def _begin(self, plan: Array) -> None:
        dt, detour = self.settings.dt, self._detour
        self._path = PathTracking(self._tracker, Waiting(), dt, detour.settings)
        self._path.follow(plan)
        self._stage = detour.start()

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Forget what was driven; the robot drives (v, ω) at present."""
        self._safety.reset(v, omega)
        self._driven = v, omega

    def left(self, pose: Pose) -> tuple[float, float]:
        """Return how far the end of the path is from a pose, m and rad."""
        end = tuple(self._path.plan[-1, :3].tolist())
        e_x, e_y, turn = tracking_error(as_pose(pose, "pose"), end)
        return math.hypot(e_x, e_y), abs(turn)

    def step(self, pose: Pose, obstacles: Obstacles | npt.ArrayLike = ()) -> Decision:
        """Return the twist to drive for the coming control step.

        ``blocked`` where there has been no way for ``blocked_time``.

        Args:
            pose: Of the robot, world frame: x, y (m), γ (rad).
            obstacles: Robot frame; or (N, 2) points alone, m.

        Raises:
            InvalidInputError: A number is not finite, or a shape does not fit.
        """
        place = as_pose(pose, "pose")
        if not isinstance(obstacles, Obstacles):
            obstacles = Obstacles(obstacles)
        tracking = self._path.step(place, self._driven)
        progress, v, omega = self._stage(obstacles, tracking)
        decision = self._safety.filter(v, omega, obstacles)
        self._driven = decision.v, decision.omega
        return blocked_if(decision, progress is Progress.BLOCKED)
