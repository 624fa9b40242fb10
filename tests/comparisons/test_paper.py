"""The paper: its statements, calibrations and pages, and its laws in a plain script."""

import math
import re
from dataclasses import replace
from itertools import islice
from pathlib import Path
from statistics import median

import numpy as np
import pytest

import one_step_qp
from places import ROOT, table
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run

calibrations = pytest.importorskip("calibrations", reason="needs SciPy")

import page
import statements
from calibrations import Calibration
from measures import STRENGTHS, by_strength, circle_about, entered, left
from qpavoid.lab.study.compare import COLUMNS, cell
from qpavoid.lab.study.metrics import metrics

SOURCE = ROOT.parent / "shared" / "paper" / "source.txt"
PAGE = (ROOT / "docs" / "test-cases.md").read_text(encoding="utf-8")
MORE = 1.0, 1.5, 0.05, "smooth"
OURS = {
    statements.TWO: Calibration(-0.032, 0.733, 0.063, -0.075, 0.0, *MORE),
    statements.ONE: Calibration(2.0, 0.8, 0.0, 0.0, 0.15, *MORE),
    statements.CENTRE: Calibration(0.05, 0.75, 0.0, -0.095, 0.0, *MORE),
    statements.FLAT: Calibration(2.5, 0.1, 0.0, 0.0, 0.15, *MORE),
}


def test_the_measured_values_are_those_of_the_committed_table():
    found = calibrations.table_of(table("calibrations/found.csv"))
    told = [{k: str(x) for k, x in line.items()} for line in found]
    assert told == table("calibrations.csv") and len(told) == 49
    assert len({line["statement"] for line in told}) == 43
    assert sum(line["ours"] == "yes" for line in told) == 39
    assert "39 of the 49" in " ".join(PAGE.split())


@pytest.mark.skipif(not SOURCE.is_file(), reason="wants the paper's text beside")
def test_the_papers_words_are_its_own():
    text = SOURCE.read_text()
    for statement in statements.STATEMENTS:
        assert statement.words in text, statement.words


@pytest.mark.parametrize("case", OURS)
def test_ours_is_a_calibration(case):
    log, same = run(load_scenario(case), "eq5"), OURS[case].scenario(case)
    again = run(same, "eq5")
    for name in ("x_m", "heading_rad", "v_mps", "clearance_m"):
        assert log[name] == pytest.approx(again[name], abs=1e-9), name


def test_the_times_of_ours_are_the_papers():
    ours = OURS[statements.TWO]
    assert calibrations.time_error(ours) <= calibrations.TOLERANCE
    row = calibrations.row_of(ours)
    assert row["eq5_final_error_m"] == pytest.approx(0.147, abs=5e-4)
    assert row["holds"] == "'" + "110000111001111011"


@pytest.mark.long
def test_the_search_meets_the_times(monkeypatch):
    monkeypatch.setattr(calibrations, "TOLERANCE", 1.5)
    found = calibrations.search(np.random.default_rng(3))
    for one in islice(found, 2):
        assert np.hypot(one.v_x_mps, one.v_y_mps) <= 0.1 and 0.0 <= one.radius_m <= 0.3
        assert 0.5 <= one.v_max_mps <= 1.5 and 1.0 <= one.omega_max_radps <= 3.0
        logs = calibrations.runs_of(one, statements.TWO)
        for law, exit_s in calibrations.EXITS.items():
            assert entered(logs[f"eq{law}"]) == pytest.approx(2.9, abs=0.1)
            assert left(logs[f"eq{law}"]) == pytest.approx(exit_s, abs=1.5)


def test_a_committed_calibration_has_the_same_statements_again():
    found = table("calibrations/found.csv")
    row = [x for x in found if x["case"] == "test_case_2"][3]
    numbers = [float(row[key]) for key in list(row)[1:9]]
    again = calibrations.row_of(Calibration(*numbers, row["activation"]))
    assert again["holds"] == row["holds"]


def test_the_page_is_made_of_the_rows():
    text = page.PAGE.read_text(encoding="utf-8")
    tables = {"statements": page.statements, "cases": page.cases}
    assert page.filled(text, tables) == text and len(text.splitlines()) <= 150
    ends = [
        1000.0 * float(x["eq5_final_error_m"])
        for x in table("calibrations/found.csv")
        if x["case"] == "test_case_2"
    ]
    low, middle, high = np.quantile(ends, [0.0, 0.5, 1.0])
    said = f"ends {low:.0f} to {high:.0f} mm from its station, {middle:.0f} mm in the"
    assert said in text


def test_the_table_of_the_test_cases():
    table = PAGE.split("<!-- table -->\n")[1].split("<!-- end -->")[0]
    heads, _, *lines = [
        [x.strip() for x in line.strip("|").split("|")] for line in table.splitlines()
    ]
    keys = {COLUMNS[key]: key for key in COLUMNS}
    assert len(lines) == 10
    for name, *cells in lines:
        row = metrics(run(load_scenario(name), cells[0]))
        for head, text in zip(heads[2:], cells[1:], strict=True):
            assert re.sub(r"\s+", " ", cell(row[keys[head]])) == text


@pytest.mark.parametrize(
    ("case", "method", "outcome", "x"),
    [
        ("figure_2a", "qp", "stalled", 1.74),
        ("figure_2a", "qp-ahead", "stalled", 5.0),
        ("figure_2a", "qp-ahead+guide", "arrived", 4.99),
    ],
)
def test_the_qp_before_a_front_edge(case, method, outcome, x):
    log = run(load_scenario(f"paper/{case}"), method)
    found = metrics(log)
    assert found["outcome"] == outcome and found["min_clearance_m"] > 0.168
    assert log.final[0] == pytest.approx(x, abs=0.01)


def test_the_circle_about_the_footprint_is_the_least():
    """Every corner is in it; none that is smaller holds rear corners and apex."""
    corners = load_scenario("paper/test_case_1").robot.footprint.vertices
    radius, times_area = circle_about()
    centres = np.linspace(-0.3, 0.5, 8001)[:, None]
    around = np.hypot(centres - corners[:, 0], corners[:, 1]).max(axis=1)
    assert radius == pytest.approx(around.min(), abs=1e-4)
    x, y = corners.T
    area = 0.5 * abs(x @ np.roll(y, 1) - y @ np.roll(x, 1))
    assert times_area == pytest.approx(math.pi * around.min() ** 2 / area, rel=2e-3)


def test_a_weaker_repulsion_touches():
    base = load_scenario("paper/test_case_1")
    assert base.settings.repulsion.speed in STRENGTHS
    weak = replace(base.settings.repulsion, speed=2.5)
    settings = replace(base.settings, repulsion=weak)
    log = run(replace(base, settings=settings), "eq5")
    assert metrics(log)["min_clearance_m"] < 0.0
    assert all(room > 0.17 for law in ("eq5", "eq7") for room in by_strength(law)[0])


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
    rows = table("calibrations/found.csv")
    found = [row for row in rows if row["case"] == "test_case_2"]
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
