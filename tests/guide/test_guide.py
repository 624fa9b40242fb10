"""A guide in a loop of its own gets there, and says so if not."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely.affinity

import qpavoid as qp
from guided import HOME, loop
from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import arc
from qpavoid.tracking.path import CubicPath

ROBOT = qp.Robot.mir100()
SETTINGS = qp.AvoidanceSettings()
DT = SETTINGS.dt
FRONT = ROBOT.footprint.vertices[:, 0].max()


def drive(guide, world, seconds, pose=HOME):
    """Poses, decisions and the time at which the goal was reached."""

    def is_there(pose):
        away, turn = guide.left(pose)
        return away < 0.01 and turn < 0.02

    rows = loop(guide, seconds, world, start=pose, until=is_there)
    poses = np.array([pose, *(row.pose for row in rows)])
    return poses, [row.step for row in rows], DT * len(rows)


def crossing(time):
    return qp.Obstacles(
        discs=[(3.0, 0.0, 0.3), (5.0, 3.0 - 0.4 * time, 0.25)],
        disc_velocities=[(0.0, 0.0), (0.0, -0.4)],
    )


TRAP = [(4.5, -1.0, 4.5, 1.0), (2.5, 1.0, 4.5, 1.0), (2.5, -1.0, 4.5, -1.0)]


@pytest.mark.parametrize(
    ("world", "most"),
    [
        (qp.Obstacles(), 22.0),
        (qp.Obstacles(discs=[(4.0, 0.0, 0.4)]), 25.0),
        (crossing, 25.0),
        (qp.Obstacles(walls=TRAP), 60.0),
        (qp.Obstacles(points=[(4.0, 0.1 * k) for k in range(-10, 11)]), 40.0),
        (qp.Obstacles(discs=[(4.0, 0.7, 0.4), (4.0, -0.7, 0.4)]), 40.0),
        (qp.Obstacles(walls=[(4.0, -4.0, 4.0, 0.8), (4.0, 2.0, 4.0, 6.0)]), 40.0),
        (qp.Obstacles(walls=[(2.5, -3.0, 2.5, 0.6), (5.2, -0.6, 5.2, 3.0)]), 40.0),
    ],
    ids=["nothing", "a disc", "one stands, one crosses", "a trap", "a wall of points"]
    + ["two discs, too close", "a wall with a gap", "a slalom"],
)
def test_it_gets_there(world, most):
    guide = qp.Guide(ROBOT)
    guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0, 1.0))
    _, decisions, time = drive(guide, world, most)
    assert guide.left((8.0, 0.0, 1.0)) == (0.0, 0.0)
    assert time < most
    assert min(d.clearance for d in decisions) > SETTINGS.radius.r_min_slow - 1e-3


def test_a_reference_that_begins_at_rest_is_not_at_its_goal():
    """The robot parked where the reference was to be 6 s later."""
    path = CubicPath((0.0, 0.0, 0.0), (0.0, 1.2, math.pi), 3.0, 5.0)
    guide = qp.Guide(ROBOT)
    guide.follow(path)
    poses, _, time = drive(guide, qp.Obstacles(), 12.0)
    way = shapely.LineString(path.sample(np.arange(0.0, 5.0, DT))[:, :2])
    assert abs(poses[: round(0.5 / DT), 2]).max() < 0.1
    assert max(way.distance(shapely.Point(p)) for p in poses[:, :2]) < 0.1
    assert time < 7.0


class Flat:
    """A path without speeds."""

    duration = 1.0

    def sample(self, times):
        return np.zeros((len(times), 3))


def test_too_near_to_turn_beside_what_stands_it_drives_off_and_comes_back():
    guide = qp.Guide(ROBOT)
    guide.stay((0.0, 0.1, 0.0))
    world = qp.Obstacles(points=[(0.1, -0.56), (-0.3, -0.56)])
    poses, _, reached = drive(guide, world, 15.0)
    assert reached < 14.0 and np.abs(poses[:, 0]).max() > 0.1


ROOM = [(2, -3, 2, 3), (-2, -3, 2, -3), (-2, 3, 2, 3), (-2, -3, -2, 3)]


@pytest.mark.parametrize("reverse", [True, False])
@pytest.mark.parametrize("v_max", [0.2, 0.4, 0.8])
def test_in_a_sealed_room_a_robot_of_any_speed_stands_and_says_blocked(v_max, reverse):
    limits = qp.Limits(-v_max if reverse else 0.0, v_max, -1.0, 1.0)
    guide = qp.Guide(qp.Robot("slow", ROBOT.footprint, limits))
    guide.go_to((0.0, 0.0, 0.0), (6.0, 0.0, 0.0))
    _, decisions, _ = drive(guide, qp.Obstacles(walls=ROOM), 90.0)
    assert all(d.status is qp.Status.BLOCKED for d in decisions[-200:])
    assert all((d.v, d.omega) == (0.0, 0.0) for d in decisions[-200:])


@pytest.mark.parametrize(
    ("robot", "radius", "aside"),
    [(ROBOT, 0.9, 0.1), (qp.Robot.jackal(), 1.1, 0.0)],
    ids=["mir100", "jackal"],
)
def test_before_what_fills_its_way_it_stands_instead_of_turning(robot, radius, aside):
    """Regression: the robot turned left and right up to 127 times in 30 s."""
    guide = qp.Guide(robot)
    guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0, 0.0))
    half = radius + aside + 0.05
    walls = [(-3.0, y, 9.0, y) for y in (-half, half)]
    walls += [(x, -half, x, half) for x in (-3.0, 9.0)]
    world = qp.Obstacles(discs=[(4.0, aside, radius)], walls=walls)
    _, decisions, _ = drive(guide, world, 20.0)
    blocked = [d.status is qp.Status.BLOCKED for d in decisions]
    turning = [d.omega for d in decisions if abs(d.omega) > 0.05]
    assert any(blocked)
    assert np.count_nonzero(np.diff(np.sign(turning))) <= 15


def off_axis(world, robot=ROBOT, goal=7.0, seconds=30.0, speed=0.5):
    """First turn, m to either side at most, and whether it arrived."""
    guide = qp.Guide(robot)
    guide.go_to((0.0, 0.0, 0.0), (goal, 0.0, 0.0), speed)
    poses, decisions, time = drive(guide, world, seconds)
    first = next((d.omega for d in decisions if abs(d.omega) > 0.05), 0.0)
    return first, poses[:, 1].max(), -poses[:, 1].min(), time < seconds


@pytest.mark.parametrize("robot", [ROBOT, qp.Robot.jackal()], ids=["mir100", "jackal"])
@pytest.mark.parametrize(
    "world",
    [
        qp.Obstacles(discs=[(3.5, 0.0, 0.8)]),
        qp.Obstacles(discs=[(3.5, -0.55, 0.5), (3.5, 0.55, 0.5)]),
        qp.Obstacles(walls=[(3.5, -0.75, 3.5, 0.75)]),
        qp.Obstacles(walls=[(3.5, -1.2, 3.5, 1.2)]),
    ],
    ids=["a disc", "two discs", "a wall", "a wide wall"],
)
def test_a_symmetric_obstacle_is_passed_on_one_side(world, robot):
    _, left, right, arrived = off_axis(world, robot, speed=0.7)
    assert arrived
    assert min(left, right) < 0.25


@pytest.mark.parametrize("v_max", [0.05, 0.2])
@pytest.mark.parametrize("robot", [ROBOT, qp.Robot.jackal()], ids=["mir100", "jackal"])
def test_a_slow_robot_drives_through_a_door_that_lets_it(robot, v_max):
    """Being near cost it more than standing: it neither passed nor said blocked."""
    slow = replace(robot, limits=replace(robot.limits, v_min=-v_max, v_max=v_max))
    half = abs(robot.footprint.vertices[:, 1]).max() + SETTINGS.radius.r_min_slow + 0.03
    door = [(1.2, half, 1.2, 3.0), (1.2, -3.0, 1.2, -half), (-2.0, 3.0, 1.2, 3.0)]
    door += [(-2.0, -3.0, 1.2, -3.0), (-2.0, -3.0, -2.0, 3.0)]
    _, left, right, arrived = off_axis(
        qp.Obstacles(walls=door), slow, 2.5, 4.0 / v_max, v_max
    )
    assert arrived and max(left, right) < 0.1


def test_a_wall_head_on_is_passed_on_the_same_side_whatever_the_heading():
    """The costs of mirror images differ by rounding, and that by the heading."""
    sides = []
    for heading in np.linspace(-3.0, 3.0, 7):
        c, s = math.cos(heading), math.sin(heading)
        turned = lambda x, y, c=c, s=s: (c * x - s * y, s * x + c * y)  # noqa: E731
        wall = qp.Obstacles(walls=[(*turned(3.0, -1.0), *turned(3.0, 1.0))])
        guide, begin = qp.Guide(ROBOT), (0.0, 0.0, heading)
        guide.go_to(begin, (*turned(6.0, 0.0), heading), 0.9)
        poses, _, time = drive(guide, wall, 25.0, begin)
        across = -s * poses[:, 0] + c * poses[:, 1]
        assert time < 20.0
        assert min(across.max(), -across.min()) < 0.3
        sides.append(np.sign(across[abs(across).argmax()]))
    assert len(set(sides)) == 1


class Sampled:
    """A path that samples what it is told."""

    def __init__(self, rows, duration=1.0):
        self.rows, self.duration = rows, duration

    def sample(self, times):
        return self.rows(len(times))


AT, SPEEDS = (0.0, 0.0, 0.0), (0.0, -1.0, math.nan, math.inf, None, "a", 1j, [1.0])
WRONG = [
    (Sampled(lambda n: None), "what a path samples must be numbers"),
    (Sampled(lambda n: "rows"), "what a path samples must be numbers"),
    (Sampled(lambda n: np.zeros((n, 5), complex)), "what a path samples must be"),
    (Sampled(lambda n: np.zeros((0, 5))), "a path must sample"),
    (Sampled(lambda n: np.full((n, 5), math.nan)), "a path must sample"),
    (Sampled(lambda n: np.zeros((n, 5)), -1.0), "a path must last"),
    (Sampled(lambda n: np.zeros((n, 5)), 1e9), "a path must last"),
    (Sampled(lambda n: np.zeros((n, 5)), math.inf), "duration must be"),
    (Sampled(lambda n: np.zeros((n, 5)), "long"), "duration must be"),
]


def test_before_somebody_who_gives_way_a_yielding_guide_does_not_retreat():
    """A person who walks up to the robot, follows it, and stops 0.25 m before it."""
    backs = []
    for yielding in (False, True):
        guide, pose, person, least = qp.Guide(ROBOT, yielding=yielding), HOME, 3.0, 0.0
        guide.go_to(pose, (6.0, 0.0, 0.0))
        for _ in range(round(6.0 / DT)):
            nearest = pose[0] + FRONT + 0.25 + 0.3
            speed = min(0.8, max(0.0, (person - nearest) / DT))
            disc, moving = [(person, pose[1], 0.3)], [(-speed, 0.0)]
            seen = qp.Obstacles(discs=disc, disc_velocities=moving).seen_from(pose)
            decision = guide.step(pose, seen)
            pose = arc(*pose, decision.v, decision.omega, DT)
            person, least = person - DT * speed, min(least, pose[0])
        backs.append(-least)
    assert backs[0] > 0.5 and backs[1] < 0.01


@pytest.mark.parametrize("kind", ["disc", "polygon"])
def test_to_a_yielding_guide_everything_is_at_rest(kind):
    box = [(-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)]
    if kind == "disc":
        parts = {"discs": [(2.0, 0.6, 0.3)], "disc_velocities": [(-0.7, -0.2)]}
        parts["disc_sigmas"] = [0.1]
    else:
        parts = {"polygons": [np.add(box, (2.0, 0.6))]}
        parts["polygon_velocities"] = [(-0.7, -0.2, 0.5)]
    seen, short = qp.Obstacles(**parts), qp.GuideSettings(horizon=0.5)
    ahead = qp.AvoidanceSettings(ahead=qp.LookAhead(horizon=0.5, horizon_still=0.5))
    guides = qp.Guide(ROBOT, yielding=True), qp.Guide(ROBOT, ahead, short)
    for guide in guides:
        guide.go_to(HOME, (6.0, 0.0, 0.0))
    for _ in range(20):
        one, other = guides[0].step(HOME, seen), guides[1].step(HOME, seen.at_rest())
        assert one[:2] == other[:2]


def test_bad_input_is_named_and_nothing_is_lost():
    guide, other = qp.Guide(ROBOT), qp.Guide(ROBOT)
    for each in (guide, other):
        each.follow([(0.0, 0.0), (3.0, 0.0)])
    with pytest.raises(InvalidInputError, match="pose"):
        guide.step((math.nan, 0.0, 0.0), on_error="raise")
    with pytest.raises(InvalidInputError, match="points"):
        guide.step((0.0, 0.0, 0.0), [(math.inf, 1.0)], on_error="raise")
    with pytest.raises(InvalidInputError):
        guide.follow([(0.0, 0.0)])
    for call, said in (
        (lambda: guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0, math.nan)), "goal must be"),
        (lambda: guide.go_to((math.nan, 0.0, 0.0), (8.0, 0.0, 0.0)), "pose must be"),
        (lambda: guide.go_to((0.0, 0.0, 0.0), (8.0, 0.0)), "goal must be"),
        (lambda: guide.go_to((0.0, 0.0, 0.0), None), "goal must be"),
        (lambda: guide.stay((0.0, 0.0)), "pose must be"),
        (lambda: guide.follow("north"), "a path must be numbers"),
        (lambda: guide.follow(Flat()), "what a path samples must have shape"),
        *((lambda p=p: guide.follow(p), said) for p, said in WRONG),
        *(
            (lambda v=v: guide.follow([(0, 0), (1, 0)], v), "speed must")
            for v in SPEEDS
        ),
        *((lambda v=v: guide.go_to(AT, AT, v), "speed must") for v in SPEEDS),
        (lambda: guide.follow([(0.0, 0.0), (1e9, 0.0)]), "at most 2 km"),
        (lambda: guide.follow([(0.0, 0.0), (1e300, 0.0)]), "or above 1e"),
        (lambda: guide.follow([(0.0, 0.0), (9.0, 0.0)], 1e-9), "must last 0 to"),
        (lambda: guide.go_to((-1e308, 0.0, 0.0), (1e308, 0.0, 0.0)), "or above 1e"),
        (lambda: guide.left("abc"), "pose must be"),
        (lambda: guide.left((math.nan, 0.0, 0.0)), "pose must be"),
        (lambda: guide.step((0.0, 0.0), on_error="raise"), "pose must be"),
        (lambda: guide.step(AT, [(1.0, 0, 1)], on_error="raise"), "points must have"),
        (lambda: guide.step(AT, [5.0, 6.0], on_error="raise"), "points must have"),
    ):
        with pytest.raises(InvalidInputError, match=said):
            call()
    for pose in ((0.0, 0.0, 0.0), (0.01, 0.0, 0.0)):
        one, two = (each.step(pose, [(1.5, 0.2)]) for each in (guide, other))
        assert one._replace(solve_time_s=0.0) == two._replace(solve_time_s=0.0)


def box(x, y, length, width):
    return [(x + a * length / 2, y + b * width / 2) for a, b in CORNERS]


CORNERS = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
HULL = [(-0.5, -0.4), (0.5, -0.4), (1.5, -0.285), (1.5, 0.285), (0.5, 0.4), (-0.5, 0.4)]


def test_forks_enter_a_pallet_their_hull_does_not_and_the_load_is_kept_clear():
    """By shapely: stringers are r_min from the forks, and the door from the pallet."""
    forks = [box(1.0, y, 1.0, 0.12) for y in (-0.225, 0.225)]
    lift = qp.Footprint.union([box(0.0, 0.0, 1.0, 0.8), *forks])
    limits = qp.Limits(-1.0, 1.0, -1.0, 1.0, 1.0, 2.0)
    settings = qp.AvoidanceSettings(radius=qp.SafetyRadius(0.05, 0.2))
    walls = [[7.0, side * 0.85, 7.0, side * 3.0] for side in (-1.0, 1.0)]
    stringers = [box(4.4, y, 0.8, 0.1) for y in (-0.45, 0.0, 0.45)]
    solid = shapely.MultiPolygon([shapely.Polygon(x) for x in stringers])
    pallet, start = qp.Obstacles(walls=walls, polygons=stringers), (0.0, 0.3, 0.0)

    def least(footprint, poses, shape):
        parts = shapely.MultiPolygon([shapely.Polygon(x) for x in footprint.parts])
        turned = [
            (shapely.affinity.rotate(parts, h, (0, 0), True), x, y) for x, y, h in poses
        ]
        return min(shapely.affinity.translate(*one).distance(shape) for one in turned)

    for footprint, enters in ((lift, True), (qp.Footprint.polygon(HULL), False)):
        guide = qp.Guide(qp.Robot("lift", footprint, limits), settings)
        guide.go_to(start, (3.4, 0.0, 0.0))
        poses = drive(guide, pallet, 30.0 if enters else 15.0, start)[0]
        assert least(footprint, poses, solid) > 0.048
        assert (guide.left(tuple(poses[-1]))[0] < 0.01) == enters
        if enters:
            loaded = guide.footprint = qp.Footprint.union(
                [lift, box(1.0, 0.0, 0.8, 1.0)]
            )
            assert guide.safety.footprint is guide.footprint is guide.robot.footprint
            guide.go_to(tuple(poses[-1]), (10.0, 0.0, 0.0))
            door = shapely.MultiLineString([np.reshape(x, (2, 2)) for x in walls])
            way, _, time = drive(
                guide, qp.Obstacles(walls=walls), 30.0, tuple(poses[-1])
            )
            assert time < 30.0 and 0.048 < least(loaded, way, door) < 0.36
