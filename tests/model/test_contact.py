"""Contacts: P_r, normal, distance and J_0 against brute force, differences, CasADi."""

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from oracles import holds_point, point_distance, point_to_segment, sides
from qpavoid.model.contact import approach_row
from qpavoid.model.contacts import (
    CONTACT_WIDTH,
    DISTANCE,
    OBSTACLE,
    Contacts,
    ObstacleContact,
    clearance_of,
    contact_at,
    contact_table,
    empty_contacts,
    nearest_distance,
    set_contact,
)
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from shapes import PENTAGON, footprints, places


def touch(footprint, place, radius=0.0):
    contacts = Contacts.of(footprint, Obstacles(discs=[[*place, radius]]))
    return contacts.point[0], contacts.normal[0], contacts.distance[0]


# ------------------------------------------------------------- points and discs
@footprints
@given(places, st.floats(0, 1))
def test_distance_is_the_least_over_the_boundary(footprint, place, radius):
    _, _, distance = touch(footprint, place, radius)
    expected = point_distance(footprint.vertices, place) - radius
    assert distance == pytest.approx(expected, abs=1e-12)


@footprints
@given(places)
def test_contact_is_consistent(footprint, place):
    """P_r on the boundary, n of unit length, place = P_r + d n, edge holds P_r."""
    contacts = Contacts.of(footprint, Obstacles(points=[place]))
    point, normal = contacts.point[0], contacts.normal[0]
    assert np.hypot(*normal) == pytest.approx(1.0, abs=1e-12)
    assert_allclose(point + contacts.distance[0] * normal, place, atol=1e-12)
    a, b = sides(footprint.vertices)[contacts.segment[0]]
    assert point_to_segment(point, a, b)[0] < 1e-12


@footprints
@given(places)
def test_normal_points_outwards_from_inside_too(footprint, place):
    assume(abs(point_distance(footprint.vertices, place)) > 1e-6)
    point, normal, _ = touch(footprint, place)
    assert not holds_point(footprint.vertices, point + 1e-7 * normal)
    assert holds_point(footprint.vertices, point - 1e-7 * normal) or _at_corner(
        footprint, point
    )


def _at_corner(footprint, point):
    return np.hypot(*(footprint.vertices - point).T).min() < 1e-3


def test_segment_at_a_corner_is_the_one_that_faces_the_obstacle():
    corner = np.array([-0.445, 0.29])
    for degrees, segment in ((100, 3), (130, 3), (140, 4), (170, 4)):
        bearing = math.radians(degrees)
        place = corner + 0.2 * np.array([math.cos(bearing), math.sin(bearing)])
        contacts = Contacts.of(PENTAGON, Obstacles(points=[place]))
        assert_allclose(contacts.point[0], corner)
        assert contacts.segment[0] == segment


@footprints
def test_on_the_boundary_the_distance_is_zero(footprint):
    for index, (a, b) in enumerate(sides(footprint.vertices)):
        for share in (0.0, 0.3, 1.0):
            place = a + share * (b - a)
            point, normal, distance = touch(footprint, place)
            assert distance == pytest.approx(0.0, abs=1e-12)
            assert_allclose(point, place, atol=1e-12)
            assert np.hypot(*normal) == pytest.approx(1.0)
            if share == 0.3:
                assert_allclose(normal, footprint.edges[index, 2:4], atol=1e-12)


@footprints
@given(places, st.floats(0, 0.3))
@example((-0.445, 0.5), 0.0)
@example((1.0, 0.0), 0.1)
def test_gradient_of_the_distance_is_the_normal(footprint, place, radius):
    """Differences over the obstacle's position, outside; corners included."""
    assume(point_distance(footprint.vertices, place) > 0.02)
    h = 1e-6
    gradient = [
        (
            touch(footprint, np.add(place, step), radius)[2]
            - touch(footprint, np.subtract(place, step), radius)[2]
        )
        / (2 * h)
        for step in ((h, 0), (0, h))
    ]
    assert_allclose(gradient, touch(footprint, place, radius)[1], atol=1e-4)


# ----------------------------------------------------------------- J_0 and rows
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
            in_world, in_robot = (
                np.array(m) for m in oracle([x, y, heading], [p_x, p_y])
            )
            assert_allclose(j_0, in_robot, atol=1e-14)
            c, s = math.cos(heading), math.sin(heading)
            printed = [[c, -p_y * c - p_x * s], [s, p_x * c - p_y * s]]
            assert_allclose(in_world, printed, atol=1e-14)
            assert_allclose(np.array([[c, -s], [s, c]]) @ j_0, printed, atol=1e-14)
            assert np.linalg.det(j_0) == pytest.approx(p_x, abs=1e-14)


@footprints
@given(places, st.floats(-1, 1), st.floats(-1.5, 1.5))
def test_row_is_the_rate_of_the_distance(footprint, place, v, omega):
    """The robot drives arc(±h), the obstacle stands: d/dt d = d̂ᵀJ_0 u."""
    assume(point_distance(footprint.vertices, place) > 0.02)
    world, h = Obstacles(points=[place]), 1e-6

    def distance(time):
        pose = arc(0.0, 0.0, 0.0, v, omega, time)
        return Contacts.of(footprint, world.seen_from(pose)).distance[0]

    contacts = Contacts.of(footprint, world)
    row = approach_row(*contacts.point[0], *contacts.normal[0])
    rate = (distance(h) - distance(-h)) / (2 * h)
    assert row @ np.array([v, omega]) == pytest.approx(rate, abs=2e-4)
    assert_allclose(row, -contacts.normal[0] @ contacts.jacobian[0], atol=1e-15)


@given(places, st.tuples(st.floats(-2, 2), st.floats(-2, 2)))
def test_rate_with_a_moving_disc(place, velocity):
    """ḋ = d̂ᵀ(J_0 u − v_o), here with u ≠ 0 and the disc moving over ground."""
    assume(point_distance(PENTAGON.vertices, place) > 0.3)
    h, u = 1e-6, (0.4, -0.9)

    def contacts(time):
        disc = [[*np.add(place, time * np.array(velocity)), 0.1]]
        world = Obstacles(discs=disc, disc_velocities=[velocity])
        seen = world.seen_from(arc(0.0, 0.0, 0.0, *u, time))
        return Contacts.of(PENTAGON, seen)

    now = contacts(0.0)
    rate = (contacts(h).distance[0] - contacts(-h).distance[0]) / (2 * h)
    relative = now.jacobian[0] @ u - now.velocity[0]
    assert -now.normal[0] @ relative == pytest.approx(rate, abs=1e-4)


# ------------------------------------------------------------------ many at once
def scene(rng, size=40):
    return {
        "points": rng.uniform(-4, 4, (size, 2)),
        "discs": np.abs(rng.normal(size=(size, 3))) * [3, 3, 0.2],
        "disc_velocities": rng.normal(size=(size, 2)),
        "walls": rng.uniform(-4, 4, (size // 4, 4)),
    }


def table(footprint, arrays, reach):
    """Contacts within reach, and the row of the nearest."""
    contacts = empty_contacts(footprint.edges, arrays)
    contacts[:] = math.nan
    known = footprint.edges, footprint.circumradius, arrays, reach, contacts
    count, nearest = contact_table(*known)
    return contacts[:count], nearest


def test_one_obstacle_at_a_time_gives_the_same():
    points, discs, velocities, walls = scene(np.random.default_rng(5)).values()
    together = Contacts.of(PENTAGON, Obstacles(points, discs, velocities, walls))
    for i, place in enumerate(points):
        alone = Contacts.of(PENTAGON, Obstacles(points=[place]))
        assert_allclose(together.point[together.obstacle == i], alone.point)
    for i, disc in enumerate(discs, start=len(points)):
        alone = Contacts.of(PENTAGON, Obstacles(discs=[disc]))
        ours = together.obstacle == i
        assert_allclose(together.distance[ours], alone.distance)
        assert_allclose(together.velocity[ours], [velocities[i - len(points)]])


def test_of_equally_near_obstacles_the_first_is_the_nearest():
    places = np.array([[2.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert table(PENTAGON, Obstacles(places).arrays, 9.0)[1] == 1


def test_a_row_of_the_table_reads_as_it_was_written():
    row = ObstacleContact(0.1, 0.2, 0.6, 0.8, 0.5, -1.0, -2.0, 7, 3)
    contacts = np.full((2, CONTACT_WIDTH), math.nan)
    set_contact(contacts, 1, row)
    assert contact_at(contacts, 1) == row and contacts[1].tolist() == [*row]
    assert nearest_distance(contacts, 1) == 0.5 and contacts[1, OBSTACLE] == 7
    assert nearest_distance(contacts, -1) == math.inf


def test_the_clearance_is_the_least_distance():
    arrays = Obstacles(**scene(np.random.default_rng(6))).arrays
    everything, _ = table(PENTAGON, arrays, math.inf)
    assert clearance_of(PENTAGON, arrays) == everything[:, DISTANCE].min()
    assert clearance_of(PENTAGON, Obstacles().arrays) == math.inf
