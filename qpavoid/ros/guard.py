"""What the node does, without ROS: messages in, at every step a twist out."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.freshness import Fault, Freshness, InputWatch, Latch
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.footprint import Footprint
from qpavoid.model.given import NO_CAPSULES, NO_POINTS
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.model.trail import Trail, relative
from qpavoid.model.transform import Transform
from qpavoid.ros.frames import Frames
from qpavoid.ros.messages import (
    Sight,
    Tracks,
    read_cloud,
    read_odometry,
    read_scan,
    read_tracks,
    read_twist,
    seconds,
)
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

STANDSTILL: Twist = (0.0, 0.0)

FASTER, JUMP, TURN = 1.5, 0.1, 0.2
"""Odometry may say so many times the limits of the robot, and m and rad more: bases
overshoot, wheels slip, stamps jitter. What is farther is no motion."""

UNREADABLE = ValueError, TypeError, AttributeError, OverflowError
"""What reading a message raises that is not what its topic says."""

WAITING = "Inputs are good again; the robot waits until they have been for a while."


class GuardSetup(NamedTuple):
    """What can be set while it runs; the settings' ``dt`` is the control step."""

    robot: Robot
    settings: AvoidanceSettings
    freshness: Freshness


class Wiring(NamedTuple):
    """What the node hears and where its sensors are; empty topics: there is none.

    Attributes:
        scans: Topics of ``LaserScan``.
        clouds: Topics of ``PointCloud2``.
        odometry: Of ``Odometry``; without it what was driven is what was given.
        tracks: Of tracked discs, see :mod:`qpavoid.ros.messages`.
        height_min_m: Points of clouds below this over the base's origin are floor.
        height_max_m: Those above pass over the robot.
        mask_m: Points in the footprint grown by this are the robot itself.
        base_frame: The middle of the axle, x ahead.
        odom_frame: Fixed to the ground.
        frames: Names of the sensors' frames.
        frame_poses: Of each x, y, z, roll, pitch, yaw on the base, one after the other.
    """

    scans: tuple[str, ...] = ("scan",)
    clouds: tuple[str, ...] = ()
    odometry: str = "odom"
    tracks: str = ""
    height_min_m: float = 0.05
    height_max_m: float = 2.0
    mask_m: float = 0.0
    base_frame: str = "base_link"
    odom_frame: str = "odom"
    frames: tuple[str, ...] = ()
    frame_poses: tuple[float, ...] = ()

    @property
    def topics(self) -> list[str]:
        """All that must be heard.

        Raises:
            InvalidInputError: Nothing sees obstacles, or one is named twice.
        """
        named = [*self.scans, *self.clouds, self.odometry, self.tracks]
        named = [name for name in named if name]
        want(len({*named}) == len(named), f"a topic is named twice in {named}")
        want(bool(self.scans or self.clouds), "name a topic in scans or in clouds")
        return named

    @property
    def sensors(self) -> dict[str, Transform]:
        """The frames of the sensors on the base.

        Raises:
            InvalidInputError: Not six numbers a frame.
        """
        poses, many = self.frame_poses, len(self.frames)
        want(len(poses) == 6 * many, f"frame_poses wants {6 * many} numbers")
        of = Transform.of_angles
        return {k: of(poses[6 * i : 6 * i + 6]) for i, k in enumerate(self.frames)}


class GuardStep(NamedTuple):
    """What became of a control step.

    Attributes:
        v: m/s, to be driven.
        omega: rad/s.
        desired: (v, ω) that was asked for.
        decision: Of the filter; None: it was not asked, the robot brakes.
        faults: By topic.
        ages: s, by topic; ``inf``: never seen.
        obstacles: That the filter was told, robot frame.
    """

    v: float
    omega: float
    desired: Twist
    decision: Decision | None
    faults: dict[str, Fault]
    ages: dict[str, float]
    obstacles: Obstacles

    @property
    def sentence(self) -> str:
        """What was done, and why."""
        if self.decision is not None:
            return self.decision.status.sentence
        told = (f"{name}: {why}. {why.sentence}" for name, why in self.faults.items())
        return " ".join(told) or WAITING


class Guard:
    """The filter between a command and a base, among inputs that may fail.

    It stops among what it saw last while an input has a :class:`Fault`, and until the
    :class:`Latch` opens. What is seen is brought on to the time of the step by the
    robot's own motion. A command that is too old is standing still, not a fault.

    Attributes:
        driven: (v, ω) given last.
        sensors: Where their frames are on the robot, by the wiring.
        frames: Where all others are, by tf.
        errors: What was wrong last, by topic.
    """

    def __init__(self, setup: GuardSetup, wiring: Wiring) -> None:
        self.wiring, self.sensors, self.trail = wiring, wiring.sensors, Trail()
        self.frames = Frames()
        self.driven, self._desired = STANDSTILL, STANDSTILL
        self.errors: dict[str, str] = {}
        self._unread: dict[str, Any] = {}
        self._jumped: dict[str, Fault] = {}
        self._seen: dict[str, Sight | Tracks] = {}
        self._readers: dict[str, Callable[[Any], Sight | Tracks]] = {
            **dict.fromkeys(wiring.scans, read_scan),
            **dict.fromkeys(wiring.clouds, read_cloud),
            wiring.tracks: read_tracks,
        }
        self.watches = {name: InputWatch(0.0, 0.0) for name in wiring.topics}
        self._command, self.latch = InputWatch(0.0, 0.0), Latch(math.inf)
        self.change(setup)

    def change(self, setup: GuardSetup) -> None:
        """Take other settings from the next step on.

        A twist is held for a step: what is too old at its end is so at its beginning.

        Raises:
            InvalidInputError: An age is not above that.
        """
        fresh, dt = setup.freshness, setup.settings.dt
        held = dt * (1.0 + setup.settings.actuation.jitter)
        named = {self.wiring.odometry: fresh.odometry, self.wiring.tracks: fresh.discs}
        oldest = [named.get(name, fresh.points) for name in self.watches]
        known = min(oldest) > held
        want(known, f"freshness wants ages above the {held:g} s of a step")
        for watch, age in zip(self.watches.values(), oldest, strict=True):
            watch.oldest, watch.future = age - held, fresh.future
        self.setup = setup
        self._command.oldest, self._command.future = fresh.command, fresh.future
        self.latch.steps = fresh.good_steps(dt)
        self.safety = SafetyFilter(setup.robot, setup.settings)
        self.safety.reset(*self.driven)

    def see(self, topic: str, message: Any, now: float, steady: float) -> Fault | None:
        """Take a message of any input but the command; return why it is refused.

        What is seen is read when a step wants it: of a flood, only the newest is.
        """
        try:
            stamp = seconds(message.header.stamp)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault = self.watches[topic].receive(stamp, now, steady)
        if fault is not None:
            return fault
        if topic != self.wiring.odometry:
            self._unread[topic] = message
            return None
        try:
            pose, twist = read_odometry(message)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault = self._jump(stamp, pose)
        self.trail.record(stamp, pose, twist)
        return fault

    def _jump(self, stamp: float, pose: Pose) -> Fault | None:
        """Note until the next step that odometry jumped; a new trail begins then.

        What was seen before counts as seen from where the robot is said to be now. What
        a tracker has placed in the frame that jumped waits for its next message.
        """
        limits, leg = self.setup.robot.limits, self.trail.leg(stamp, pose)
        speed = max(limits.v_max, -limits.v_min)
        turn_rate = max(limits.omega_max, -limits.omega_min)
        near = leg.length <= FASTER * speed * leg.time + JUMP
        along = leg.turn <= FASTER * turn_rate * leg.time + TURN
        if leg.time <= 0.0 or (near and along):
            return None
        self.trail = Trail()
        self._jumped[self.wiring.odometry] = Fault.JUMPED
        said = f"{leg.length:.3g} m, {leg.turn:.3g} rad in {leg.time:.3g} s"
        self.errors[self.wiring.odometry] = said
        if self.wiring.tracks:
            self.watches[self.wiring.tracks].judge(Fault.JUMPED)
        return Fault.JUMPED

    def command(self, message: Any, now: float, steady: float) -> None:
        """Take a desired twist; one that cannot be read is to stand still."""
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
        """Return what to drive from now on, for a control step.

        Args:
            now: Time of the stamps' clock, s.
            steady: Time of a clock that nobody sets, s.
            driven: What the robot drives at present, where that is not what was given.
        """
        for topic in tuple(self._unread):
            self._read(topic, self._unread.pop(topic))
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
        if self.latch.step(faults):
            step = self._filtered(step, now, driven)
        if step.decision is None:
            step = self._braked(step, self._known(now, faults))
        self.driven = step.v, step.omega
        if not self.wiring.odometry:
            self.trail.record(now, self.trail.at(now), self.driven)
        return step

    def _filtered(self, step: GuardStep, now: float, driven: Twist | None) -> GuardStep:
        """Ask the filter; what it cannot be told is a fault."""
        try:
            obstacles = self._obstacles(now)
            age = max((step.ages[topic] for topic in self._seen), default=0.0)
            wanted = step.desired
            decision = self.safety.filter(*wanted, obstacles, age=age, driven=driven)
        except InvalidInputError as error:
            self.errors["filter"], faults = str(error), {"filter": Fault.INVALID}
            self.latch.step(faults)
            return step._replace(faults=faults)
        v, omega = decision.v, decision.omega
        return step._replace(v=v, omega=omega, decision=decision, obstacles=obstacles)

    def brake(self, why: str) -> GuardStep:
        """Return a step that brakes, whatever else is known; the latch closes."""
        faults = {"step": Fault.INVALID}
        self.errors["step"], _ = why, self.latch.step(faults)
        ages = dict.fromkeys(self.watches, math.inf)
        nothing = GuardStep(*STANDSTILL, STANDSTILL, None, faults, ages, NO_OBSTACLES)
        return self._braked(nothing, None)

    def stop(self) -> None:
        """Count as standing from now on; the latch closes."""
        self.driven, self.latch = STANDSTILL, Latch(self.latch.steps)
        self.safety.reset()

    def _known(self, now: float, faults: Mapping[str, Fault]) -> Obstacles | None:
        """Return all that was seen last, where it is known where the robot is."""
        if not self._seen or self.wiring.odometry in faults:
            return None
        try:
            return self._obstacles(now)
        except InvalidInputError:
            return None

    def _braked(self, step: GuardStep, seen: Obstacles | None) -> GuardStep:
        """Stop among what stood when it was seen last; else brake along the arc."""
        if seen is None:
            self.safety.reset(*self.driven)
        v, omega, *_ = self.safety.brake(step.sentence, self.driven, seen)
        self.driven = v, omega
        return step._replace(v=v, omega=omega)

    def _read(self, topic: str, message: Any) -> None:
        """Read a message; if it is blind or invalid, its topic has a fault."""
        try:
            seen = self._readers[topic](message)
            if isinstance(seen, Sight) or seen.frame != self.wiring.odom_frame:
                self._place(seen)
        except UNREADABLE as error:
            self._judge(topic, Fault.INVALID, error)
            return
        self._seen[topic] = seen
        if isinstance(seen, Sight):
            # Beams that end on the robot itself see nothing of what is around it.
            valid, beams = seen.valid, len(seen.points)
            if seen.each > 0.0:
                valid -= seen.each * (beams - len(self._on_base(seen, False)))
            if seen.stuck or valid < self.setup.freshness.valid:
                self._judge(topic, Fault.BLIND, f"{valid:.0%} valid")

    def _judge(self, topic: str, fault: Fault, why: object) -> Fault:
        self.errors[topic] = str(why)
        return self.watches[topic].judge(fault)

    def _obstacles(self, now: float) -> Obstacles:
        """Return all that is seen, as the robot sees it where it is now."""
        here, points, capsules = self.trail.at(now), [NO_POINTS], NO_CAPSULES
        for topic, seen in self._seen.items():
            then = self.trail.at(seen.stamp)
            if isinstance(seen, Sight):
                flat = self._on_base(seen, topic in self.wiring.clouds)
                points.append(to_world(flat, relative(here, then)))
            elif len(seen.discs):
                capsules = self._tracked(seen, then).seen_from(here).capsules
        return Obstacles.of(np.vstack(points), capsules)

    def _place(self, seen: Sight | Tracks) -> Transform:
        """Return where its frame was on the robot; an unknown one is an error."""
        if seen.frame in self.sensors:
            return self.sensors[seen.frame]
        return self.frames.find(self.wiring.base_frame, seen.frame, seen.stamp)

    def _on_base(self, seen: Sight, banded: bool) -> Array:
        """Return points (n, 2) on the base, m, in the height band; not the robot."""
        points = self._place(seen).apply(seen.points)
        if banded:
            height, low, high = (
                points[:, 2],
                self.wiring.height_min_m,
                self.wiring.height_max_m,
            )
            points = points[(height >= low) & (height <= high)]
        flat = np.ascontiguousarray(points[:, :2])
        return flat[~within(self.setup.robot.footprint, flat, self.wiring.mask_m)]

    def _tracked(self, seen: Tracks, then: Pose) -> Obstacles:
        """Return tracked discs in the frame of odometry; of a robot at a pose then."""
        discs, velocities = seen.discs, seen.velocities
        if seen.frame != self.wiring.odom_frame:
            place, lift = self._place(seen), np.zeros((len(discs), 1))
            centres = place.apply(np.hstack([discs[:, :2], lift]))[:, :2]
            velocities = (np.hstack([velocities, lift]) @ place.rotation.T)[:, :2]
            centres = to_world(centres, then)
            velocities = to_world(velocities, (0.0, 0.0, then[2]))
            discs = np.column_stack([centres, discs[:, 2]])
        return Obstacles((), discs, velocities)


def within(footprint: Footprint, points: Array, margin: float) -> npt.NDArray[np.bool_]:
    """Return which points (N, 2), m, lie in a footprint, its edges moved out by m."""
    edges = footprint.edges
    out = ((points[:, None] - edges[:, :2]) * edges[:, 2:4]).sum(axis=2)
    return np.asarray((out <= margin).all(axis=1))
