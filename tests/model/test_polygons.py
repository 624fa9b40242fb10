"""Contacts with convex polygons, against shapely, differences, and dense sampling."""

import math

import numpy as np
import pytest
import shapely.affinity
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from oracles import holds_point
from qpavoid.model import capsules
from qpavoid.model.contacts import Contacts, contact_table, empty_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import PENTAGON, footprints

SIZES = {"small": 0.05, "like the robot": 0.6, "round the robot": 4.0}


@st.composite
def polygons(draw, size=1.0, reach=2.0):
    """Corners in order round a circle: convex, of any number up to nine."""
    n = draw(st.integers(3, 9))
    shares = np.array([draw(st.floats(0.0, 0.8)) for _ in range(n)])
    angles = (np.arange(n) + shares + draw(st.floats(0, 1))) * 2 * math.pi / n
    middle = [draw(st.floats(-reach, reach)) for _ in range(2)]
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return size * draw(st.floats(0.2, 1.0)) * circle + middle


def contacts_of(footprint, corners, motion=(0.0, 0.0, 0.0)):
    world = Obstacles(polygons=[corners], polygon_velocities=[motion])
    return Contacts.of(footprint, world)


def depth(footprint, corners):
    """The least shift that ends an overlap: of the origin out of the difference."""
    difference = (corners[:, None] - footprint.vertices[None]).reshape(-1, 2)
    hull = shapely.MultiPoint(difference).convex_hull
    origin = shapely.Point(0, 0)
    return hull.exterior.distance(origin) if hull.contains(origin) else 0.0


@footprints
@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
@given(data=st.data())
def test_distance_is_that_of_shapely(footprint, size, data):
    """Positive if and only if apart; the way out of an overlap, one inside as well."""
    corners = data.draw(polygons(size))
    contacts = contacts_of(footprint, corners)
    distance = contacts.distance.min()
    robot = shapely.Polygon(footprint.vertices)
    apart = robot.distance(shapely.Polygon(corners))
    assert distance == pytest.approx(apart or -depth(footprint, corners), abs=1e-9)
    assert len(contacts) == 1 or distance > 0


@footprints
@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
@given(data=st.data())
def test_contacts_are_consistent(footprint, size, data):
    """P_r on the boundary of the one, P_r + d n on that of the other, n of length 1."""
    corners = data.draw(polygons(size))
    contacts = contacts_of(footprint, corners)
    assert_allclose(np.hypot(*contacts.normal.T), 1.0, atol=1e-12)
    outline = shapely.Polygon(footprint.vertices).exterior
    other = shapely.Polygon(corners)
    overlap = len(contacts) == 1 and contacts.distance[0] <= 0
    ends = contacts.point + contacts.distance[:, None] * contacts.normal
    for point, end in zip(contacts.point, ends, strict=True):
        assert outline.distance(shapely.Point(point)) < 1e-9
        if not overlap:
            assert other.exterior.distance(shapely.Point(end)) < 1e-9
    sides = footprint.edges[contacts.segment]
    across = ((contacts.point - sides[:, :2]) * sides[:, 2:4]).sum(axis=1)
    assert_allclose(across, 0.0, atol=1e-9)


@footprints
@given(data=st.data())
def test_the_way_out_ends_an_overlap(footprint, data):
    """Shifted by the depth along −n both just touch; by less they still overlap."""
    corners = data.draw(polygons(data.draw(st.sampled_from([0.3, 4.0])), 0.3))
    contacts = contacts_of(footprint, corners)
    assume(contacts.distance[0] < -1e-3)
    robot = shapely.Polygon(footprint.vertices)
    for more, area in ((-1e-6, True), (1e-6, False)):
        shift = (contacts.distance[0] - more) * contacts.normal[0]
        moved = shapely.affinity.translate(robot, *shift)
        assert moved.intersects(shapely.Polygon(corners)) == area


def test_a_polygon_that_holds_the_footprint_shows_the_way_out():
    box = np.array([[-3.0, -3], [3, -3], [3, 2.9], [-3, 2.9]])
    contacts = contacts_of(PENTAGON, box)
    assert_allclose(contacts.normal, [[0, -1]])
    assert_allclose(contacts.distance, [-(2.9 + 0.29)])


def test_shared_vertices_are_counted_once():
    box = np.array([[1.5, -0.2], [2, -0.2], [2, 0.2], [1.5, 0.2]])
    contacts = contacts_of(PENTAGON, box)
    ends = contacts.point + contacts.distance[:, None] * contacts.normal
    for corner in box:
        assert (np.hypot(*(ends - corner).T) < 1e-9).sum() == 1
    assert len(contacts) <= len(box) * (1 + len(PENTAGON.edges))
    assert contacts.distance.min() == pytest.approx(1.5 - PENTAGON.vertices[2, 0])


@footprints
@given(
    polygons(0.8, 2.0),
    st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-2, 2)),
    st.tuples(st.floats(-1, 1), st.floats(-1.5, 1.5)),
)
def test_rate_of_the_distance(footprint, corners, motion, twist):
    """ḋ = d̂ᵀ(J_0 u − v_o) of every contact, polygon and robot moving and turning."""
    world, h = Obstacles(polygons=[corners], polygon_velocities=[motion]), 1e-6

    def contacts(time):
        pose = arc(0.0, 0.0, 0.0, *twist, time)
        return Contacts.of(footprint, world.moved(time).seen_from(pose))

    now, before, after = contacts(0.0), contacts(-h), contacts(h)
    assume(len(now) == len(before) == len(after))
    assume(now.distance.min() > 0.02)
    rate = (after.distance - before.distance) / (2 * h)
    relative = now.jacobian @ np.array(twist) - now.velocity
    assert_allclose(-(now.normal * relative).sum(axis=1), rate, atol=1e-3)


@given(polygons(0.8, 2.0), st.floats(-2, 2))
def test_v_o_is_the_velocity_of_the_nearest_point(corners, turn):
    motion = (0.3, -0.2, turn)
    contacts = contacts_of(PENTAGON, corners, motion)
    middle = shapely.Polygon(corners).centroid
    nearest = contacts.point + contacts.distance[:, None] * contacts.normal
    arm = nearest @ [1, 1j] - complex(middle.x, middle.y)
    expected = complex(*motion[:2]) + 1j * turn * arm
    assert_allclose(contacts.velocity @ [1, 1j], expected, atol=1e-9)


def table(footprint, arrays, reach):
    contacts = empty_contacts(footprint.edges, arrays)
    contacts[:] = math.nan
    known = footprint.edges, footprint.circumradius, arrays, reach, contacts
    count, nearest = contact_table(*known)
    return contacts[:count], nearest


@footprints
@pytest.mark.parametrize("reach", [0.0, 0.3, 1.0])
def test_pruning_keeps_what_lies_within_reach_and_the_nearest(footprint, reach):
    rng = np.random.default_rng(4)
    square = np.array([[0, 0], [0.5, 0], [0.7, 0.5], [0, 0.4]])
    for _ in range(20):
        world = Obstacles(
            points=rng.uniform(-4, 4, (5, 2)),
            discs=np.abs(rng.normal(size=(5, 3))) * [3, 3, 0.2],
            walls=rng.uniform(-4, 4, (5, 4)),
            polygons=[square + place for place in rng.uniform(-4, 4, (9, 2))],
        ).arrays
        everything, _ = table(footprint, world, math.inf)
        kept, nearest = table(footprint, world, reach)
        assert kept[nearest, 4] == everything[:, 4].min()
        assert_array_equal(
            kept[kept[:, 4] <= reach], everything[everything[:, 4] <= reach]
        )


@given(polygons(0.8, 2.0), st.integers(0, 8))
def test_it_does_not_matter_where_the_corners_begin(corners, first):
    one = contacts_of(PENTAGON, corners)
    other = contacts_of(PENTAGON, np.roll(corners, first, axis=0))
    assert_allclose(np.sort(one.distance), np.sort(other.distance), atol=1e-12)


@given(polygons(), st.integers(0, 2**32 - 1))
def test_who_is_in_a_polygon_by_casting_a_ray(corners, seed):
    chain = Obstacles(polygons=[corners]).capsules
    for place in corners.mean(axis=0) + np.random.default_rng(seed).normal(
        size=(20, 2)
    ):
        assert capsules.holds_point(chain, *place) == holds_point(corners, place)
