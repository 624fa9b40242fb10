"""Unseen space is not entered; points on the robot are no obstacles."""

import math

import numpy as np
import pytest
import ros_guards
import shapely
from ros_guards import BEAMS, DT, LASER, SMALL, Loop

import ros_messages as ros
from qpavoid.avoidance.inputs import Fault
from qpavoid.ros.frames import Transform
from qpavoid.ros.mask import RECORDED, beyond, border
from qpavoid.ros.messages import Fan
from shapes import footprints

ANGLES = -math.pi + 2.0 * math.pi / BEAMS * np.arange(BEAMS)


def guarded(changed=(), **wiring):
    return ros_guards.guarded(SMALL | dict(changed), **(LASER | wiring))


def about(middle, width):
    """Beams within half a width of a bearing, both in degrees."""
    return np.abs((np.degrees(ANGLES) - middle + 180.0) % 360.0 - 180.0) < width / 2


def among(guard, posts, seen=lambda ranges, k: ranges):
    """A loop among posts (n, 2), with a scanner that sees free space as ``inf``."""
    loop = Loop(guard, (), [(x, y, 0.05, 0.0, 0.0) for x, y in posts])
    loop.seen, loop.every, loop.noise = seen, 2, 0.0
    return loop


def blinded(beams, value=math.nan, start=0):
    return lambda ranges, k: np.where(beams & (k >= start), value, ranges)


@footprints
def test_a_border_is_where_beams_leave_all_parts(footprint):
    """By shapely: no beam meets the footprint beyond; one that misses it has none."""
    fan = Fan(ANGLES[0], ANGLES[1] - ANGLES[0], np.zeros(BEAMS))
    shape = shapely.union_all([shapely.Polygon(x) for x in footprint.outlines])
    for x, y in [footprint.parts[0].mean(axis=0), (0.103, 0.0517), (-1.5031, 0.4071)]:
        place = Transform(np.eye(3), np.array([x, y, 0.0]))
        found = border(fan, np.ones(BEAMS, dtype=bool), place, footprint)
        ends = np.column_stack([x + 9.0 * np.cos(ANGLES), y + 9.0 * np.sin(ANGLES)])
        beams = [shape.intersection(shapely.LineString([(x, y), e])) for e in ends]
        far = [shapely.hausdorff_distance(b, shapely.Point(x, y)) for b in beams if b]
        np.testing.assert_allclose(np.hypot(*(found - (x, y)).T), far, atol=1e-9)


@footprints
def test_points_within_a_footprint_are_those_of_shapely(footprint):
    points = np.random.default_rng(1).uniform(-1.3, 1.3, (500, 2))
    shape = shapely.union_all([shapely.Polygon(x) for x in footprint.outlines])
    held = beyond(footprint, points) <= 0.0
    assert (held == shapely.contains_xy(shape, *points.T)).all()


@pytest.mark.parametrize("value", [math.nan, 0.0, 0.04, -1.0])
@pytest.mark.parametrize("start", [0, 40])
def test_an_unknown_sector_ahead_is_not_driven_into(value, start):
    loop = among(guarded(), [(9.0, 0.0)], blinded(about(0, 40), value, start))
    steps = [loop.step(0.6) for _ in range(160)]
    assert abs(steps[-1].v) < 0.02 and "degrees are unknown" in steps[-1].sentence
    assert 0.0 <= loop.world.pose[0] < 0.25 + 0.6 * DT * start


@pytest.mark.parametrize(
    ("beams", "wiring"),
    [(about(180, 60), {}), (about(0, 8), {}),
     (about(0, 40), {"blind_sector_deg": 360.0}),
     (about(0, 40), {"mask_boxes_m": (0.1, -0.1, 0.2, 0.1)})],
)  # fmt: skip
def test_other_sectors_do_not_stop_it(beams, wiring):
    """One behind, a dropout; one that is allowed, one that a mast hides."""
    loop = among(guarded(**wiring), [(9.0, 3.0)], blinded(beams, 0.0))
    for _ in range(80):
        loop.step(0.5)
    assert loop.world.pose[0] == pytest.approx(0.5 * DT * 80, abs=0.1)


@pytest.mark.parametrize("seed", [8, 10, 15, 24, 29, 57])
def test_nothing_that_stands_is_touched_with_a_blind_sector(seed):
    """Regression: with the sector taken as free, each of these runs touches a post."""
    rng = np.random.default_rng(seed)
    posts = rng.uniform(-3.0, 3.0, (60, 2))
    posts = posts[np.hypot(*posts.T) > 0.9][:14]
    middle, width = rng.uniform(-180, 180), rng.uniform(30, 150)
    start = int(rng.uniform(0, 80))
    loop = among(guarded(), posts, blinded(about(middle, width), start=start))
    asked = rng.uniform([-0.5, -1.5], [1.0, 1.5], (20, 2))
    for k in range(300):
        loop.step(*asked[k // 15])
        assert loop.world.clearances().min() > 0.03


def rolled(time, span, at, turning=2.0):
    """A scan of a post 1.5 m off at 150 degrees over ground, by a robot that turns."""
    heading = turning * (at + span * np.arange(BEAMS) / (BEAMS - 1) - 100.0)
    off = (ANGLES + heading - math.radians(150) + math.pi) % (2 * math.pi) - math.pi
    made = ros.scan(time, np.where(np.abs(off) < 0.02, 1.5, np.inf), "laser")
    made.time_increment, made.scan_time = span / (BEAMS - 1), abs(span)
    return made


@pytest.mark.parametrize(
    ("stamp", "arrival", "wiring"),
    [(100.1, 100.28, {}), (100.28, 100.28, {}),
     (100.28, 100.3, {"last_beam_stamps": ("scan",)})],
)  # fmt: skip
def test_beams_are_placed_from_where_they_were_measured(stamp, arrival, wiring):
    """Stamped by the first; by the last, unsaid, which was before arrival; said."""
    guard = guarded({"freshness.points_s": 0.5, "freshness.odometry_s": 0.5}, **wiring)
    for time in np.arange(100.0, 100.29, 0.02).tolist():
        pose = (0.0, 0.0, 2.0 * (time - 100.0))
        guard.see("odom", ros.odometry(time, pose, 0.0, 2.0), time, time)
    guard.see("scan", rolled(stamp, 0.18, 100.1), arrival, arrival)
    x, y = guard.step(arrival, arrival).obstacles.points.mean(axis=0)
    bearing = math.degrees(math.atan2(y, x) + 2.0 * (arrival - 100.0))
    assert bearing == pytest.approx(150.0, abs=0.6)


def test_an_empty_cloud_is_blind_unless_it_is_said_to_be_free():
    for free, fault in (((), {"cloud": Fault.BLIND}), (("cloud",), {})):
        guard = guarded(odometry="", scans=(), clouds=("cloud",), empty_is_free=free)
        guard.see("cloud", ros.cloud(10.0, "xyz", [], "laser"), 10.0, 10.0)
        assert guard.step(10.0, 10.0).faults == fault


def test_what_was_always_in_the_outline_is_the_robot_and_what_enters_it_is_not():
    """A mast behind the scanner, of noisy ranges; a box 5 cm inside the front edge."""
    box = math.inf

    def seen(ranges, k):
        mast = 0.15 + 0.015 * np.sin(7.0 * np.arange(BEAMS) + k)
        ranges = np.where(about(180, 20), mast, ranges)
        return np.where(about(0, 60), np.minimum(ranges, box), ranges)

    loop = among(guarded(), [(9.0, 3.0)], seen)
    for _ in range(2 * RECORDED + 10):
        last = loop.step(0.3)
    assert last.v == pytest.approx(0.3) and "entered" not in last.sentence
    box = 0.2
    entered = [loop.step(0.3) for _ in range(20)][6:]
    assert max(step.v for step in entered) < 0.02
    assert "scan: a point has entered the outline" in entered[-1].sentence
    box = 0.0  # it covers the lens
    assert max(loop.step(0.3).v for _ in range(20)) < 0.02
    masked = guarded(mask_boxes_m=(-0.25, -0.2, 0.25, 0.2))
    assert among(masked, [(9.0, 3.0)], seen).step(0.3).v > 0.0


def test_a_cover_at_the_lens_is_no_obstacle_that_moves_along_and_hides_what_it_covers():
    """In front of the lens, 13 cm before the outline where 17 cm are to be kept."""
    wide = {"radius.r_min_slow_m": 0.17, "radius.r_min_fast_m": 0.17}
    guard = guarded(wide, frame_poses=(0.3, 0.0, 0.0, 0.0, 0.0, 0.0))
    loop = among(guard, [(9.0, 3.0)], blinded(about(0, 60), 0.08))
    assert [loop.step(0.0).v for _ in range(40)] == [0.0] * 40
    assert min(loop.step(0.3).v for _ in range(80)) > -0.02
    assert -0.01 < loop.world.pose[0] < 0.3


@pytest.mark.parametrize("near", [0.06, 0.09])
def test_a_blind_sensor_is_no_reason_to_back_up(near):
    """A lens that is covered during the drive: what it showed last counts."""
    loop = among(guarded(), [(9.0, 3.0)])
    for _ in range(40):
        loop.step(0.3)
    loop.seen = blinded(about(0, 360), near)
    x = loop.world.pose[0]
    steps = [loop.step(0.0) for _ in range(100)]
    assert steps[-1].faults == {"scan": Fault.BLIND}
    assert min(step.v for step in steps) >= 0.0 and loop.world.pose[0] < x + 0.2


@pytest.mark.parametrize("told", [20.0, -20.0, -0.5, 1.4, 0.0])
def test_a_twist_that_its_poses_do_not_show_is_a_fault(told):
    loop = among(guarded({"freshness.good_s": 0.5}), [(9.0, 3.0)])
    for _ in range(40):
        loop.step(0.5)
    assert loop.guard.driven[0] == pytest.approx(0.5)
    loop.told, x = (told, 0.0), loop.world.pose[0]
    steps = [loop.step(0.5) for _ in range(30)]
    assert {"odom": Fault.IMPLAUSIBLE} in [step.faults for step in steps]
    believed, way = loop.guard.odometry.twist[0], loop.world.pose[0] - x
    assert abs(believed) < 0.7 and way < 0.7
    assert "that of its poses" in loop.guard.errors["odom"]


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_twist_that_was_never_filled_in_is_that_of_the_poses(turn):
    loop = among(guarded(), [(9.0, 9.0)])
    loop.told, loop.by_odometry = (0.0, 0.0), True
    steps = [loop.step(0.5, turn) for _ in range(60)]
    assert (steps[-1].v, steps[-1].omega) == pytest.approx((0.5, turn), abs=0.01)
    assert not any(step.faults for step in steps)


def test_a_frame_that_is_not_known_is_named_with_those_that_are():
    guard = guarded()
    bad = ros.link("base_link", "mast", (0, 0, 0), (0, 0, 0, 0))
    guard.sensing.frames.add(ros.Fields(transforms=[bad]), fixed=True)
    assert "'mast' is left out" in guard.errors["tf"]
    guard.see("scan", ros.wall(10.0, 3.0, frame="mast"), 10.0, 10.0)
    said = guard.step(10.0, 10.0).sentence
    assert "frame 'mast'" in said and "known: laser" in said and "left out" in said
