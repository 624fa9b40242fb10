"""Polygons in figures."""

import pytest
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.plots import save_figures
from qpavoid.lab.study.scene import draw_run, middles, view_box
from qpavoid.lab.study.style import styles
from scenario_files import CROSSING, SLOW

POLYGONS = """
[[obstacles]]
kind = "polygon"
vertices_m = [[1.2, 0.9], [1.8, 0.9], [1.5, 1.4]]
velocity_mps = [0.05, -0.02]
turn_rate_radps = -0.4
[[obstacles]]
kind = "polygon"
vertices_m = [[0.0, -1.5], [1.0, -1.5], [1.0, -1.0], [0.0, -1.0]]
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory):
    file = tmp_path_factory.mktemp("drawn") / "polygons.toml"
    file.write_text(CROSSING + SLOW + POLYGONS)
    return file


@pytest.fixture(scope="module")
def log(config):
    return run(load_scenario(config), "eq7")


def test_polygons_are_drawn_where_they_are(log, tmp_path):
    box = view_box([log], surroundings=1.0)
    for step in (0, 40):
        axes = Figure().subplots()
        draw_run(axes, log, styles([log])[0], box, step)
        (polygons,) = [x for x in axes.collections if isinstance(x, PolyCollection)]
        drawn = [path.vertices for path in polygons.get_paths()]
        for outline, corners in zip(drawn, log.polygons_at(step), strict=True):
            assert_allclose(outline[: len(corners)], corners)
    assert len(middles(log)) == 1 and middles(log)[0].shape == (len(log), 2)
    assert box[2] < -1.4
    assert len(save_figures([log], tmp_path)) == 4
