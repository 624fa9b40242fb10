"""Parts of the guide alone: the field, distances on it, the reference's end."""

import numpy as np
import pytest
import shapely
from test_choice import ROBOT, course, straight

from boxes import RADIUS, box
from qpavoid.guide.geodesic import Goal, cells_of, geodesic
from qpavoid.guide.rollout import ROWS, parking
from qpavoid.guide.room import AMPLE, GRID_PITCH, Field, new_field, outline
from qpavoid.guide.steering import TURN_FROM, park_twist, point_ahead
from qpavoid.guide.way import (
    ARC_LENGTH,
    CHANGE_COST,
    MOST_ACTIONS,
    NEAR_COST,
    REVERSE_COST,
    TURN_COST,
    Search,
    _cost,
    find_way,
    search_size,
)
from qpavoid.model.capsules import CAPSULE_WIDTH
from qpavoid.model.obstacles import Obstacles
from qpavoid.tracking.kanayama import tracking_error

HALF = 1.5
"""m, of small grids."""

WIDE = AMPLE + 0.29
NO_WALLS = np.zeros((0, CAPSULE_WIDTH))


def test_the_field_is_the_distance_at_every_node_and_less_within_polygons():
    """Against shapely, to the last row: discs and boxes across borders, a triangle."""
    discs = [[x, y, 0.2] for x in (-HALF, 0.0, HALF) for y in (-HALF, HALF)]
    discs += [[-HALF, 0.0, 0.2], [HALF, 0.0, 0.2]]
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
    field = new_field(HALF, WIDE, RADIUS, world.arrays)
    along = GRID_PITCH * np.arange(len(field)) - HALF
    x, y = np.meshgrid(along, along, indexing="ij")
    truth = shapely.distance(everything, shapely.points(x, y))
    near = (truth > 0.0) & (truth < AMPLE)
    np.testing.assert_allclose(field[near], truth[near] - 0.17, atol=1e-4)
    assert (field[truth == 0.0] <= -0.17 + 1e-9).all()


def test_distances_on_the_grid_are_the_same_with_x_and_y_exchanged():
    """To a goal behind a long wall, which is thinner than a step."""
    walls = np.array([(0.5, -0.9, 0.5, 1.4), (-1.0, -0.7, 1.0, -1.0)])

    def distances(walls, goal):
        nodes = new_field(HALF, WIDE, RADIUS, Obstacles(walls=walls).arrays)
        n = cells_of(HALF)
        cost, heap = np.empty((n, n)), np.empty((60 * n * n, 3))
        field = Field(nodes, HALF, outline(ROBOT.footprint))
        geodesic(field, -0.05, Goal(*goal, NO_WALLS), cost, heap)
        return cost

    one = distances(walls, (1.2, 0.2))
    other = distances(walls[:, [1, 0, 3, 2]], (0.2, 1.2))
    np.testing.assert_allclose(one, other.T, atol=1e-9)
    middle = len(one) // 2
    assert 2.0 < one[middle, middle] < np.inf


@pytest.mark.parametrize("before", [0.0, -1.0, 1e6])
def test_a_way_is_found_whatever_the_memory_held(before):
    nodes = new_field(HALF, WIDE, RADIUS, Obstacles(walls=box(1.3, -1, 2, 1)).arrays)
    field = Field(nodes, HALF, outline(ROBOT.footprint))
    search = Search(0.29, True, 0.02, 0.1, (3.5, 0.0, 0.0), False, NO_WALLS)
    memory, way = np.full(search_size(HALF), before), np.zeros(MOST_ACTIONS)
    memory_of_zeros, known = np.zeros(search_size(HALF)), np.zeros(MOST_ACTIONS)
    count = find_way(field, search, memory, way)
    assert count == find_way(field, search, memory_of_zeros, known) > 0
    np.testing.assert_array_equal(way[:count], known[:count])


def test_it_is_parked_at_the_very_end_of_the_reference():
    ahead = straight(0.0)
    ahead[-1, :3] = end = 0.3, 0.1, 0.5
    pose = (0.1, -0.2, 0.3)
    found = parking(course(Obstacles(), ahead), pose)
    assert found == park_twist(ROBOT.limit_vector, tracking_error(pose, end))
    assert found != parking(course(Obstacles(), straight(0.0)), pose)


@pytest.mark.parametrize("room", [-0.1, 0.0, 0.5 * AMPLE, 2 * AMPLE])
def test_an_action_costs_its_way_its_turn_and_its_change(room):
    near = {-0.1: 1.0, 0.0: 1.0, 0.5 * AMPLE: 0.25, 2 * AMPLE: 0.0}[room]
    way, turn = ARC_LENGTH * (1.0 + NEAR_COST * near), 0.3 * TURN_COST
    assert _cost(0.0, -0.3, 1.0, room) == pytest.approx(turn)
    assert _cost(0.1, 0.3, 0.0, room) == pytest.approx(turn + way)
    assert _cost(0.1, 0.0, 1.0, room) == pytest.approx(way)
    back = REVERSE_COST * (turn + way)
    assert _cost(-0.1, 0.3, -1.0, room) == pytest.approx(back)
    assert _cost(-0.1, 0.3, 1.0, room) == pytest.approx(back + CHANGE_COST)
    assert _cost(0.1, 0.3, -1.0, room) == pytest.approx(turn + way + CHANGE_COST)


def test_to_park_it_drives_whichever_way_takes_the_smaller_turns():
    """Turns as quotients of complex numbers: to the way, and from it to the pose."""
    rng, limits = np.random.default_rng(4), ROBOT.limit_vector
    for _ in range(500):
        goal, turn = complex(*rng.uniform(-2, 2, 2)), rng.uniform(-np.pi, np.pi)
        ways = {sign: sign * goal / abs(goal) for sign in (1.0, -1.0)}
        turns = {
            sign: abs(np.angle(way)) + abs(np.angle(np.exp(1j * turn) / way))
            for sign, way in ways.items()
        }
        sign = min(turns, key=turns.get)
        v, omega = park_twist(limits, (goal.real, goal.imag, turn))
        assert omega * np.angle(ways[sign]) > 0.0
        assert v * sign >= 0.0 and (v == 0.0) == (abs(np.angle(ways[sign])) > TURN_FROM)


@pytest.mark.parametrize("way", [0.0, 0.5, 2.0, 100.0])
def test_a_point_ahead_of_a_straight_reference_goes_on_straight(way):
    """Within a step of the reference's rows, and exactly beyond its end."""
    ahead, step = straight(0.5, 0.2), 0.05
    x, y = point_ahead(ahead, 3, way, 0.4)
    assert y == pytest.approx(0.6)
    assert 3 * step + way - 1e-9 <= x <= 3 * step + way + step
    if way > step * ROWS:
        assert x == pytest.approx(3 * step + way)
