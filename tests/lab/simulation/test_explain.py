"""The QP of every step, and a run's outcome from its log: both are what happened."""

import dataclasses

import numpy as np
import pytest

from qpavoid.lab.simulation.batch import as_loop
from qpavoid.lab.simulation.log import COLUMNS
from qpavoid.lab.simulation.outcome import OUTCOME, outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.simulation.simulation import MOST_PLANES

CONTROLLERS = ("eq5", "eq7", "qp", "qp-ahead")
EXPLAINED = COLUMNS[COLUMNS.index("v_low_mps") :]


SCENARIO = dataclasses.replace(load_scenario("paper/test_case_1"), duration=12.0)
"""Until the obstacle has passed."""


@pytest.fixture(scope="module")
def runs():
    return {name: run(SCENARIO, name, explain=True) for name in CONTROLLERS}


@pytest.fixture(params=("qp", "qp-ahead"))
def filtered(request, runs):
    return runs[request.param]


@pytest.mark.parametrize("name", CONTROLLERS)
def test_looking_on_changes_nothing(name, runs):
    explained, plain = runs[name], run(SCENARIO, name)
    for column in set(COLUMNS) - {"solve_time_s", *EXPLAINED}:
        np.testing.assert_array_equal(plain[column], explained[column])
    assert plain.planes.shape == (len(plain), 0, 4)
    assert all(np.isnan(plain[column]).all() for column in EXPLAINED)


def test_the_filters_keep_the_rows_that_are_shown(filtered):
    u = np.column_stack([filtered["v_mps"], filtered["omega_radps"]])
    a, b = filtered.planes[..., :2], filtered.planes[..., 2]
    room = np.einsum("nkd,nd->nk", a, u) - b
    assert filtered.planes.shape[1:] == (MOST_PLANES, 4)
    assert np.nanmin(room) > -1e-9 and (np.abs(room) < 1e-9).any()
    for i, name in enumerate(("v", "omega")):
        unit = "mps" if name == "v" else "radps"
        assert (u[:, i] >= filtered[f"{name}_low_{unit}"] - 1e-12).all()
        assert (u[:, i] <= filtered[f"{name}_high_{unit}"] + 1e-12).all()


def test_where_nothing_holds_it_the_aimed_twist_is_driven(filtered):
    aim = np.column_stack([filtered["v_aim_mps"], filtered["omega_aim_radps"]])
    u = np.column_stack([filtered["v_mps"], filtered["omega_radps"]])
    low = np.column_stack([filtered["v_low_mps"], filtered["omega_low_radps"]])
    high = np.column_stack([filtered["v_high_mps"], filtered["omega_high_radps"]])
    a, b = filtered.planes[..., :2], filtered.planes[..., 2]
    kept = np.nan_to_num(np.einsum("nkd,nd->nk", a, aim) - b).min(axis=1) >= 0.0
    kept &= ((aim >= low) & (aim <= high)).all(axis=1)
    assert kept.sum() > 100
    np.testing.assert_allclose(u[kept], aim[kept], atol=1e-9)


@pytest.mark.parametrize(
    ("config", "ends"), [("paper/test_case_2", False), ("demo/trap", True)]
)
@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_log_says_what_the_compiled_loop_says(config, name, ends):
    scenario = load_scenario(config)
    seconds = scenario.duration if ends else 10.0
    scenario = dataclasses.replace(scenario, ends_at_goal=ends, duration=seconds)
    batch, loop = as_loop(scenario)
    compiled = batch.run(name, [loop], threads=1)[0]
    logged = outcome_of(run(scenario, name))[0]
    for column in OUTCOME.names:
        assert logged[column] == pytest.approx(compiled[column], abs=1e-9), column


def test_what_the_compiled_loop_does_not_know_is_left_to_run():
    assert as_loop(load_scenario("demo/crowd")) is None
