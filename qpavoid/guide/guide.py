"""Guide: reference, candidate choice and filter in one call, without a scenario."""

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import Decision, Status, blocked_if
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.inputs import Stamps, as_driven, caught, problem_of
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError, QPAvoidError
from qpavoid.guide.headway import AT_GOAL, Headway, lengths, moves_near, start_row
from qpavoid.guide.rest import EXACT, JUMP, Rest, beyond_band, is_driven
from qpavoid.guide.rollout import ROWS, TICK, fill_ahead
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.sight import Sight
from qpavoid.guide.stage import GuideStage, Tracking, fresh_stage
from qpavoid.guide.state import CLEAR, SEARCHING, STAGE_MODE, STILL, Progress
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import TINY, arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.validation import as_number, as_pose, as_rows
from qpavoid.perception.perception import Perception
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains, Tracker, tracking_error
from qpavoid.tracking.path import Path, SplinePath
from qpavoid.tracking.station import StationKeeping, StationTracker
from qpavoid.types import Array, Pose, Twist

TURN_ONLY_WITHIN = 1e-6
"""m; distance of a goal to which the robot only turns."""

PATH_STEPS = 1_000_000
"""Control steps of a path: 5.5 h at 0.02 s, 40 MB."""

SAME_PATH = 0.05
"""m and rad; tolerance of equal goals, or points of a path."""

STRAYED = 3.0
"""m from the reference beyond which a goal that is sent again is planned anew."""

CHANGED = 0.1
"""m of change in clearance or remaining distance after which a robot that gave up near
its goal tries again."""


class Asked(NamedTuple):
    """Task of a guide.

    Attributes:
        given: (3,) goal, (n, 2) way-points or (n, 5) rows of a path, world frame.
        speed: Greatest speed, m/s.
    """

    given: Array
    speed: float

    def is_like(self, other: "Asked") -> bool:
        """Return whether two tasks are equal within :data:`SAME_PATH`."""
        if self.given.shape != other.given.shape or self.speed != other.speed:
            return False
        off = np.abs(self.given - other.given)
        if off.shape == (3,):
            off[2] = abs(wrap_angle(off[2]))
        return bool((off <= SAME_PATH).all())


def as_speed(value: float) -> float:
    """Return a speed, m/s.

    Raises:
        InvalidInputError: Not a finite number, or below :data:`TINY`.
    """
    speed = as_number(value, "speed")
    if speed < TINY:
        raise InvalidInputError(f"speed must be above 0, not {speed:g}")
    return speed


def memory_ahead(settings: GuideSettings | None) -> Array:
    """Return memory for the reference ahead; without rows if there is no guide."""
    return np.empty((0 if settings is None else ROWS, 5))


def standing(pose: Pose | Array) -> Array:
    """Return a plan, (2, 5), at rest at a pose."""
    return np.tile([*pose, 0.0, 0.0], (2, 1))


def rows_of(path: Path, dt: float) -> Array:
    """Return the rows of a path, (n, 5), one per control step.

    Raises:
        InvalidInputError: It lasts less than 0 s or more than :data:`PATH_STEPS`, or
            does not sample as many rows of finite numbers.
    """
    duration = as_number(getattr(path, "duration", 0.0), "a path's duration")
    if not 0.0 <= duration <= PATH_STEPS * dt:
        raise InvalidInputError(f"a path must last 0 to {PATH_STEPS * dt:g} s")
    times: Array = dt * np.arange(math.ceil(duration / dt) + 2, dtype=np.float64)
    rows = as_rows(path.sample(times), 5, "what a path samples")
    if len(rows) != len(times) or not np.isfinite(rows).all():
        raise InvalidInputError("a path must sample (n, 5) finite numbers for n times")
    return rows


class PathTracking:
    """Tracking of a plan: tracker, clock, and the input of a stage.

    Attributes:
        plan: (n, 5) the reference, world frame, one row per control step.
        target: Reference of the last step, world frame.
        place: Its progress, in control steps.
    """

    def __init__(
        self, tracker: Tracker, clock: Waiting, dt: float, stage: GuideSettings | None
    ) -> None:
        self._track, self._waiting, self._dt = tracker.start(), clock, dt
        self._ahead = memory_ahead(stage)

    def follow(self, plan: Array, place: float = 0.0) -> None:
        """Follow a plan from ``place`` on, in rows."""
        self.plan, self.place = plan, place
        self._follow = self._waiting.start(plan, place)

    @property
    def has_ended(self) -> bool:
        """Whether the reference rests at its end."""
        return self.place >= len(self.plan) - 2

    @property
    def row(self) -> int:
        """Row of the plan of the reference in the next step."""
        return min(int(self.place) + 1, len(self.plan) - 1)

    @property
    def reference(self) -> Pose:
        """Pose of that row, world frame."""
        x, y, heading = self.plan[self.row, :3].tolist()
        return x, y, heading

    def step(self, pose: Pose, driven: Twist) -> Tracking:
        """Return the tracking of one control step, and advance the clock."""
        target, self.place = self._follow(pose)
        fill_ahead(self.plan, self.place, pose, TICK / self._dt, self._ahead)
        self.target, desired = target, self._track(pose, target)
        error = tracking_error(pose, target[:3])
        return Tracking(desired, error, target.v, driven, self._dt, self._ahead)


class Guide:
    """Path following, or motion to a pose, among obstacles: one filter for one robot.

    The path's clock waits for the robot. Candidates for the coming seconds are scored
    against static and moving obstacles (:mod:`qpavoid.guide.stage`); the chosen twist
    goes through the safety filter, whose guarantees hold for any desired twist.

    Args:
        robot: Footprint and limits.
        settings: Of the filter; its ``dt`` is the control step.
        guide: Of the candidates, and of stall and block.
        perception: Of scans; default one LiDAR all round, at the first scan.

    Attributes:
        robot: Footprint and limits.
        settings: Of the filter.
    """

    def __init__(
        self,
        robot: Robot,
        settings: AvoidanceSettings | None = None,
        guide: GuideSettings | None = None,
        perception: Perception | None = None,
    ) -> None:
        self.robot = robot
        self.settings = settings if settings is not None else AvoidanceSettings()
        self._sight = Sight(robot, perception, self.settings.dt)
        self._guide, self._limits = guide or GuideSettings(), robot.limit_vector
        self._safety = SafetyFilter(robot, self.settings)
        self._rest = Rest(robot.limits, self.settings.dt)
        self._driven, self._clearance = (0.0, 0.0), math.inf
        self._pose: Pose | None = None
        self._mode = float(CLEAR)
        self._resigned: Array | None = None
        self._from, self._asked = (0.0, 0.0, 0.0), Asked(np.zeros(3), math.inf)
        plan, law = (
            standing(self._from),
            StationTracker(Gains(), StationKeeping(), robot.limits),
        )
        self._headway, self._state = Headway(plan, 0, 1.0), fresh_stage()
        self._path = PathTracking(law, Waiting(), self.settings.dt, self._guide)
        self._path.follow(plan)
        self._begin(plan, self._asked)

    @property
    def perception(self) -> Perception | None:
        """Perception of scans; None before the first."""
        return self._sight.perception

    @property
    def safety(self) -> SafetyFilter:
        """Filter behind the guide, with its ``faults`` and ``acknowledge``."""
        return self._safety

    @property
    def footprint(self) -> Footprint:
        """Footprint of the robot, of filter and perception too; may be set.

        Between steps: see :attr:`qpavoid.SafetyFilter.footprint`. Path and progress are
        kept.
        """
        return self.robot.footprint

    @footprint.setter
    def footprint(self, footprint: Footprint) -> None:
        self._safety.footprint = footprint
        self.robot = self._safety.robot
        self._sight.fit(self.robot)
        self._start_stage()

    def follow(self, path: Path | npt.ArrayLike, speed: float = 0.5) -> None:
        """Follow a path.

        It may be sent again at any time. The same path, each point within
        :data:`SAME_PATH`, changes nothing. Another one to the same goal is followed
        from the robot's position on it, with the states of stall and detour; one that
        begins closely behind the robot from there; any other from its beginning.

        Args:
            path: World frame; or (n, 2) way-points, m, of a smooth one, which begins
                with the speed driven last.
            speed: Greatest on way-points, m/s; only to evade, the filter may drive
                faster. A :class:`Path` has its own.

        Raises:
            InvalidInputError: Fewer than two distinct way-points, numbers that are not
                finite, a path that lasts more than :data:`PATH_STEPS`, or a speed
                within the dead band of the motors. The previous path is kept.
        """
        speed = self._as_speed(speed)
        if isinstance(path, Path):
            plan = given = rows_of(path, self.settings.dt)
            speed = float(np.abs(plan[:, 3]).max()) or math.inf
        else:
            given = as_rows(path, 2, "a path").copy()
        asked = Asked(given, speed)
        old = self._path.plan
        lap = self._path.has_ended and math.dist(old[0, :2], old[-1, :2]) <= AT_GOAL
        if asked.is_like(self._asked) and not lap:
            return
        if not isinstance(path, Path):
            plan = self._planned(given, speed)
        self._begin(plan, asked)

    def go_to(self, pose: Pose, goal: Pose, speed: float = 0.5) -> None:
        """Go from a pose to another one, straight if that is free; world frame.

        It may be sent again at any time: to a goal near the last one the robot
        continues, with the states of stall and detour.

        Args:
            pose: Of the robot.
            goal: Target pose.
            speed: Greatest, m/s, as of :meth:`follow`.

        Raises:
            InvalidInputError: A pose is not three finite numbers, or the speed not
                positive, or within the dead band of the motors. The previous path is
                kept.
        """
        start, end = as_pose(pose, "pose"), as_pose(goal, "goal")
        self._go(start, Asked(np.array(end), self._as_speed(speed)))

    def stay(self, pose: Pose) -> None:
        """Stay at a pose, world frame, and return to it after evading."""
        end = as_pose(pose, "pose")
        self._go(self._pose or end, Asked(np.array(end), math.inf))

    def _go(self, start: Pose, asked: Asked) -> None:
        """Go straight to a goal; at speed 0 stay there."""
        end = as_pose(asked.given, "goal")
        plan, strayed = standing(end), self._has_strayed(start)
        if not strayed and asked.is_like(self._asked):
            self._path.plan[-1, :3] = end
            return
        if strayed or not self._leads_on(plan, asked):
            x, y, heading = start
        else:
            x, y, heading = self._from
        if asked.speed < math.inf and math.dist((x, y), end[:2]) > TURN_ONLY_WITHIN:
            turn = math.atan2(end[1] - y, end[0] - x) - heading
            plan = self._planned(np.array([(x, y), end[:2]]), asked.speed, turn)
            plan[-1] = (*end, 0.0, 0.0)
        self._pose, self._from = start, (x, y, heading)
        self._begin(plan, asked)

    def _as_speed(self, value: float) -> float:
        speed, dead = as_speed(value), self.robot.limits.v_dead
        if speed <= dead:
            raise InvalidInputError(f"speed must be above the dead band, {dead:g} m/s")
        return speed

    def _planned(self, points: Array, speed: float, turn: float = 0.0) -> Array:
        """Return the rows of a path, one per control step; it begins at an angle."""
        begin = min(max(self._driven[0] * math.cos(turn), 0.0), speed)
        return rows_of(SplinePath(points, speed, begin=begin), self.settings.dt)

    def _has_strayed(self, pose: Pose | None) -> bool:
        """Return whether a robot is far from its reference, and on no detour."""
        if pose is None or self._state[STAGE_MODE] != CLEAR:
            return False
        far = AT_GOAL if self._path.has_ended else STRAYED
        return math.dist(pose[:2], self._path.reference[:2]) > far

    def _leads_on(self, plan: Array, asked: Asked) -> bool:
        """Return whether a plan leads to about the present goal."""
        same_kind = asked.given.ndim == self._asked.given.ndim
        return same_kind and math.dist(self._path.plan[-1, :2], plan[-1, :2]) <= AT_GOAL

    def _begin(self, plan: Array, asked: Asked) -> None:
        """Follow a plan from the row of the robot, or of the last reference."""
        old, headway, limits = self._path, self._headway, self.robot.limits
        kept, place, speed = self._leads_on(plan, asked), 0, asked.speed
        ended = asked.given.ndim == 2 and old.has_ended
        if kept and not (ended or self._has_strayed(self._pose)):
            along = lengths(old.plan)
            place = start_row(plan, old.reference, along[-1] - along[old.row])
        elif self._pose is not None:
            closed = math.dist(plan[0, :2], plan[-1, :2]) <= AT_GOAL
            goes_on = kept and asked.given.ndim == 2 and not closed
            place = start_row(plan, self._pose, 0.0 if goes_on else None)
        progress = min(self._guide.progress, 0.25 * self._guide.blocked_time * speed)
        self._headway = Headway(plan, place, progress)
        if kept:
            self._headway.take_over(headway)
        else:
            self._state, self._mode, self._resigned = fresh_stage(), float(CLEAR), None
            self._rest.forget()
        v_min, v_max = max(limits.v_min, -speed), min(limits.v_max, speed)
        limits = replace(limits, v_min=v_min, v_max=v_max)
        tracker = StationTracker(Gains(), StationKeeping(), limits)
        self._path = PathTracking(tracker, Waiting(), self.settings.dt, self._guide)
        self._path.follow(plan, place)
        self._asked, self._slowed, self._law = asked, limits, tracker.array
        self._start_stage()

    def _start_stage(self) -> None:
        """Continue with the candidates of the present footprint and greatest speed."""
        robot = replace(self.robot, limits=self._slowed)
        stage = GuideStage(robot, self._guide, self.settings, self._law)
        self._stage = stage.start(self._state)

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Reset the state; the robot drives (v, ω), cut to its limits.

        Raises:
            InvalidInputError: Not two finite numbers.
        """
        self._safety.reset(v, omega)
        self._driven = as_driven((v, omega), self._limits)
        self._rest.forget()
        self._sight.forget()

    def left(self, pose: Pose) -> tuple[float, float]:
        """Return the distance of the end of the path from a pose, m and rad."""
        e_x, e_y, turn = tracking_error(as_pose(pose, "pose"), self._end)
        return math.hypot(e_x, e_y), abs(turn)

    @property
    def _end(self) -> Pose:
        x, y, heading = self._path.plan[-1, :3].tolist()
        return x, y, heading

    def step(
        self,
        pose: Pose,
        obstacles: Obstacles | npt.ArrayLike = (),
        *,
        scan: npt.ArrayLike | None = None,
        stamp: float | None = None,
        driven: tuple[float, float] | None = None,
        age: float = 0.0,
        stamps: Stamps | None = None,
        on_error: Literal["raise", "brake"] = "raise",
    ) -> Decision:
        """Return the twist for the coming control step.

        ``blocked`` if the robot has made no progress to the goal for ``blocked_time``,
        and stands.

        Args:
            pose: Of the robot, world frame: x, y (m), γ (rad).
            obstacles: Robot frame; or (N, 2) points alone, m. Not with scans.
            scan: Ranges of a LiDAR, as of ``Perception.update``; the pose is odometry.
                A step without one has the obstacles known so far, for 0.5 s.
            stamp: Time of the scan, s; without a scan the time to predict to.
            driven: Measured (v, ω). Default the guide's last twist: after an emergency
                stop it then continues with the speed before.
            age: s since the obstacles were measured.
            stamps: When pose and obstacles were measured; checked as by
                :meth:`qpavoid.avoidance.filter.SafetyFilter.step`.
            on_error: ``brake``: any fault gives a decision ``invalid`` with its
                ``problem``, with the latch and braking of that method.

        Raises:
            InvalidInputError: A number is not finite, or a shape does not fit.
            FaultError: Stamps or age are not valid, or scans are missing.
        """
        driven, given = self._motors_driven(driven), (obstacles, scan, stamp)
        if on_error == "brake":
            found = caught(self._desire, pose, given, driven)
            if isinstance(found, BaseException):
                decision = self._safety.brake(problem_of(found), driven)
            else:
                told: dict[str, Any] = {"age": age, "stamps": stamps, "driven": driven}
                decision = self._safety.step(*found, **told)
        elif on_error == "raise":
            known = caught(self._safety._watch.age, stamps, age)
            if isinstance(known, QPAvoidError):
                raise known
            if isinstance(known, BaseException):
                raise InvalidInputError(f"stamps must be Stamps: {known}")
            v, omega, seen = self._desire(pose, given, driven)
            decision = self._safety.filter(v, omega, seen, age=known, driven=driven)
        else:
            raise InvalidInputError("on_error must be 'raise' or 'brake'")
        self._driven = decision.v, decision.omega
        if not is_driven(*self._driven, self.robot.limits):
            self._driven = 0.0, 0.0
        self._clearance = decision.clearance
        if decision.status is Status.INVALID:
            return decision
        return blocked_if(decision, self._blocked)

    def _motors_driven(self, driven: Any) -> Any:
        """Return the measured twist; inside the dead band the last one commanded.

        There the motors do not move for any command, and accelerations relative to the
        measured twist would never leave it.
        """
        limits, given = self.robot.limits, self._safety._last
        found = caught(as_driven, driven, self._limits)
        if limits.dead == (0.0, 0.0) or driven is None or not isinstance(found, tuple):
            return driven
        inside = not (is_driven(*found, limits) or is_driven(*given, limits))
        return given if inside else driven

    def _desire(
        self, pose: Pose, given: tuple[Any, Any, Any], driven: Any
    ) -> tuple[float, float, Obstacles]:
        """Return the desired twist of the guide, and the obstacles.

        ``given``: obstacles, scan and stamp of :meth:`step`.
        """
        at, seen = as_pose(pose, "pose"), self._sight.see(pose, *given)
        if driven is not None:
            self._driven = as_driven(driven, self._limits)
        before, self._pose = self._pose or at, at
        x, y, _ = arc(*before, *self._driven, self.settings.dt)
        if math.dist((x, y), at[:2]) > JUMP:  # moved by hand, or relocalised
            self._headway.restart()
        if self._path.has_ended:
            at = self._rest.see(at, self._driven, self._end)
        tracking, speed = self._path.step(at, self._driven), self._asked.speed
        v = min(max(tracking.desired[0], -speed), speed)
        tracking = tracking._replace(desired=(v, tracking.desired[1]))
        resigns = self._note(at, seen, tracking)
        progress, v, omega = self._stage(seen, tracking)
        self._blocked = resigns or progress is Progress.BLOCKED
        if resigns:
            return 0.0, 0.0, seen
        v = min(max(v, -speed), speed)
        return *beyond_band(v, omega, self.robot.limits), seen

    def _note(self, at: Pose, seen: Obstacles, tracking: Tracking) -> bool:
        """Register progress to the goal; return whether the robot gives up near it.

        Without progress the stage is stalled and searches for a detour, for any motion
        of the robot; near its goal the robot stands until something changes there.
        """
        s, headway, state = self._guide, self._headway, self._state
        was, self._mode = self._mode, state[STAGE_MODE]
        near = moves_near(seen)
        if near and self._path.has_ended:
            # A robot that evades at its goal makes no progress to it.
            headway.restart()
        headway.note(at, self.settings.dt)
        e_x, e_y, turn = tracking.error
        off = max(math.hypot(e_x, e_y), abs(turn))
        at_goal = self._path.has_ended and headway.left < AT_GOAL
        found = was == SEARCHING and state[STAGE_MODE] != SEARCHING and not at_goal
        if found or off < (EXACT if self._path.has_ended else s.tolerance):
            headway.time = 0.0
        if state[STAGE_MODE] == SEARCHING:
            state[STILL] = max(state[STILL], headway.time)
        late = headway.time >= (1.0 if at_goal else 0.5) * s.blocked_time
        late = (late or self._resigned is not None) and not near
        if late and not at_goal and state[STAGE_MODE] == CLEAR:
            state[STILL] = max(state[STILL], s.stall_time)
        # Without obstacles a slow robot reaches its goal eventually.
        hindered = self._clearance < AT_GOAL or self.robot.limits.dead != (0.0, 0.0)
        if not (late and at_goal and hindered):
            self._resigned = None
            return False
        here = np.array([self._clearance, headway.left])
        if self._resigned is None:
            self._resigned = here
        with np.errstate(invalid="ignore"):
            changed = bool((np.abs(here - self._resigned) > CHANGED).any())
        if changed:
            headway.time, self._resigned = 0.0, None
        return not changed
