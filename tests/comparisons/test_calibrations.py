"""Calibrations of the paper's cases: the loop is the simulation's, and what is kept."""

import csv
from itertools import islice

import numpy as np
import pytest

calibrations = pytest.importorskip("calibrations", reason="needs SciPy")

import statements
from calibration_loop import Calibration, base_of, log_of
from places import COMPARISONS
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from statement_measures import entered, left

MORE = 1.0, 1.5, 0.05, "smooth"
OURS = Calibration(-0.032, 0.733, 0.063, -0.075, 0.0, *MORE)
OTHERS = {
    statements.ONE: Calibration(2.0, 0.8, 0.0, 0.0, 0.15, *MORE),
    statements.CENTRE: Calibration(0.05, 0.75, 0.0, -0.095, 0.0, *MORE),
    statements.FLAT: Calibration(2.5, 0.1, 0.0, 0.0, 0.15, *MORE),
    statements.TIP: Calibration(2.5, 0.1, 0.0, 0.0, 0.15, *MORE),
    statements.PASSING: Calibration(0.9, -1.0, -0.01, 0.1, 0.15, *MORE),
}
FOUND = COMPARISONS / "results" / "calibrations" / "found.csv"


@pytest.mark.long
@pytest.mark.parametrize(("law", "alike"), [(5, 2000), (7, 350)])
def test_the_fast_loop_is_that_of_the_simulation(law, alike):
    """Eq. 7 turns to and fro in the end, which makes much of the last bit."""
    base = base_of(statements.TWO)
    log, fast = run(base, f"eq{law}"), log_of(OURS, law)
    names = "t_s", "x_m", "y_m", "heading_rad", "v_mps", "omega_radps", "clearance_m"
    for name in (*names, "r_m", "r_min_m", "v_desired_mps", "omega_desired_radps"):
        same = pytest.approx(fast[name][:alike], abs=1e-9)
        assert log[name][:alike] == same, name
    told, seen = metrics(log), metrics(fast)
    for key in ("zone_exit_s", "final_error_m", "min_clearance_m"):
        assert told[key] == pytest.approx(seen[key], abs=2e-3)


@pytest.mark.parametrize("case", OTHERS)
def test_ours_of_the_other_cases_is_that_of_the_simulation_too(case):
    log = run(base_of(case), "eq5")
    fast = log_of(OTHERS[case], 5, case)
    for name in ("x_m", "x_ref_m", "heading_ref_rad", "v_mps", "clearance_m"):
        assert log[name][:600] == pytest.approx(fast[name][:600], abs=1e-9), name


def test_the_shipped_calibration_is_one():
    assert calibrations.off(OURS) <= calibrations.TOLERANCE
    row = calibrations.row_of(OURS)
    assert row["eq5_final_error_m"] == pytest.approx(0.147, abs=5e-4)
    assert row["holds"] == "'" + "110000111001111011"


def test_what_is_found_meets_the_times():
    found = calibrations.search(np.random.default_rng(3))
    for one in islice(found, 3):
        assert np.hypot(one.v_x, one.v_y) <= 0.1 and 0.0 <= one.radius <= 0.3
        assert 0.5 <= one.v_max <= 1.5 and 1.0 <= one.omega_max <= 3.0
        for law, exit_s in ((5, 11.1), (7, 14.1)):
            log = log_of(one, law)
            assert entered(log) == pytest.approx(2.9, abs=0.1)
            assert left(log) == pytest.approx(exit_s, abs=0.101)


def test_other_cases_are_drawn_as_is_said():
    rng = np.random.default_rng(3)
    for one in islice(calibrations.SEARCHES[statements.CENTRE](rng), 20):
        way = np.array([one.v_x, one.v_y])
        assert np.hypot(*way) == pytest.approx(0.1)
        assert abs(one.x * way[1] - one.y * way[0]) / 0.1 <= 0.1
    for one in islice(calibrations.SEARCHES[statements.TIP](rng), 20):
        assert np.hypot(one.x - 2.5, one.y - 0.1) <= 0.15 and one.v_x == 0.0
    (one,) = islice(calibrations.SEARCHES[statements.ONE](rng), 1)
    for law in (5, 7):
        log = log_of(one, law, statements.ONE)
        assert abs(entered(log) - 5.0) < 0.25 and left(log) < 10.5


def test_the_table_is_what_the_rows_say():
    with FOUND.open() as file:
        rows = list(csv.DictReader(file))
    with (FOUND.parent.parent / "calibrations.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [(x["statement"], x["read"]) for x in table] == [
        (x.words, x.read) for x in statements.STATEMENTS
    ]
    for case in calibrations.CASES:
        lines = [x for x in table if f"paper/{x['case']}" == case]
        digits = [row["holds"][1:] for row in rows if f"paper/{row['case']}" == case]
        assert len(digits) >= 100
        for k, line in enumerate(lines):
            assert int(line["holds"]) == sum(told[k] == "1" for told in digits)
            assert int(line["of"]) == len(digits)
    row = next(row for row in rows if row["case"] == "test_case_2")
    numbers = [float(row[key]) for key in list(row)[1:9]]
    again = calibrations.row_of(Calibration(*numbers, row["activation"]))
    assert again["holds"] == row["holds"]


def test_shares_are_by_words_and_reading():
    claims = statements.of_case(statements.TWO)
    digits = "'" + ("10" * len(claims))[: len(claims)]
    found = calibrations.shares([{"case": "test_case_2", "holds": digits}] * 3)
    assert len(found) == len(claims)
    for k, claim in enumerate(claims):
        assert found[claim.words, claim.read] == [(k + 1) % 2] * 3
