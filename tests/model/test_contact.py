"""Contacts of points, discs, walls and polygons against shapely and differences."""

import math
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
import shapely.affinity
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid.model import capsules
from qpavoid.model.contact import approach_row
from qpavoid.model.contacts import (
    CONTACT,
    Contacts,
    clearance_of,
    contact_table,
    empty_contacts,
)
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import PENTAGON, footprints

SIZES = (0.05, 0.6, 4.0)
"""m: small, like the robot, round the robot."""

KINDS = ("point", "disc", "wall", "polygon")
REST = (0.0, 0.0, 0.0)
kinds = pytest.mark.parametrize("kind", KINDS)
motions = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-2, 2))
twists = st.tuples(st.floats(-1, 1), st.floats(-1.5, 1.5))


@st.composite
def corners_of(draw, kind, size=1.0, reach=2.0):
    """One place, two ends, or corners in order round a circle: convex, up to nine."""
    middle = np.array([draw(st.floats(-reach, reach)) for _ in range(2)])
    if kind in ("point", "disc"):
        return middle[None]
    n = 2 if kind == "wall" else draw(st.integers(3, 9))
    shares = np.array([draw(st.floats(0.0, 0.8)) for _ in range(n)])
    angles = (np.arange(n) + shares + draw(st.floats(0, 1))) * 2 * math.pi / n
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return size * draw(st.floats(0.2, 1.0)) * circle + middle


def world_of(kind, corners, motion=REST, radius=0.1):
    """Obstacles of one, which moves; points and discs do not turn, nor do walls."""
    if kind == "point":
        return Obstacles(points=corners)
    if kind == "disc":
        disc, velocity = [[*corners[0], radius]], [motion[:2]]
        return Obstacles(discs=disc, disc_velocities=velocity)
    if kind == "wall":
        return Obstacles(walls=[corners.ravel()], wall_velocities=[motion[:2]])
    return Obstacles(polygons=[corners], polygon_velocities=[motion])


def shape_of(corners):
    kinds = {1: lambda x: shapely.Point(*x), 2: shapely.LineString}
    return kinds.get(len(corners), shapely.Polygon)(corners)


def depth(footprint, corners):
    """The greatest of the least shifts that end the overlap with a part.

    Of the origin out of the difference.
    """
    deep, origin = 0.0, shapely.Point(0, 0)
    for part in footprint.parts:
        difference = (corners[:, None] - part[None]).reshape(-1, 2)
        hull = shapely.MultiPoint(difference).convex_hull
        if hull.contains(origin):
            deep = max(deep, hull.exterior.distance(origin))
    return deep


def robot_of(footprint):
    return shapely.union_all([shapely.Polygon(x) for x in footprint.outlines])


@footprints
@kinds
@settings(max_examples=60)
@given(data=st.data())
def test_distance_is_that_of_shapely(footprint, kind, data):
    """Positive if and only if apart; the way out of an overlap, one inside as well."""
    corners = data.draw(st.sampled_from(SIZES).flatmap(lambda x: corners_of(kind, x)))
    radius = 0.1 * (kind == "disc")
    contacts = Contacts.of(footprint, world_of(kind, corners))
    robot, distance = robot_of(footprint), contacts.distance.min()
    apart = robot.distance(shape_of(corners)) or -depth(footprint, corners)
    assert distance == pytest.approx(apart - radius, abs=1e-12 if apart > 0 else 1e-9)
    assert len(contacts) == 1 or distance > 0 or len(footprint.parts) > 1


@footprints
@kinds
@settings(max_examples=60)
@given(data=st.data())
def test_contacts_are_consistent(footprint, kind, data):
    """P_r on its side of the robot, P_r + d n on the obstacle, n of length 1."""
    corners = data.draw(st.sampled_from(SIZES).flatmap(lambda x: corners_of(kind, x)))
    radius = 0.1 * (kind == "disc")
    contacts = Contacts.of(footprint, world_of(kind, corners))
    assert_allclose(np.hypot(*contacts.normal.T), 1.0, atol=1e-12)
    outline = shapely.union_all([shapely.LinearRing(x) for x in footprint.parts])
    apart = contacts.distance + radius
    ends = contacts.point + apart[:, None] * contacts.normal
    other = shape_of(corners)
    other = other.exterior if kind == "polygon" else other
    for point in contacts.point:
        assert outline.distance(shapely.Point(point)) < 1e-9
    if kind in ("point", "disc") or apart.min() > 0:
        chosen = range(len(apart))
        if kind == "wall" or len(footprint.parts) > 1:
            chosen = [apart.argmin()]
        for end in ends[chosen]:
            assert other.distance(shapely.Point(end)) < 1e-9
    edges = footprint.edges[contacts.segment]
    across = ((contacts.point - edges[:, :2]) * edges[:, 2:4]).sum(axis=1)
    assert_allclose(across, 0.0, atol=1e-9)


@footprints
@pytest.mark.parametrize("kind", ["wall", "polygon"])
@given(data=st.data())
def test_the_way_out_ends_an_overlap(footprint, kind, data):
    """Shifted by the depth along −n both just touch; by less they still overlap."""
    size = data.draw(st.sampled_from([0.3, 4.0]))
    corners = data.draw(corners_of(kind, size, 0.3))
    world = world_of(kind, corners, radius=0.0)
    for part in footprint.parts:
        contacts = Contacts.of(Footprint.polygon(part), world)
        if contacts.distance[0] < -1e-3:
            for more, overlaps in ((-1e-6, True), (1e-6, False)):
                shift = (contacts.distance[0] - more) * contacts.normal[0]
                moved = shapely.affinity.translate(shapely.Polygon(part), *shift)
                assert moved.intersects(shape_of(corners)) == overlaps


@footprints
@kinds
@given(st.data(), motions, twists)
def test_rate_of_the_distance(footprint, kind, data, motion, twist):
    """ḋ = d̂ᵀ(J_0 u − v_o) of every contact, obstacle and robot moving and turning."""
    world, h = world_of(kind, data.draw(corners_of(kind, 0.8)), motion), 1e-6

    def contacts(time):
        pose = arc(*REST, *twist, time)
        return Contacts.of(footprint, world.moved(time).seen_from(pose))

    now, before, after = contacts(0.0), contacts(-h), contacts(h)
    assume(len(now) == len(before) == len(after))
    assume(now.distance.min() > 0.02)
    smooth = np.abs(after.distance - 2 * now.distance + before.distance) < 1e-10
    rate = (after.distance - before.distance) / (2 * h)
    relative = now.jacobian @ np.array(twist) - now.velocity
    ours = -(now.normal * relative).sum(axis=1)
    assert_allclose(ours[smooth], rate[smooth], atol=1e-3)
    row = approach_row(*now.point[0], *now.normal[0])
    assert_allclose(row, -now.normal[0] @ now.jacobian[0], atol=1e-15)
    nearest = now.point + now.distance[:, None] * now.normal
    if kind == "polygon":
        middle = shapely.Polygon(world.polygons[0]).centroid
        arm = nearest @ [1, 1j] - complex(middle.x, middle.y)
        expected = complex(*motion[:2]) + 1j * motion[2] * arm
        assert_allclose(now.velocity @ [1, 1j], expected, atol=1e-9)


@footprints
def test_on_the_boundary_the_distance_is_zero(footprint):
    ends = np.vstack(
        [
            np.stack([part, np.roll(part, -1, axis=0)], axis=1)
            for part in footprint.parts
        ]
    )
    for row, (a, b) in enumerate(ends):
        part = np.unique(footprint.edges[:, 5]).searchsorted(footprint.edges[row, 5])
        for share in (0.0, 0.3, 1.0):
            place = a + share * (b - a)
            contacts = Contacts.of(footprint, Obstacles(points=[place]))
            assert contacts.distance[part] == pytest.approx(0.0, abs=1e-12)
            assert_allclose(contacts.point[part], place, atol=1e-12)
            assert np.hypot(*contacts.normal[part]) == pytest.approx(1.0)
            if share == 0.3:
                edge = footprint.edges[row, 2:4]
                assert_allclose(contacts.normal[part], edge, atol=1e-12)


def test_j_0_is_casadis_derivative_in_both_frames():
    """World position of P_r differentiated symbolically, times J of Eq. 1."""
    pose, p = ca.SX.sym("pose", 3), ca.SX.sym("p", 2)
    cos, sin = ca.cos(pose[2]), ca.sin(pose[2])
    rotation = ca.vertcat(ca.horzcat(cos, -sin), ca.horzcat(sin, cos))
    J = ca.vertcat(ca.horzcat(cos, 0), ca.horzcat(sin, 0), ca.horzcat(0, 1))
    world = ca.jacobian(pose[:2] + rotation @ p, pose) @ J
    oracle = ca.Function("J_0", [pose, p], [world, rotation.T @ world])
    rng = np.random.default_rng(3)
    for x, y, heading in rng.uniform(-3, 3, (20, 3)):
        contacts = Contacts.of(PENTAGON, Obstacles(points=rng.uniform(-2, 2, (3, 2))))
        for (p_x, p_y), j_0 in zip(contacts.point, contacts.jacobian, strict=True):
            in_world, in_robot = map(np.array, oracle([x, y, heading], [p_x, p_y]))
            assert_allclose(j_0, in_robot, atol=1e-14)
            c, s = math.cos(heading), math.sin(heading)
            printed = [[c, -p_y * c - p_x * s], [s, p_x * c - p_y * s]]
            assert_allclose(in_world, printed, atol=1e-14)
            assert np.linalg.det(j_0) == pytest.approx(p_x, abs=1e-14)


def scene(rng):
    square = np.array([[0, 0], [0.5, 0], [0.7, 0.5], [0, 0.4]])
    return Obstacles(
        points=rng.uniform(-4, 4, (20, 2)),
        discs=np.abs(rng.normal(size=(20, 3))) * [3, 3, 0.2],
        disc_velocities=rng.normal(size=(20, 2)),
        walls=rng.uniform(-4, 4, (10, 4)),
        polygons=[square + place for place in rng.uniform(-4, 4, (9, 2))],
    )


def table(footprint, arrays, reach):
    """Contacts within reach, and the row of the nearest."""
    contacts = empty_contacts(footprint.edges, arrays)
    contacts[:] = math.nan
    known = footprint.edges, footprint.circumradius, arrays, reach, contacts
    count, nearest = contact_table(*known)
    return contacts.view(CONTACT)[:count], nearest


@footprints
@pytest.mark.parametrize("reach", [0.0, 0.3, 1.0, math.inf])
def test_pruning_keeps_what_lies_within_reach_and_the_nearest(footprint, reach):
    rng = np.random.default_rng(4)
    for _ in range(20):
        arrays = scene(rng).arrays
        everything, _ = table(footprint, arrays, math.inf)
        kept, nearest = table(footprint, arrays, reach)
        ours, all_of_them = kept["distance"], everything["distance"]
        assert ours[nearest] == all_of_them.min()
        assert_array_equal(kept[ours <= reach], everything[all_of_them <= reach])
        assert clearance_of(PENTAGON, arrays) == (
            table(PENTAGON, arrays, math.inf)[0]["distance"].min()
        )
    assert clearance_of(PENTAGON, Obstacles().arrays) == math.inf


WALLS = {
    "through the middle": (-0.05, -0.4, 0.05, 0.4),
    "through a corner": (0.3, 0.35, 0.8, 0.1),
    "inside": (-0.05, 0.0, 0.05, 0.02),
    "along a side": (-1.0, 0.3, 1.0, 0.3),
    "radial": (1.2, 0.0, 3.0, 0.0),
    "of no length": (0.9, 0.4, 0.9, 0.4),
    "across the needle's tip": (0.6, -0.04, 0.7, 0.04),
}


@footprints
@pytest.mark.parametrize("wall", WALLS.values(), ids=WALLS)
def test_distance_of_a_wall(footprint, wall):
    corners, robot = np.reshape(wall, (2, 2)), robot_of(footprint)
    apart = robot.distance(shape_of(corners)) or -depth(footprint, corners)
    contacts = Contacts.of(footprint, Obstacles(walls=[wall]))
    assert contacts.distance.min() == pytest.approx(apart, abs=1e-9)


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
    known = Obstacles(walls=rng.permutation([*pieces, beside])).capsules
    joined = np.empty_like(known)
    assert capsules.join_walls(known, joined) == 2
    found = [{tuple(row[:2]), tuple(row[2:4])} for row in joined[:2].round(9)]
    for wall in ([*one, *other], beside):
        assert {tuple(np.round(wall[:2], 9)), tuple(np.round(wall[2:], 9))} in found


def test_a_parallel_wall_is_held_at_both_corners():
    """Both ends of the left side get a row: neither can turn into the wall."""
    contacts = Contacts.of(PENTAGON, Obstacles(walls=[[-2, 0.5, 2, 0.5]]))
    near = contacts.distance < 0.21 + 1e-9
    assert sorted(contacts.point[near, 0]) == pytest.approx([-0.445, 0.445])
    assert_allclose(contacts.normal[near], [[0, 1], [0, 1]], atol=1e-12)
