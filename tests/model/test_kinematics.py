"""Eq. 1 and its exact integral, against numerical integration and group laws."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from qpavoid.model.kinematics import arc, wrap_angle

small = st.floats(-5, 5)
turning = st.one_of(st.floats(-4, 4), st.floats(-1e-3, 1e-3), st.just(0.0))
poses = st.tuples(small, small, st.floats(-7, 7))
twists = st.tuples(st.floats(-2, 2), turning)


def integrated(pose, twist, dt):
    """Integrate x' = v cos, y' = v sin, γ' = ω numerically."""
    v, omega = twist

    def rate(_, state):
        return [v * math.cos(state[2]), v * math.sin(state[2]), omega]

    solution = solve_ivp(rate, (0, dt), pose, rtol=1e-11, atol=1e-12, method="DOP853")
    return solution.y[:, -1]


@given(poses, twists, st.floats(-3, 3))
@example((0.3, -0.2, 0.7), (2.0, 1e-4), 1.5)
def test_arc_is_the_integral_of_eq_1(pose, twist, dt):
    assert arc(*pose, *twist, dt) == pytest.approx(
        integrated(pose, twist, dt), abs=1e-9
    )


@given(st.floats(-1e4, 1e4))
def test_wrapped_angle_is_the_same_direction(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi - 1e-12 <= wrapped <= math.pi + 1e-12
    turns = (angle - wrapped) / (2 * math.pi)
    assert turns == pytest.approx(round(turns), abs=1e-9)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (0.0, 0.0),
        (math.pi, math.pi),
        (-math.pi, math.pi),
        (3 * math.pi, math.pi),
        (-3 * math.pi, math.pi),
        (math.pi / 2 - 2 * math.pi, math.pi / 2),
        (math.nextafter(math.pi, 0), math.nextafter(math.pi, 0)),
        (-3.141592, -3.141592),
    ],
)
def test_the_cut_lies_at_minus_pi(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-15)
