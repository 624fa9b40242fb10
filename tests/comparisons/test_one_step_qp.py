"""The plain script against the package: two codes that share nothing but the paper."""

import csv
import math
import re
from pathlib import Path
from statistics import median

import pytest

import one_step_qp
from places import COMPARISONS, ROOT
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run


@pytest.mark.parametrize(
    "law, controller", [("Eq. 5", "eq5"), ("Eq. 7", "eq7"), ("QP", "qp")]
)
def test_the_plain_script_drives_as_the_package_does(law, controller):
    log = run(load_scenario("paper/test_case_2"), controller)
    least, (x, y, heading) = one_step_qp.run(law)
    assert least == pytest.approx(log["least_clearance_m"].min(), abs=1e-3)
    there = log["x_m"][-1], log["y_m"][-1]
    assert math.dist((x, y), there) < 2e-3
    assert heading == pytest.approx(log["heading_rad"][-1], abs=1e-3)


def test_the_page_says_what_it_prints():
    ends = [one_step_qp.run(law) for law in ("Eq. 5", "Eq. 7", "QP")]
    least = [f"{room:.3f}" for room, _ in ends]
    off = [f"{1000.0 * math.hypot(x, y):.0f}" for _, (x, y, _) in ends]
    told = "{}, {} and {} m, and at the end {}, {} and {} mm".format(*least, *off)
    page = " ".join((ROOT / "docs/how-it-works.md").read_text().split())
    assert told in page
    with (COMPARISONS / "results" / "calibrations" / "found.csv").open() as file:
        found = [row for row in csv.DictReader(file) if row["case"] == "test_case_2"]
    middle = median(1000.0 * float(row["eq5_final_error_m"]) for row in found)
    said = (
        f"over {len(found)} calibrations Eq. 5 ends {middle:.0f} mm off in the median"
    )
    assert said in page
    script = Path(one_step_qp.__file__)
    readme = (ROOT / "README.md").read_text()
    told = f"[{code_lines(script)} lines without anything of ours](comparisons/"
    assert f"{told}{script.name})" in readme


def code_lines(path):
    """Lines that are neither blank nor a comment nor of a docstring."""
    text = re.sub(r'""".*?"""', "", path.read_text(), flags=re.S)
    lines = [line.strip() for line in text.splitlines()]
    return sum(bool(line) and not line.startswith("#") for line in lines)
