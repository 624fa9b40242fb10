"""The way of a detour: room on a grid, lines, and ways that are free."""

import math

import numpy as np
import pytest
import shapely

from qpavoid.guide.hybrid_astar import (
    ACTIONS,
    ARC_LENGTH,
    MOST_ACTIONS,
    TURN,
    Search,
    find_way,
    search_size,
    way_beyond,
)
from qpavoid.guide.local_grid import (
    AMPLE,
    GRID_PITCH,
    Field,
    grid_size,
    line_room,
    outline,
    pose_room,
    room_field,
)
from qpavoid.model.capsules import CAPSULE_WIDTH, Segment
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc, to_world, wrap_angle
from qpavoid.model.obstacles import Obstacles
from shapes import HALF, RADIUS, ROBOT, box

SIZE = search_size(HALF)
NO_WALLS = np.zeros((0, CAPSULE_WIDTH))


def new_field(half, ample, curve, obstacles):
    """A new array of room_field."""
    nodes = np.empty((grid_size(half), grid_size(half)))
    room_field(half, ample, curve, obstacles, nodes)
    return nodes


def driven(way, on=(0.0, 0.0, 0.0)):
    """Poses at every tenth of every action."""
    for drive, turn in np.array(ACTIONS)[way.astype(int)]:
        pose = on
        for part in np.linspace(0.1, 1.0, 10):
            on = arc(*pose, drive * ARC_LENGTH, turn * TURN, part)
            yield on


def clutter(rng):
    points, discs = rng.uniform(-4.0, 4.0, (5, 2)), rng.uniform(-4.0, 4.0, (8, 2))
    discs = np.column_stack([discs, rng.uniform(0.1, 0.5, 8)])
    return Obstacles(points, discs=discs, walls=rng.uniform(-4.0, 4.0, (2, 4)))


def test_room_is_the_clearance_less_r_min(robot):
    """Against the exact contacts, for poses that touch nothing."""
    rng, body = np.random.default_rng(1), outline(robot.footprint)
    worst = []
    for _ in range(200):
        world, pose = clutter(rng), tuple(rng.uniform(-3.0, 3.0, 3).tolist())
        field = new_field(HALF, AMPLE + 0.29, RADIUS, world.arrays)
        exact = Contacts.of(robot.footprint, world.seen_from(pose)).distance.min()
        room = pose_room(Field(field, HALF, body), *pose)
        if 0.1 < exact < 0.6:
            worst.append(room - (exact - 0.17))
        elif exact < 0.0:
            assert room < 0.0
    assert len(worst) > 20
    assert -0.002 < min(worst) and max(worst) < 0.01


def test_room_knows_the_radius_of_fast_obstacles(robot):
    fast = Obstacles(discs=[(2.0, 0.0, 0.3)], disc_velocities=[(0.5, 0)])
    field = new_field(HALF, 0.8, RADIUS, fast.arrays)
    centre = np.zeros((1, 2))
    room = pose_room(Field(field, HALF, centre), 1.0, 0.0, 0.0)
    assert room == pytest.approx(0.47, abs=1e-3)


def test_a_line_is_free_or_not(robot):
    body = outline(robot.footprint)
    for y, free in ((0.0, False), (0.55, False), (1.1, True)):
        field = new_field(HALF, 0.8, RADIUS, Obstacles(discs=[(2.0, y, 0.3)]).arrays)
        assert (line_room(Field(field, HALF, body), 4.0, 0.0, 0.0) >= 0.0) is free


@pytest.mark.parametrize("reverse", [True, False])
def test_ways_are_free_and_lead_to_the_target(robot, reverse):
    """Checked with the exact contacts, at every tenth of every action."""
    rng, body, found = np.random.default_rng(2), outline(robot.footprint), 0
    inner, way = robot.footprint.inner_radius, np.zeros(MOST_ACTIONS)
    for _ in range(30):
        world, place = clutter(rng), rng.uniform(-4.0, 4.0, 2).tolist()
        target = (*place, rng.uniform(-3, 3))
        nodes = new_field(HALF, AMPLE + inner, RADIUS, world.arrays)
        field = Field(nodes, HALF, body)
        if pose_room(field, 0.0, 0.0, 0.0) < 0.05:
            continue
        search = Search(inner, reverse, 0.05, target, True, NO_WALLS)
        count = find_way(field, search, np.empty(SIZE), way)
        if count <= 0:
            continue
        found += 1
        assert reverse or (np.array(ACTIONS)[way[:count].astype(int), 0] >= 0.0).all()
        for pose in driven(way[:count]):
            contacts = Contacts.of(robot.footprint, world.seen_from(pose))
            assert contacts.distance.min() > 0.17
        assert math.hypot(pose[0] - target[0], pose[1] - target[1]) <= 0.2
        assert abs(wrap_angle(pose[2] - target[2])) <= 1.51 * TURN
    assert found >= 8


def test_an_axle_outside_of_the_footprint_leads_an_l_through_a_gap():
    """An L of 2 m hooks the wall's end into its notch; distances are shapely's."""
    ell = [(-1, -1), (1, -1), (1, -0.6), (-0.6, -0.6), (-0.6, 1), (-1, 1)]
    ends = [shapely.box(2.0, y, 3.0, y + 6.0) for y in (1.0, -7.0)]
    corners = [np.array(end.exterior.coords)[:4] for end in ends]
    robot, way = Footprint.polygon(ell), np.zeros(MOST_ACTIONS)
    nodes = new_field(HALF, AMPLE, RADIUS, Obstacles(polygons=corners).arrays)
    field, target = Field(nodes, HALF, outline(robot)), (5.0, 0.0, 0.0)
    assert pose_room(field, 0.0, 0.0, 0.0) > 0.49
    search = Search(robot.inner_radius, True, 0.03, target, False, NO_WALLS)
    count = find_way(field, search, np.empty(SIZE), way)
    assert count > 0
    walls = shapely.MultiPolygon(ends)
    for pose in driven(way[:count]):
        assert walls.distance(shapely.Polygon(to_world(np.array(ell), pose))) > 0.17
    assert math.dist(pose[:2], target[:2]) <= 0.2


def test_no_way_is_no_way(robot):
    body, inner = outline(robot.footprint), robot.footprint.inner_radius
    way = np.zeros(MOST_ACTIONS)
    world = Obstacles(walls=box(-1.5, -1.5, 2.5, 1.5))
    field = new_field(HALF, AMPLE + inner, RADIUS, world.arrays)
    search = Search(inner, True, 0.01, (4.0, 0.0, 0.0), False, NO_WALLS)
    assert find_way(Field(field, HALF, body), search, np.empty(SIZE), way) == 0


def test_the_way_beyond_the_grid_goes_round_each_wall():
    """Against the least of the ways by every place on a fine line through the wall."""
    rng = np.random.default_rng(5)
    across = 0
    for _ in range(200):
        here, there, *wall = rng.uniform(-9, 9, (4, 2))
        wall = np.array(wall)
        capsules = Obstacles(walls=[wall.ravel()]).capsules
        found = way_beyond(capsules, Segment(*here, *there))
        share = np.linspace(0.0, 1.0, 20_001)[:, None]
        places = wall[0] + share * (wall[1] - wall[0])
        by = np.hypot(*(places - here).T) + np.hypot(*(places - there).T)
        straight = math.dist(here, there)
        if 0 < by.argmin() < len(by) - 1 and by.min() < straight + 1e-6:
            across += 1
            assert found == pytest.approx(min(by[0], by[-1]))
        else:
            assert found == pytest.approx(straight)
    assert across > 20


def test_a_way_to_what_lies_beyond_the_grid_stays_on_this_side_of_a_long_wall(robot):
    """In a corridor with three robots that stand: past them, not out and beside it."""
    body, inner = outline(robot.footprint), robot.footprint.inner_radius
    way = np.zeros(MOST_ACTIONS)
    boxes = [
        [(x, -0.7), (x + 0.9, -0.7), (x + 0.9, -0.1), (x, -0.1)]
        for x in (1.2, 2.8, 4.4)
    ]
    walls = [(-2.4, -2.0, 22.0, -2.0), (-2.4, 1.2, 22.0, 1.2)]
    world = Obstacles(walls=walls, polygons=boxes)
    for turn, away in ((0.0, 7.6), (math.pi, 7.6)):
        seen = world.seen_from((0.0, 0.0, turn))
        nodes = new_field(HALF, AMPLE + inner, RADIUS, seen.arrays)
        target = away * math.cos(turn), 0.0, 0.0
        search = Search(inner, True, 0.01, target, False, seen.capsules)
        count = find_way(Field(nodes, HALF, body), search, np.empty(SIZE), way)
        assert count > 0
        for pose in driven(way[:count], (0.0, 0.0, turn)):
            assert -2.0 < pose[1] < 1.2
        assert pose[0] > 5.5


SMALL = 1.5
"""m, of small grids."""

WIDE = AMPLE + 0.29


def test_the_field_is_the_distance_at_every_node_and_less_within_polygons():
    """Against shapely, to the last row: discs and boxes across borders, a triangle."""
    discs = [[x, y, 0.2] for x in (-SMALL, 0.0, SMALL) for y in (-SMALL, SMALL)]
    discs += [[-SMALL, 0.0, 0.2], [SMALL, 0.0, 0.2]]
    corners = [
        [(0.4, 0.4), (1, 0.4), (0.4, 1)],
        [(-1, -1), (-0.4, -1), (-0.4, -0.4), (-1, -0.4)],
        [(1.2, -1.2), (1.9, -1.2), (1.9, -0.6), (1.2, -0.6)],
        [(-0.9, 1.2), (-0.4, 1.2), (-0.4, 1.9), (-0.9, 1.9)],
        [(-1.9, 0.7), (-1.3, 0.7), (-1.3, 1.1), (-1.9, 1.1)],
        [(0.3, -1.9), (0.7, -1.9), (0.7, -1.3), (0.3, -1.3)],
    ]
    world = Obstacles(discs=discs, walls=[(-1, 0.5, -0.3, 1)], polygons=corners)
    shapes = [shapely.Point(x, y).buffer(r, 256) for x, y, r in discs]
    shapes += [shapely.Polygon(c) for c in corners]
    everything = shapely.union_all(
        [*shapes, shapely.LineString([(-1, 0.5), (-0.3, 1)])]
    )
    field = new_field(SMALL, WIDE, RADIUS, world.arrays)
    along = GRID_PITCH * np.arange(len(field)) - SMALL
    x, y = np.meshgrid(along, along, indexing="ij")
    truth = shapely.distance(everything, shapely.points(x, y))
    near = (truth > 0.0) & (truth < AMPLE)
    np.testing.assert_allclose(field[near], truth[near] - 0.17, atol=1e-4)
    assert (field[truth == 0.0] <= -0.17 + 1e-9).all()


@pytest.mark.parametrize("before", [0.0, -1.0, 1e6])
def test_a_way_is_found_whatever_the_memory_held(before):
    nodes = new_field(SMALL, WIDE, RADIUS, Obstacles(walls=box(1.3, -1, 2, 1)).arrays)
    field = Field(nodes, SMALL, outline(ROBOT.footprint))
    search = Search(0.29, True, 0.02, (3.5, 0.0, 0.0), False, NO_WALLS)
    memory, way = np.full(search_size(SMALL), before), np.zeros(MOST_ACTIONS)
    memory_of_zeros, known = np.zeros(search_size(SMALL)), np.zeros(MOST_ACTIONS)
    count = find_way(field, search, memory, way)
    assert count == find_way(field, search, memory_of_zeros, known) > 0
    np.testing.assert_array_equal(way[:count], known[:count])
