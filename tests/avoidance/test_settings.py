"""Safety radius, activation, and settings that are refused."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from qpavoid.avoidance.settings import (
    Actuation,
    AvoidanceSettings,
    LookAhead,
    Margins,
    Repulsion,
    SafetyRadius,
    activation,
    widening,
)
from qpavoid.errors import InvalidInputError

ACTIVATIONS = ("step", "linear", "smooth")

kinds = pytest.mark.parametrize("kind", range(3), ids=ACTIVATIONS)


@pytest.mark.parametrize(
    ("speed", "r_min"),
    [
        (0.0, 0.17),
        (0.1, 0.17),
        (0.2, 0.185),
        (0.3, 0.20),
        (0.5, 0.23),
        (7.0, 0.23),
        (-0.3, 0.20),
    ],
)
def test_safety_radius_of_the_paper(speed, r_min):
    radius = SafetyRadius()
    assert radius.r_min(speed) == pytest.approx(r_min)
    assert radius.r(speed) == pytest.approx(4 * r_min / 3)


def test_safety_radius_may_jump():
    radius = SafetyRadius(speed_low=0.2, speed_high=0.2)
    assert (radius.r_min(0.2), radius.r_min(0.2001)) == (0.17, 0.23)


@kinds
@given(st.floats(-0.5, 0.5), st.sampled_from([0.0, 1e-9, 0.06, 0.2]))
@example(0.2, 0.0)
@example(0.2, 0.06)
@example(0.26, 0.06)
@example(math.nextafter(0.2, 0), 0.0)
def test_activation_is_a_switch_a_ramp_or_a_smooth_step(kind, distance, width):
    """By their formulas in (r − d) / (r − r_min); a zone of no width is a switch."""
    r_min, r = 0.2, 0.2 + width
    switch = float(distance < r)
    share = np.clip((r - distance) / (r - r_min), 0.0, 1.0) if width else switch
    expected = (switch, share, share * share * (3.0 - 2.0 * share))[kind]
    assert activation(kind, distance, r_min, r) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (SafetyRadius, {"r_min_slow": 0.3}),
        (SafetyRadius, {"r_min_fast": 0.1}),
        (SafetyRadius, {"speed_low": 0.6}),
        (LookAhead, {"horizon": 0.5, "horizon_still": 0.6}),
        (LookAhead, {"horizon": 0.04, "horizon_still": 0.0}),
        (LookAhead, {"horizon": 100.0}),
        (AvoidanceSettings, {"weights": (1.0,)}),
        (AvoidanceSettings, {"dt": Fraction(1, 50)}),
        (AvoidanceSettings, {"dt": 1e-6}),
        (AvoidanceSettings, {"ahead": LookAhead(horizon=3e4, tick=30.0)}),
        (AvoidanceSettings, {"actuation": Actuation(delay=0.17)}),
        (AvoidanceSettings, {"passive": True, "braking_room": False}),
        (AvoidanceSettings, {"margins": 0.02}),
        (AvoidanceSettings, {"ahead": None}),
    ],
    ids=str,
)
def test_settings_that_do_not_fit_together(kind, wrong):
    with pytest.raises(InvalidInputError, match=next(iter(wrong))[:6]):
        kind(**wrong)


def test_gamma_and_the_control_step_belong_together():
    assert AvoidanceSettings(gamma=10.0, dt=0.1).dt == 0.1
    with pytest.raises(InvalidInputError, match=r"gamma \* dt <= 1, not 1\.01"):
        AvoidanceSettings(gamma=10.1, dt=0.1)


@given(st.floats(0, 2), st.floats(0, 1), st.floats(0, 0.1), st.floats(0, 1))
def test_the_widening_covers_where_an_obstacle_can_have_come(speed, age, error, a):
    """An obstacle that gains speed all the time has not come farther, nor strayed."""
    wider = widening(speed, age, error, a, 0.1)
    way = speed * age + 0.5 * a * age * age
    strayed = 0.5 * a * 0.1**2
    assert wider >= error + way + strayed - 1e-12
    assert wider <= error + way + strayed + 0.5 * a * age * age + 1e-12
    assert widening(speed, 0.0, error, 0.0, 0.1) == error


def test_the_record_carries_every_setting():
    settings = AvoidanceSettings(
        SafetyRadius(0.1, 0.2, 0.3, 0.4, 1.5, 0.6),
        Repulsion(6.0, "smooth", 0.7),
        weights=(1.1, 1.2),
        bound="repulsion",
        gamma=0.8,
        reach=0.9,
        slack_tolerance=0.01,
        margins=Margins(0.02, 0.03),
        ahead=LookAhead(2.5, 1.25, 0.04, 0.15, 0.35, 0.05),
        actuation=Actuation(0.06, 0.07, True),
        dt=0.05,
        braking_room=False,
    )
    values = settings.record()[0]
    assert {name: float(values[name]) for name in values.dtype.names} == {
        **{"r_min_slow": 0.1, "r_min_fast": 0.2, "speed_low": 0.3, "speed_high": 0.4},
        **{"zone_ratio": 1.5, "closing_gain": 0.6, "speed": 6.0, "damping": 0.7},
        **{"gamma": 0.8, "reach": 0.9, "slack_tolerance": 0.01},
        **{"error": 0.02, "obstacle_acceleration": 0.03, "dt": 0.05},
        **{"weight_v": 1.1, "weight_omega": 1.2},
        **{"horizon": 2.5, "horizon_still": 1.25, "tick": 0.04},
        **{"hysteresis": 0.15, "review": 0.35, "min_clearance": 0.05},
        **{"delay": 0.06, "jitter": 0.07, "ramps": 1},
        **{"braking_room": 0, "passive": 0, "activation": 2, "bound": 1},
    }
