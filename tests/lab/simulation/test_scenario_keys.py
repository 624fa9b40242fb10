"""Every key of a scenario file: what it sets, and what it refuses."""

import pytest

from minimal import MINIMAL, problems, write
from qpavoid.avoidance.settings import (
    Actuation,
    AvoidanceSettings,
    LookAhead,
    Margins,
    SafetyRadius,
)
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.model.robot import Limits, Robot


@pytest.mark.parametrize(
    ("addition", "message"),
    [
        ("dt_s = nan\n", "dt_s"),
        ('dt_s = "0.1"\n', "dt_s"),
        ("dt_s = true\n", "dt_s"),
        ("seed = -1\n", "seed"),
        ("seed = 1.5\n", "seed"),
        ("dt_s = 1e-9\n", "a run has 2 to"),
    ],
)
def test_bad_values_at_the_top(tmp_path, addition, message):
    *others, line = problems(tmp_path, addition + MINIMAL)
    assert message in line
    assert len(others) == (addition == "dt_s = 1e-9\n")  # too long a horizon, too


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("[robot]\nv_min_mps = 0.1\n", "robot.v_min_mps"),
        ('[robot]\npreset = "jakal"\n', "(got 'jakal'); did you mean 'jackal'?"),
        ("[robot]\nfootprint_m = [[0,0],[1,0]]\n", "robot: a footprint takes"),
        (
            "[radius]\nr_min_slow_m = 0.3\nr_min_fast_m = 0.2\n",
            "0 <= r_min_slow <= r_min_fast",
        ),
        ("[radius]\nzone_ratio = 0.5\n", "radius.zone_ratio"),
        ('[repulsion]\nactivation = "abrupt"\n', "repulsion.activation"),
        ("[filter]\ngamma_per_s = 200.0\n", "gamma * dt"),
        ('[[obstacles]]\nkind = "dics"\n', "did you mean 'disc'"),
        ("[[obstacles]]\nradius_m = 1.0\n", "obstacles[0]: kind: field required"),
        (
            '[[obstacles]]\nkind = "random"\ncount = 1\nlow_m = [1.0, 0.0]\n'
            "high_m = [0.0, 1.0]\n",
            "a low bound lies above",
        ),
        ("[filter]\nweight_omega_m2 = 0.0\n", "filter.weight_omega_m2"),
        ("[filter]\nbraking_room = 1\n", "filter.braking_room"),
        ("[robot]\nacceleration_mps2 = 0.0\n", "robot.acceleration_mps2"),
        (
            "[robot]\nangular_acceleration_radps2 = -1.0\n",
            "robot.angular_acceleration_radps2",
        ),
        ("[robot]\nwheel_speed_mps = 0.0\ntrack_m = 0.4\n", "robot.wheel_speed_mps"),
        ("[robot]\nwheel_speed_mps = 1.0\n", "robot: limits need a track"),
        ("[robot]\nwheel_speed_mps = 1.0\ntrack_m = 0.0\n", "robot.track_m"),
        ("[robot]\nv_max_mps = -0.1\n", "robot.v_max_mps"),
        ("[radius]\nclosing_gain_s = -0.1\n", "radius.closing_gain_s"),
        ("[margins]\nerror_m = -0.1\n", "margins.error_m"),
        ("[margins]\nacceleration_mps2 = nan\n", "margins.acceleration_mps2"),
        ("[actuation]\ndelay_s = -0.1\n", "actuation.delay_s"),
        ("[margins]\nacceleration = 1.0\n", "did you mean 'acceleration_mps2'"),
        ("[ahead]\nhorizon_s = -3.0\n", "ahead.horizon_s"),
        ("[ahead]\nhorizon_still_s = -1.0\n", "ahead.horizon_still_s"),
        ("[ahead]\nhorizon_still_s = 9.0\n", "look-ahead needs 0 <= horizon_still"),
        ("[ahead]\ntick_s = 4.0\n", "look-ahead needs 0 < tick <= horizon"),
        ("[ahead]\nhysteresis = 1.0\n", "ahead.hysteresis"),
        ("[ahead]\nreview_s = inf\n", "ahead.review_s"),
        ("[ahead]\nticks_s = 3.0\n", "did you mean 'tick_s'"),
        (
            '[[obstacles]]\nkind="waypoints"\ntimes_s=[0.0,0.0]\n'
            "positions_m=[[0.0,0.0],[1.0,1.0]]\n",
            "must increase",
        ),
    ],
)
def test_bad_values_in_sections(tmp_path, section, message):
    assert message in "\n".join(problems(tmp_path, MINIMAL + section))


def test_every_setting_of_the_filter_has_a_key(tmp_path):
    scenario = load_scenario(
        write(
            tmp_path,
            MINIMAL.replace("duration_s", "dt_s = 0.05\nsettled_s = 0.5\nduration_s", 1)
            + """
[robot]
acceleration_mps2 = 2.0
angular_acceleration_radps2 = 2.5
wheel_speed_mps = 1.1
track_m = 0.45
[radius]
closing_gain_s = 0.3
[margins]
error_m = 0.02
acceleration_mps2 = 0.4
[ahead]
horizon_s = 2.0
horizon_still_s = 0.5
tick_s = 0.1
hysteresis = 0.3
review_s = 0.4
[actuation]
delay_s = 0.1
jitter = 0.5
ramps = true
[filter]
braking_room = false
""",
        )
    )
    limits, settings = scenario.robot.limits, scenario.settings
    assert limits == Limits(-1.0, 1.0, -1.5, 1.5, 2.0, 2.5, 1.1, 0.45)
    assert settings.radius == SafetyRadius(closing_gain=0.3)
    assert settings.margins == Margins(0.02, 0.4)
    assert settings.ahead == LookAhead(2.0, 0.5, 0.1, 0.3, 0.4)
    assert settings.actuation == Actuation(0.1, 0.5, True)
    assert (settings.dt, settings.braking_room) == (0.05, False)
    assert scenario.settled == 0.5


@pytest.mark.parametrize("passive", [False, True])
def test_whether_the_filter_is_passive_is_read(tmp_path, passive):
    text = f"[filter]\npassive = {str(passive).lower()}\n"
    assert load_scenario(write(tmp_path, MINIMAL + text)).settings.passive is passive


def test_a_file_without_settings_has_the_defaults(tmp_path):
    """All but the control step, which belongs to the scenario."""
    scenario = load_scenario(write(tmp_path, "dt_s = 0.02\n" + MINIMAL))
    assert scenario.settings == AvoidanceSettings()
    assert scenario.robot.limits == Robot.mir100().limits


def test_problems_of_several_sections_come_together(tmp_path):
    lines = problems(
        tmp_path,
        MINIMAL
        + "[robot]\nfootprint_m = [[0,0],[1,0]]\n"
        + "[radius]\nr_min_slow_m = 0.3\nr_min_fast_m = 0.2\n",
    )
    assert len(lines) == 2
