"""Figures say what the logs say, are readable, and leave nothing behind."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image, ImageSequence

from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study import plots
from qpavoid.lab.study.scene import draw_run, middles, styles, view_box
from qpavoid.model.footprint import offset_outline
from qpavoid.model.kinematics import to_world
from scenario_files import CROSSING, SLOW

FIGURES = (plots.frames, plots.paths, plots.poses, plots.twists, plots.distance)


def line(axes, label):
    (found,) = [x for x in axes.get_lines() if x.get_label() == label]
    return found


def patch(axes, label):
    (found,) = [x for x in axes.patches if x.get_label() == label]
    assert isinstance(found, Polygon)
    return found.get_xy()[:-1]  # matplotlib repeats the first corner


def legend_texts(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_frame_shows_what_the_log_says(logs):
    log, step = logs[1], 30
    axes = plots.frames(logs).axes[4]
    here = log["x_m"][step], log["y_m"][step], log["heading_rad"][step]
    contact = [log["contact_x_m"][step], log["contact_y_m"][step]]
    np.testing.assert_array_equal(np.ravel(line(axes, "$P_r$").get_data()), contact)
    target = [log["x_ref_m"][step], log["y_ref_m"][step]]
    np.testing.assert_array_equal(np.ravel(line(axes, "target").get_data()), target)
    place = np.ravel(line(axes, "obstacle").get_data())
    np.testing.assert_allclose(place, [1.3, 0.7 - 0.08 * 1.5], atol=1e-12)
    outline = to_world(log.vertices, here)
    np.testing.assert_array_equal(patch(axes, "footprint"), outline)
    for label, name in (("within $r$", "r_m"), ("within $r_{min}$", "r_min_m")):
        zone = offset_outline(outline, log[name][step])
        np.testing.assert_allclose(patch(axes, label), zone, atol=1e-12)
    planned = line(axes, "planned")
    assert planned.get_linestyle() == "--"
    np.testing.assert_array_equal(planned.get_xdata(), log["x_ref_m"])
    driven = [x for x in axes.get_lines() if x.get_color() == styles(logs)[1].color]
    np.testing.assert_array_equal(driven[0].get_xdata(), log["x_m"][: step + 1])


def test_a_world_without_obstacles_can_be_drawn(worlds, tmp_path):
    figure = plots.distance(worlds["empty"])
    assert legend_texts(figure)[0] == "one-step QP: no obstacle"
    for file in plots.save_figures(worlds["empty"], tmp_path):
        assert file.stat().st_size > 10_000


def test_paths_cross_out_the_first_contact(worlds, logs):
    assert "first contact" not in legend_texts(plots.paths(logs))
    (log,) = worlds["crowd"]
    touched = int(np.argmax(log["least_clearance_m"] < 0.0))
    assert log["least_clearance_m"][touched] < 0.0
    figure = plots.paths([log])
    x, y = np.ravel(line(figure.axes[0], "first contact").get_data())
    assert (x, y) == (log["contact_x_m"][touched], log["contact_y_m"][touched])
    assert figure.axes[0].get_title() == "Eq. 7: touched"


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


def test_polygons_are_drawn_where_they_are(tmp_path):
    (tmp_path / "polygons.toml").write_text(CROSSING + SLOW + POLYGONS)
    log = run(load_scenario(tmp_path / "polygons.toml"), "eq7")
    box = view_box([log], surroundings=1.0)
    for step in (0, 40):
        axes = Figure().subplots()
        draw_run(axes, log, styles([log])[0], box, step)
        (polygons,) = [x for x in axes.collections if isinstance(x, PolyCollection)]
        drawn = [path.vertices for path in polygons.get_paths()]
        for outline, corners in zip(drawn, log.polygons_at(step), strict=True):
            np.testing.assert_allclose(outline[: len(corners)], corners)
    assert len(middles(log)) == 1 and middles(log)[0].shape == (len(log), 2)
    assert box[2] < -1.4


def test_save_figures_names_and_writes_them(logs, tmp_path):
    others = pyplot.get_fignums()  # of examples that ran here before
    named = [replace(log, meta={**log.meta, "scenario": "a/b"}) for log in logs]
    files = plots.save_figures(named, tmp_path / "new")
    kinds = [file.name for file in files]
    assert kinds == [
        f"a-b-{kind}.png" for kind in ("frames", "poses", "twists", "distance")
    ]
    for file in files:
        with Image.open(file) as image:
            assert image.width == 1800
            assert len(image.convert("RGB").getcolors(1 << 24)) > 20
    assert pyplot.get_fignums() == others


def test_a_film_shows_the_robot_move(worlds, tmp_path):
    (log,) = worlds["crowd"]
    *_, file = plots.save_figures([log], tmp_path, film=True)
    with Image.open(file) as film:
        shown = [np.array(x.convert("L")) for x in ImageSequence.Iterator(film)]
    assert file.name.endswith("-film.gif") and len(shown) > 3
    assert (np.diff(shown, axis=0) != 0).any(axis=(1, 2)).all()


@pytest.mark.parametrize("draw", FIGURES)
def test_runs_of_other_scenarios_are_refused(worlds, draw):
    with pytest.raises(InvalidInputError, match="one scenario, not of none"):
        draw([])
    with pytest.raises(InvalidInputError, match="not of crowd, empty"):
        draw([worlds["crowd"][0], worlds["empty"][0]])
