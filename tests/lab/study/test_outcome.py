"""Outcome of a run: one word in tables and sweeps."""

import math

import numpy as np
import pytest

from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.outcome import contacts_moving, mean_jerk, verdict
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.study.sweep.sources import scenario_file


@pytest.mark.parametrize(
    ("clearance", "arrived", "still", "word"),
    [
        (-0.01, 3.0, 0.0, "touched"),
        (0.0, 3.0, 9.0, "arrived"),
        (0.1, math.inf, 5.1, "stalled"),
        (0.1, math.inf, 4.9, "off goal"),
    ],
)
def test_the_word(clearance, arrived, still, word):
    noted = {"min_clearance_m": clearance, "arrived_s": arrived, "still_s": still}
    assert verdict(noted) == word


def test_compare_and_sweep_say_the_same():
    """Eq. 5 ends 15 cm beside its station: once `off goal` here and `stalled` there."""
    case = "paper/test_case_2"
    log = run(load_scenario(case), "eq5")
    job = Job("0", scenario_file(case), None, "{}", None, "eq5", "exact", "none")
    row, compared = run_job(job)[0], metrics(log)
    assert row["outcome"] == compared["outcome"] == "stalled"
    assert row["solver"] == compared["solver"] == "closed form"


def test_a_contact_is_whose_who_moved_when_it_began():
    """Touched at rest and driven off while touched: none; into something: one each."""
    least = np.array([0.1, -0.1, -0.2, 0.1, -0.1, -0.1, 0.2, -0.1])
    moving = np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0])
    assert contacts_moving(least[:4], moving[:4]).tolist() == []
    assert contacts_moving(least, moving).tolist() == [4]
    assert contacts_moving(-np.ones(3), np.ones(3)).tolist() == [0]


def test_jerk_is_that_of_a_cubic():
    """x = t³: v = 3 t², a jerk of 6 m/s³; without a third speed there is none."""
    times = 0.1 * np.arange(20)
    assert mean_jerk(3.0 * times**2, 0.1) == pytest.approx(6.0)
    assert mean_jerk(np.array([0.0, 1.0]), 0.1) == 0.0


@pytest.mark.parametrize("name", ["eq5", "stop"])
def test_a_row_says_how_it_began_and_what_a_step_took(name):
    case = "paper/test_case_2"
    log = run(load_scenario(case), name)
    job = Job("0", scenario_file(case), None, "{}", None, name, "exact", "none")
    row = run_job(job)[0]
    assert row["start_clearance_m"] == pytest.approx(log["clearance_m"][0])
    assert row["jerk_mps3"] == pytest.approx(mean_jerk(log["v_mps"], log.meta["dt_s"]))
    assert row["contacts_moving"] == 0.0
    assert row["contact"] == (name == "stop")
    assert 0.0 < row["solve_us"] < 1e5
