"""Convex polygons that move and turn, in every part of the package that meets them."""

import numpy as np
import pytest
import shapely
from numpy.testing import assert_allclose, assert_array_equal

from qpavoid import Log
from qpavoid.errors import ConfigError
from qpavoid.lab.planning.grid import Grid
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles

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


def test_a_grid_is_marked_within_a_polygon():
    grid = Grid.around(np.array([[0.0, 0.0], [3.0, 2.0]]), 0.5, 0.1)
    grid.mark(CART, 1.0)
    rows, columns = np.nonzero(grid.seen == 1.0)
    places = grid.places(np.column_stack([rows, columns]))
    solid = shapely.Polygon(BOX)
    assert all(solid.distance(shapely.Point(p)) < 0.08 for p in places)
    assert len(places) >= solid.area / 0.01
