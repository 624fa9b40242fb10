"""The search of plans behind the encounters: its geometry, its plans, its limit."""

import math

import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

import encounter_movers as movers
import encounter_oracle
import limit
import limit_search
import plan_room
import plan_search
from encounter_scenes import WORLDS, draw_encounters
from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.model.robot import Robot

QUICK = (plan_search.Effort(3, 0, 3, 60, 5.0),)
RADIUS = SafetyRadius()
BOX = shapely.box(-1.0, -1.0, 1.0, 1.0)


def polygon(robot, x, y, heading):
    body = shapely.Polygon(robot.footprint.vertices)
    return translate(rotate(body, heading, origin=(0, 0), use_radians=True), x, y)


def outlines(encounter, t):
    """What stands and moves at a time, as shapely has it, each with its radius."""
    for mover in encounter.all_movers:
        x, y, *_ = mover.at(t)
        shape = shapely.Polygon(mover.corners(t)) if mover.is_cart else None
        yield shape or shapely.Point(x, y), mover.radius
    for point in encounter.posts:
        yield shapely.Point(*point), 0.0
    for wall in encounter.solid:
        yield shapely.LineString(wall.reshape(2, 2)), 0.0


def euler(robot, plan, start, until, dt=2e-3):
    """Drive a plan in tiny steps with ramps of our own; yield poses and times."""
    v, omega, x, y, heading, t = *start, 0.0, 0.0, 0.0, 0.0
    a, alpha = robot.limits.acceleration, robot.limits.angular_acceleration
    ends = np.cumsum(plan[:, 2])
    while t < until:
        yield x, y, heading, t
        k = int(np.searchsorted(ends, t, side="right"))
        target, turn = plan[k, :2] if k < len(plan) else (0.0, 0.0)
        v += float(np.clip(target - v, -a * dt, a * dt))
        omega += float(np.clip(turn - omega, -alpha * dt, alpha * dt))
        middle = heading + 0.5 * dt * omega
        x, y = x + dt * v * math.cos(middle), y + dt * v * math.sin(middle)
        heading, t = heading + dt * omega, t + dt


def test_distance_to_a_rectangle_is_that_of_shapely(robot):
    rng = np.random.default_rng(2)
    body = polygon(robot, 0.0, 0.0, 0.0)
    for _ in range(300):
        (x, y), angle = rng.uniform(-2, 2, 2), rng.uniform(-4, 4)
        length, width = rng.uniform(0.2, 0.8, 2)
        box = rotate(translate(shapely.affinity.scale(BOX, length, width), x, y), angle,
                     use_radians=True)  # fmt: skip
        d = plan_room.rectangle_distance(
            robot.footprint.edges, x, y, angle, length, width
        )
        if body.intersects(box):
            assert d <= 1e-9
        else:
            assert d == pytest.approx(body.distance(box), abs=1e-9)


def test_overlap_is_the_shortest_way_out(robot):
    edges = robot.footprint.edges
    inside = plan_room.rectangle_distance(edges, 0.0, 0.0, 0.0, 2.0, 0.1)
    assert inside == pytest.approx(-(0.29 + 0.1))
    assert plan_room.rectangle_distance(edges, 0.0, 0.39, 0.0, 2.0, 0.1) == (
        pytest.approx(0.0, abs=1e-12)
    )


@pytest.mark.slow
@pytest.mark.parametrize("family", list(WORLDS))
def test_a_plan_keeps_what_the_search_says(robot, family):
    """Sampled every 16 ms with shapely: no nearer than promised, to 4 mm."""
    for encounter in draw_encounters(family, 4, 7, robot)[3:]:
        driver = robot
        if encounter.limited:
            driver = limit_search.with_accelerations(robot, 2.0, 2.5)
        start = (encounter.speed, 0.0)
        radii = encounter_oracle.wanted_radii(encounter, RADIUS)
        promised, plan = plan_search.search_plan(
            driver, encounter.scene, radii, start, 0.02, efforts=QUICK
        )
        wanted = [*radii[:-1], *[radii[-1]] * 100]
        kept = math.inf
        poses = list(euler(driver, plan, start, min(encounter.scene.until, 25.0)))
        for x, y, heading, t in poses[::8]:
            body = polygon(robot, x, y, heading)
            for (shape, radius), zone in zip(
                outlines(encounter, t), wanted, strict=False
            ):
                kept = min(kept, body.distance(shape) - radius - zone)
        assert kept == pytest.approx(promised, abs=4e-3) or promised < -0.1


def test_a_coarse_look_at_a_plan_never_misses_what_beats_the_floor(robot):
    encounter = draw_encounters("mixed", 2, 5, robot)[1]
    limits = limit_search.limit_numbers(robot.limits)
    nothing = np.zeros(len(encounter.all_movers) + 1)
    rng = np.random.default_rng(1)
    for _ in range(60):
        plan = rng.uniform((-1.0, -1.5, 0.0), (1.0, 1.5, 2.0), (4, 3))
        start = np.array((encounter.speed, 0.0))
        about = robot.footprint.edges, limits, encounter.scene, nothing, start
        given = plan_room.Case(*about), plan
        true = plan_room.plan_room(*given, -math.inf, 1e-4)
        for floor in (-0.2, 0.0, 0.1, 0.25):
            least = plan_room.plan_room(*given, floor, 4e-3)
            assert least <= floor or true > floor - 4e-3
            if true > floor + 1e-3:
                assert true - 1e-3 <= least <= true + 0.033


@pytest.mark.slow
def test_the_search_finds_the_limit_of_one_disc_and_no_more(robot):
    grid = limit.Grid(spacing=0.08, headings=72, ahead=3.0, cap=0.9)
    tables = limit.limit_tables(robot, (1.5,), grid)
    rows = limit_search.sample_encounters(150, 1.5, 3)
    kept = tables.clearance(rows)
    first = [limit.distance(robot.footprint.edges, x, y, 0.0) for x, y in rows[:, :2]]
    pressed = np.flatnonzero((kept < 0.7) & (kept < np.array(first) - 0.05))
    assert len(pressed) > 20
    for row, clearance in zip(rows[pressed][:24], kept[pressed], strict=False):
        disc = movers.straight(np.array([*row[:2], 0.0]), row[2:4])
        scene = plan_room.make_scene(np.empty((0, 2)), np.empty((0, 4)), [disc], 15.0)
        for less, effort in ((0.06, plan_search.DEEPENED), (-0.06, QUICK)):
            wanted = np.array([clearance - less, 0.0])
            least, _ = plan_search.search_plan(
                robot, scene, wanted, (0.0, 0.0), 0.0, efforts=effort
            )
            assert (least >= 0.0) is (less > 0.0)


@pytest.mark.long
def test_it_ends_where_it_has_enough_and_deepens_where_it_has_not(robot):
    scene = plan_room.make_scene(
        np.array([[1.0, 0.0], [-1.0, 0.0]]),
        np.empty((0, 4)),
        [movers.straight(np.array([3.0, 0.0, 0.2]), np.array([-0.5, 0.0]))],
        30.0,
    )
    easy = plan_search.search_plan(robot, scene, np.zeros(2), (0.0, 0.0), 0.02)
    assert easy[0] >= 0.02 and len(easy[1]) == plan_search.DEEPENED[0].pieces
    hopeless = plan_search.search_plan(
        robot, scene, np.ones(2), (0.0, 0.0), 0.0, efforts=QUICK
    )
    assert hopeless[0] < 0.0
    again = plan_search.search_plan(robot, scene, np.zeros(2), (0.0, 0.0), 0.02)
    assert again[0] == easy[0] and np.array_equal(again[1], easy[1])


@pytest.mark.slow
def test_what_the_search_misses():
    for line in encounter_oracle.misses(Robot.mir100(), 300, 1, RADIUS, None):
        assert line["missed"] <= 0.03 * line["possible"]
        assert line["beyond"] == 0
