"""Roles and modes of the guard in closed loop: a world, a LiDAR, odometry, tf."""

import math

import numpy as np
import pytest
from ros_guards import BEAMS, DT, LASER, R_MIN, SMALL, Loop, setup

import ros_messages as ros
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.inputs import Fault
from qpavoid.ros.guard import Guard
from qpavoid.ros.parameters import Wiring
from ray_world import BOX, DOCK, ROOM, World


def goal(time, x, y, heading=0.0, frame="odom"):
    posed = ros.odometry(time, (x, y, heading)).pose.pose
    return ros.Fields(header=ros.header(time, frame), pose=posed)


def path(time, places, frame="odom"):
    poses = [goal(time, *place, frame=frame) for place in places]
    return ros.Fields(header=ros.header(time, frame), poses=poses)


def guarded(wiring=(), **changed):
    return Guard(setup(SMALL, **changed), Wiring(**LASER | dict(wiring)))


def guided(walls=ROOM, people=(), pose=(-3.0, 0.0, 0.0)):
    return Loop(guarded({"role": "guide"}), walls, people, pose)


def off(loop, x, y, heading=0.0):
    """Distance (m) and angle (rad) of the robot from a pose."""
    turn = (loop.world.pose[2] - heading + math.pi) % (2 * math.pi) - math.pi
    return math.dist(loop.world.pose[:2], (x, y)), abs(turn)


def test_a_goal_sent_again_every_second_is_reached_round_a_box():
    loop = guided([*ROOM, *BOX])
    loop.run(1.0)
    assert loop.world.pose[0] == -3.0, "without a task it stays"
    given = loop.guard.tasks.take
    loop.run(25.0, lambda k: k % 20 or given("goal_pose", goal(loop.now, 3.0, 0.0)))
    assert loop.guard.has_arrived and loop.least.min() > 0.07
    assert max(off(loop, 3.0, 0.0)) < 0.06
    assert max(abs(step.v) for step in loop.steps) <= 0.5 + 1e-9
    assert given("goal_pose", goal(loop.now, 3.0, 0.0, frame="moon")) != ""
    assert "unknown frame 'moon'" in loop.step().sentence
    loop.run(1.0)
    assert max(off(loop, 3.0, 0.0)) < 0.06, "a refused goal changes nothing"


def test_a_path_of_a_map_that_drifts_ends_with_its_heading():
    """The map moves 0.2 m to the left on the ground while the path is driven."""
    loop = guided()
    places = [(0.5 * k, 0.1 * k, 0.3) for k in range(10)]

    def tells(k):
        place = 3.0, 1.0 - 0.2 * min(k / 200, 1.0), 0.0
        said = ros.Fields(transforms=[ros.link("map", "odom", place, time=loop.now)])
        loop.guard.transforms(said, loop.now, loop.now)
        if k % 20 == 0 and k > 20:
            assert loop.guard.tasks.take("path", path(loop.now, places, "map")) == ""

    loop.run(22.0, tells)
    x, y, heading = places[-1]
    assert loop.guard.has_arrived
    assert max(off(loop, x - 3.0, y - 0.8, heading)) < 0.08
    assert min(step.v for step in loop.steps) > -0.05, "it never goes back"


def test_after_an_emergency_stop_it_starts_from_rest():
    loop = guided()
    loop.run(0.5)
    loop.guard.tasks.take("goal_pose", goal(loop.now, 3.0, 0.0))
    loop.run(4.0)
    assert loop.steps[-1].v > 0.4
    drive, loop.world.drive = loop.world.drive, lambda *_: drive(0.0, 0.0, DT)
    for _ in range(30):
        loop.guard.driven = (0.0, 0.0)
        loop.step()
    loop.world.drive = drive
    assert loop.step().v < 0.2


def test_a_goal_in_a_closed_room_is_blocked_and_said():
    loop = guided([*ROOM, (0, -5, 0, 5)])
    loop.run(0.5)
    loop.guard.tasks.take("goal_pose", goal(loop.now, 3.0, 0.0))
    steps = loop.run(35.0)
    assert Status.BLOCKED in [step.decision.status for step in steps]
    assert not loop.guard.has_arrived and loop.least.min() > 0.07


def test_among_people_who_give_way_it_does_not_retreat():
    """Somebody walks up to the robot at its station, and stops before it."""
    backs = []
    for yielding in (False, True):
        guard = guarded({"role": "guide"}, guide__yielding=yielding)
        loop = Loop(guard, ROOM, [(3.0, 0.0, 0.3, -0.8, 0.0)])
        loop.run(2.5)
        backs.append(-min(step.v for step in loop.steps))
    assert backs[0] > 0.3 and backs[1] < 0.01


def operated(walls=ROOM, people=(), pose=(-3.0, 0.0, 0.0), v=0.8, **wiring):
    mode = wiring.pop("mode", "teleop")
    loop = Loop(guarded(wiring, drive__mode=mode), walls, people, pose)
    loop.command = (v, 0.0)
    return loop


def test_an_operator_drives_along_a_wall_at_full_speed():
    """5 cm beyond the required distance."""
    wall = -0.2 - R_MIN - 0.05
    loop = operated([(-9.0, wall, 30.0, wall)], v=1.0)
    late = loop.run(8.0)[40:]
    assert min(step.v for step in late) > 0.99
    assert max(abs(step.omega) for step in late) < 0.05


@pytest.mark.parametrize("y", [0.0, 0.1, -0.1, 0.35])
def test_an_operator_is_steered_round_a_box_and_keeps_the_direction(y):
    loop = operated([*ROOM, *BOX], pose=(-3.0, y, 0.0), v=0.6)
    loop.run(9.0)
    assert loop.world.pose[0] > 0.8 and abs(loop.world.pose[2]) < 0.05
    assert loop.least.min() > 0.07


def test_an_operator_before_a_wall_is_not_turned_round():
    loop = operated([(1.0, -9.0, 1.0, 9.0)])
    loop.run(20.0, lambda k: max(0, abs(loop.world.pose[2]) - 1.6) and pytest.fail())
    assert abs(loop.steps[-1].v) < 0.01 and loop.least.min() > 0.07
    loop.command = (-0.3, 0.0)
    assert loop.run(2.0)[-1].v == pytest.approx(-0.3), "backwards he drives himself"


def test_an_operator_is_slowed_down_for_a_person_who_crosses():
    loop = operated(people=[(0.5, -2.5, 0.25, 0.0, 0.8)])
    steps = loop.run(6.0)
    assert min(step.v for step in steps[20:]) < 0.4 and loop.least.min() > 0.2
    assert steps[-1].v > 0.75 and abs(loop.world.pose[2]) < 0.05


def test_a_person_is_followed_at_a_distance():
    person = (-1.2, 0.0, 0.25, 0.5, 0.0)
    loop = operated(people=[person], mode="follow", v=0.0)
    loop.run(1.0)
    loop.command = (1.0, 0.0)
    assert "follow: a person" in loop.run(8.0)[-1].sentence
    assert loop.world.clearances()[-1] == pytest.approx(1.0, abs=0.1)
    assert loop.steps[-1].v == pytest.approx(0.5, abs=0.05)
    loop.world.people[0, 3] = -0.5
    loop.run(2.5)
    assert loop.least[-1] > 0.15, "who comes too near is an obstacle"


DOCKED = {
    "dock_frame": "dock",
    "dock_m": (-0.1, -0.35, 0.3, -0.35, 0.3, 0.35, -0.1, 0.35),
}


@pytest.mark.parametrize("known", [True, False])
def test_a_dock_is_approached_to_2_cm_and_nothing_else(known):
    """A box stands beside it; without its frame nothing is exempt."""
    loop = operated([*DOCK, *ROOM], pose=(2.5, 0.0, 0.0), mode="dock", **DOCKED)
    if known:
        moved = ros.Fields(transforms=[ros.link("odom", "dock", (4.0, 0.0, 0.0))])
        loop.guard.transforms(moved, 0.0, 0.0, fixed=True)

    def drives(k):
        loop.command = (0.8 * (4.0 - 0.25 - 0.02 - loop.world.pose[0]), 0.0)

    loop.run(20.0, drives)
    gap = loop.world.clearances()[0]
    assert loop.least[1:].min() > R_MIN - 0.02
    if known:
        assert gap == pytest.approx(0.02, abs=0.005)
    else:
        assert (
            gap > 0.07 and "nothing is exempt: unknown frame" in loop.steps[-1].sentence
        )


def grid(time, cells, frame="odom", size=0.05, origin=(0.0, 0.0)):
    info = ros.Fields(height=40, width=40, resolution=size)
    info.origin = goal(time, *origin).pose
    data = np.zeros((40, 40), dtype=np.int8)
    for row, column in cells:
        data[row, column] = 100
    data[0, 0] = 99
    return ros.Fields(header=ros.header(time, frame), info=info, data=data.ravel())


def test_a_costmap_is_an_obstacle_that_scans_do_not_see():
    cells = [(row, 20) for row in range(10, 30)]
    loop = operated(costmap="map", mode="command", v=0.6)

    def tells(k):
        seen = grid(loop.now, cells, origin=(-1.0, -1.0))
        return k % 10 or loop.guard.see("map", seen, loop.now, loop.now)

    steps = loop.run(5.0, tells)
    gaps = [step.decision.clearance for step in steps if step.decision]
    assert 0.09 < min(gaps) < 0.2 and loop.least.min() > 1.0
    x, y = loop.world.seen_at([(0.0, 0.25)])[0]
    places = np.hypot(*(loop.steps[-1].obstacles.points - (x, y)).T)
    assert places.min() < 0.05, "a corner of a cell's near side"
    assert len(loop.steps[-1].obstacles.points) > 30
    assert loop.run(1.5)[-1].faults == {"map": Fault.STALE}
    bad = grid(loop.now, cells)
    bad.info.width = 7
    loop.guard.see("map", bad, loop.now + 1e-3, loop.now + 1e-3)
    assert "do not fit its size" in loop.step().sentence


def test_a_footprint_that_is_published_counts_and_a_wrong_one_does_not():
    def polygon(rows, frame):
        points = [ros.Fields(x=x, y=y, z=0.0) for x, y in rows]
        shape = ros.Fields(points=points)
        return ros.Fields(header=ros.header(loop.now, frame), polygon=shape)

    loop = operated(pose=(-3.0, 1.0, 0.5), v=0.3, footprint="shape")
    loop.run(1.0)
    clockwise = np.array([(0.6, 0.3), (0.6, -0.3), (-0.4, -0.3), (-0.4, 0.3)])
    loop.guard.outline(polygon(clockwise, "base_link"))
    known = loop.guard.setup.robot.footprint.vertices
    np.testing.assert_allclose(known, clockwise[::-1])
    c, s = math.cos(0.5), math.sin(0.5)
    placed = clockwise @ [[c, s], [-s, c]] + loop.guard.odometry.at(loop.now)[:2]
    loop.guard.outline(polygon(placed, "odom"))
    assert loop.guard.setup.robot.footprint.vertices is known, "the same, in odom"
    loop.guard.change(setup(SMALL))
    assert loop.guard.setup.robot.footprint.vertices is known, "settings leave it"
    crossed = [(0.6, 0.3), (-0.4, -0.3), (0.6, -0.3), (-0.4, 0.4)]
    loop.guard.outline(polygon(crossed, "base_link"))
    assert "footprint: " in loop.step().sentence
    assert loop.guard.setup.robot.footprint.vertices is known


def test_a_driver_that_repeats_its_ranges_is_found_out():
    loop = operated(mode="command", v=0.5)
    loop.run(1.0)
    ranges = loop.world.ranges(BEAMS)
    loop.world.ranges = lambda *_, **__: ranges
    steps = loop.run(2.0)
    assert {"scan": Fault.BLIND} in [step.faults for step in steps]
    assert any("the ranges repeat while" in step.sentence for step in steps)
    assert loop.guard.inputs.faults["scan: blind"] > 3 and loop.world.pose[0] < -2.0


def test_equal_ranges_of_a_robot_at_rest_are_no_fault():
    """Seen before the first odometry, which is far from the origin."""
    loop = Loop(guarded(), ROOM, (), (50.0, 0.0, 0.0))
    ranges = World(ROOM).ranges(BEAMS)
    loop.guard.see("scan", ros.scan(loop.now, ranges, "laser"), loop.now, loop.now)
    loop.guard.step(loop.now, loop.now)
    loop.world.ranges = lambda *_, **__: ranges
    assert not any(step.faults for step in loop.run(1.0))


@pytest.mark.parametrize(("ahead", "said"), [(-8310659.0, "-8.311e+06"), (3.0, "+3")])
def test_a_topic_of_another_clock_is_named(ahead, said):
    loop = operated(mode="command")
    loop.run(1.0)
    for _ in range(20):
        loop.now += DT
        scan = ros.scan(loop.now + ahead, loop.world.ranges(BEAMS), "laser")
        loop.guard.see("scan", scan, loop.now, loop.now)
        loop.guard.see("odom", ros.odometry(loop.now), loop.now, loop.now)
        step = loop.guard.step(loop.now, loop.now)
    assert f"scan: its stamps are {said} s from this node's clock" in step.sentence


@pytest.mark.parametrize(
    ("spoil", "said"),
    [(lambda m: m.poses.clear(), "a path needs poses"),
     (lambda m: setattr(m, "poses", None), "not iterable"),
     (lambda m: setattr(m.poses[3].pose.position, "x", math.nan), "finite numbers"),
     (lambda m: setattr(m.poses[3].pose.orientation, "w", 0.5), "quaternion"),
     (lambda m: setattr(m.header, "frame_id", ""), "unknown frame ''"),
     (lambda m: [setattr(p.pose.position, "x", 1e300) for p in m.poses], "")],
)  # fmt: skip
def test_a_path_that_is_none_is_refused_and_the_last_one_kept(spoil, said):
    loop = guided()
    message = path(loop.now, [(0.0, 0.0, 0.0)])
    assert "no odometry yet" in loop.guard.tasks.take("path", message)
    loop.run(0.5)
    places = [(-3.0 + 0.2 * k, 0.0, 0.0) for k in range(10)]
    assert loop.guard.tasks.take("path", path(loop.now, places)) == ""
    message = path(loop.now, places)
    spoil(message)
    refused = loop.guard.tasks.take("path", message)
    assert refused and said in refused and "path: refused" in loop.step().sentence
    loop.run(6.0)
    assert max(off(loop, -1.2, 0.0)) < 0.08


def test_a_mover_of_old_data_is_avoided_earlier_than_one_of_fresh_data():
    """Tracks that come at 0.5 m/s, of a slow tracker; both ages are allowed."""

    def given(age, away):
        ages = {"freshness__points_s": 0.6, "freshness__discs_s": 0.6}
        loop = Loop(guarded({"role": "guide", "tracks": "people"}, **ages), ROOM)

        def tells(k):
            seen = ros.tracks(loop.now + DT - age, [(away, 0.0, 0.25, -0.5, 0.0)])
            assert loop.guard.see("people", seen, loop.now + DT, loop.now + DT) is None

        assert not loop.run(0.5, tells)[-1].faults
        return loop.steps[-1].v

    for away in (1.0, 1.2, 1.4):
        assert given(0.5, away) < given(0.2, away) - 0.01 < -0.2


@pytest.mark.parametrize("role", ["filter", "guide"])
def test_tracks_beyond_numbers_are_a_fault_of_their_topic(role):
    loop = Loop(guarded({"role": role, "tracks": "people"}), ROOM)
    near = (3.0, 0.0, 0.3, 0.0, 0.0)
    for k in range(30):
        now, disc = loop.now + DT, (1e300, 1e300, 0.3, 0.0, 0.0) if k == 20 else near
        loop.guard.see("people", ros.tracks(now, [disc], kind="f8"), now, now)
        step = loop.step()
        assert (step.decision is None) == (k == 20)
        if k == 20:
            assert step.faults == {"people": Fault.INVALID} and step.notes["people"]
