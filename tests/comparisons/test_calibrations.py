"""Calibrations of test case 2: the fast loop is the simulation's, and what is kept."""

import numpy as np
import pytest

calibrations = pytest.importorskip("calibrations", reason="needs SciPy")

from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from statements import value

OURS = calibrations.Calibration(-0.032, 0.733, 0.063, -0.075, 0.0, "smooth", 0.05)


@pytest.mark.parametrize(("law", "alike"), [(5, 2000), (7, 350)])
def test_the_fast_loop_is_that_of_the_simulation(law, alike):
    """Eq. 7 turns to and fro in the end, which makes much of the last bit."""
    log, fast = run(calibrations.BASE, f"eq{law}"), calibrations.log_of(OURS, law)
    names = "t_s", "x_m", "y_m", "heading_rad", "v_mps", "omega_radps", "clearance_m"
    for name in (*names, "r_m", "r_min_m"):
        same = pytest.approx(fast[name][:alike], abs=1e-9)
        assert log[name][:alike] == same, name
    told, seen = metrics(log), metrics(fast)
    for key in ("zone_exit_s", "final_error_m", "min_clearance_m"):
        assert told[key] == pytest.approx(seen[key], abs=2e-3)


def test_the_shipped_calibration_is_one():
    assert calibrations.off(OURS) <= calibrations.TOLERANCE
    row = calibrations.row_of(OURS)
    assert row["eq5_final_error_m"] == pytest.approx(0.147, abs=5e-4)
    held = [row[f"claim_{k}"] for k in range(1, 1 + len(calibrations.CLAIMS))]
    assert held == [1, 1, 0, 1, 0, 1]


def test_what_is_found_meets_the_times():
    found = calibrations.search(seed=3, seconds=60.0)
    for _, (_, one) in zip(range(3), found, strict=False):
        assert np.hypot(one.v_x, one.v_y) <= 0.1 and 0.0 <= one.radius <= 0.3
        logs = {f"eq{law}": calibrations.log_of(one, law) for law in (5, 7)}
        for law, exit_s in (("eq5", 11.1), ("eq7", 14.1)):
            assert value(logs, law, "zone_entry_s") == pytest.approx(2.9, abs=0.1)
            assert value(logs, law, "zone_exit_s") == pytest.approx(exit_s, abs=0.101)


def test_shares_have_wilsons_interval():
    rows = [{f"claim_{k}": int(k > i) for k in range(1, 7)} for i in range(4)]
    lines = calibrations.shares(rows)
    assert [line["holds"] for line in lines] == [1, 2, 3, 4, 4, 4]
    assert (lines[1]["share"], lines[1]["low"], lines[1]["high"]) == (0.5, 0.15, 0.85)
