"""Scenario files: keys and values, everything wrong at once, with a suggestion."""

import math
import shutil

import numpy as np
import pytest

from qpavoid.avoidance.settings import Margins
from qpavoid.errors import ConfigError, DataError
from qpavoid.lab.scenario.config import builtin_configs
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.scenario.world import ABSENT, Track
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits
from scenario_files import MINIMAL, problems, write


def test_shipped_scenarios_are_listed_and_valid(data_folder):
    names = list(builtin_configs())
    assert "paper/test_case_1" in names
    assert "paper/test_case_2_as_printed" in names
    assert "barn/world_0" in names
    for name in names:
        scenario = load_scenario(name, data_folder)
        assert scenario.steps > 0
        others = len(scenario.world.at(0.0)) or len(scenario.robots) - 1
        assert others > 0


def test_every_error_at_once_with_key_and_suggestion(tmp_path):
    lines = problems(
        tmp_path,
        """
title = 3
duration_s = -1.0
dt = 0.01
[robot]
preset = "mir"
[reference]
kind = "cubic"
start = { x_m = 0.0, y_m = 0.0 }
goal = { x_m = 1.0, y = 0.0 }
k_m = 1.0
duration_s = 5.0
[[obstacles]]
kind = "disc"
position_m = [0.0]
radius_n = 0.2
[[obstacles]]
kind = "dics"
""",
    )
    text = "\n".join(lines)
    assert "title: " in text
    assert "duration_s: " in text and "greater than 0" in text
    assert "dt: unknown key; did you mean 'dt_s'?" in text
    assert "robot.preset: " in text and "mir100" in text
    assert "reference.goal.y: unknown key; did you mean 'y_m'?" in text
    assert "reference.goal.y_m: field required" in text
    assert "obstacles[0].radius_n: unknown key; did you mean 'radius_m'?" in text
    assert "obstacles[0].position_m" in text
    assert "obstacles[1]" in text and "dics" in text
    assert len(lines) >= 9


def test_broken_toml_and_missing_file(tmp_path):
    assert "not valid TOML" in problems(tmp_path, "title = ")[0]
    path = tmp_path / "s.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="not valid TOML"):
        load_scenario(path)


def test_obstacles_of_every_kind(tmp_path):
    np.save(tmp_path / "a.npy", np.array([[3.0, 4.0], [5.0, 6.0]]))
    (tmp_path / "b.csv").write_text("x,y\n1,2\n\n3.5,-4e-1\n")
    scenario = load_scenario(
        write(
            tmp_path,
            MINIMAL
            + """
[[obstacles]]
kind = "disc"
position_m = [1, 2]
radius_m = 0.5
[[obstacles]]
kind = "disc"
position_m = [0.0, 0.0]
velocity_mps = [1.0, -2.0]
[[obstacles]]
kind = "waypoints"
times_s = [1.0, 2.0, 4.0]
positions_m = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]
radius_m = 0.1
[[obstacles]]
kind = "wall"
start_m = [0.0, 1.0]
end_m = [2.0, 1.0]
[[obstacles]]
kind = "polygon"
vertices_m = [[1.6, 0.9], [2.3, 0.9], [2.3, 1.3], [1.6, 1.3]]
velocity_mps = [-0.1, -0.15]
turn_rate_radps = 0.5
[[obstacles]]
kind = "points"
file = "a.npy"
[[obstacles]]
kind = "points"
file = "b.csv"
""",
        )
    )
    world = scenario.world.at(3.0)
    np.testing.assert_array_equal(world.discs, [[1, 2, 0.5], [3, -6, 0], [1, 1, 0.1]])
    np.testing.assert_array_equal(world.disc_velocities, [[0, 0], [1, -2], [0, 1]])
    np.testing.assert_array_equal(world.walls, [[0, 1, 2, 1]])
    np.testing.assert_array_equal(world.points, [[3, 4], [5, 6], [1, 2], [3.5, -0.4]])
    box, motion = [(1.6, 0.9), (2.3, 0.9), (2.3, 1.3), (1.6, 1.3)], (-0.1, -0.15, 0.5)
    cart = Obstacles(polygons=[box], polygon_velocities=[motion])
    np.testing.assert_allclose(world.polygons, cart.moved(3.0).polygons)
    np.testing.assert_array_equal(world.polygon_velocities, [motion])
    before, after = scenario.world.at(0.5), scenario.world.at(9.0)
    np.testing.assert_array_equal(before.discs[2], [0, 0, 0.1])
    np.testing.assert_array_equal(after.discs[2], [1, 2, 0.1])
    assert not before.disc_velocities[2].any() and not after.disc_velocities[2].any()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "x,y\n1,2\n3\n", "not a readable table"),
        ("a.csv", "1,2,3\n", "two columns"),
        ("a.csv", "1,nan\n", "point 0 is not finite"),
        ("a.npy", "no array", "not a readable array"),
        ("a.txt", "1,2\n", "not '.txt'"),
    ],
)
def test_damaged_point_files(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    text = MINIMAL + f'[[obstacles]]\nkind = "points"\nfile = "{name}"\n'
    with pytest.raises(DataError, match=message):
        load_scenario(write(tmp_path, text))


def test_barn_world_in_its_published_form(data_folder):
    for data in (data_folder, data_folder / "barn", data_folder / "barn" / "BARN"):
        scenario = load_scenario("barn/world_0", data)
        discs = scenario.world.at(0.0).discs
        assert discs.shape == (209, 3)
        assert set(discs[:, 2]) == {0.075}
        assert scenario.start == (-2.25, 3.0, math.pi / 2)
        reference = scenario.path.sample(np.linspace(0, scenario.duration, 2000))
        gap = np.hypot(*(reference[:, None, :2] - discs[None, :, :2]).T).min()
        assert gap > 0.40
        np.testing.assert_allclose(reference[-1, :2], (-2.25, 13.0), atol=0.05)


def test_damaged_barn_files(data_folder, tmp_path):
    source = data_folder / "barn" / "BARN"
    (tmp_path / "path_files").mkdir()
    path = tmp_path / "path_files" / "path_0.npy"
    shutil.copy(source / "world_0.world", tmp_path)
    path.write_bytes((source / "path_files" / "path_0.npy").read_bytes()[:60])
    with pytest.raises(DataError, match="not a readable array"):
        load_scenario("barn/world_0", tmp_path)
    np.save(path, np.zeros((4, 3)))
    with pytest.raises(DataError, match=r"\(n, 2\) cells"):
        load_scenario("barn/world_0", tmp_path)


def test_who_is_away_is_far_from_everybody_wherever_that_is():
    for place in (0.0, 4_900.0, 1e4, -6e5, 5e6):
        places = np.array([[place, 0.0], [place + 1.0, 0.0]])
        track = Track(np.array([1.0, 2.0]), places, 0.2, fleeting=True)
        position, _ = track.at(3.0)
        assert np.abs(position - places).max(axis=1).min() >= 0.5 * ABSENT
    assert track.at(1.5)[0] == pytest.approx([5e6 + 0.5, 0.0])


POLYGON = '[[obstacles]]\nkind = "polygon"\nvertices_m = {}\n'


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ('[robot]\npreset = "jakal"\n', "(got 'jakal'); did you mean 'jackal'?"),
        ("[robot]\nfootprint_m = [[0,0],[1,0]]\n", "robot: a footprint takes"),
        ("[robot]\nfootprint_m = []\n", "robot: a footprint takes"),
        ("[robot]\nfootprint_m = [[]]\n", "robot: a footprint takes"),
        ("[robot]\nfootprint_m = [[[0,0],[1,0]]]\n", "robot: a footprint takes"),
        (
            "[radius]\nr_min_slow_m = 0.3\nr_min_fast_m = 0.2\n",
            "r_min_slow <= r_min_fast",
        ),
        ("[filter]\ngamma_per_s = 200.0\n", "gamma * dt"),
        ('[[obstacles]]\nkind = "dics"\n', "did you mean 'disc'"),
        ("[[obstacles]]\nradius_m = 1.0\n", "obstacles[0]: kind: field required"),
        (
            '[[obstacles]]\nkind = "random"\ncount = 1\nlow_m = [1.0, 0.0]\n'
            "high_m = [0.0, 1.0]\n",
            "a low bound lies above",
        ),
        (POLYGON.format([[0, 0], [1, 0]]), "obstacles[0]"),
        (POLYGON.format([[0, 0], [0, 1], [1, 0]]), "obstacles[0]"),
        (POLYGON.format([[0, 0, 0]]), "obstacles[0]"),
        ("[robot]\nwheel_speed_mps = 1.0\n", "robot: limits need a track"),
        ("[margins]\nacceleration = 1.0\n", "did you mean 'acceleration_mps2'"),
        ("[ahead]\nhorizon_still_s = 9.0\n", "look-ahead needs horizon_still"),
        (
            '[[obstacles]]\nkind="waypoints"\ntimes_s=[0.0,0.0]\n'
            "positions_m=[[0.0,0.0],[1.0,1.0]]\n",
            "must increase",
        ),
    ],
)
def test_bad_values_in_sections(tmp_path, section, message):
    assert message in "\n".join(problems(tmp_path, MINIMAL + section))


def test_values_of_sections_reach_the_settings(tmp_path):
    text = "[robot]\nwheel_speed_mps = 1.1\ntrack_m = 0.45\n[filter]\npassive = true\n"
    text += "[margins]\nerror_m = 0.02\nacceleration_mps2 = 0.4\n"
    scenario = load_scenario(write(tmp_path, "settled_s = 0.5\n" + MINIMAL + text))
    wheels = {"wheel_speed": 1.1, "track": 0.45}
    assert scenario.robot.limits == Limits(-1.0, 1.0, -1.5, 1.5, **wheels)
    assert scenario.settings.margins == Margins(0.02, 0.4)
    assert scenario.settings.passive and scenario.settled == 0.5
