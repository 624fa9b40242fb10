"""Wall segments: distance, depth and rows against segment-to-segment brute force."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from oracles import point_to_segment, sides, wall_distance
from qpavoid.model.capsules import join_walls
from qpavoid.model.contact import approach_row
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import PENTAGON, footprints, places

WALLS = {
    "beside a corner, 10 degrees off": (0.40, 0.295, 0.57, 1.28),
    "beside a corner, oblique": (0.35, 0.34, 0.95, 1.14),
    "through the middle": (-0.05, -0.4, 0.05, 0.4),
    "through a corner": (0.3, 0.35, 0.8, 0.1),
    "one end inside": (0.0, 0.0, 0.0, 2.0),
    "inside": (-0.05, 0.0, 0.05, 0.02),
    "along a side": (-1.0, 0.3, 1.0, 0.3),
    "radial": (1.2, 0.0, 3.0, 0.0),
    "of no length": (0.9, 0.4, 0.9, 0.4),
    "across the needle's tip": (0.6, -0.04, 0.7, 0.04),
}


def clearance(footprint, wall):
    return Contacts.of(footprint, Obstacles(walls=[wall])).distance.min()


def check_wall(footprint, wall):
    expected = wall_distance(footprint.vertices, wall)
    distance = clearance(footprint, wall)
    if expected < 0:
        assert distance <= 1e-12
    else:
        assert distance == pytest.approx(expected, abs=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_a_wall_in_pieces_is_one(seed):
    """In whatever order, from whichever end; one that turns off stays by itself."""
    rng = np.random.default_rng(seed)
    one, other = rng.uniform(-2, 2, (2, 2))
    assume(math.dist(one, other) > 0.1)
    cuts = np.sort([0.0, *rng.uniform(0, 1, rng.integers(1, 5)), 1.0])
    assume(np.diff(cuts).min() > 0.01)
    ends = one + cuts[:, None] * (other - one)
    pieces = [rng.permutation(two).ravel() for two in pairwise(ends)]
    beside = [*other, *(other + (other - one) @ [[0.0, 1.0], [-1.0, 0.0]])]
    table = Obstacles(walls=rng.permutation([*pieces, beside])).capsules
    joined = np.empty_like(table)
    assert join_walls(table, joined) == 2
    found = [{tuple(row[:2]), tuple(row[2:4])} for row in joined[:2].round(9)]
    for wall in ([*one, *other], beside):
        assert {tuple(np.round(wall[:2], 9)), tuple(np.round(wall[2:], 9))} in found


@footprints
@pytest.mark.parametrize("wall", WALLS.values(), ids=WALLS)
def test_distance_of_a_wall(footprint, wall):
    check_wall(footprint, wall)


@footprints
@given(places, places)
def test_distance_of_any_wall(footprint, first, second):
    check_wall(footprint, (*first, *second))


@footprints
@given(places, places)
def test_depth_of_an_overlap_is_the_least_shift_out_of_it(footprint, first, second):
    """Shifted by the depth along the normal it is free; by less, in no direction."""
    ends = np.array([first, second])
    assume(wall_distance(footprint.vertices, ends.ravel()) < 0)
    contacts = Contacts.of(footprint, Obstacles(walls=[ends.ravel()]))
    assert len(contacts) == 1
    depth, normal = -contacts.distance[0], contacts.normal[0]
    assume(depth > 1e-6)
    free = ends + (1.0 + 1e-6) * depth * normal
    assert wall_distance(footprint.vertices, free.ravel()) >= 0
    for bearing in np.linspace(0, 2 * math.pi, 72, endpoint=False):
        step = 0.999 * depth * np.array([math.cos(bearing), math.sin(bearing)])
        assert wall_distance(footprint.vertices, (ends + step).ravel()) < 0


@footprints
@given(places, places)
def test_contacts_of_a_wall_are_consistent(footprint, first, second):
    """Each P_r lies on its edge; the nearest contact leads onto the wall."""
    wall = np.array([first, second])
    contacts = Contacts.of(footprint, Obstacles(walls=[wall.ravel()]))
    assert_allclose(np.hypot(*contacts.normal.T), 1.0, atol=1e-12)
    for point, segment in zip(contacts.point, contacts.segment, strict=True):
        assert point_to_segment(point, *sides(footprint.vertices)[segment])[0] < 1e-12
    if contacts.distance.min() > 0:
        k = contacts.distance.argmin()
        reached = contacts.point[k] + contacts.distance[k] * contacts.normal[k]
        assert point_to_segment(reached, *wall)[0] < 1e-9


@given(places, places, st.floats(-1, 1), st.floats(-1.5, 1.5))
def test_rows_of_a_wall_bound_the_rate_of_its_distance(first, second, v, omega):
    """The nearest contact is as fast as the distance, wherever that is smooth."""
    wall, h = (*first, *second), 1e-6
    assume(wall_distance(PENTAGON.vertices, wall) > 0.02)
    world = Obstacles(walls=[wall])
    contacts = Contacts.of(PENTAGON, world)
    order = np.argsort(contacts.distance)
    gaps = contacts.distance[order]
    assume(len(gaps) < 2 or gaps[1] - gaps[0] > 1e-4)

    def distance(time):
        seen = world.seen_from(arc(0.0, 0.0, 0.0, v, omega, time))
        return Contacts.of(PENTAGON, seen).distance.min()

    nearest = order[0]
    row = approach_row(*contacts.point[nearest], *contacts.normal[nearest])
    rate = (distance(h) - distance(-h)) / (2 * h)
    assert row @ np.array([v, omega]) == pytest.approx(rate, abs=1e-3)


def test_a_parallel_wall_is_held_at_both_corners():
    """Both ends of the left side get a row: neither can turn into the wall."""
    contacts = Contacts.of(PENTAGON, Obstacles(walls=[[-2, 0.5, 2, 0.5]]))
    near = contacts.distance < 0.21 + 1e-9
    assert sorted(contacts.point[near, 0]) == pytest.approx([-0.445, 0.445])
    assert_allclose(contacts.normal[near], [[0, 1], [0, 1]], atol=1e-12)
