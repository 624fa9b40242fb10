"""The one table of obstacles: polygons, motion, and what it tells of them."""

import math

import numpy as np
import pytest
import shapely
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import (
    OWNER,
    PIVOT_X,
    PIVOT_Y,
    TURN,
    capsule_at,
    greatest_speed,
    speed_bound,
)
from qpavoid.model.obstacles import NO_CAPSULES, Obstacles
from shapes import every_kind

TRIANGLE = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]])


@pytest.mark.parametrize("wrong", [TRIANGLE[::-1], [[0, 0], [1, 0]], []])
def test_what_is_no_convex_polygon_is_refused_by_name(wrong):
    """More kinds of these: of footprints, by the same function."""
    with pytest.raises(InvalidInputError, match=r"polygons\[1\]"):
        Obstacles(polygons=[TRIANGLE, wrong, TRIANGLE])


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_polygons_must_be_finite(bad):
    corners = TRIANGLE.copy()
    corners[1, 0] = bad
    with pytest.raises(InvalidInputError, match=r"polygons\[0\]\[1\].*finite"):
        Obstacles(polygons=[corners])
    with pytest.raises(InvalidInputError, match=r"polygon_velocities\[0\].*finite"):
        Obstacles(polygons=[TRIANGLE], polygon_velocities=[[0, 0, bad]])
    with pytest.raises(InvalidInputError, match="polygon_velocities has 1"):
        Obstacles(polygons=[TRIANGLE] * 2, polygon_velocities=[[0, 0, 1]])


def test_what_was_given_is_told_again():
    given = every_kind(np.random.default_rng(1))
    obstacles = Obstacles(**given)
    assert len(obstacles) == 10 and len(obstacles.capsules) == 18
    for name, value in given.items():
        told = getattr(obstacles, name)
        for one, other in zip(told, value, strict=True):
            assert_array_equal(one, other)
    assert_array_equal(obstacles.lines[:2], given["walls"])
    assert len(obstacles.lines) == 16


def test_the_pivot_of_a_polygon_is_the_centroid_of_its_area():
    given = every_kind(np.random.default_rng(2))
    obstacles = Obstacles(**given)
    for chain, corners in zip(obstacles.chains[4:], given["polygons"], strict=True):
        middle = shapely.Polygon(corners).centroid
        assert_allclose(
            chain[:, [PIVOT_X, PIVOT_Y]] - [middle.x, middle.y], 0, atol=1e-12
        )
    at = obstacles.capsules[:4, [PIVOT_X, PIVOT_Y]]
    walls = given["walls"].reshape(-1, 2, 2).mean(axis=1)
    assert_allclose(at, np.vstack([given["discs"][:, :2], walls]))


@pytest.mark.parametrize("time", [0.0, 0.7, -2.0])
def test_obstacles_move_and_turn(time):
    """Oracle: complex numbers."""
    given = every_kind(np.random.default_rng(3))
    world = Obstacles(**given)
    moved = world.moved(time)
    for name in ("disc", "wall"):
        on = time * given[f"{name}_velocities"]
        before, after = given[f"{name}s"], getattr(moved, f"{name}s")
        assert_allclose(after[:, :2], before[:, :2] + on)
    assert_allclose(moved.walls[:, 2:], given["walls"][:, 2:] + on)
    motions = zip(given["polygons"], given["polygon_velocities"], strict=True)
    for after, (corners, (v_x, v_y, turn)) in zip(moved.polygons, motions, strict=True):
        middle = shapely.Polygon(corners).centroid
        pivot = complex(middle.x, middle.y)
        arm = (corners @ [1, 1j] - pivot) * np.exp(1j * turn * time)
        assert_allclose(after @ [1, 1j], pivot + complex(v_x, v_y) * time + arm)
    assert_allclose(moved.polygon_velocities, given["polygon_velocities"])
    again = moved.moved(-time)
    assert_allclose(again.capsules, world.capsules, atol=1e-12)
    for i, row in enumerate(world.capsules):
        ends = np.array(capsule_at(world.capsules, i, time))
        assert_allclose(ends, moved.capsules[i, :4], atol=1e-12)
        assert row[TURN] == moved.capsules[i, TURN]


def test_no_point_is_faster_than_the_bound():
    world = Obstacles(**every_kind(np.random.default_rng(4)))
    h = 1e-6
    later, bounds = world.moved(h).capsules, []
    for i, row in enumerate(world.capsules):
        ends = (later[i, :4] - row[:4]).reshape(2, 2) / h
        bounds.append(speed_bound(world.capsules, i))
        fastest = np.hypot(*ends.T).max()
        assert fastest <= bounds[-1] + 1e-6
        assert row[TURN] != 0.0 or fastest == pytest.approx(bounds[-1], rel=1e-6)
    assert greatest_speed(world.capsules) == max(bounds)
    assert greatest_speed(NO_CAPSULES) == 0.0


def test_discs_round_everything():
    world = Obstacles(**every_kind(np.random.default_rng(5)))
    discs = world.as_discs
    assert len(discs) == len(world) and len(discs.capsules) == 7
    assert_array_equal(discs.discs[:2], world.discs)
    assert_allclose(discs.disc_velocities[4:], world.polygon_velocities[:, :2])
    for (x, y, radius), corners in zip(discs.discs[4:], world.polygons, strict=True):
        assert np.hypot(*(corners - [x, y]).T).max() == pytest.approx(radius)
    assert len(Obstacles().as_discs) == 0


def test_within_keeps_what_is_near_and_what_is_round_the_robot():
    world = Obstacles(
        points=[[1, 0], [3, 0]],
        discs=[[3, 0, 1.5], [5, 0, 1]],
        walls=[[-5, 1, 5, 1], [-5, 9, 5, 9]],
        polygons=[5 * TRIANGLE + 4, 9 * TRIANGLE - 3.5, TRIANGLE - [0.5, 3]],
    )
    near = world.within(2.0)
    assert_array_equal(near.points, [[1, 0]])
    assert_array_equal(near.discs, [[3, 0, 1.5]])
    assert_array_equal(near.walls, [[-5, 1, 5, 1]])
    assert [len(one) for one in near.polygons] == [3]
    assert_allclose(near.polygons[0], 9 * TRIANGLE - 3.5)
    assert len(Obstacles(polygons=[40 * TRIANGLE - 9]).within(2.0)) == 1
    assert_array_equal(near.capsules[:, OWNER], [1, 2, 3, 3, 3])
    assert len(near.chosen(near.capsules[:, TURN] != 0.0)) == 1


def test_tables_are_joined_and_numbered_anew():
    rng = np.random.default_rng(6)
    one, other = Obstacles(**every_kind(rng)), Obstacles(**every_kind(rng))
    both = one.joined(other)
    assert len(both) == len(one) + len(other) - len(other.points)
    assert_array_equal(both.polygons[4], other.polygons[1])
    assert_array_equal(np.unique(both.capsules[:, OWNER]), np.arange(3, 17))
    assert len(Obstacles().joined(Obstacles())) == 0
    single = Obstacles(discs=[[1, 2, 3]])
    assert len(single.joined(single)) == 2


def test_speeds_are_those_of_whole_obstacles():
    world = Obstacles(**every_kind(np.random.default_rng(7)))
    for i, speed in enumerate(world.speeds):
        owner = world.capsules[:, OWNER] == world.capsules[i, OWNER]
        bounds = [speed_bound(world.capsules, j) for j in np.flatnonzero(owner)]
        assert speed == pytest.approx(max(bounds))
    assert len(Obstacles().speeds) == 0
