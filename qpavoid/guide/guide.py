"""Guide: reference, candidate choice and filter in one call, without a scenario."""

import math
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.inputs import (
    FaultError,
    Freshness,
    InputWatch,
    Stamps,
    as_driven,
    caught,
)
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.guide.headway import AT_GOAL, Headway, lengths, moves_near, start_row
from qpavoid.guide.rest import EXACT, JUMP, Bounds, Rest, beyond_band
from qpavoid.guide.rollout import ROWS, TICK, fill_ahead
from qpavoid.guide.settings import GuideSettings, look_short
from qpavoid.guide.stage import (
    ACTION,
    ACTION_SHARE,
    CLEAR,
    COUNT,
    DETOUR,
    NO_PATH,
    SEARCHING,
    STAGE_MODE,
    STILL,
    Stage,
    Tracking,
    fresh_stage,
    start_stage,
)
from qpavoid.model.contacts import clearance_of
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import TINY, arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.prediction import Prediction, Predictor
from qpavoid.model.robot import Robot
from qpavoid.model.validation import as_number, as_pose, as_rows
from qpavoid.perception.perception import Perception
from qpavoid.settings import want
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains, tracking_error
from qpavoid.tracking.path import Path, SplinePath
from qpavoid.tracking.station import StationKeeping, Tracker
from qpavoid.types import Array, Pose, Twist

TURN_ONLY_WITHIN = 1e-6
"""m; distance of a goal to which the robot only turns."""

PATH_STEPS = 1_000_000
"""Control steps of a path: 5.5 h at 0.02 s, 40 MB."""

SAME_PATH = 0.05
"""m and rad; tolerance of equal goals, or points of a path."""

STRAYED = 3.0
"""m from the reference beyond which a goal that is sent again is planned anew."""

NEAR_GOAL = 1.5
"""m; distance of the goal from which on the robot does not drive round one that is
occupied."""

LEAVE = 3.0
"""Blocked times after which a robot that was at its goal holds another place while that
is occupied."""

CHANGED = 0.1
"""m of change in clearance or remaining distance after which a robot that gave up near
its goal tries again."""

LONGEST_BLIND = 0.5
"""s without a new and valid scan after which a step is a fault."""


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
        self._ahead = np.empty((0 if stage is None else ROWS, 5))

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


class Sight:
    """Perception of a guide, and the time since its last valid scan.

    Args:
        robot: Its footprint.
        perception: Of scans; default one LiDAR all round, at the first scan.
        dt: Control step, s.
    """

    def __init__(self, robot: Robot, perception: Perception | None, dt: float) -> None:
        self.robot, self.perception, self._dt = robot, perception, dt
        self.forget()

    def fit(self, robot: Robot) -> None:
        """Set the robot, that of the perception too."""
        self.robot = robot
        if self.perception is not None:
            self.perception.fit(robot)

    def forget(self) -> None:
        """Expect scans only after the next one."""
        self._watch, self._time = InputWatch(LONGEST_BLIND, math.inf), 0.0

    def see(self, pose: Pose, given: Any, scan: Any, stamp: Any) -> Obstacles:
        """Return the given obstacles, or those perceived.

        After a first scan a step without obstacles and scan has those known so far.

        Raises:
            FaultError: No scan has been new and valid for :data:`LONGEST_BLIND`.
        """
        none, watch = isinstance(given, tuple) and not given, self._watch
        expected = math.isfinite(watch.stamp)
        if scan is None and stamp is None and not (none and expected):
            return given if isinstance(given, Obstacles) else Obstacles(given)
        want(none, "a step has obstacles, or else a scan or its stamp, not both")
        if self.perception is None:
            self.perception = Perception(self.robot)
        self._time += self._dt  # counted: a scan may come again with its old stamp
        time, perception = math.nan if stamp is None else stamp, self.perception
        if scan is not None:
            seen = perception.update(scan, time, pose)
        else:
            if stamp is None:
                time = watch.stamp + watch.age(watch.stamp, self._time)
            seen = perception.obstacles(time, pose)
        if perception.last_valid != watch.stamp:
            watch.stamp = -math.inf  # of another clock, if it went back
            watch.receive(perception.last_valid, time, self._time)
        fault = watch.fault(time, self._time)
        if fault is not None:
            raise FaultError({"scan": fault})
        return seen


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
        freshness: Greatest ages of the inputs of :meth:`step`, and when a fault ends.
        predict: Velocities of moving discs from their :class:`Tracks`, for the scores
            of candidates. Default: the measured ones, which the filter always uses.
        yielding: Sets that of ``guide``.

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
        freshness: Freshness | None = None,
        predict: Predictor | None = None,
        yielding: bool = False,
    ) -> None:
        self.robot = robot
        settings, guide = settings or AvoidanceSettings(), guide or GuideSettings()
        guide = replace(guide, yielding=True) if yielding else guide
        self.settings, self._guide = look_short(settings, guide)
        self._sight = Sight(robot, perception, self.settings.dt)
        self._prediction = None
        if predict is not None:
            self._prediction = Prediction(predict, self.settings.dt)
        self._limits = robot.limit_vector
        self._safety = SafetyFilter(robot, self.settings, freshness=freshness)
        self._rest = Rest(robot.limits, self.settings.dt)
        self._driven, self._clearance = (0.0, 0.0), math.inf
        self._pose: Pose | None = None
        self._bounds: Bounds | None = None
        self._resigned: Array | None = None
        self._mode, self._arrived, self._quiet = float(CLEAR), False, math.inf
        self._from, self._asked = (0.0, 0.0, 0.0), Asked(np.zeros(3), math.inf)
        plan = standing(self._from)
        law = Tracker(Gains(), StationKeeping(), robot.limits)
        self._headway, self._state = Headway(plan, 0, 1.0), fresh_stage()
        self._path = PathTracking(law, Waiting(), self.settings.dt, self._guide)
        self._path.follow(plan)
        self._begin(plan, self._asked)

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Refuse copies, which would share the state of tracking and stage."""
        raise TypeError("a Guide cannot be copied or pickled; make another one")

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

    def stay(
        self,
        pose: Pose,
        *,
        max_away: float = math.inf,
        region: npt.ArrayLike | None = None,
    ) -> None:
        """Stay at a pose, world frame, and return to it after giving way.

        At the edge of the area the robot stops instead of giving way any farther.

        Args:
            pose: Station.
            max_away: Greatest distance of the robot's origin from it, m.
            region: (n, 2) corners of a simple polygon, counter-clockwise, world frame,
                m, that the origin must not leave.

        Raises:
            InvalidInputError: Numbers that are not finite, a distance that is not
                positive, a region that is no such polygon, or a station outside of it.
                The previous task is kept.
        """
        end = as_pose(pose, "pose")
        edges = np.empty((0, 6))
        if region is not None:
            try:
                edges = Footprint.polygon(region).edges  # type: ignore[arg-type]
            except InvalidInputError as error:
                raise InvalidInputError(f"a region is a polygon: {error}") from None
        away = max_away if max_away == math.inf else as_number(max_away, "max_away")
        want(away > 0.0, f"max_away must be above 0, not {away:g}")
        bounds = Bounds(end, away, edges)
        want(bounds.beyond(*end[:2]) == 0.0, "the station must be inside its region")
        self._go(self._pose or end, Asked(np.array(end), math.inf))
        self._bounds = bounds

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
        speed, dead = as_number(value, "speed"), self.robot.limits.v_dead
        want(speed >= TINY, f"speed must be above 0, not {speed:g}")
        want(speed > dead, f"speed must be above the dead band, {dead:g} m/s")
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
            self._arrived = False
            self._rest.begin(speed == math.inf)
        v_min, v_max = max(limits.v_min, -speed), min(limits.v_max, speed)
        limits = replace(limits, v_min=v_min, v_max=v_max)
        tracker = Tracker(Gains(), StationKeeping(), limits)
        self._path = PathTracking(tracker, Waiting(), self.settings.dt, self._guide)
        self._path.follow(plan, place)
        self._asked, self._slowed, self._law = asked, limits, tracker.array
        self._bounds = None
        self._start_stage()

    def _start_stage(self) -> None:
        """Continue with the candidates of the present footprint and greatest speed."""
        robot = replace(self.robot, limits=self._slowed)
        stage = Stage.of(robot, self._guide, self.settings, self._law)
        self._stage = start_stage(stage, self._state)

    def reset(self, v: float = 0.0, omega: float = 0.0) -> None:
        """Reset the state; the robot drives (v, ω), cut to its limits.

        Raises:
            InvalidInputError: Not two finite numbers.
        """
        self._safety.reset(v, omega)
        self._driven = as_driven((v, omega), self._limits)
        self._rest.begin(True)
        self._sight.forget()
        if self._prediction is not None:
            self._prediction.forget()

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
        on_error: Literal["brake", "raise"] = "brake",
    ) -> Decision:
        """Return the twist for the coming control step.

        ``blocked`` if the robot has made no progress to the goal for ``blocked_time``;
        it may still move, to evade.

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
        found: tuple[float, float, Obstacles] | BaseException
        given: tuple[Any, ...] = pose, (obstacles, scan, stamp), driven
        told: dict[str, Any] = {"age": age, "stamps": stamps, "driven": driven}
        if on_error == "raise":
            found = self._desire(*given)
        elif on_error == "brake":
            found = caught(self._desire, *given)
        else:
            raise InvalidInputError("on_error must be 'raise' or 'brake'")
        if isinstance(found, BaseException):
            decision = self._safety.brake(found, driven)
        else:
            decision = self._safety.step(
                *found, **told, on_error=on_error, accept=self._stays
            )
        self._driven, self._clearance = (decision.v, decision.omega), decision.clearance
        if decision.status is Status.INVALID:
            self._headway.time = 0.0
        elif self._blocked:
            decision = decision._replace(status=Status.BLOCKED)
        return decision

    def _stays(self, v: float, omega: float) -> bool:
        """Return whether a robot that gives way with a twist stays in its area."""
        bounds, pose = self._bounds, self._pose
        if bounds is None or pose is None or not self._arrived:
            return True
        pose = arc(*pose, *self._driven, self.settings.actuation.delay)
        return not bounds.is_left(self._limits, pose, (v, omega), self.settings.dt)

    def _desire(
        self, pose: Pose, given: tuple[Any, Any, Any], driven: Any
    ) -> tuple[float, float, Obstacles]:
        """Return the desired twist of the guide, and the obstacles.

        ``given``: obstacles, scan and stamp of :meth:`step`.
        """
        at, seen = as_pose(pose, "pose"), self._sight.see(pose, *given)
        if driven is not None:
            self._driven = as_driven(driven, self._limits)
        rated = known = seen.at_rest() if self._guide.yielding else seen
        if self._prediction is not None:
            rated = self._prediction.see(known, at, self._driven)
        before, self._pose = self._pose or at, at
        x, y, _ = arc(*before, *self._driven, self.settings.dt)
        if math.dist((x, y), at[:2]) > JUMP:  # moved by hand, or relocalised
            self._headway.restart()
        if self._path.has_ended:
            at = self._rest.see(at, self._driven, self._end)
        tracking, speed = self._path.step(at, self._driven), self._asked.speed
        if self._note(at, seen, tracking):
            error, ahead = (0.0, 0.0, 0.0), np.zeros((ROWS, 5))
            tracking = tracking._replace(desired=error[:2], error=error, ahead=ahead)
        v = min(max(tracking.desired[0], -speed), speed)
        tracking = tracking._replace(desired=(v, tracking.desired[1]))
        mode, v, omega = self._stage(rated, tracking)
        late = self._headway.time >= self._guide.blocked_time
        self._blocked = late or mode == NO_PATH
        v = min(max(v, -speed), speed)
        if not self._stays(v, omega):
            # Without anybody to give way to, the way back is that of the tracking.
            back = tracking.desired
            returns = not moves_near(seen) and self._stays(*back)
            v, omega = back if returns else (0.0, omega)
        return *beyond_band(v, omega, self.robot.limits), known

    def _note(self, at: Pose, seen: Obstacles, tracking: Tracking) -> bool:
        """Register progress to the goal; return whether the robot gives up near it.

        Without progress the stage is stalled and searches for a detour, for any motion
        of the robot. Near its goal the robot holds its place: while the goal is
        occupied, else until something changes there.
        """
        s, headway, state = self._guide, self._headway, self._state
        was, self._mode = self._mode, state[STAGE_MODE]
        ended, near = self._path.has_ended, moves_near(seen)
        e_x, e_y, turn = tracking.error
        off = max(math.hypot(e_x, e_y), abs(turn))
        occupied = off >= EXACT and self._is_occupied(at, seen)
        evades = near and ended and not occupied  # it makes no progress to its goal
        self._quiet = 0.0 if evades else self._quiet + self.settings.dt
        if evades and self._arrived:
            headway.restart()
        at_goal = occupied or (ended and headway.left < AT_GOAL)
        detour = math.inf
        if state[STAGE_MODE] == DETOUR and not at_goal:
            detour = state[COUNT] - state[ACTION] - state[ACTION_SHARE]
        headway.note(at, self.settings.dt, detour)
        if was == SEARCHING and state[STAGE_MODE] == CLEAR and not at_goal:
            headway.found()
        self._arrived |= ended and off < EXACT
        if off < (EXACT if ended else s.tolerance):
            headway.restart()
        if state[STAGE_MODE] == SEARCHING:
            state[STILL] = max(state[STILL], headway.time)
        least = s.blocked_time if at_goal else 0.5 * s.blocked_time
        if occupied:
            least = LEAVE * s.blocked_time if self._arrived else s.stall_time
        late = min(headway.time, self._quiet) >= least
        late = (late or self._resigned is not None) and (occupied or not near)
        if late and not at_goal and state[STAGE_MODE] == CLEAR:
            state[STILL] = max(state[STILL], s.stall_time)
        hindered = self._clearance < AT_GOAL
        if at_goal and not hindered:  # it turns on the spot, and gets there
            state[STILL], state[STAGE_MODE] = 0.0, CLEAR
        hindered |= self.robot.limits.dead != (0.0, 0.0)
        if not (late and at_goal and (hindered or occupied)):
            self._resigned = None
            return False
        here = np.array([self._clearance, headway.left])
        if self._resigned is None or self._driven != (0.0, 0.0):
            self._resigned = here  # its own motion is no change
        with np.errstate(invalid="ignore"):
            changed = bool((np.abs(here - self._resigned) > CHANGED).any())
        if changed and not occupied:
            headway.time, self._resigned = 0.0, None
        return occupied or not changed

    def _is_occupied(self, at: Pose, seen: Obstacles) -> bool:
        """Return whether the robot is near its goal, and an obstacle too near to it."""
        goal = tracking_error(at, self._end)
        if math.hypot(goal[0], goal[1]) > NEAR_GOAL:
            return False
        there = clearance_of(self.robot.footprint, seen.seen_from(goal).arrays)
        return there < self.settings.radius.r_min_slow
