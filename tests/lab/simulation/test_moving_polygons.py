"""Convex polygons that move and turn, in every part of the package that meets them."""

import numpy as np
import pytest
import shapely
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid import Log
from qpavoid.errors import ConfigError
from qpavoid.lab.baselines.drive import line_points, wide_discs, wide_lines
from qpavoid.lab.baselines.mppi import Judgement, depth_within
from qpavoid.lab.baselines.orca import by_motion
from qpavoid.lab.planning.grid import Grid
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.capsules import CAPSULE_WIDTH, RADIUS, X1, Y2
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, SAFETY

SCENARIO = """
title = "A cart turns across the way"
duration_s = 4.0
dt_s = 0.05
frames_s = [0.0, 2.0]
[reference]
kind = "cubic"
start = { x_m = 0.0, y_m = 0.0 }
goal = { x_m = 2.5, y_m = 0.3 }
k_m = 2.0
duration_s = 4.0
[[obstacles]]
kind = "disc"
position_m = [3.0, -2.0]
radius_m = 0.1
[[obstacles]]
kind = "polygon"
vertices_m = [[1.6, 0.9], [2.3, 0.9], [2.3, 1.3], [1.6, 1.3]]
velocity_mps = [-0.1, -0.15]
turn_rate_radps = 0.5
[[obstacles]]
kind = "polygon"
vertices_m = [[0.0, -1.5], [1.0, -1.5], [0.5, -0.9]]
"""
BOX = np.array([[1.6, 0.9], [2.3, 0.9], [2.3, 1.3], [1.6, 1.3]])
MOTION = (-0.1, -0.15, 0.5)
CART = Obstacles(polygons=[BOX], polygon_velocities=[MOTION])


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("polygons") / "cart.toml"
    file.write_text(SCENARIO)
    return load_scenario(file)


@pytest.fixture(scope="module")
def log(scenario):
    return run(scenario, "qp-ahead")


def gap(log, step):
    """The distance by shapely, from the log alone."""
    pose = [log[name][step] for name in ("x_m", "y_m", "heading_rad")]
    robot = shapely.Polygon(to_world(log.vertices, pose))
    gaps = [robot.distance(shapely.Polygon(one)) for one in log.polygons_at(step)]
    discs = [
        robot.distance(shapely.Point(x, y)) - r for x, y, r in log.discs[step].tolist()
    ]
    return min(gaps + discs)


# --------------------------------------------------------------------- the scenario
def test_a_polygon_of_a_scenario_moves_and_turns(scenario):
    for time in (0.0, 1.5, 9.0):
        world = scenario.world.at(time)
        assert len(world) == 3 and len(world.discs) == 1
        moved, still = world.polygons
        assert_allclose(moved, CART.moved(time).polygons[0])
        assert_allclose(still[2], (0.5, -0.9))
    assert_allclose(world.polygon_velocities, [MOTION, (0, 0, 0)])


@pytest.mark.parametrize(
    "vertices", ["[[0, 0], [1, 0]]", "[[0, 0], [0, 1], [1, 0]]", "[[0, 0, 0]]"]
)
def test_what_is_no_polygon_is_an_error_of_the_file(tmp_path, vertices):
    file = tmp_path / "wrong.toml"
    file.write_text(
        SCENARIO.replace("[[0.0, -1.5], [1.0, -1.5], [0.5, -0.9]]", vertices)
    )
    with pytest.raises(ConfigError, match=r"obstacles\[2\].*"):
        load_scenario(file)


# ------------------------------------------------------------------------- the runs
def test_the_clearance_of_a_log_is_that_of_shapely(log):
    for step in range(0, len(log), 5):
        if log["clearance_m"][step] > 0:
            assert log["clearance_m"][step] == pytest.approx(gap(log, step), abs=1e-9)
    assert log["obstacle"].max() == 2 and log["least_clearance_m"].min() > 0.05


def test_a_log_keeps_its_polygons(log, tmp_path):
    log.save(tmp_path / "log.npz")
    again = Log.load(tmp_path / "log.npz")
    assert_array_equal(again.corners, log.corners)
    assert [len(one) for one in again.polygons_at(7)] == [4, 3]
    assert_allclose(again.polygons_at(40)[0], CART.moved(2.0).polygons[0])


# ----------------------------------------------------------------------- the filter


def test_a_polygon_that_turns_towards_the_robot_is_moving():
    """At rest in its middle, its near edge comes: the row says how fast."""
    bar = np.array([[0.95, -2.0], [1.05, -2.0], [1.05, 2.0], [0.95, 2.0]])
    turning = Obstacles(polygons=[bar + [0, 2]], polygon_velocities=[(0, 0, -0.3)])
    contacts = Contacts.of(ROBOT.footprint, turning)
    assert np.hypot(*contacts.velocity.T).max() > 0.5
    assert SAFETY.filter(0.0, 0.0, turning).v < 0.0


# ---------------------------------------------------------------------- what is seen


def test_velocities_of_polygons_are_known_where_those_of_discs_are_estimated(tmp_path):
    file = tmp_path / "estimated.toml"
    file.write_text(SCENARIO.replace("[reference]", "[estimation]\n[reference]", 1))
    log = run(load_scenario(file), "qp")
    assert len(log.polygons) == 2 and np.isfinite(log["clearance_m"]).all()


# ------------------------------------------------------------------ grids and detours
def test_a_grid_is_marked_within_a_polygon():
    grid = Grid.around(np.array([[0.0, 0.0], [3.0, 2.0]]), 0.5, 0.1)
    grid.mark(CART, 1.0)
    rows, columns = np.nonzero(grid.seen == 1.0)
    places = grid.places(np.column_stack([rows, columns]))
    solid = shapely.Polygon(BOX)
    assert all(solid.distance(shapely.Point(p)) < 0.08 for p in places)
    assert len(places) >= solid.area / 0.01


# -------------------------------------------------------------------- the baselines
def test_orca_takes_the_disc_round_a_moving_polygon():
    still = Obstacles(points=[[9, 9]], discs=[[5, 5, 1]], polygons=[BOX + 3])
    corners, rest = by_motion(still.joined(CART))
    assert_array_equal(corners[0], BOX + 3)
    wide = wide_discs(rest, SAFETY.settings)
    assert wide.shape == (3, 5)
    x, y, radius, *velocity = wide[2]
    assert_allclose((x, y), BOX.mean(axis=0))
    assert radius > np.hypot(*(BOX - (x, y)).T).max() + 0.17
    assert_allclose(velocity, MOTION[:2])


def test_points_on_edges_have_their_own_velocities():
    points, h = line_points(CART, 0.13), 1e-6
    moved = line_points(CART.moved(h), 0.13)
    assert_allclose((moved[:, :2] - points[:, :2]) / h, points[:, 3:], atol=1e-5)
    edge = shapely.Polygon(BOX).exterior
    assert max(edge.distance(shapely.Point(p)) for p in points[:, :2]) < 1e-12


def test_points_on_walls_hold_both_ends_and_leave_no_gap():
    ends = np.array(
        [(0.1, 0.3, 1.0, 0.3), (0.7, 0.1, 0.7, 0.17), (-2.0, 1.0, 1.0, 5.0)]
    )
    discs = np.array([(1.0, 1.0, 0.2), (3.0, 0.0, 0.1)])
    points = line_points(Obstacles(discs=discs, walls=ends), 0.2)
    assert [*np.round(points[:6, 0], 9)] == [0.1, 0.28, 0.46, 0.64, 0.82, 1.0]
    assert len(points) == 6 + 2 + 26 and not points[:, 2:].any()
    for line, some in zip(ends, np.split(points[:, :2], [6, 8]), strict=True):
        assert (some[0] == line[:2]).all() and (some[-1] == line[2:]).all()
        assert np.ptp(np.hypot(*np.diff(some, axis=0).T)) < 1e-12
    assert line_points(Obstacles(discs=discs)).shape == (0, 5)
    assert len(line_points(Obstacles(walls=[(0.0, 1.0, 1e99, 1.0)]))) == 1000


def test_mppi_sees_polygons_where_they_will_be():
    lines, edges = wide_lines(CART, SAFETY.settings), ROBOT.footprint.edges
    r_min, empty = lines[0, RADIUS], np.empty((0, 5))
    assert 0.17 < r_min <= 0.23 and lines.shape == (4, CAPSULE_WIDTH)
    for time in (0.0, 2.0, 5.0):
        for x in (0.3, 0.9):
            pose = (x, 0.3, 0.2)
            none, still = np.empty(0), np.empty((0, 3))
            known = edges, ROBOT.limit_vector, empty, none, lines, r_min, still
            by = Judgement(*known, (0.0, 0.0), (0.0, 0.0))
            depth = depth_within(by, pose, time)
            there = CART.moved(time).seen_from(pose)
            walls = Obstacles(walls=there.capsules[:, X1 : Y2 + 1])
            gaps = Contacts.of(ROBOT.footprint, walls).distance
            assert depth == pytest.approx(max(0.0, r_min - gaps.min()), abs=1e-9)
