"""Guard of a base: messages in, a safe twist per control step out, without ROS."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.inputs import WAITING, Fault, Freshness, InputWatch, Latch
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.guide.guide import Guide
from qpavoid.guide.settings import GuideSettings
from qpavoid.model.footprint import Footprint, offset_outline
from qpavoid.model.given import NO_POINTS
from qpavoid.model.kinematics import to_world, wrap_angle
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.trail import Trail, placed, relative
from qpavoid.model.transform import Transform
from qpavoid.ros import mask, messages, modes
from qpavoid.ros.frames import Frames
from qpavoid.ros.messages import Fan, Poses, Sight, Tracks
from qpavoid.ros.perceiver import NodePerception, Perceiver
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

STANDSTILL: Twist = (0.0, 0.0)
ORIGIN: Pose = (0.0, 0.0, 0.0)

FASTER, SPARE = 1.5, np.array([0.1, 0.2])
"""Tolerances of odometry: factor of the robot's limits, and m and rad (m/s and rad/s of
its twist), for overshoot, slip and jitter."""

SLIP = 0.25
"""Tolerated difference of twists and poses relative to the path of the poses, in
addition to :data:`SPARE`."""

LEAST_AWAY, AROUND, CORNER_POINTS = 0.05, 1.0, 5
"""m: least distance of an unknown sector's border beyond the required distance;
greatest distance beyond the circumradius at which it is stored; points round its
corners."""

UNREADABLE = ValueError, TypeError, AttributeError, OverflowError
"""Exceptions of reading a message that does not match its type."""

TELL = Fault.INVALID, Fault.BLIND, Fault.IMPLAUSIBLE, Fault.JUMPED
"""Faults whose reason is in the errors of their topic."""


AT_OUTLINE = 0.02
"""m; echoes so near to the outline count beside the perceived obstacles, which leave
out all that is inside."""

FROZEN_WAY, FROZEN_BEAMS = 0.3, 10
"""m or rad of motion and number of echoes from which on equal ranges are repeated ones,
not measurements."""

AT_END, STANDING_TWIST = (0.05, 0.1), 0.01
"""m and rad, and m/s and rad/s, within which the robot has arrived."""

NEAR_GOAL, GOAL_MOVED = 0.1, 0.02
"""m: distance of a path's end from which on the robot parks there; motion on the ground
(m or rad) with which a task is given again."""

OUTLINE_MOVED, LATEST = 0.005, math.inf
"""m; motion of a corner that makes a new footprint. s; time of the newest transform."""

LEAST_STRAIGHT, ANEW, BACK_GAIN = 0.05, 0.25, 1.5
"""m/s and rad/s, above and below which an operator drives straight ahead; m or m/s of
change with which the line in that direction is drawn again; 1/s, return to it."""

NO_STALL = 1e6
"""s; of a stall in teleoperation, which has no detours."""

ROLES = "filter", "guide"

TF = "/tf"
"""As topic of odometry: poses of the base frame by tf."""

NO_ODOMETRY = "no topic of odometry: all that scans and clouds show counts as at rest"


class GuardSetup(NamedTuple):
    """Settings that can change at run time; ``dt`` is the control step."""

    robot: Robot
    settings: AvoidanceSettings
    freshness: Freshness
    perception: NodePerception = NodePerception()
    guide: GuideSettings = GuideSettings()
    drive: modes.DriveSettings = modes.DriveSettings()


class Wiring(NamedTuple):
    """Topics and sensor frames of the node; an empty topic is not used.

    Attributes:
        role: ``filter``: commands are filtered; ``guide``: goals are driven to.
        scans: Topics of ``LaserScan``.
        clouds: Topics of ``PointCloud2``.
        odometry: Of ``Odometry``; ``/tf``: the base frame's pose in ``odom_frame`` by
            tf; without it the last twist counts as driven, and all echoes as at rest.
        tracks: Of tracked discs, see :mod:`qpavoid.ros.messages`.
        costmap: Of ``OccupancyGrid``; its occupied cells are static obstacles.
        costmap_s: Greatest age of it.
        footprint: Of ``PolygonStamped``, in the base frame or one by tf.
        dock_frame: Frame of the dock, by tf.
        dock_m: x1, y1, x2, y2, … of its region there, counter-clockwise.
        height_min_m: Points of clouds below this over the base's origin are floor.
        height_max_m: Points above this are ignored: they pass over the robot.
        mask_m: Points in the footprint grown by this may be the robot itself: those
            where a point was in the first messages of their topic
            (:mod:`qpavoid.ros.mask`).
        mask_boxes_m: x_min, y_min, x_max, y_max on the base of each box, concatenated;
            points in these boxes are the robot itself, and then no others are.
        blind_sector_deg: A run of unknown beams wider than this is an unknown sector,
            into which the robot does not drive; narrower ones are dropouts.
        last_beam_stamps: Topics of ``scans`` whose stamp is that of the last beam.
        empty_is_free: Topics of ``clouds`` whose empty clouds are free; others are
            blind.
        base_frame: The middle of the axle, x ahead.
        odom_frame: Fixed to the ground.
        frames: Names of the sensors' frames.
        frame_poses: x, y, z, roll, pitch, yaw on the base of each, concatenated.
    """

    role: str = "filter"
    scans: tuple[str, ...] = ("scan",)
    clouds: tuple[str, ...] = ()
    odometry: str = "odom"
    tracks: str = ""
    costmap: str = ""
    costmap_s: float = 1.0
    footprint: str = ""
    dock_frame: str = ""
    dock_m: tuple[float, ...] = ()
    height_min_m: float = 0.05
    height_max_m: float = 2.0
    mask_m: float = 0.0
    mask_boxes_m: tuple[float, ...] = ()
    blind_sector_deg: float = 10.0
    last_beam_stamps: tuple[str, ...] = ()
    empty_is_free: tuple[str, ...] = ()
    base_frame: str = "base_link"
    odom_frame: str = "odom"
    frames: tuple[str, ...] = ()
    frame_poses: tuple[float, ...] = ()

    @property
    def topics(self) -> list[str]:
        """All required topics.

        Raises:
            InvalidInputError: No topic of obstacles, or one is repeated; or an entry of
                ``last_beam_stamps`` or ``empty_is_free`` is not among them; or the role
                is unknown.
        """
        want(self.role in ROLES, f"role must be one of {ROLES}, not {self.role!r}")
        named = [*self.scans, *self.clouds, self.odometry, self.tracks, self.costmap]
        named = [name for name in named if name]
        want(len({*named}) == len(named), f"a topic is repeated in {named}")
        want(self.role == "filter" or self.odometry != "", "a guide needs odometry")
        docks = (self.dock_frame == "") == (self.dock is None)
        want(docks, "a dock needs dock_frame and dock_m")
        want(bool(self.scans or self.clouds), "scans or clouds must name a topic")
        for key, of in (
            ("last_beam_stamps", self.scans),
            ("empty_is_free", self.clouds),
        ):
            wrong = sorted({*getattr(self, key)} - {*of})
            want(not wrong, f"{key} names {wrong}, not among {[*of]}")
        return named

    @property
    def boxes(self) -> Array:
        """The boxes (n, 4) of ``mask_boxes_m``, m.

        Raises:
            InvalidInputError: Not four numbers per box, or an empty box.
        """
        want(len(self.mask_boxes_m) % 4 == 0, "mask_boxes_m needs 4 numbers per box")
        made = np.array(self.mask_boxes_m, dtype=np.float64).reshape(-1, 4)
        sound = bool((made[:, :2] < made[:, 2:]).all())
        want(sound, "mask_boxes_m needs x_min, y_min < x_max, y_max")
        return made

    @property
    def dock(self) -> Footprint | None:
        """Region of the dock in its frame; None without one.

        Raises:
            InvalidInputError: Not a simple polygon, counter-clockwise.
        """
        want(len(self.dock_m) % 2 == 0, "dock_m needs pairs of numbers")
        corners = np.array(self.dock_m, dtype=np.float64).reshape(-1, 2)
        return Footprint.polygon(corners) if len(corners) else None

    @property
    def sensors(self) -> dict[str, Transform]:
        """Transforms of the sensors' frames to the base.

        Raises:
            InvalidInputError: Not six numbers per frame, or angles not in rad.
        """
        poses, many = self.frame_poses, len(self.frames)
        want(len(poses) == 6 * many, f"frame_poses needs {6 * many} numbers")
        of = Transform.of_angles
        return {k: of(poses[6 * i : 6 * i + 6]) for i, k in enumerate(self.frames)}


def spans(corners: Array) -> Array:
    """Return the distances (n, n) between all corners (n, 2), m."""
    return np.asarray(np.hypot(*(corners[:, None] - corners).transpose(2, 0, 1)))


class GuardStep(NamedTuple):
    """Result of a control step.

    Attributes:
        v: m/s, to be driven.
        omega: rad/s.
        desired: Commanded (v, ω).
        decision: Of the filter; None: it was not called, the robot brakes.
        faults: By topic.
        ages: s, by topic; ``inf``: never seen.
        obstacles: Input of the filter, robot frame.
        notes: Other findings, and reasons of faults, by topic.
    """

    v: float
    omega: float
    desired: Twist
    decision: Decision | None
    faults: dict[str, Fault]
    ages: dict[str, float]
    obstacles: Obstacles
    notes: Mapping[str, str] = MappingProxyType({})

    @property
    def sentence(self) -> str:
        """Description of the step, with its reasons."""
        notes = [f"{name}: {note}." for name, note in self.notes.items()]
        if self.decision is not None:
            return " ".join([self.decision.status.sentence, *notes])
        told = [f"{name}: {why}. {why.sentence}" for name, why in self.faults.items()]
        return " ".join([*(told or [WAITING]), *notes])


class Guard:
    """Filter, or guide, of a base with monitored inputs.

    While an input has a :class:`Fault`, and until the :class:`Latch` opens, the robot
    stops clear of the last known static obstacles. Obstacles are moved to the time of
    the step by the robot's own motion. An old command is replaced by standing still,
    which is no fault.

    Attributes:
        driven: (v, ω) given last.
        sensors: Transforms of the sensors' frames, by the wiring.
        frames: All other frames, by tf.
        perceiver: Map and tracks of scans and clouds.
        guide: Of the guide role, and of the mode ``teleop``.
        errors: Last error by topic.
        faults: Number of steps with each fault, by topic and reason.
    """

    def __init__(self, setup: GuardSetup, wiring: Wiring) -> None:
        self.wiring, self.sensors, self.trail = wiring, wiring.sensors, Trail()
        self.errors: dict[str, str] = {}
        self.frames = Frames(self.errors, self.sensors)
        self.driven, self._desired = STANDSTILL, STANDSTILL
        self._boxes = wiring.boxes
        self._own = {name: mask.OwnPlaces() for name in (*wiring.scans, *wiring.clouds)}
        self._drove, self._filled = False, np.zeros(2, dtype=np.bool_)
        self._unknown, self._notes = dict[str, Array](), dict[str, str]()
        self._unread: dict[str, tuple[Any, float]] = {}
        self._jumped, self._is_posed = dict[str, Fault](), False
        self._stamps, self._ground = dict[str, float](), dict[str, Array]()
        self._tracks: Tracks | None = None
        self._readers: dict[str, Callable[[Any], Sight | Tracks | Poses]] = {
            **dict.fromkeys(wiring.scans, messages.read_scan),
            **dict.fromkeys(wiring.clouds, messages.read_cloud),
            wiring.tracks: messages.read_tracks,
            wiring.costmap: messages.read_grid,
        }
        self.faults, self._ahead = Counter[str](), dict[str, float]()
        self._scanned = dict[str, tuple[Array, Pose]]()
        self._task: tuple[str, Poses] | None = None
        self.guide: Guide | None = None
        self._outline: Footprint | None = None
        self.watches = {name: InputWatch(0.0, 0.0) for name in wiring.topics}
        self._command, self.latch = InputWatch(0.0, 0.0), Latch(math.inf)
        self.perceiver = Perceiver(setup.robot, setup.perception)
        if setup.perception.enabled and not wiring.odometry:
            self.errors["perception"] = NO_ODOMETRY
        self.change(setup)

    def change(self, setup: GuardSetup) -> None:
        """Change the settings from the next step on.

        A twist is held for a step: data have to be fresh until its end.

        Raises:
            InvalidInputError: A greatest age is not above that.
        """
        if self._outline is not None:
            robot = replace(setup.robot, footprint=self._outline)
            setup = setup._replace(robot=robot)
        fresh, dt = setup.freshness, setup.settings.dt
        held = dt * (1.0 + setup.settings.actuation.jitter)
        wired, drive = self.wiring, setup.drive
        named = {wired.odometry: fresh.odometry, wired.tracks: fresh.discs}
        named |= {wired.costmap: wired.costmap_s}
        oldest = [named.get(name, fresh.points) for name in self.watches]
        want(min(oldest) > held, f"freshness needs ages above the {held:g} s of a step")
        for watch, age in zip(self.watches.values(), oldest, strict=True):
            watch.oldest, watch.future = age - held, fresh.future
        before, outline = self.perceiver, setup.robot.footprint.edges
        same = np.array_equal(before.robot.footprint.edges, outline)
        if not same or before.settings != setup.perception:
            self.perceiver = Perceiver(setup.robot, setup.perception)
        self.setup = setup
        self._command.oldest, self._command.future = fresh.command, fresh.future
        self.latch.steps = fresh.good_steps(dt)
        self._sent: Array | None = None
        self._course, self._is_free = math.nan, True
        self._follow = modes.Follow(drive, setup.robot.footprint, dt)
        self.guide, self.safety = None, SafetyFilter(setup.robot, setup.settings)
        if wired.role == "guide" or drive.mode == "teleop":
            never = {"stall_time": NO_STALL, "blocked_time": 2.0 * NO_STALL}
            patience = {} if wired.role == "guide" else never
            guide = replace(setup.guide, **patience)
            # Of scans stamped by their first beam, and of tracks; both are monitored.
            oldest = max(fresh.points, fresh.discs) + messages.MOST_SPAN
            known = replace(fresh, points=oldest)
            self.guide = Guide(setup.robot, setup.settings, guide, freshness=known)
            self.safety = self.guide.safety
        self.safety.reset(*self.driven)

    def see(self, topic: str, message: Any, now: float, steady: float) -> Fault | None:
        """Register a message of any input but the command; return its fault, or None.

        Sensor messages are decoded in the next step: of several, only the newest.
        """
        try:
            stamp = messages.seconds(message.header.stamp)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        self._ahead[topic] = stamp - now
        fault = self.watches[topic].receive(stamp, now, steady)
        if fault is not None:
            return fault
        if topic != self.wiring.odometry:
            self._unread[topic] = message, now
            return None
        try:
            if topic == TF:
                pose, twist = self._place_of(self.wiring.base_frame, stamp), STANDSTILL
            else:
                pose, twist = messages.read_odometry(message)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault = self._jump(stamp, pose)
        return self._moved(stamp, pose, twist) or fault

    def transforms(
        self, message: Any, now: float, steady: float, fixed: bool = False
    ) -> None:
        """Register a message of tf, which may be that of odometry."""
        self.frames.add(message, fixed)
        mover = self.frames.mover(self.wiring.base_frame)
        for link in message.transforms:
            if self.wiring.odometry == TF and link.child_frame_id == mover:
                self.see(TF, link, now, steady)

    def _place_of(self, frame: str, time: float) -> Pose:
        """Return the pose of a frame in the odometry frame."""
        x, y, heading = self._on_ground(Poses(time, frame, np.zeros((1, 3))))[
            0
        ].tolist()
        return x, y, heading

    def _on_ground(self, seen: Poses) -> Array:
        """Return poses (n, 3) in the odometry frame."""
        if seen.frame == self.wiring.odom_frame:
            return seen.poses
        place = self.frames.find(self.wiring.odom_frame, seen.frame, seen.stamp)
        flat = np.column_stack([seen.poses[:, :2], np.zeros(len(seen.poses))])
        turn = math.atan2(place.rotation[1, 0], place.rotation[0, 0])
        return np.column_stack([place.apply(flat)[:, :2], seen.poses[:, 2] + turn])

    def outline(self, message: Any) -> None:
        """Take a footprint; on an error the known one is kept."""
        try:
            seen = messages.read_polygon(message)
            corners, known = seen.poses[:, :2], self.setup.robot.footprint.vertices
            off = np.inf if corners.shape != known.shape else corners - known
            if seen.frame != self.wiring.base_frame:  # its place is of another time
                if corners.shape == known.shape:
                    off = spans(corners) - spans(known)
                back = relative(self.trail.at(seen.stamp), ORIGIN)
                corners = to_world(self._on_ground(seen)[:, :2], back)
            if np.abs(off).max() > OUTLINE_MOVED:
                self._outline = Footprint.polygon(corners)
                self.change(self.setup)
            self._notes.pop("footprint", None)
        except UNREADABLE as error:
            self._note("footprint", str(error))

    def task(self, kind: str, message: Any) -> str:
        """Take a task of the guide role; return why it is refused, else nothing.

        ``kind``: ``goal_pose``, ``path`` or ``stay``.
        """
        before, self._sent = self._task, None
        try:
            self._task = kind, messages.read_poses(message)
            self._send()
        except UNREADABLE as error:
            self._task = before
            self._note(kind, f"refused: {error}")
            return str(error)
        self._notes.pop(kind, None)
        return ""

    def rest(self) -> None:
        """Replace the task by a stay at the present pose."""
        self._task = self._sent = None

    def _send(self) -> None:
        """Give the task to the guide, again after it has moved on the ground."""
        assert self.guide is not None
        time, speed = self.watches[self.wiring.odometry].stamp, self.setup.drive.speed
        want(math.isfinite(time), "there is no odometry yet")
        pose = self.trail.at(time)
        here = Poses(time, self.wiring.odom_frame, np.array([pose]))
        self._task = kind, known = self._task or ("stay", here)
        rows = self._on_ground(known._replace(stamp=LATEST))
        x, y, heading = rows[-1].tolist()
        near = math.dist(pose[:2], (x, y)) < NEAR_GOAL
        rows = rows if kind == "path" and not near else rows[-1:]
        old = self._sent
        if old is not None and old.shape == rows.shape:
            if np.abs(rows - old).max() < GOAL_MOVED:
                return
        if len(rows) > 1:
            self.guide.follow(rows[:, :2], speed)
        elif kind == "goal_pose":
            self.guide.go_to(pose, (x, y, heading), speed)
        else:
            self.guide.stay((x, y, heading))
        self._sent = rows

    @property
    def left(self) -> tuple[float, float]:
        """Distance to the end of the task, m and rad; NaN without a guide."""
        if self.guide is None or self._sent is None:
            return math.nan, math.nan
        return self.guide.left(self.trail.at(self.watches[self.wiring.odometry].stamp))

    @property
    def has_arrived(self) -> bool:
        """Whether the robot is at rest at the end of its task."""
        (away, turn), twist = self.left, max(map(abs, self.driven))
        return away < AT_END[0] and turn < AT_END[1] and twist < STANDING_TWIST

    def _moved(self, stamp: float, pose: Pose, twist: Twist) -> Fault | None:
        """Record a pose; a twist beyond the limits, or unlike the poses, is a fault.

        Components of the twists that were always exactly 0 count as not filled in: the
        poses' replace them, also during a fault.
        """
        by_poses = np.clip(self.trail.twist_to(stamp, pose), *self._fastest)
        self._filled |= np.array(twist) != 0.0
        told = np.where(self._filled, twist, by_poses)
        near = np.clip(told, *(FASTER * self._fastest + (-SPARE, SPARE)))
        self.trail.record(stamp, pose, (float(near[0]), float(near[1])))
        off, path = self.trail.drift()
        if (near == told).all() and (np.abs(off) <= SLIP * path + SPARE).all():
            return None
        self.trail.twist = float(by_poses[0]), float(by_poses[1])
        said = f"its twist is {told} (m/s, rad/s), that of its poses {by_poses}"
        return self._judge(self.wiring.odometry, Fault.IMPLAUSIBLE, said)

    @property
    def _fastest(self) -> Array:
        """(2, 2) least and greatest (v, ω), symmetric, of the greater limits."""
        limits = self.setup.robot.limits
        speed, turn_rate = (
            (limits.v_min, limits.v_max),
            (limits.omega_min, limits.omega_max),
        )
        most = np.abs([speed, turn_rate]).max(axis=1)
        return np.array([-most, most])

    def _jump(self, stamp: float, pose: Pose) -> Fault | None:
        """Report a jump of odometry until the next step; start a new pose history.

        Earlier echoes count as seen from the new pose. The map is begun anew; tracks in
        the frame that jumped are dropped until the next message.
        """
        leg = self.trail.leg(stamp, pose)
        most = FASTER * self._fastest[1] * leg.time + SPARE
        if leg.time <= 0.0 or (leg.length <= most[0] and leg.turn <= most[1]):
            return None
        back = relative(self.trail.at(stamp), ORIGIN)
        for points in (*self._unknown.values(), *self._ground.values()):
            points[:] = to_world(to_world(points, back), pose)
        self.trail, self._scanned = Trail(), {}
        self.perceiver.forget()
        self._jumped[self.wiring.odometry] = Fault.JUMPED
        said = f"{leg.length:.3g} m, {leg.turn:.3g} rad in {leg.time:.3g} s"
        self.errors[self.wiring.odometry] = said
        if self.wiring.tracks:
            self.watches[self.wiring.tracks].judge(Fault.JUMPED)
        return Fault.JUMPED

    def command(self, message: Any, now: float, steady: float) -> None:
        """Register a desired twist; an invalid one is standing still."""
        stamp, desired = now, STANDSTILL
        try:
            header = getattr(message, "header", None)
            stamp = now if header is None else messages.seconds(header.stamp)
            desired = messages.read_twist(message)
        except UNREADABLE as error:
            self.errors["command"] = str(error)
        if self._command.receive(stamp, now, steady) is None:
            self._desired = desired

    def step(self, now: float, steady: float, driven: Twist | None = None) -> GuardStep:
        """Return the twist to drive from now on, for a control step.

        Args:
            now: Time of the stamps' clock, s.
            steady: Time of a monotonic clock, s.
            driven: Measured (v, ω), default the last one given.
        """
        posed = self.watches.get(self.wiring.odometry)
        self._is_posed = posed is not None and posed.fault(now, steady) is None
        for topic in sorted(self._unread, key=lambda name: self.watches[name].stamp):
            self._read(topic, *self._unread.pop(topic))
        found = {name: watch.fault(now, steady) for name, watch in self.watches.items()}
        faults = {name: fault for name, fault in found.items() if fault is not None}
        faults, self._jumped = faults | self._jumped, {}
        ages = {name: watch.age(now, steady) for name, watch in self.watches.items()}
        late = self._command.fault(now, steady) is not None
        desired = STANDSTILL if late else self._desired
        if driven is not None and not np.isfinite(driven).all():
            self.errors["driven"], driven = f"{driven} driven", None
            faults["driven"] = Fault.INVALID
        self.driven = self.driven if driven is None else driven
        self.faults.update(f"{name} {fault}" for name, fault in faults.items())
        step = GuardStep(*STANDSTILL, desired, None, faults, ages, NO_OBSTACLES)
        step = step._replace(notes=self._told(faults))
        if self.latch.step(faults):
            step = self._filtered(step, now, driven)
        if step.decision is None:
            step = self._braked(step, self._known(now, faults))
        self.driven = step.v, step.omega
        self._drove |= self.driven != STANDSTILL
        if not self.wiring.odometry:
            self.trail.record(now, self.trail.at(now), self.driven)
        return step

    def _filtered(self, step: GuardStep, now: float, driven: Twist | None) -> GuardStep:
        """Call the filter; invalid arguments are a fault."""
        try:
            obstacles = self._obstacles(now)
            # A scan stamped by its last beam is older than its stamp.
            ages = (max(step.ages[k], now - x) for k, x in self._stamps.items())
            age, pose = max(ages, default=0.0), self.trail.at(now)
            asked = modes.Request(step.desired, obstacles)
            if self._leads(asked, pose):
                decision = self._guided(pose, obstacles, age)
            else:
                wanted, obstacles, note = self._requested(asked, pose)
                told: Any = {"age": age, "driven": driven}
                decision = self.safety.filter(*wanted, obstacles, **told)
                notes: dict[str, str] = {self.setup.drive.mode: note} if note else {}
                step = step._replace(notes={**step.notes, **notes})
        except InvalidInputError as error:
            self.errors["filter"], faults = str(error), {"filter": Fault.INVALID}
            self.latch.step(faults)
            return step._replace(faults=faults, notes=self._told(faults))
        v, omega = decision.v, decision.omega
        return step._replace(v=v, omega=omega, decision=decision, obstacles=obstacles)

    def _guided(self, pose: Pose, obstacles: Obstacles, age: float) -> Decision:
        """Return the decision of the guide."""
        assert self.guide is not None
        return self.guide.step(pose, obstacles, age=age, driven=self.driven)

    def _leads(self, asked: modes.Request, pose: Pose) -> bool:
        """Return whether the guide leads the robot: in its role, or in ``teleop``.

        There it does where the operator drives straight ahead and that way is not free,
        along a line from the robot.
        """
        if self.wiring.role == "guide":
            self._send()
            return True
        (v, omega), (x, y, heading) = asked.desired, pose
        if self.guide is None or v < LEAST_STRAIGHT or abs(omega) > LEAST_STRAIGHT:
            self._course = math.nan
            return False
        if math.isnan(self._course):
            self._course, self._sent = heading, None
        off, settings = wrap_angle(self._course - heading), self.setup.settings
        keep = settings.radius.r_min_slow + settings.margins.error
        outline = self.setup.robot.footprint
        self._is_free = modes.is_free(asked.obstacles, outline, off, keep)
        if self._is_free or abs(off) > self.setup.drive.turn:
            self._sent = None
            return False
        now = np.array([x, y, v])
        if self._sent is None or np.abs(now - self._sent).max() > ANEW:
            line = to_world(modes.AHEAD, (x, y, self._course))
            self.guide.follow(line, v)
            self._sent = now
        return True

    def _requested(self, asked: modes.Request, pose: Pose) -> modes.Request:
        """Return command and obstacles as the mode changes them."""
        drive = self.setup.drive
        if drive.mode == "teleop" and not math.isnan(self._course):
            off = wrap_angle(self._course - pose[2])
            back = (asked.desired[0], BACK_GAIN * off) if self._is_free else STANDSTILL
            return modes.Request(back, asked.obstacles)
        if drive.mode == "follow":
            return self._follow.step(asked, pose, self.perceiver.place_of(drive.person))
        if drive.mode != "dock":
            return asked
        try:
            dock = relative(self._place_of(self.wiring.dock_frame, LATEST), pose)
        except InvalidInputError as error:
            return asked._replace(note=f"nothing is exempt: {error}")
        region = self.wiring.dock
        assert region is not None
        return modes.docking(asked, dock, region, drive.dock_speed)

    def brake(self, why: str) -> GuardStep:
        """Return a step that brakes, for any inputs; the latch closes."""
        faults = {"step": Fault.INVALID}
        self.errors["step"], _ = why, self.latch.step(faults)
        ages = dict.fromkeys(self.watches, math.inf)
        nothing = GuardStep(*STANDSTILL, STANDSTILL, None, faults, ages, NO_OBSTACLES)
        return self._braked(nothing, None)

    def stop(self) -> None:
        """Set the robot to standing still, without a task; the latch closes."""
        self.rest()
        self.driven, self.latch = STANDSTILL, Latch(self.latch.steps)
        self.safety.reset()

    def _known(self, now: float, faults: Mapping[str, Fault]) -> Obstacles | None:
        """Return all obstacles seen last, if the robot's pose is known."""
        if not self._stamps or self.wiring.odometry in faults:
            return None
        try:
            return self._obstacles(now)
        except InvalidInputError:
            return None

    def _braked(self, step: GuardStep, seen: Obstacles | None) -> GuardStep:
        """Stop clear of the last known static obstacles; else brake along the arc."""
        if seen is None:
            self.safety.reset(*self.driven)
        v, omega, *_ = self.safety.brake(step.sentence, self.driven, seen)
        self.driven = v, omega
        return step._replace(v=v, omega=omega)

    def _told(self, faults: Mapping[str, Fault]) -> dict[str, str]:
        """Return the notes and errors of topics beside their faults."""
        known = {k for k, x in faults.items() if x in TELL and k in self.errors}
        told = self._notes | {k: self.errors[k] for k in known}
        for name in faults.keys() & self.watches.keys() - known:
            ahead, watch = self._ahead.get(name, 0.0), self.watches[name]
            if ahead > watch.future or -ahead > watch.oldest:
                told[name] = f"its stamps are {ahead:+.4g} s from this node's clock"
        return told

    def _read(self, topic: str, message: Any, now: float) -> None:
        """Decode a message; a blind or invalid one is a fault of its topic."""
        try:
            seen = self._readers[topic](message)
            if isinstance(seen, Tracks):
                if seen.frame != self.wiring.odom_frame:
                    self._place(seen)
                self._tracks = seen
            elif isinstance(seen, Poses):
                self._ground[topic] = self._on_ground(seen)[:, :2]
                return
            else:
                seen = self._begun(topic, seen, now)
                self._look(topic, seen)
        except UNREADABLE as error:
            self._judge(topic, Fault.INVALID, error)
            return
        if not self.watches[topic].is_blind:
            self._stamps[topic] = seen.stamp

    def _begun(self, topic: str, seen: Sight, now: float) -> Sight:
        """Return a scan with the stamp of its first beam; its last has arrived."""
        if seen.fan is None or seen.fan.span <= 0.0:
            return seen
        latest = max(seen.stamp, now) - seen.fan.span
        if topic in self.wiring.last_beam_stamps:
            latest = seen.stamp - seen.fan.span
        return seen._replace(stamp=min(seen.stamp, latest))

    def _look(self, topic: str, seen: Sight) -> None:
        """Check a sensor's message; store its echoes, and enter them into the map.

        Learns and removes the robot's own points, marks unknown sectors. Beams that end
        on the robot, or in its outline, do not count as valid.
        """
        place, outline, fan = self._place(seen), self.setup.robot.footprint, seen.fan
        flat, valid = self._flat(topic, place.apply(seen.points)), seen.valid
        near = mask.within(outline, flat, self.wiring.mask_m)
        inside, own = mask.within(outline, flat, 0.0), self._is_own(topic, flat, near)
        if fan is not None:
            valid -= float((own | inside).sum()) / max(len(fan.unknown), 1)
        if seen.empty and topic in self.wiring.empty_is_free:
            valid = 1.0
        frozen = fan is not None and self._is_frozen(topic, fan.ranges, seen.stamp)
        blind = seen.stuck or frozen or valid < self.setup.freshness.valid
        if not (blind or self._drove) and self._own[topic].messages < mask.RECORDED:
            sensor = place.translation[:2]
            self._own[topic].learn(flat[near], sensor, fan is not None)
            own = self._is_own(topic, flat, near)
        self._notes.pop(topic, None)
        if fan is not None:
            self._mark(topic, seen, fan, place)
            fan.ranges[np.flatnonzero(np.isfinite(fan.ranges))[own | inside]] = np.nan
        if (inside & ~own).any():
            self._note(topic, "a point has entered the outline")
        if blind:
            why = "the ranges repeat while the robot moves" if frozen else ""
            self._judge(topic, Fault.BLIND, why or f"{valid:.0%} valid")
            return
        after = seen.after[: len(own)][~own]
        poses = self.trail.along(seen.stamp + after)
        self._ground[topic] = placed(flat[~own], poses)
        self.perceiver.taken.discard(topic)
        if self._is_posed and self.setup.perception.enabled:
            around = seen._replace(points=flat[~(own | inside)])
            said = self.perceiver.take(topic, around, place, self.trail)
            if said:
                self._note(topic, said)

    def _is_frozen(self, topic: str, ranges: Array, stamp: float) -> bool:
        """Return whether the ranges have not changed while the robot moved."""
        here = self.trail.at(stamp)
        known, there = self._scanned.get(topic, (NO_POINTS, here))
        if not self._is_posed:
            self._scanned.pop(topic, None)
            return False
        if not np.array_equal(known, ranges, equal_nan=True):
            self._scanned[topic] = ranges.copy(), here
            return False
        x, y, turn = relative(there, here)
        moved = max(math.hypot(x, y), abs(turn)) > FROZEN_WAY
        return bool(moved and np.isfinite(ranges).sum() >= FROZEN_BEAMS)

    def _mark(self, topic: str, seen: Sight, fan: Fan, place: Transform) -> None:
        """Bound the unknown sectors of a scan by static points on the ground.

        Points seen there last, and the border of the stopping distance. Each is removed
        when its bearing is known again, or the robot has left it.
        """
        least = math.radians(self.wiring.blind_sector_deg)
        beams = mask.unknown_sectors(fan, place, self._boxes, least)
        before = self._unknown.pop(topic, NO_POINTS)
        if not beams.any():
            return
        before = np.vstack([before, self._ground.get(topic, NO_POINTS)])
        robot, pose = self.setup.robot, self.trail.at(seen.stamp)
        known, away = to_world(before, relative(pose, ORIGIN)), self._away
        kept = np.hypot(*known.T) < robot.footprint.circumradius + away + AROUND
        kept &= mask.hidden(known, fan, beams, place)
        parts = (offset_outline(x, away, CORNER_POINTS) for x in robot.footprint.parts)
        added = mask.border(fan, beams, place, Footprint.union([*parts]))
        bound = to_world(np.vstack([known[kept], added]), pose)
        first = np.unique(np.floor(bound / mask.SPACING), axis=0, return_index=True)[1]
        self._unknown[topic] = bound[np.sort(first)]
        width = math.degrees(abs(fan.step) * beams.sum())
        bearing = math.degrees(math.atan2(*added[len(added) // 2, ::-1]))
        said = f"some {width:.0f} degrees are unknown, as at {round(bearing, -1):g}"
        self._note(topic, said)

    @property
    def _away(self) -> float:
        """Distance of the border from the outline, m: required, and to stop."""
        s, v = self.setup.settings, abs(self.driven[0])
        kept = s.radius.r_min_slow + s.margins.error
        way = v * (s.dt + s.actuation.delay)
        way += 0.5 * v * v / self.setup.robot.limits.acceleration
        return kept + max(0.5 * kept, LEAST_AWAY) + way

    def _note(self, topic: str, said: str) -> None:
        self._notes[topic] = self.errors[topic] = said

    def _judge(self, topic: str, fault: Fault, why: object) -> Fault:
        self.errors[topic] = str(why)
        return self.watches[topic].judge(fault)

    def _obstacles(self, now: float) -> Obstacles:
        """Return all obstacles in the present robot frame.

        Of a message in the map only echoes at the outline are added to the map's.
        """
        here, tracked = self.trail.at(now), NO_OBSTACLES
        if self._tracks is not None and len(self._tracks.discs):
            then = self.trail.at(self._tracks.stamp)
            tracked = self._tracked(self._tracks, then).seen_from(here)
        found, back = self.perceiver.obstacles(now, here), relative(here, ORIGIN)
        points = [found.points]
        for topic, ground in self._ground.items():
            echoes = to_world(ground, back)
            if topic in self.perceiver.taken:
                echoes = echoes[
                    mask.within(self.setup.robot.footprint, echoes, AT_OUTLINE)
                ]
            points.append(echoes)
        points += [to_world(ground, back) for ground in self._unknown.values()]
        return Obstacles.of(np.vstack(points), found.capsules).joined(tracked)

    def _place(self, seen: Sight | Tracks) -> Transform:
        """Return the transform of a sensor's frame; an unknown one is an error."""
        if seen.frame in self.sensors:
            return self.sensors[seen.frame]
        return self.frames.find(self.wiring.base_frame, seen.frame, seen.stamp)

    def _flat(self, topic: str, points: Array) -> Array:
        """Return points (n, 2) on the base, m; of a cloud those in the height band."""
        if topic in self.wiring.clouds:
            low, high = self.wiring.height_min_m, self.wiring.height_max_m
            points = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
        return np.ascontiguousarray(points[:, :2])

    def _is_own(self, topic: str, flat: Array, near: mask.Flags) -> mask.Flags:
        """Return which points (n, 2) are the robot itself; ``near``: candidates."""
        if len(self._boxes):
            return mask.in_boxes(self._boxes, flat)
        own = near.copy()
        own[near] = self._own[topic].hold(flat[near])
        return own

    def _tracked(self, seen: Tracks, then: Pose) -> Obstacles:
        """Return tracked discs in the odometry frame; ``then``: pose of the robot."""
        discs, velocities = seen.discs, seen.velocities
        if seen.frame != self.wiring.odom_frame:
            place, lift = self._place(seen), np.zeros((len(discs), 1))
            centres = place.apply(np.hstack([discs[:, :2], lift]))[:, :2]
            velocities = (np.hstack([velocities, lift]) @ place.rotation.T)[:, :2]
            centres = to_world(centres, then)
            velocities = to_world(velocities, (0.0, 0.0, then[2]))
            discs = np.column_stack([centres, discs[:, 2]])
        return Obstacles((), discs, velocities)
