"""Guard of a base: messages in, a safe twist per control step out, without ROS."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.decision import Decision, Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.inputs import (
    WAITING,
    Fault,
    FaultError,
    InputMonitor,
    Latch,
)
from qpavoid.errors import InvalidInputError
from qpavoid.guide.guide import Guide
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import relative, to_world
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot
from qpavoid.ros import messages, modes
from qpavoid.ros.messages import UNREADABLE
from qpavoid.ros.odometry import Odometry
from qpavoid.ros.parameters import TF, GuardSetup, Wiring
from qpavoid.ros.sensing import ORIGIN, Sensing
from qpavoid.settings import want
from qpavoid.types import Array, Pose, Twist

STANDSTILL: Twist = (0.0, 0.0)

COMMAND = "cmd_vel_in"
"""Name of the command among the inputs; an old one is no fault."""

AT_END, STANDING_TWIST, AT_REST = (0.05, 0.1), 0.01, 0.5
"""m and rad; m/s and rad/s; s: the robot has arrived if it has been within these
distances of the end and stood for that time: between two turns it stands, too."""

OUTLINE_MOVED = 0.005
"""m; motion of a corner that makes a new footprint."""

NO_STALL = 1e6
"""s; of a stall in teleoperation, which has no detours."""

NO_ODOMETRY = "no topic of odometry: all that scans and clouds show counts as at rest"


class GuardStep(NamedTuple):
    """Result of a control step.

    Attributes:
        v: m/s, to be driven.
        omega: rad/s.
        desired: Commanded (v, ω).
        decision: Of filter or guide; None: not called, the robot brakes.
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
        causes = [f"{name}: {why}. {why.sentence}" for name, why in self.faults.items()]
        return " ".join([*(causes or [WAITING]), *notes])


class Guard:
    """Filter, or guide, of a base with monitored inputs.

    While an input has a :class:`Fault`, and until the :class:`Latch` opens, the robot
    stops clear of the last known static obstacles. Obstacles are moved to the time of
    the step by the robot's own motion. An old command is replaced by standing still,
    which is no fault.

    Attributes:
        driven: (v, ω) given last.
        inputs: Monitor of all topics, and of the command.
        odometry: Pose history.
        sensing: Obstacles of all sensors.
        guide: Of the guide role, and of the mode ``teleop``.
        tasks: Task of the guide role.
        errors: Last error by topic.
    """

    def __init__(self, setup: GuardSetup, wiring: Wiring) -> None:
        self.wiring, self.driven, self._desired = wiring, STANDSTILL, STANDSTILL
        self._stood = 0.0
        self.errors, self._notes = dict[str, str](), dict[str, str]()
        names = (*wiring.topics, COMMAND)
        self.inputs = InputMonitor(dict.fromkeys(names, 0.0), 0.0, Latch(math.inf))
        self.inputs.awaited.discard(COMMAND)
        self._unread: dict[str, tuple[Any, float]] = {}
        self._jumps: dict[str, str] = {}
        self.odometry = Odometry(setup.robot.limits)
        self.sensing = Sensing(setup, wiring, self.odometry, self._note)
        frames = self.sensing.frames
        self.tasks = modes.Tasks(frames, self.odometry, wiring.odom_frame)
        self._outline: Footprint | None = None
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
        fresh, dt, wired = setup.freshness, setup.settings.dt, self.wiring
        held = dt * (1.0 + setup.settings.actuation.jitter)
        oldest = dict.fromkeys(self.inputs.awaited, fresh.points)
        oldest |= {wired.odometry: fresh.odometry, wired.tracks: fresh.discs}
        oldest |= {wired.costmap: wired.costmap_s, COMMAND: fresh.command + held}
        known = min(oldest[name] for name in self.inputs.watches) > held
        want(known, f"freshness needs ages above the {held:g} s of a step")
        for name, watch in self.inputs.watches.items():
            watch.oldest, watch.future = oldest[name] - held, fresh.future
        self.inputs.latch.steps = fresh.good_steps(dt)
        self.setup, self.guide = setup, None
        self.odometry.fit(setup.robot.limits)
        self.safety = SafetyFilter(setup.robot, setup.settings)
        leads = wired.role == "guide"
        if leads or setup.drive.mode == "teleop":
            patience = setup.guide
            if not leads:
                never = {"stall_time": NO_STALL, "blocked_time": 2.0 * NO_STALL}
                patience = replace(patience, **never, yielding=False)
            self.guide = Guide(setup.robot, setup.settings, patience)
            self.safety = self.guide.safety
            self._teleop = modes.Teleop(self.guide, setup.drive, setup.keep)
        last, self.safety.monitor = self.inputs.last, self.inputs
        self.safety.reset(*self.driven)
        self.inputs.last = last
        self.tasks.use(self.guide, setup.drive.speed)
        self._fit(setup.robot)

    def _fit(self, robot: Robot) -> None:
        """Use a footprint in sensing and following; filter and guide have it."""
        self.setup = setup = self.setup._replace(robot=robot)
        self.sensing.fit(setup)
        self._follow = modes.Follow(setup.drive, robot.footprint, setup.settings.dt)

    def see(self, topic: str, message: Any, now: float, steady: float) -> Fault | None:
        """Register a message of any input but the command; return its fault, or None.

        Sensor messages are decoded in the next step: of several, only the newest.
        """
        watch = self.inputs.watches[topic]
        try:
            stamp = messages.seconds(message.header.stamp)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        fault, ahead = watch.receive(stamp, now, steady), stamp - now
        if fault is None:
            self._notes.pop(topic, None)
        if ahead > watch.future or -ahead > watch.oldest:
            self._note(topic, f"its stamps are {ahead:+.4g} s from this node's clock")
        if fault is not None:
            return fault
        if topic == self.wiring.odometry:
            return self._posed(topic, message, stamp)
        self._unread[topic] = message, now
        return None

    def _posed(self, topic: str, message: Any, stamp: float) -> Fault | None:
        """Record a message of odometry.

        A jump is a fault until the next step, and starts a new pose history. Tracks are
        a fault until the next message.
        """
        try:
            if topic == TF:
                named = self.wiring.base_frame, self.wiring.odom_frame
                pose, twist = self.sensing.frames.pose_of(*named, stamp), STANDSTILL
            else:
                pose, twist = messages.read_odometry(message)
        except UNREADABLE as error:
            return self._judge(topic, Fault.INVALID, error)
        odometry, fault = self.odometry, None
        jump = odometry.jump(stamp, pose)
        if jump:
            self.sensing.rebase(odometry.at(stamp), pose)
            odometry.forget()
            fault = Fault.JUMPED
            self._jumps[topic] = self.errors[topic] = jump
            if self.wiring.tracks:
                self.inputs.watches[self.wiring.tracks].judge(fault)
        wrong = odometry.measure(stamp, pose, twist)
        return self._judge(topic, Fault.IMPLAUSIBLE, wrong) if wrong else fault

    def transforms(
        self, message: Any, now: float, steady: float, fixed: bool = False
    ) -> None:
        """Register a message of tf, which may be that of odometry."""
        frames = self.sensing.frames
        frames.add(message, fixed)
        mover = frames.mover(self.wiring.base_frame)
        for link in message.transforms:
            if self.wiring.odometry == TF and link.child_frame_id == mover:
                self.see(TF, link, now, steady)

    def outline(self, message: Any) -> None:
        """Take a footprint; on an error the known one is kept."""
        try:
            seen = messages.read_polygon(message)
            corners, known = seen.poses[:, :2], self.setup.robot.footprint.vertices
            off = np.inf if corners.shape != known.shape else corners - known
            if seen.frame != self.wiring.base_frame:  # its place is of another time
                if corners.shape == known.shape:
                    off = spans(corners) - spans(known)
                back = relative(self.odometry.at(seen.stamp), ORIGIN)
                rows = self.sensing.frames.poses_in(self.wiring.odom_frame, seen)
                corners = to_world(rows[:, :2], back)
            if np.abs(off).max() > OUTLINE_MOVED:
                self._outline = Footprint.polygon(corners)
                (self.guide or self.safety).footprint = self._outline
                self._fit(replace(self.setup.robot, footprint=self._outline))
            self._notes.pop("footprint", None)
        except UNREADABLE as error:
            self._note("footprint", str(error))

    @property
    def has_arrived(self) -> bool:
        """Whether the robot is at rest at the end of its task."""
        away, turn = self.tasks.left
        return away < AT_END[0] and turn < AT_END[1] and self._stood >= AT_REST

    def command(self, message: Any, now: float, steady: float) -> None:
        """Register a desired twist; an invalid one is standing still."""
        stamp, desired = now, STANDSTILL
        try:
            header = getattr(message, "header", None)
            stamp = now if header is None else messages.seconds(header.stamp)
            desired = messages.read_twist(message)
        except UNREADABLE as error:
            self.errors["command"] = str(error)
        if self.inputs.watches[COMMAND].receive(stamp, now, steady) is None:
            self._desired = desired

    def step(self, now: float, steady: float, driven: Twist | None = None) -> GuardStep:
        """Return the twist to drive from now on, for a control step.

        Args:
            now: Time of the stamps' clock, s.
            steady: Time of a monotonic clock, s.
            driven: Measured (v, ω), default the last one given.
        """
        self._read(now, steady)
        jumped = dict.fromkeys(self._jumps, Fault.JUMPED)
        faults = self.inputs.found(now, steady) | jumped
        notes = self._notes | self._jumps | self.tasks.refused
        self._jumps = {}
        if driven is not None and not np.isfinite(driven).all():
            notes["driven"], driven = f"{driven} driven", None
            faults["driven"] = Fault.INVALID
        self.driven = self.driven if driven is None else driven
        late = self.inputs.watches[COMMAND].fault(now, steady) is not None
        desired = STANDSTILL if late else self._desired
        ages = self.inputs.ages(now, steady)
        step = GuardStep(*STANDSTILL, desired, None, faults, ages, NO_OBSTACLES, notes)
        step = self._braked(step, now) if faults else self._driving(step, now, driven)
        self.driven = step.v, step.omega
        stands = max(map(abs, self.driven)) < STANDING_TWIST
        self._stood = self._stood + self.setup.settings.dt if stands else 0.0
        self.sensing.drives(*self.driven)
        if not self.wiring.odometry:
            self.odometry.record(now, self.odometry.at(now), self.driven)
        return step

    def _read(self, now: float, steady: float) -> None:
        """Decode the newest messages; an invalid or blind one is a fault."""
        watches = self.inputs.watches
        odometry = watches.get(self.wiring.odometry)
        posed = odometry is not None and odometry.fault(now, steady) is None
        for topic in sorted(self._unread, key=lambda name: watches[name].stamp):
            message, arrival = self._unread.pop(topic)
            try:
                blind = self.sensing.read(topic, message, arrival, posed)
            except UNREADABLE as error:
                self._judge(topic, Fault.INVALID, error)
            else:
                if blind:
                    self._judge(topic, Fault.BLIND, blind)

    def _driving(self, step: GuardStep, now: float, driven: Twist | None) -> GuardStep:
        """Call filter or guide, which brake until the latch opens, and on an error."""
        seen = NO_OBSTACLES
        try:
            seen, pose = self.sensing.obstacles(now), self.odometry.at(now)
            # A scan stamped by its last beam is older than its stamp.
            stamps = self.sensing.stamps.items()
            age = max((max(step.ages[k], now - x) for k, x in stamps), default=0.0)
            asked = self._asked(modes.Request(step.desired, seen), pose)
        except InvalidInputError as error:
            decision = self.safety.brake(error, driven)
        else:
            if asked is None:
                assert self.guide is not None
                decision = self.guide.step(pose, seen, age=age, driven=self.driven)
            else:
                wanted, seen, note = asked
                decision = self.safety.step(*wanted, seen, age=age, driven=driven)
                if note:
                    notes = {**step.notes, self.setup.drive.mode: note}
                    step = step._replace(notes=notes)
        step = step._replace(v=decision.v, omega=decision.omega)
        if decision.status is not Status.INVALID:
            return step._replace(decision=decision, obstacles=seen)
        if decision.problem == WAITING:
            return step
        self.errors["filter"] = decision.problem
        notes = {**step.notes, "filter": decision.problem}
        return step._replace(faults={"filter": Fault.INVALID}, notes=notes)

    def _asked(self, asked: modes.Request, pose: Pose) -> modes.Request | None:
        """Return the request as the mode changes it; None where the guide drives."""
        drive = self.setup.drive
        if self.wiring.role == "guide":
            self.tasks.send()
            return None
        if drive.mode == "teleop":
            return self._teleop.step(asked, pose)
        if drive.mode == "follow":
            person = self.sensing.perceiver.place_of(drive.person)
            return self._follow.step(asked, pose, person)
        if drive.mode != "dock":
            return asked
        try:
            named = self.wiring.dock_frame, self.wiring.odom_frame
            dock = relative(self.sensing.frames.pose_of(*named, modes.LATEST), pose)
        except InvalidInputError as error:
            return asked._replace(note=f"nothing is exempt: {error}")
        region = self.wiring.dock
        assert region is not None  # with its frame
        return modes.docking(asked, dock, region, drive.dock_speed)

    def brake(self, why: str) -> GuardStep:
        """Return a step that brakes, for any inputs; the latch closes."""
        ages, self.errors["step"] = dict.fromkeys(self.inputs.awaited, math.inf), why
        step = GuardStep(*STANDSTILL, STANDSTILL, None, {}, ages, NO_OBSTACLES)
        step = step._replace(faults={"step": Fault.INVALID}, notes={"step": why})
        return self._braked(step, math.nan)

    def stop(self) -> None:
        """Set the robot to standing still, without a task; the latch closes."""
        self.tasks.rest()
        self.driven, self.inputs.latch = STANDSTILL, Latch(self.inputs.latch.steps)
        self.safety.reset()

    def _braked(self, step: GuardStep, now: float) -> GuardStep:
        """Stop clear of all obstacles seen last; without a pose, of those before."""
        seen, posed = None, self.wiring.odometry not in step.faults
        if self.sensing.stamps and posed and math.isfinite(now):
            with suppress(InvalidInputError):
                seen = self.sensing.obstacles(now)
        v, omega, *_ = self.safety.brake(FaultError(step.faults), self.driven, seen)
        return step._replace(v=v, omega=omega)

    def _note(self, topic: str, finding: str) -> None:
        self._notes[topic] = self.errors[topic] = finding

    def _judge(self, topic: str, fault: Fault, why: object) -> Fault:
        self._note(topic, str(why))
        return self.inputs.watches[topic].judge(fault)


def spans(corners: Array) -> Array:
    """Return the distances (n, n) between all corners (n, 2), m."""
    return np.asarray(np.hypot(*(corners[:, None] - corners).transpose(2, 0, 1)))
