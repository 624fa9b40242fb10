"""Footprints: the tip, Eq. 8, presets, parts of a polygon, and faults."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from qpavoid.errors import InvalidInputError
from qpavoid.model.footprint import Footprint, offset_outline, why_not_simple
from qpavoid.model.robot import Limits, Robot
from shapes import PENTAGON, UNIONS

L, D = 0.890, 0.580
ALPHA = math.radians(40.0)
SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1)]


def test_tip_of_the_paper():
    """The numbers of section 2: apex at 0.688 m, normal (cos 40°, sin 40°)."""
    footprint = Footprint.pentagon(L, D, ALPHA)
    assert len(footprint.vertices) == len(footprint.edges) == 5
    apex = footprint.vertices[np.argmax(footprint.vertices[:, 0])]
    assert apex == pytest.approx((0.688, 0.0), abs=5e-4)
    corners = {(-0.445, -0.29), (0.445, -0.29), (0.445, 0.29), (-0.445, 0.29)}
    others = {tuple(np.round(v, 9)) for v in footprint.vertices if v[1] != 0.0}
    assert others == corners


@pytest.mark.parametrize("corner", [2, 5, 16])
def test_an_outline_at_a_distance_has_it_everywhere(corner):
    vertices = Footprint.pentagon(L, D, ALPHA).vertices
    shape = shapely.Polygon(vertices)
    outline = offset_outline(vertices, 0.2, corner)
    assert outline.shape == (5 * corner, 2)
    assert_allclose(shapely.distance(shape, shapely.points(outline)), 0.2)
    whole = shape.buffer(0.2, 256)
    assert shapely.Polygon(outline).area <= whole.area
    assert shapely.Polygon(outline).area >= whole.area * (1.0 - 0.2 / corner**2)


@given(st.integers(3, 12), st.floats(0, 6.28), st.floats(0.1, 5), st.floats(-1, 1))
def test_edges_describe_the_polygon(corners, start, radius, offset):
    angles = start + 2 * math.pi * np.arange(corners) / corners
    vertices = radius * np.column_stack([np.cos(angles), np.sin(angles)]) + offset
    footprint = Footprint.polygon(vertices)
    a, n, length = (
        footprint.edges[:, :2],
        footprint.edges[:, 2:4],
        footprint.edges[:, 4],
    )
    tangent = np.column_stack([-n[:, 1], n[:, 0]])
    ends = a + length[:, None] * tangent
    assert_allclose(a, vertices)
    assert_allclose(ends, np.roll(vertices, -1, axis=0), atol=1e-12)
    assert_allclose(np.hypot(*n.T), 1.0)
    assert (n * (a - vertices.mean(axis=0))).sum(axis=1).min() > 0
    assert footprint.circumradius == pytest.approx(np.hypot(*vertices.T).max())


@pytest.mark.parametrize("degrees", [33.0, 33.09, 10.0, 0.0, -40.0])
def test_eq_8_names_the_least_angle(degrees):
    with pytest.raises(InvalidInputError, match=r"Eq\. 8.*33\.09 deg"):
        Footprint.pentagon(L, D, math.radians(degrees))


def test_eq_8_is_strict_and_just_above_is_fine():
    with pytest.raises(InvalidInputError, match="Eq. 8"):
        Footprint.pentagon(L, D, math.atan(D / L))
    assert len(Footprint.pentagon(L, D, math.atan(D / L) + 1e-6).vertices) == 5


@given(st.floats(0.2, 2.0), st.floats(0.2, 2.0), st.floats(0.01, 0.99))
def test_eq_8_is_what_makes_the_turn_right(length, width, share):
    """Under Eq. 8 the lever is positive on the whole left tip edge; by sampling."""
    least = math.atan(width / length)
    angle = least + share * (math.pi / 2 - least)
    footprint = Footprint.pentagon(length, width, angle)
    edge = footprint.edges[2]
    assert edge[2:4] == pytest.approx((math.cos(angle), math.sin(angle)))
    along = np.linspace(0, edge[4], 50)[:, None] * [-edge[3], edge[2]]
    p_x, p_y = (edge[:2] + along).T
    assert (p_y * math.cos(angle) - p_x * math.sin(angle)).max() < 0


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf])
def test_sizes_are_positive(size):
    for build in (
        lambda: Footprint.rectangle(size, 1.0),
        lambda: Footprint.rectangle(1.0, size),
        lambda: Footprint.pentagon(size, 0.5, 1.0),
        lambda: Footprint.pentagon(1.0, size, 1.0),
    ):
        with pytest.raises(InvalidInputError, match="must be positive"):
            build()


@pytest.mark.parametrize(
    ("vertices", "said"),
    [
        (SQUARE[::-1], "clockwise"),
        ([(-1, -1), (-1, 1), (0, 1), (1, 1), (1, -1)], "clockwise"),
        ([(0, 0), (0, 2), (0.5, 0.5), (2, 0)], "clockwise"),
        ([(0, 0), (1, 0), (2, 0)], "on a side"),
        ([*SQUARE, SQUARE[-1]], "repeat a corner"),
        ([(0, 0), (2, 0), (1, 0), (0, 2)], "crosses or touches itself"),
        ([(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)], "crosses or touches itself"),
        ([(0, 0), (2, 2), (2, 0), (0, 2)], "crosses or touches itself"),
        (SQUARE * 2, "crosses or touches itself"),
        ([(0, 0), (1, 0)], "n >= 3"),
        ([(0, 0), (1, 0), (math.nan, 1)], "finite"),
        ([(0, 0), (1, 0), (math.inf, 1)], "finite"),
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], r"not \(3, 3\)"),
        ([1.0, 2.0, 3.0], r"not \(3,\)"),
        ([(0, 0), (1,), (1, 1)], "must be numbers"),
        ([("a", "b"), ("c", "d"), ("e", "f")], "must be numbers"),
    ],
)
def test_what_is_wrong_with_corners_is_said(vertices, said):
    with pytest.raises(InvalidInputError, match=said):
        Footprint.polygon(vertices)


@given(st.integers(0, 2**32 - 1))
def test_parts_are_convex_and_make_up_the_polygon(seed):
    """Rings about the origin with random radii, and combs, turned by any angle."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 14))
    angles = 2 * math.pi * (np.arange(n) + rng.uniform(0, 0.8, n)) / n
    corners = np.exp(1j * angles) * rng.uniform(0.2, 1.0, n)
    if rng.random() < 0.5:
        x, y = np.arange(2 * n), np.where(np.arange(2 * n) % 2, 1.0, rng.integers(2, 9))
        corners = np.append(x[::-1] + 1j * y, [-1, 2 * n - 1j])
    corners = corners * np.exp(1j * rng.choice([0.0, rng.uniform(0, 7)]))
    vertices = np.column_stack([corners.real, corners.imag])
    assume(not why_not_simple(vertices))
    footprint = Footprint.polygon(vertices)
    shapes = [shapely.Polygon(part) for part in footprint.parts]
    whole = shapely.Polygon(footprint.vertices)
    assert sum(x.area for x in shapes) == pytest.approx(whole.area)
    assert all(x.equals(x.convex_hull) for x in map(shapely.normalize, shapes))
    assert shapely.union_all(shapes).symmetric_difference(whole).area < 1e-12
    sides = np.roll(corners, -1) - corners
    reflex = int(((np.roll(sides, 1).conj() * sides).imag < 0).sum())
    assert len(shapes) <= 2 * reflex + 1
    inside = whole.contains(shapely.Point(0, 0))
    assert (footprint.inner_radius > 0) <= inside
    assert (
        footprint.inner_radius <= whole.exterior.distance(shapely.Point(0, 0)) + 1e-12
    )


def test_few_parts_of_the_published_shapes():
    assert [len(one.parts) for one in UNIONS.values()] == [2, 4, 3]
    tee = [(0.3, 1), (-0.3, 1), (-0.3, -1), (0.3, -1), (0.3, -0.2), (1.5, -0.2)]
    assert len(Footprint.polygon([*tee, (1.5, 0.2), (0.3, 0.2)]).parts) == 2
    apart = Footprint.union([PENTAGON, SQUARE])
    assert [len(x) for x in apart.outlines] == [5, 4] and len(apart.vertices) == 9
    assert apart.inner_radius == 1.0 and PENTAGON.inner_radius == 0.29
    for wrong, said in (([], "one polygon or more"), (5, "takes several polygons")):
        with pytest.raises(InvalidInputError, match=said):
            Footprint.union(wrong)


def test_parts_without_a_width_are_left_out():
    """Corners 1 km away, a nanometre off a straight line."""
    footprint = Footprint.polygon(
        [
            (1000.6666666667938, 1000.0000000001829),
            (1000.8333333332558, 1000.0000000000057),
            (1000.8333333334349, 1000.1666666665693),
            (1000.833333333428, 1000.4999999999404),
            (1000.6666666665346, 1000.5000000000763),
            (1000.4999999999263, 1000.4999999998898),
            (1000.0000000000998, 1000.5000000000947),
            (1000.1666666667132, 1000.3333333332924),
            (1000.3333333335488, 1000.166666666869),
            (1000.166666666637, 999.999999999837),
        ]
    )
    assert [len(part) for part in footprint.parts] == [7, 3]
    assert np.isfinite(footprint.edges).all()


def test_a_footprint_cannot_be_changed():
    vertices = np.array(SQUARE, dtype=float)
    footprint = Footprint.polygon(vertices)
    vertices[0] = 9.0
    assert footprint.vertices[0] == pytest.approx((-1, -1))
    for array in (footprint.vertices, footprint.edges):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0
    with pytest.raises(AttributeError):
        footprint.vertices = vertices


def test_presets():
    paper, jackal = Robot.mir100(), Robot.jackal()
    assert_allclose(paper.footprint.vertices, Footprint.pentagon(L, D, ALPHA).vertices)
    assert paper.limits == Limits(-1.0, 1.0, -1.5, 1.5)
    rectangle = Robot.mir100_rectangle().footprint.vertices
    assert_allclose(np.abs(rectangle), [[0.445, 0.29]] * 4)
    assert_allclose(np.abs(jackal.footprint.vertices), [[0.254, 0.215]] * 4)
    with pytest.raises(InvalidInputError, match="Eq. 8"):
        Robot.mir100(tip_angle=0.5)
