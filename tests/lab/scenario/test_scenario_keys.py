"""Keys of a scenario file: values that reach the settings, and values refused."""

import pytest

from qpavoid.avoidance.settings import Margins
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.model.robot import Limits
from scenario_files import MINIMAL, problems, write


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
