"""What became of a run: one word, whoever says it."""

import math

import pytest

from qpavoid.lab.simulation.outcome import verdict
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.metrics import metrics
from qpavoid.lab.study.report.payload import pack_run
from qpavoid.lab.study.sweep.job import Job, run_job
from qpavoid.lab.study.sweep.study import scenario_file


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
    noted = {"clearance": clearance, "arrived": arrived, "still": still}
    assert verdict(noted) == word


def test_compare_sweep_and_replay_say_the_same():
    """Eq. 5 ends 15 cm beside its station: once `off goal` here and `stalled` there."""
    case = "paper/test_case_2"
    log = run(load_scenario(case), "eq5")
    job = Job("0", scenario_file(case), None, "{}", None, "eq5", "exact", "none")
    row, compared = run_job(job)[0], metrics(log)
    words = {row["outcome"], compared["outcome"], pack_run(log)["outcome"]}
    assert words == {"stalled"}
    assert row["solver"] == compared["solver"] == "closed form"
