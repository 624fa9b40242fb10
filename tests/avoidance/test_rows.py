"""Rows of the QP: their right-hand sides, and that pruning never changes an answer."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from problem_bank import qp
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, Repulsion, SafetyRadius
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.qp.solve import solve

SETTINGS = {
    "barrier": AvoidanceSettings(),
    "slow barrier": AvoidanceSettings(gamma=0.2),
    "fast barrier": AvoidanceSettings(gamma=50.0),
    "repulsion": AvoidanceSettings(bound="repulsion", repulsion=Repulsion(0.3)),
    "as printed": AvoidanceSettings(
        bound="repulsion", repulsion=Repulsion(0.2, "step")
    ),
    "long reach": AvoidanceSettings(
        radius=SafetyRadius(0.1, 1.5, 0.0, 1.0), gamma=0.5, weights=(1.0, 4.0)
    ),
}
every = pytest.mark.parametrize("settings", SETTINGS.values(), ids=SETTINGS)


def scene(rng, size=6):
    """Obstacles from close to far, a few of them inside, some fast."""
    return Obstacles(
        points=rng.normal(size=(size, 2)) * 1.5,
        discs=np.abs(rng.normal(size=(size, 3))) * [2, 2, 0.2],
        disc_velocities=rng.normal(size=(size, 2)),
        walls=rng.uniform(-3, 3, (2, 4)),
    )


def all_rows(robot, settings, obstacles):
    """Every row, from the contacts, by numpy and without any pruning."""
    contacts = Contacts.of(robot.footprint, obstacles)
    away = -contacts.normal
    A = np.einsum("ni,nij->nj", away, contacts.jacobian)
    speed = np.hypot(*contacts.velocity.T)
    radius = settings.radius
    r_min = np.interp(
        speed,
        [radius.speed_low, radius.speed_high],
        [radius.r_min_slow, radius.r_min_fast],
    )
    d = contacts.distance
    if settings.bound == "barrier":
        b = -settings.gamma * (d - r_min) + (away * contacts.velocity).sum(axis=1)
        keep = d <= settings.reach
    else:
        r = radius.zone_ratio * r_min
        share = np.clip((r - d) / (r - r_min), 0.0, 1.0)
        if settings.repulsion.activation == "step":
            share = np.ones_like(d)
        b, keep = settings.repulsion.speed * share, (d < r) & (d <= settings.reach)
    return A[keep], b[keep], contacts.obstacle[keep]


def box(robot):
    limits = robot.limits
    return (limits.v_min, limits.omega_min), (limits.v_max, limits.omega_max)


@every
@given(st.integers(0, 2**32 - 1))
def test_every_row_of_the_problem_is_one_of_the_contacts(robot, settings, seed):
    obstacles = scene(np.random.default_rng(seed))
    problem = SafetyFilter(robot, settings, ahead=False).problem(0.5, 0.1, obstacles)
    A, b, owner = all_rows(robot, settings, obstacles)
    known = {
        (*np.round(row, 9), round(bound, 9), int(i))
        for row, bound, i in zip(A, b, owner, strict=True)
    }
    for row, bound, i in zip(problem.A, problem.b, problem.obstacle, strict=True):
        near = min(
            known, key=lambda k: abs(np.subtract(k, (*row, bound, i))).max(), default=()
        )
        assert_allclose(near, (*row, bound, i), atol=1e-8)


@every
@given(st.integers(0, 2**32 - 1), st.floats(-1.5, 1.5), st.floats(-2, 2))
def test_pruning_never_changes_the_answer(robot, settings, seed, v, omega):
    obstacles = scene(np.random.default_rng(seed))
    alone = dataclasses.replace(settings, braking_room=False)
    safety = SafetyFilter(robot, alone, ahead=False)
    decision = safety.filter(v, omega, obstacles)
    A, b, _ = all_rows(robot, settings, obstacles)
    complete = solve(qp(A, b, (v, omega), settings.weights, *box(robot)))
    assert (decision.v, decision.omega) == pytest.approx(complete.u, abs=1e-7)
    assert decision.slack == pytest.approx(complete.slack, abs=1e-9)
