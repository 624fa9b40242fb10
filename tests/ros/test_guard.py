"""The node's logic without ROS: what is seen, what fails, what is driven."""

import math

import numpy as np
import pytest
import ros_guards
from ros_guards import AT_ONCE, DT, setup

import ros_messages as ros
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.inputs import WAITING, Fault
from qpavoid.errors import InvalidInputError
from qpavoid.ros.messages import READERS, seconds

HALF = 0.445
"""Half the length of the MiR without its tip, m."""


def guarded(settings=AT_ONCE, **wiring):
    return ros_guards.guarded(settings, **({"odometry": ""} | wiring))


class World:
    """A clock, and what is heard at every step unless it fails."""

    def __init__(self, guard, distance=6.0, v=0.4, odom=False):
        self.guard, self.distance, self.v, self.now = guard, distance, v, 100.0
        self.odom = odom

    def step(self, scan=True, command=True, **changes):
        self.now += DT
        now = self.now, self.now
        if scan is True:
            scan = ros.wall(self.now, self.distance)
        if scan:
            self.guard.see("scan", scan, *now)
        if self.odom:
            self.guard.see("odom", ros.odometry(self.now, v=self.guard.driven[0]), *now)
        if command:
            self.guard.command(ros.twist(self.v), *now)
        return self.guard.step(*now, **changes)

    def steps(self, many, **how):
        return [self.step(**how) for _ in range(many)]


def test_it_waits_until_all_has_been_good_for_a_while():
    world = World(guarded({"freshness.good_s": 0.25}))
    first = world.step(scan=False)
    assert first.faults == {"scan": Fault.NEVER} and first.decision is None
    assert first.sentence == "scan: never seen. Nothing has been received yet."
    steps = world.steps(6)
    assert [step.v for step in steps] == [0.0] * 4 + [0.4] * 2
    assert steps[0].sentence == WAITING
    assert steps[-1].decision.status is Status.TRACKING


def test_no_data_is_not_no_obstacles():
    """0.2 s are the limit at the end of a step, 0.15 s at its beginning."""
    world = World(guarded({"freshness.good_s": 0.5}))
    world.steps(12)
    assert [step.v for step in world.steps(5, scan=False)] == [0.4] * 3 + [0.0] * 2
    last = world.step(scan=False)
    assert last.faults == {"scan": Fault.STALE} and last.ages["scan"] > 0.2
    again = world.steps(12)
    assert [step.v for step in again] == [0.0] * 9 + [0.4] * 3


@pytest.mark.parametrize("x", [0.4, None, "fast", [], math.nan, 1e400])
def test_a_command_that_is_old_or_invalid_is_to_stand_still(x):
    """0.5 s count; one that cannot be read stops the robot at once."""
    world = World(guarded())
    assert world.steps(3)[-1].v == 0.4
    world.guard.command(ros.twist(x), world.now + 1e-3, world.now + 1e-3)
    late = world.steps(12, command=False)
    assert late[8].v == (0.4 if x == 0.4 else 0.0) and late[11].v == 0.0
    assert not late[11].faults and late[11].decision.status is Status.TRACKING
    assert ("command" in world.guard.errors) == (x != 0.4)


def test_a_parked_robot_steps_aside_without_any_command():
    guard = guarded(tracks="people")
    world = World(guard)
    least = 0.0
    for k in range(60):
        disc = (1.6 - 0.5 * DT * k, 0.0, 0.2, -0.5, 0.0)
        now = world.now + DT
        guard.see("people", ros.tracks(now, [disc], "base_link"), now, now)
        least = min(least, world.step(command=False).v)
    assert least < -0.2


COVERED = np.linspace(0.1, 0.12, 72)
"""Ranges of a lens with something on it: every beam ends on the robot itself."""


@pytest.mark.parametrize("driven", [(math.nan, 0.0), (0.0, math.inf)])
def test_what_is_driven_and_not_finite_is_a_fault(driven):
    world = World(guarded())
    assert world.steps(3)[-1].v == 0.4
    step = world.step(driven=driven)
    assert step.faults == {"driven": Fault.INVALID} and step.decision is None
    assert math.isfinite(step.v) and 0.0 <= step.v < 0.4
    assert world.step().v == pytest.approx(0.4)


def spoilt(part, name, value):
    """A scan with a field of the message, or of its header or stamp, replaced."""

    def made(time):
        scan = ros.wall(time, 6.0)
        owners = {"scan": scan, "header": scan.header, "stamp": scan.header.stamp}
        setattr(owners[part], name, value)
        return scan

    return made


@pytest.mark.parametrize(
    ("message", "fault", "said"),
    [
        (lambda t: ros.scan(t, [math.nan] * 72), Fault.BLIND, "0% valid"),
        (lambda t: ros.scan(t, [3.0] * 72), Fault.BLIND, "100% valid"),
        (lambda t: ros.scan(t, COVERED), Fault.BLIND, "0% valid"),
        (lambda t: ros.scan(t, [0.2] * 40 + [math.inf] * 32), Fault.BLIND, "44% valid"),
        (spoilt("scan", "header", None), Fault.INVALID, "'stamp'"),
        (spoilt("stamp", "sec", "now"), Fault.INVALID, "convert"),
        (spoilt("scan", "ranges", ["near"]), Fault.INVALID, "near"),
        (spoilt("scan", "range_min", []), Fault.INVALID, "list"),
        (lambda t: ros.scan(t, []), Fault.BLIND, "0% valid"),
        (lambda t: ros.wall(t, 3.0, frame="mast"), Fault.INVALID, "frame 'mast'"),
    ],
)
def test_what_is_blind_or_unreadable_brakes_at_once(message, fault, said):
    world = World(guarded())
    world.steps(3)
    now = world.now + DT
    step = world.step(scan=message(now))
    assert step.faults == {"scan": fault} and (step.v, step.omega) == (0.0, 0.0)
    assert said in world.guard.errors["scan"]
    assert world.step().v == 0.4


def test_of_a_flood_only_the_newest_is_read(monkeypatch):
    world, read = World(guarded()), []
    reader = READERS["scan"]
    monkeypatch.setitem(READERS, "scan", lambda m: read.append(m) or reader(m))
    for k in range(100):
        time = world.now + 4e-4 * k
        world.guard.see("scan", ros.wall(time, 6.0), time, time)
    world.step(scan=None)
    assert len(read) == 1 and seconds(read[0].header.stamp) == 100.0396


def test_what_was_seen_is_brought_on_by_the_robots_motion():
    """A scan of 0.1 s ago, from a robot that drove 1 m/s since: 0.1 m nearer."""
    guard = guarded(odometry="odom", settings={"freshness.odometry_s": 0.5})
    for k in range(5):
        at = 10.0 + 0.05 * k
        guard.see("odom", ros.odometry(at, (k * 0.05, 0.0, 0.0), v=1.0), at, at)
    guard.see("scan", ros.wall(10.1, 2.0, beams=73), 10.2, 10.2)
    for k in range(11):
        step = guard.step(10.2, 10.2 + 1e-6 * k)
    assert step.decision.clearance == pytest.approx(2.0 - 0.1 - HALF, abs=1e-3)


@pytest.mark.parametrize(
    ("pose", "jumps"),
    [((50.0, 0.0, 0.0), True), ((0.2, 0.0, 0.0), True), ((0.0, 0.0, 3.0), True),
     ((0.13, 0.0, 0.0), False), ((0.0, 0.05, -0.25), False)],
)  # fmt: skip
def test_odometry_that_jumps_brakes_and_moves_no_obstacle(pose, jumps):
    """At most 1.5 times 1 m/s and 1.5 rad/s for a step, and 0.1 m and 0.2 rad more."""
    world = World(guarded(odometry="odom", tracks="people"), odom=True, v=0.0)
    guard = world.guard

    def people():
        now = world.now + 1e-3
        guard.see("people", ros.tracks(now, [(4.0, 0.0, 0.3, 0.0, 0.0)]), now, now)

    for _ in range(3):
        people()
        before = world.step()
    assert before.decision is not None
    world.odom, at = False, world.now + 0.5 * DT
    fault = guard.see("odom", ros.odometry(at, pose), at, at)
    assert fault is (Fault.JUMPED if jumps else None)
    after = at + 1e-3  # one that goes on where the last ended hides nothing
    assert guard.see("odom", ros.odometry(after, pose), after, after) is None
    step = world.step()
    if not jumps:
        assert step.decision is not None
        return
    assert step.decision is None and step.faults == dict.fromkeys(
        ("odom", "people"), Fault.JUMPED
    )
    assert "rad in 0.0" in guard.errors["odom"]
    people()
    now = world.now + DT
    guard.see("odom", ros.odometry(now, pose), now, now)
    step = world.step(scan=False)
    assert step.decision is not None
    nearest = np.hypot(*step.obstacles.points.T).min()
    assert nearest == pytest.approx(
        np.hypot(*before.obstacles.points.T).min(), abs=0.01
    )


def test_without_odometry_it_is_what_was_given():
    guard = guarded({"freshness.good_s": 0.0, "freshness.points_s": 1.0})
    world = World(guard, distance=4.0, v=1.0)
    world.step()
    for k in range(1, 5):
        step = world.step(scan=None)
        assert step.decision.clearance == pytest.approx(4.0 - HALF - DT * k, abs=0.03)


MAST = {"frames": ("mast",), "frame_poses": (0.5, 0, 0, 0, 0, math.pi / 2)}


@pytest.mark.parametrize(
    ("frame", "disc", "seen", "velocity"),
    [("odom", (1.0, 4.0, 0.5, 0.0, -1.0), (3.0, 0.0, 0.5), (-1.0, 0.0)),
     ("mast", (2.0, 1.0, 0.5, 1.0, 0.0), (-0.5, 2.0, 0.5), (0.0, 1.0))],
)  # fmt: skip
def test_tracked_discs_of_odometry_and_of_a_turned_sensor(frame, disc, seen, velocity):
    guard, at = guarded(odometry="odom", tracks="people", **MAST), 10.0
    guard.see("odom", ros.odometry(at, (1.0, 1.0, math.pi / 2)), at, at)
    guard.see("people", ros.tracks(at, [disc], frame), at, at)
    guard.see("scan", ros.wall(at, 8.0), at, at)
    found = guard.step(at, at).obstacles
    np.testing.assert_allclose(found.discs, [seen], atol=1e-9)
    np.testing.assert_allclose(found.disc_velocities, [velocity], atol=1e-9)


def test_the_robot_itself_and_the_floor_are_no_obstacles():
    wiring = {"scans": (), "clouds": ("cloud",), "mask_m": 0.05}
    guard = guarded(**wiring)
    rows = [
        *((0.0, 0.0, 0.5), (HALF + 0.04, 0.0, 0.5)),  # the robot
        *((2.0, 0.0, 0.0), (2.0, 0.0, 2.5)),  # floor, and a lamp
        (HALF + 0.3, 0.0, 0.5),
    ]
    guard.see("cloud", ros.cloud(10.0, "xyz", rows), 10.0, 10.0)
    step = guard.step(10.0, 10.0)
    assert len(step.obstacles) == 1
    assert step.decision.clearance == pytest.approx(0.3, abs=1e-6)


def test_settings_change_between_two_steps():
    world = World(guarded(), v=0.5)
    assert world.steps(2)[-1].v == 0.5
    world.guard.change(setup(robot__v_max_mps=0.2, freshness__good_s=0.0))
    assert world.step().v == pytest.approx(0.2), "at once, and without a stop"
    with pytest.raises(InvalidInputError, match=r"ages above the 0\.05 s of a step"):
        world.guard.change(setup(freshness__points_s=0.04))
    assert world.step().v == pytest.approx(0.2)


def test_an_error_of_whatever_kind_brakes_and_closes_the_latch():
    world = World(guarded({"freshness.good_s": 0.2}))
    world.steps(6)
    step = world.guard.brake("out of memory")
    assert (step.v, step.omega) == (0.0, 0.0) and "step: invalid" in step.sentence
    assert world.guard.errors["step"] == "out of memory"
    assert [step.v for step in world.steps(5)] == [0.0] * 3 + [0.4] * 2


def test_what_is_driven_may_be_told():
    guard = guarded({"freshness.good_s": 0.0, "robot.acceleration_mps2": 1.0})
    world = World(guard, v=0.5)
    world.steps(20)
    assert world.step(driven=(0.1, 0.0)).v == pytest.approx(0.15)
