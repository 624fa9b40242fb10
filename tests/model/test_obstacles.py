"""Obstacle arrays: what they accept, refuse, number, and how frames change."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import OWNER, PIVOT_X, PIVOT_Y
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from shapes import every_kind

SQUARE = Footprint.rectangle(2.0, 2.0)


def test_empty_means_none():
    for nothing in ([], (), np.empty((0, 2)), np.empty(0)):
        assert len(Obstacles(points=nothing)) == 0
    assert len(Obstacles()) == 0
    assert len(Contacts.of(SQUARE, Obstacles())) == 0
    assert Contacts.of(SQUARE, Obstacles()).jacobian.shape == (0, 2, 2)


def test_points_come_first_then_discs_walls_and_polygons():
    obstacles = Obstacles(
        points=[[3, 0], [4, 0]],
        discs=[[0, 3, 1]],
        walls=[[-9, -3, 9, -3]],
        polygons=[[[-7, 0], [-6, 0], [-6, 1]], [[0, 8], [1, 8], [1, 9]]],
    )
    assert len(obstacles) == 6
    contacts = Contacts.of(SQUARE, obstacles)
    for number, distance in enumerate([2.0, 3.0, 1.0, 2.0, 5.0, 7.0]):
        of_one = contacts.distance[contacts.obstacle == number]
        assert of_one.min() == pytest.approx(distance)


NAMES = ["points", "discs", "disc_velocities", "walls", "wall_velocities"]
NAMES += ["polygons", "polygon_velocities"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    "value",
    [[1.0, 2.0, 3.0, 4.0, 5.0], [[1.0]], [[[1.0, 2.0]]], 7.0, "text", None]
    + [[[1, 2], [3]], [["a", "b"]], {"x": 1}, [[]], np.zeros((2, 5))],
    ids=str,
)
def test_wrong_shapes_are_refused_by_name(name, value):
    with pytest.raises(InvalidInputError, match=name):
        Obstacles(**{name: value})


WIDTHS = {"points": 2, "discs": 3, "disc_velocities": 2, "walls": 4}
NOT_REAL = {
    "masked": np.ma.array,
    "masked rows": lambda rows: [np.ma.array(row) for row in rows.tolist()],
    "complex": lambda rows: rows + 0j,
    "text": lambda rows: rows.astype(str),
    "bytes": lambda rows: rows.astype(bytes),
    "objects": lambda rows: np.full(rows.shape, object()),
    "truth values as objects": lambda rows: (rows > 0).astype(object),
    "too large": lambda rows: (rows.astype(int).astype(object) * 10**400).tolist(),
    "truth values": lambda rows: rows > 0,
    "dates": lambda rows: rows.astype(int).astype("datetime64[s]"),
    "spans": lambda rows: rows.astype(int).astype("timedelta64[s]"),
    "None": lambda rows: [[None, *row[1:]] for row in rows.tolist()],
}


@pytest.mark.parametrize("name", [*WIDTHS, "polygons[0]"])
@pytest.mark.parametrize("make", NOT_REAL.values(), ids=NOT_REAL)
def test_what_is_no_real_number_is_refused_by_name(name, make):
    rows = make(np.ones((3, WIDTHS.get(name, 2))))
    given = {name: rows} if name in WIDTHS else {"polygons": [rows]}
    with pytest.raises(InvalidInputError, match=name.replace("[", r"\[")):
        Obstacles(**given)


def test_real_numbers_of_any_kind_are_taken():
    for kind in (np.int8, np.uint64, np.float32, np.longdouble, object):
        rows = np.array([[3, 4]], dtype=kind)
        assert_array_equal(Obstacles(points=rows).points, [[3.0, 4.0]])
    assert_array_equal(Obstacles(points=[(3, 4.0)]).points, [[3.0, 4.0]])
    frozen = np.asfortranarray(np.ones((4, 2)))
    frozen.setflags(write=False)
    assert Obstacles(points=frozen).points.flags.carray


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("name", "columns"), [("points", 2), ("discs", 3), ("walls", 4)]
)
def test_rows_that_are_not_finite_are_named(name, columns, bad):
    for column in range(columns):
        rows = np.ones((3, columns))
        rows[2, column] = bad
        with pytest.raises(InvalidInputError, match=rf"{name}\[2\]"):
            Obstacles(**{name: rows})


def test_velocities_are_checked():
    disc = [[3.0, 0.0, 0.5]]
    with pytest.raises(InvalidInputError, match="disc_velocities"):
        Obstacles(discs=disc, disc_velocities=[[0.1, 0.0], [0.2, 0.0]])
    with pytest.raises(InvalidInputError, match="disc_velocities"):
        Obstacles(disc_velocities=[[0.1, 0.0]])
    with pytest.raises(InvalidInputError, match=r"disc_velocities\[0\]"):
        Obstacles(discs=disc, disc_velocities=[[math.nan, 0.0]])
    assert_array_equal(Obstacles(discs=disc).disc_velocities, [[0.0, 0.0]])


def test_sigmas_belong_to_the_velocities_of_discs():
    given = {"discs": [[3.0, 0.0, 0.5]] * 2, "disc_velocities": [[1.0, 0.0]] * 2}
    made = Obstacles([[1.0, 1.0]], **given, disc_sigmas=[0.1, 0.2])
    for seen in (made, made.seen_from((1.0, 2.0, 0.5), 0.3), made.as_discs):
        assert_array_equal(seen.disc_sigmas, [0.1, 0.2])
    assert_array_equal(Obstacles(**given).disc_sigmas, [0.0, 0.0])
    for wrong in ([0.1], [0.1, -0.1], [0.1, math.nan], ["a", "b"], [0.1] * 3):
        with pytest.raises(InvalidInputError, match="disc_sigmas"):
            Obstacles(**given, disc_sigmas=wrong)


def test_negative_radii_are_refused_and_zero_is_a_point():
    with pytest.raises(InvalidInputError, match=r"discs\[1\].*-0\.1"):
        Obstacles(discs=[[3, 0, 0.1], [3, 0, -0.1]])
    disc = Contacts.of(SQUARE, Obstacles(discs=[[3, 0.5, 0.0]]))
    point = Contacts.of(SQUARE, Obstacles(points=[[3, 0.5]]))
    assert_array_equal(disc.point, point.point)
    assert disc.distance == point.distance


@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-7, 7)),
    st.integers(0, 2**32 - 1),
)
def test_seen_from_a_pose(pose, seed):
    """Oracle: complex numbers; radii and turns stay."""
    world = Obstacles(**every_kind(np.random.default_rng(seed)))
    seen, turn = world.seen_from(pose), np.exp(-1j * pose[2])
    places = [(seen.points, world.points)]
    places += zip(seen.polygons, world.polygons, strict=True)
    table, known = seen.capsules, world.capsules
    for x, y in ((0, 1), (2, 3), (PIVOT_X, PIVOT_Y)):
        places.append((table[:, [x, y]], known[:, [x, y]]))
    for found, known_rows in places:
        expected = (known_rows @ [1, 1j] - complex(*pose[:2])) * turn
        assert_allclose(found @ [1, 1j], expected, atol=1e-12)
    for name in ("disc_velocities", "wall_velocities", "polygon_velocities"):
        found, before = getattr(seen, name), getattr(world, name)
        expected = before[:, :2] @ [1, 1j] * turn
        assert_allclose(found[:, :2] @ [1, 1j], expected, atol=1e-12)
        assert_array_equal(found[:, 2:], before[:, 2:])
    assert_array_equal(seen.discs[:, 2], world.discs[:, 2])
    assert_array_equal(table[:, OWNER], known[:, OWNER])
