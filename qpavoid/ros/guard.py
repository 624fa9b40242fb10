"""Guard of a base: messages in, a safe twist per control step out, without ROS."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.inputs import WAITING, Fault, Freshness, InputWatch, Latch
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.footprint import Footprint, offset_outline
from qpavoid.model.given import NO_POINTS
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.trail import Trail, placed, relative
from qpavoid.model.transform import Transform
from qpavoid.ros.frames import Frames
from qpavoid.ros.mask import (
    RECORDED,
    SPACING,
    Flags,
    OwnPlaces,
    border,
    hidden,
    in_boxes,
    unknown_sectors,
    within,
)
from qpavoid.ros.messages import (
    Fan,
    Sight,
    Tracks,
    read_cloud,
    read_odometry,
    read_scan,
    read_tracks,
    read_twist,
    seconds,
)
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

NO_ODOMETRY = "no topic of odometry: all that scans and clouds show counts as at rest"


class GuardSetup(NamedTuple):
    """Settings that can change at run time; ``dt`` is the control step."""

    robot: Robot
    settings: AvoidanceSettings
    freshness: Freshness
    perception: NodePerception = NodePerception()


class Wiring(NamedTuple):
    """Topics and sensor frames of the node; an empty topic is not used.

    Attributes:
        scans: Topics of ``LaserScan``.
        clouds: Topics of ``PointCloud2``.
        odometry: Of ``Odometry``; without it the last twist counts as driven, and all
            echoes as at rest.
        tracks: Of tracked discs, see :mod:`qpavoid.ros.messages`.
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

    scans: tuple[str, ...] = ("scan",)
    clouds: tuple[str, ...] = ()
    odometry: str = "odom"
    tracks: str = ""
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
                ``last_beam_stamps`` or ``empty_is_free`` is not among them.
        """
        named = [*self.scans, *self.clouds, self.odometry, self.tracks]
        named = [name for name in named if name]
        want(len({*named}) == len(named), f"a topic is repeated in {named}")
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
    def sensors(self) -> dict[str, Transform]:
        """Transforms of the sensors' frames to the base.

        Raises:
            InvalidInputError: Not six numbers per frame, or angles not in rad.
        """
        poses, many = self.frame_poses, len(self.frames)
        want(len(poses) == 6 * many, f"frame_poses needs {6 * many} numbers")
        of = Transform.of_angles
        return {k: of(poses[6 * i : 6 * i + 6]) for i, k in enumerate(self.frames)}


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
    """Filter between a command and a base, with monitored inputs.

    While an input has a :class:`Fault`, and until the :class:`Latch` opens, the robot
    stops clear of the last known static obstacles. Obstacles are moved to the time of
    the step by the robot's own motion. An old command is replaced by standing still,
    which is no fault.

    Attributes:
        driven: (v, ω) given last.
        sensors: Transforms of the sensors' frames, by the wiring.
        frames: All other frames, by tf.
        perceiver: Map and tracks of scans and clouds.
        errors: Last error by topic.
    """

    def __init__(self, setup: GuardSetup, wiring: Wiring) -> None:
        self.wiring, self.sensors, self.trail = wiring, wiring.sensors, Trail()
        self.errors: dict[str, str] = {}
        self.frames = Frames(self.errors, self.sensors)
        self.driven, self._desired = STANDSTILL, STANDSTILL
        self._boxes = wiring.boxes
        self._own = {name: OwnPlaces() for name in (*wiring.scans, *wiring.clouds)}
        self._drove, self._filled = False, np.zeros(2, dtype=np.bool_)
        self._unknown, self._notes = dict[str, Array](), dict[str, str]()
        self._unread: dict[str, tuple[Any, float]] = {}
        self._jumped, self._is_posed = dict[str, Fault](), False
        self._stamps, self._ground = dict[str, float](), dict[str, Array]()
        self._tracks: Tracks | None = None
        self._readers: dict[str, Callable[[Any], Sight | Tracks]] = {
            **dict.fromkeys(wiring.scans, read_scan),
            **dict.fromkeys(wiring.clouds, read_cloud),
            wiring.tracks: read_tracks,
        }
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
        fresh, dt = setup.freshness, setup.settings.dt
        held = dt * (1.0 + setup.settings.actuation.jitter)
        named = {self.wiring.odometry: fresh.odometry, self.wiring.tracks: fresh.discs}
        oldest = [named.get(name, fresh.points) for name in self.watches]
        known = min(oldest) > held
        want(known, f"freshness needs ages above the {held:g} s of a step")
        for watch, age in zip(self.watches.values(), oldest, strict=True):
            watch.oldest, watch.future = age - held, fresh.future
        before, outline = self.perceiver, setup.robot.footprint.edges
        same = np.array_equal(before.robot.footprint.edges, outline)
        if not same or before.settings != setup.perception:
            self.perceiver = Perceiver(setup.robot, setup.perception)
        self.setup = setup
        self._command.oldest, self._command.future = fresh.command, fresh.future
        self.latch.steps = fresh.good_steps(dt)
        self.safety = SafetyFilter(setup.robot, setup.settings)
        self.safety.reset(*self.driven)

    def see(self, topic: str, message: Any, now: float, steady: float) -> Fault | None:
        """Register a message of any input but the command; return its fault, or None.

        Sensor messages are decoded in the next step: of several, only the newest.
        """
        try:
            stamp = seconds(message.header.stamp)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault = self.watches[topic].receive(stamp, now, steady)
        if fault is not None:
            return fault
        if topic != self.wiring.odometry:
            self._unread[topic] = message, now
            return None
        try:
            pose, twist = read_odometry(message)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault = self._jump(stamp, pose)
        return self._moved(stamp, pose, twist) or fault

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
        self.trail = Trail()
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
            stamp = now if header is None else seconds(header.stamp)
            desired = read_twist(message)
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
            age = max(ages, default=0.0)
            wanted = step.desired
            decision = self.safety.filter(*wanted, obstacles, age=age, driven=driven)
        except InvalidInputError as error:
            self.errors["filter"], faults = str(error), {"filter": Fault.INVALID}
            self.latch.step(faults)
            return step._replace(faults=faults, notes=self._told(faults))
        v, omega = decision.v, decision.omega
        return step._replace(v=v, omega=omega, decision=decision, obstacles=obstacles)

    def brake(self, why: str) -> GuardStep:
        """Return a step that brakes, for any inputs; the latch closes."""
        faults = {"step": Fault.INVALID}
        self.errors["step"], _ = why, self.latch.step(faults)
        ages = dict.fromkeys(self.watches, math.inf)
        nothing = GuardStep(*STANDSTILL, STANDSTILL, None, faults, ages, NO_OBSTACLES)
        return self._braked(nothing, None)

    def stop(self) -> None:
        """Set the robot to standing still; the latch closes."""
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
        known = [k for k, x in faults.items() if x in TELL and k in self.errors]
        return self._notes | {k: self.errors[k] for k in known}

    def _read(self, topic: str, message: Any, now: float) -> None:
        """Decode a message; a blind or invalid one is a fault of its topic."""
        try:
            seen = self._readers[topic](message)
            if isinstance(seen, Tracks):
                if seen.frame != self.wiring.odom_frame:
                    self._place(seen)
                self._tracks = seen
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
        near = within(outline, flat, self.wiring.mask_m)
        inside, own = within(outline, flat, 0.0), self._is_own(topic, flat, near)
        if fan is not None:
            valid -= float((own | inside).sum()) / max(len(fan.unknown), 1)
        if seen.empty and topic in self.wiring.empty_is_free:
            valid = 1.0
        blind = seen.stuck or valid < self.setup.freshness.valid
        if not (blind or self._drove) and self._own[topic].messages < RECORDED:
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
            self._judge(topic, Fault.BLIND, f"{valid:.0%} valid")
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

    def _mark(self, topic: str, seen: Sight, fan: Fan, place: Transform) -> None:
        """Bound the unknown sectors of a scan by static points on the ground.

        Points seen there last, and the border of the stopping distance. Each is removed
        when its bearing is known again, or the robot has left it.
        """
        least = math.radians(self.wiring.blind_sector_deg)
        beams = unknown_sectors(fan, place, self._boxes, least)
        before = self._unknown.pop(topic, NO_POINTS)
        if not beams.any():
            return
        before = np.vstack([before, self._ground.get(topic, NO_POINTS)])
        robot, pose = self.setup.robot, self.trail.at(seen.stamp)
        known, away = to_world(before, relative(pose, ORIGIN)), self._away
        kept = np.hypot(*known.T) < robot.footprint.circumradius + away + AROUND
        kept &= hidden(known, fan, beams, place)
        parts = (offset_outline(x, away, CORNER_POINTS) for x in robot.footprint.parts)
        added = border(fan, beams, place, Footprint.union([*parts]))
        bound = to_world(np.vstack([known[kept], added]), pose)
        first = np.unique(np.floor(bound / SPACING), axis=0, return_index=True)[1]
        self._unknown[topic] = bound[np.sort(first)]
        width = math.degrees(abs(fan.step) * beams.sum())
        bearing = math.degrees(math.atan2(*added[len(added) // 2, ::-1]))
        said = f"some {width:.0f} degrees are unknown, as at {round(bearing, -1):g}"
        self._note(topic, said)

    @property
    def _away(self) -> float:
        """Distance of the border from the outline, m: required, and to stop."""
        s, v = self.setup.settings, abs(self.driven[0])
        kept = s.radius.r_min() + s.margins.error
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
                echoes = echoes[within(self.setup.robot.footprint, echoes, AT_OUTLINE)]
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

    def _is_own(self, topic: str, flat: Array, near: Flags) -> Flags:
        """Return which points (n, 2) are the robot itself; ``near``: candidates."""
        if len(self._boxes):
            return in_boxes(self._boxes, flat)
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
