"""Several robots in one run: what they see of each other, and what comes of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shapely import Polygon

from qpavoid.errors import InvalidInputError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.outcome import outcome_of, verdict, worst_of
from qpavoid.lab.simulation.run import RobotObstacle, run, run_fleet
from qpavoid.lab.study.plots import frames
from qpavoid.model.kinematics import integrate, to_world
from qpavoid.model.obstacles import Obstacles
from scenario_files import CROSSING, SLOW, write
from shapes import ELL, SHIFTED

HEAD = """
title = "Several"
duration_s = 6.0
dt_s = 0.05
ends_at_goal = true
[tracking]
station_keeping = true
waiting = true
"""


def robot(x, y, x_goal, y_goal, more=""):
    return f"""
[[robots]]
kind = "one"
{more}
[robots.reference]
kind = "spline"
points_m = [[{x}, {y}], [{x_goal}, {y_goal}]]
speed_mps = 0.7
"""


ALONG, AGAINST, ACROSS = (
    robot(-1.8, 0.1, 2.0, 0.1),
    robot(1.8, -0.1, -2.0, -0.1, "jitter_m = 0.1"),
    robot(0.3, -2.0, 0.3, 2.0, 'robot = { preset = "mir100_rectangle" }'),
)


@pytest.fixture(scope="module")
def three(tmp_path_factory):
    path = write(tmp_path_factory.mktemp("fleet"), HEAD + ALONG + AGAINST + ACROSS)
    scenario = load_scenario(path)
    return scenario, run_fleet(scenario, "qp-ahead")


def test_the_distances_between_robots_are_those_of_their_polygons(three):
    _, logs = three
    ways = [outlines(log) for log in logs]
    for i, log in enumerate(logs):
        others = [way for j, way in enumerate(ways) if j != i]
        exact = [
            min(mine.distance(other) for other in there)
            for mine, *there in zip(ways[i], *others, strict=True)
        ]
        assert log["clearance_m"] == pytest.approx(exact[:-1], abs=1e-9)
        assert (log["least_clearance_m"] <= np.add(exact[1:], 1e-9)).all()


def test_the_others_stand_in_each_log_as_they_are(three):
    _, logs = three
    assert [log.meta["number"] for log in logs] == [0, 1, 2]
    assert {log.meta["seed"] for log in logs} == {0}
    assert len({len(log) for log in logs}) == 1
    for i, log in enumerate(logs):
        others = [other for j, other in enumerate(logs) if j != i]
        for k in (0, len(log) // 2, len(log) - 1):
            for corners, other in zip(log.polygons_at(k), others, strict=True):
                pose = other["x_m"][k], other["y_m"][k], other["heading_rad"][k]
                assert corners == pytest.approx(to_world(other.vertices, pose))


@pytest.mark.parametrize("footprint", [SHIFTED, ELL], ids=["shifted", "ell"])
def test_a_body_moves_as_its_robot_drives(footprint):
    pose, twist, lateral, dt = (1.0, -2.0, 0.7), (0.8, 1.3), -0.2, 0.05
    body = RobotObstacle(footprint, 3)

    def corners(capsules, time):
        moved = Obstacles.of(np.empty((0, 2)), capsules).moved(time)
        return np.vstack(moved.polygons)

    mean = body.at(pose, twist, lateral, dt)
    vertices = np.vstack(footprint.parts)
    there = to_world(vertices, integrate(pose, twist, lateral, dt))
    assert corners(mean, dt) == pytest.approx(there, abs=1e-12)
    now, tiny = body.at(pose, twist, lateral), 1e-6
    there = to_world(vertices, integrate(pose, twist, lateral, tiny))
    assert corners(now, tiny) == pytest.approx(there, abs=1e-11)


@pytest.mark.parametrize("controller", ["eq5", "qp-ahead", "qp-ahead+guide"])
def test_permuted_robots_do_the_same(tmp_path, controller):
    straight = AGAINST.replace("jitter_m = 0.1", "")
    first, second = (
        run_fleet(load_scenario(write(tmp_path, HEAD + text)), controller)
        for text in (ALONG + straight, straight + ALONG)
    )
    for log, same in zip(first, reversed(second), strict=True):
        for name in set(log.columns) - {"solve_time_s"}:
            np.testing.assert_array_equal(log[name], same[name], name)


@pytest.mark.parametrize("controller", ["eq7", "qp-ahead", "qp-ahead+guide"])
def test_a_fleet_of_one_is_an_ordinary_run(tmp_path, controller):
    alone = load_scenario(write(tmp_path, CROSSING + SLOW))
    one = '[[robots]]\nkind = "one"\n'
    (fleet,) = run_fleet(
        load_scenario(write(tmp_path, CROSSING + SLOW + one)), controller
    )
    log = run(alone, controller)
    for name in set(log.columns) - {"solve_time_s"}:
        np.testing.assert_array_equal(log[name], fleet[name], name)
    assert log.final.tolist() == fleet.final.tolist()


def test_starts_are_drawn_from_the_seed(tmp_path):
    entry = '[[robots]]\nkind = "random"\ncount = 6\nspeed_mps = 0.5\n'
    entry += (
        "low_m = [-4.0, -3.0]\nhigh_m = [4.0, 3.0]\napart_m = 1.2\njitter_m = 0.05\n"
    )
    first, again, other = (
        load_scenario(write(tmp_path, f"seed = {seed}\n" + HEAD + entry))
        for seed in (7, 7, 8)
    )
    starts = np.array([one.start for one in first.robots])
    assert [one.start for one in again.robots] == [one.start for one in first.robots]
    assert not np.isclose(starts, [one.start for one in other.robots]).any()
    away = np.hypot(*(starts[:, None, :2] - starts[None, :, :2]).transpose(2, 0, 1))
    assert away[~np.eye(6, dtype=bool)].min() > 1.2 - 4 * 0.05
    assert len({one.seed for one in first.robots}) == 6
    assert all(one.world is first.world for one in first.robots)


def test_a_robot_may_have_a_controller_of_its_own(tmp_path):
    text = (
        HEAD.replace("6.0", "1.0")
        + ALONG
        + robot(1.8, 0.0, -2.0, 0.0, 'controller = "eq5"')
    )
    logs = run_fleet(load_scenario(write(tmp_path, text)), "qp-ahead")
    assert [log.meta["solver"] for log in logs] == ["exact", "closed form"]
    assert [log.meta["controller"] for log in logs] == ["qp-ahead"] * 2
    assert logs[1].meta["driver"] == "eq5"


def test_run_wants_one_robot(three):
    with pytest.raises(InvalidInputError, match="has 3 robots: see run_fleet"):
        run(three[0], "qp-ahead")


def test_the_worst_robot_counts(three):
    outcomes = [outcome_of(log) for log in three[1]]
    for one, arrived, still in zip(outcomes, (3.0, 4.0, 5.0), (9, 1, 1), strict=True):
        one |= {"arrived_s": arrived, "still_s": float(still)}
    least = min(one["min_clearance_m"] for one in outcomes)
    assert worst_of(outcomes)["min_clearance_m"] == least
    assert verdict(worst_of(outcomes)) == "arrived"
    outcomes[1]["arrived_s"] = math.inf
    assert verdict(worst_of(outcomes)) == "off goal"
    assert worst_of(outcomes[:1]) == outcomes[0]


def test_a_robot_of_several_parts_is_logged_drawn_and_met_by_another(tmp_path):
    """Two of them pass each other; the log has their polygons, and reads as written."""
    parts = (
        "[[[-0.3,-0.2],[0.3,-0.2],[0.3,0.2],[-0.3,0.2]],[[0.3,0],[0.6,0],[0.5,0.2]]]"
    )
    text = HEAD + f"[robot]\nfootprint_m = {parts}\n" + ALONG + AGAINST
    logs = run_fleet(load_scenario(write(tmp_path, text)), "qp-ahead")
    assert min(log["least_clearance_m"].min() for log in logs) > 0.15
    logs[0].save(tmp_path / "run.npz")
    log = Log.load(tmp_path / "run.npz")
    assert [len(x) for x in log.footprint.outlines] == [4, 3]
    assert len(log.polygons) == 2 and log.outlines.tolist() == [4, 3]
    (axes,) = frames([replace(log, meta={**log.meta, "frames_s": [0.0]})]).axes
    whole = [x for x in axes.patches if x.get_facecolor()[:3] == (1.0, 1.0, 1.0)]
    assert [len(x.get_xy()) - 1 for x in whole] == [4, 3]


def outlines(log):
    """Return that of a robot at every control step and after the last."""
    columns = (log[key].tolist() for key in ("x_m", "y_m", "heading_rad"))
    poses = [*zip(*columns, strict=True), tuple(log.final.tolist())]
    return [Polygon(to_world(log.vertices, pose)) for pose in poses]
