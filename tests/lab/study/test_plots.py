"""Figures say what the logs say, are readable, and leave nothing behind."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from qpavoid.errors import InvalidInputError
from qpavoid.lab.study import plots
from qpavoid.lab.study.metrics import metrics
from qpavoid.lab.study.scene import decisive_step, view_box
from qpavoid.lab.study.style import SOLID, styles
from qpavoid.model.contact import point_contact
from qpavoid.model.footprint import Footprint, offset_outline
from qpavoid.model.kinematics import to_world

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


def test_zone_outline_is_everywhere_at_its_distance(robot):
    edges = robot.footprint.edges
    outline = offset_outline(robot.footprint.vertices, 0.2)
    closed = np.vstack([outline, outline[:1]])
    assert np.hypot(*np.diff(closed, axis=0).T).max() < 1.0
    distances = [point_contact(edges, x, y).distance for x, y in outline]
    np.testing.assert_allclose(distances, 0.2, atol=1e-12)


def test_placed_turns_left_and_shifts():
    moved = to_world(np.array([[1.0, 0.0]]), (2.0, 3.0, np.pi / 2))
    np.testing.assert_allclose(moved, [[2.0, 4.0]], atol=1e-15)


def test_frames_have_a_row_a_method_and_a_column_a_time(logs):
    figure = plots.frames(logs)
    assert len(figure.axes) == 9
    titles = [axes.get_title() for axes in figure.axes[:3]]
    assert titles == ["t = 0.0 s", "t = 1.5 s", "t = 3.0 s"]
    sides = [axes.get_ylabel() for axes in figure.axes[::3]]
    assert sides == ["Eq. 5\ny (m)", "Eq. 7\ny (m)", "one-step QP\ny (m)"]
    assert {axes.get_xlabel() for axes in figure.axes[6:]} == {"x (m)"}
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}) == 1
    assert {axes.get_aspect() for axes in figure.axes} == {1.0}


def test_many_frames_stand_the_other_way_round(logs):
    figure = plots.frames(logs, times=[0.0, 1.0, 1.5, 2.0, 3.0])
    titles = [axes.get_title() for axes in figure.axes[:3]]
    assert titles == ["Eq. 5", "Eq. 7", "one-step QP"]
    assert figure.axes[3].get_ylabel() == "t = 1.0 s\ny (m)"
    target = line(figure.axes[4], "target")  # second row, second column
    assert target.get_xdata() == pytest.approx(logs[1]["x_ref_m"][20])


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


def test_contact_marker_lies_on_the_footprint(logs):
    for axes in plots.frames(logs).axes:
        edges = Footprint(patch(axes, "footprint")).edges
        x, y = np.ravel(line(axes, "$P_r$").get_data())
        assert point_contact(edges, x, y).distance == pytest.approx(0.0, abs=1e-9)


def test_discs_are_drawn_to_scale(worlds):
    log = replace(worlds["fast"][0], walls=np.empty((0, 4)))
    figure = plots.frames([log], times=[1.0])
    figure.set_dpi(200)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (axes,) = figure.axes
    x, y = np.rint(axes.bbox.get_points()).astype(int).T
    inside = np.asarray(canvas.buffer_rgba())[::-1][slice(*y), slice(*x), :3]
    pixels = (inside == int(SOLID[1:3], 16)).all(axis=-1).sum()
    per_metre = axes.bbox.width / np.ptp(axes.get_xlim())
    assert pixels / per_metre**2 == pytest.approx(np.pi * 0.1**2, rel=0.1)


def test_frame_times_come_from_the_interaction(logs, worlds):
    assert plots.frame_times(logs) == [0.0, 1.5, 3.0]
    unnamed = [replace(log, meta={**log.meta, "frames_s": []}) for log in logs]
    times = plots.frame_times(unnamed)
    entries = [metrics(log)["zone_entry_s"] for log in logs]
    assert len(times) >= 4
    assert times[0] == 0.0
    assert times[1] == min(entries)
    assert times[-1] == logs[0]["t_s"][-1]
    alone = worlds["empty"][0]
    free = replace(alone, meta={**alone.meta, "frames_s": []})
    np.testing.assert_allclose(plots.frame_times([free]), np.linspace(0.0, 3.95, 4))


def test_view_holds_robots_plans_and_near_discs(logs):
    x_low, x_high, y_low, y_high = view_box(logs, steps=[0, 30])
    for log in logs:
        for step in range(len(log)):
            here = log["x_m"][step], log["y_m"][step], log["heading_rad"][step]
            zone = offset_outline(to_world(log.vertices, here), log["r_m"][step])
            assert x_low <= zone[:, 0].min() and zone[:, 0].max() <= x_high
            assert y_low <= zone[:, 1].min() and zone[:, 1].max() <= y_high
        assert y_low < log.discs[30, 0, 1] < y_high


def test_view_may_hold_what_stands_beyond(logs):
    x_low, x_high, y_low, y_high = view_box(logs)
    points = np.array([[x_high + 0.3, 0.0], [x_high + 2.0, 0.0]])
    walls = np.array([[0.0, y_low - 0.3, 0.0, y_low - 2.0]])
    log = replace(logs[0], points=points, walls=walls)
    assert view_box([log, *logs]) == (x_low, x_high, y_low, y_high)
    wide = view_box([log, *logs], surroundings=0.5)
    assert wide == pytest.approx((x_low, x_high + 0.4, y_low - 0.4, y_high))


def test_poses_against_the_plan(logs):
    axes = plots.poses(logs).axes
    labels = [x.get_ylabel() for x in axes]
    assert labels == ["x (m)", "y (m)", "heading γ (rad)"]
    assert axes[-1].get_xlabel() == "t (s)"
    assert {x.get_xlim() for x in axes} == {(0.0, 4.0)}
    for panel, name in zip(axes, ("x_m", "y_m", "heading_rad"), strict=True):
        for log, style in zip(logs, styles(logs), strict=True):
            drawn = line(panel, style.label)
            np.testing.assert_array_equal(drawn.get_ydata(), log[name])
        planned = line(panel, "planned").get_ydata()
        reference = name.replace("_", "_ref_", 1)
        np.testing.assert_array_equal(planned, logs[0][reference])


def test_twists_share_their_scales_and_shade_the_zone(logs):
    axes = plots.twists(logs).axes
    for column, name in enumerate(("v_mps", "omega_radps")):
        panels = axes[column::2]
        assert len({panel.get_ylim() for panel in panels}) == 1
        for panel, log in zip(panels, logs, strict=True):
            np.testing.assert_array_equal(panel.get_lines()[0].get_ydata(), log[name])
            planned = line(panel, "planned")
            assert planned.get_linestyle() == ":"
            reference = name.replace("_", "_ref_")
            np.testing.assert_array_equal(planned.get_ydata(), log[reference])
            (shade,) = panel.collections
            reach = shade.get_datalim(panel.transData)
            assert reach.x0 == pytest.approx(metrics(log)["zone_entry_s"])
    assert [x.get_ylabel() for x in axes[:2]] == ["Eq. 5\nv (m/s)", "ω (rad/s)"]


def test_distance_shows_bands_entry_and_exit(logs):
    figure = plots.distance(logs)
    (axes,) = figure.axes
    margin, danger = axes.collections
    heights = [np.unique(x.get_paths()[0].vertices[:, 1]) for x in (margin, danger)]
    np.testing.assert_allclose(heights[0], [0.17, 0.17 * 4 / 3])
    np.testing.assert_allclose(heights[1], [0.0, 0.17])
    drawn = {x.get_marker(): x for x in axes.get_lines() if x.get_marker() in "v^"}
    found = metrics(logs[-1])
    assert drawn["v"].get_xdata() == pytest.approx(found["zone_entry_s"])
    assert drawn["^"].get_xdata() == pytest.approx(found["zone_exit_s"])
    for text, log in zip(legend_texts(figure)[:3], logs, strict=True):
        found = metrics(log)
        assert f"least {found['min_clearance_m']:.3f} m" in text
        assert f"{found['zone_entry_s']:.2f} to {found['zone_exit_s']:.2f} s" in text
    assert legend_texts(figure)[-2:] == [
        "nearer than $r$ = 0.227 m",
        "nearer than $r_{min}$ = 0.17 m",
    ]


def test_distance_gives_each_method_its_own_band_where_r_differs(worlds):
    logs = worlds["fast"]
    assert any((log["r_m"] != logs[0]["r_m"]).any() for log in logs)
    figure = plots.distance(logs)
    assert len(figure.axes) == 3
    assert len({axes.get_ylim() for axes in figure.axes}) == 1
    assert legend_texts(figure)[-1] == "nearer than $r_{min}$"


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


def test_paths_show_what_moves_at_the_decisive_moment(logs):
    step = decisive_step(logs[:1])
    (axes,) = plots.paths(logs[:1]).axes
    assert axes.get_title().endswith(f"shown: t = {logs[0]['t_s'][step]:.1f} s")
    there = np.transpose(line(axes, "obstacle").get_data())
    np.testing.assert_array_equal(there, logs[0].discs[step, :, :2])


def test_the_decisive_moment(worlds, logs):
    columns = logs[0].columns | {
        "least_clearance_m": np.where(np.arange(len(logs[0])) > 7, -0.1, 1.0)
    }
    assert decisive_step([replace(logs[0], columns=columns)]) == 8
    assert decisive_step(logs[:1]) == int(logs[0]["least_clearance_m"].argmin())
    (alone,) = worlds["empty"]
    assert decisive_step([alone]) == len(alone) - 1


def test_a_disc_that_is_near_is_seen_whole(logs):
    step = decisive_step(logs[:1])
    (x, y, radius), *_ = logs[0].discs[step]
    x_low, x_high, y_low, y_high = view_box(logs, steps=[step])
    assert x_low < x - radius and x + radius < x_high
    assert y_low < y - radius and y + radius < y_high


@pytest.mark.parametrize("kind, head", [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_figures_can_be_drawn_for_print(logs, tmp_path, kind, head):
    for path in plots.save_figures(logs[:1], tmp_path, kind):
        assert path.suffix == f".{kind}" and path.read_bytes().startswith(head)


def test_five_methods_stand_in_two_rows_of_paths(logs):
    figure = plots.paths([*logs, *logs[:2]])
    assert len(figure.axes) == 5
    assert len({axes.get_xlim() for axes in figure.axes}) == 1


@pytest.mark.parametrize("world", ["slow", "fast", "crowd"])
@pytest.mark.parametrize("draw", FIGURES)
def test_no_legend_or_panel_covers_another(worlds, draw, world):
    figure = draw(worlds[world])
    for _ in range(2):  # as savefig does: the layout settles at the second drawing
        figure.draw_without_rendering()
    whole = figure.bbox.padded(1.0)
    boxes = [figure.legends[0].get_window_extent()]
    boxes += [axes.get_tightbbox() for axes in figure.axes]
    for i, box in enumerate(boxes):
        if i == 0:
            assert whole.containsx(box.x0) and whole.containsx(box.x1)
        assert whole.containsy(box.y0) and whole.containsy(box.y1)
        for other in boxes[:i]:
            overlap = box.intersection(box, other)
            assert overlap is None or min(overlap.width, overlap.height) < 2.0


def test_methods_keep_their_look_in_any_company(logs):
    looks = dict(zip(("eq5", "eq7", "qp"), styles(logs), strict=True))
    assert styles(logs[::-1]) == list(looks.values())[::-1]
    others = [
        replace(logs[2], meta={**logs[2].meta, "controller": name, "solver": solver})
        for name, solver in (("qp", "osqp"), ("dwa", "its own"), ("vfh", "exact"))
    ]
    labels = [style.label for style in styles([*logs, *others])]
    assert labels[3:] == ["one-step QP (osqp)", "dwa", "vfh"]
    chosen = styles([*logs, *others[1:]])
    assert len({style.color for style in chosen}) == 5
    assert len({style.line for style in chosen}) == 5


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


def test_paths_are_drawn_where_frames_would_not_fit(
    logs, worlds, tmp_path, monkeypatch
):
    monkeypatch.setattr(Figure, "savefig", lambda *arguments, **options: None)
    unnamed = replace(logs[0], meta={**logs[0].meta, "frames_s": []})
    for runs, name in ((worlds["crowd"], "crowd-eq7"), ([unnamed], "slow-eq5")):
        assert plots.save_figures(runs, tmp_path)[0].name == f"{name}-paths.png"


@pytest.mark.parametrize("draw", FIGURES)
def test_runs_of_other_scenarios_are_refused(worlds, draw):
    with pytest.raises(InvalidInputError, match="one scenario, not of none"):
        draw([])
    with pytest.raises(InvalidInputError, match="not of crowd, empty"):
        draw([worlds["crowd"][0], worlds["empty"][0]])
