"""The judge of the tests is itself held to the oracles, and to shapely."""

import math

import numpy as np
import pytest
import shapely.affinity
from hypothesis import given
from hypothesis import strategies as st

from driven import driven_to, gap_at, least_of, lines_of, point_gap
from oracles import point_distance, wall_distance
from shapes import convex, places

times = st.floats(0.0, 3.0)


@convex
@given(places, places)
def test_gaps_are_those_of_the_oracles(footprint, one, other):
    corners, rest = footprint.vertices, (0.0, 0.0, 0.0)
    assert point_gap(corners, *one) == pytest.approx(
        point_distance(corners, one), abs=1e-12
    )
    gap = gap_at(corners, rest, lines_of(walls=[[*one, *other]])[0], 0.0)
    expected = wall_distance(corners, [*one, *other])
    if one != other and abs(expected) > 1e-9:
        assert (gap <= 0.0) == (expected < 0.0)
        assert gap <= 0.0 or gap == pytest.approx(expected, abs=1e-12)


@given(places, st.floats(-2, 2), st.floats(-1, 1), st.floats(-2, 2), times)
def test_a_polygon_that_turns_is_where_shapely_turns_it(place, v, omega, turn, time):
    corners = np.array([(0.0, 0.0), (0.5, 0.1), (0.4, 0.5)]) + place
    lines = lines_of(polygons=[corners], motions=[(0.3, -0.2, turn)])
    moved = shapely.affinity.rotate(
        shapely.Polygon(corners), turn * time, "centroid", use_radians=True
    )
    moved = shapely.affinity.translate(moved, 0.3 * time, -0.2 * time)
    robot = np.array([(-0.3, -0.2), (0.4, -0.2), (0.4, 0.3)])
    pose = driven_to((0.1, 0.2, 0.3), v, omega, time)
    placed = shapely.affinity.rotate(
        shapely.Polygon(robot), pose[2], (0.0, 0.0), use_radians=True
    )
    placed = shapely.affinity.translate(placed, pose[0], pose[1])
    apart = placed.distance(moved)
    gap = min(gap_at(robot, pose, line, time) for line in lines)
    if apart > 1e-9:
        assert gap == pytest.approx(apart, abs=1e-9)


@given(places, st.floats(-1, 1), st.floats(-2, 2), places)
def test_the_least_on_the_way_is_that_of_ten_thousand_looks(place, v, omega, velocity):
    corners = np.array([(-0.3, -0.2), (0.4, -0.2), (0.4, 0.3)])
    line = lines_of(discs=[(*place, 0.1)], velocities=[velocity])[0]
    pose, twist = (0.1, -0.2, 0.3), (v, omega)
    looks = [
        gap_at(corners, driven_to(pose, *twist, t), line, 0.5 + t)
        for t in np.linspace(0.0, 0.4, 1001)
    ]
    least = least_of(corners, pose, twist, 0.4, 0.5, line, math.inf)
    within = 1e-7 if min(looks) > 0.0 else 1e-4  # nothing is curved inside
    assert min(looks) - 2e-3 <= least <= min(looks) + within
