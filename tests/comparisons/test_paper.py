"""`comparisons/paper/paper.py`: files, the page's table, and which statements hold."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

import paper
from places import ROOT
from qpavoid.lab.simulation.run import run, run_fleet
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study import compare
from qpavoid.lab.study.metrics import metrics
from statement_measures import STRENGTHS, by_strength, circle_about
from statements import STATEMENTS

PAGE = ROOT / "docs" / "test-cases.md"
SOURCE = ROOT.parent / "shared" / "paper" / "source.txt"


def test_figures_tables_and_statements(tmp_path, monkeypatch, undrawn):
    """Without the QP of every step: two fifths of the time, and nothing shows it."""
    monkeypatch.setattr(compare, "run_fleet", lambda *given, explain: run_fleet(*given))
    studies = []
    monkeypatch.setattr(paper, "run_study", lambda *given: studies.append(given) or [])
    monkeypatch.setattr(
        sys, "argv", ["paper.py", "--out", str(tmp_path), "--workers", "1"]
    )
    paper.main()
    ((_, scenes, options),) = studies  # how one is run: tests/comparisons/test_studies
    assert [scene.setting for scene in scenes] == [*paper.CASES]
    assert options.methods == paper.METHODS and options.out == tmp_path
    names = {path.name for path in tmp_path.glob("*.png")}
    kinds = ("frames", "poses", "twists", "distance")
    cases = "test_case_1", "test_case_2", "test_case_2_centre", "figure_2b"
    cases += "figure_2a", "figure_2a_passing"
    assert names == {f"paper-{case}-{kind}.png" for case in cases for kind in kinds}
    written = (tmp_path / "tables.md").read_text()
    table, _, statements = written.partition("\n| case ")
    shown = PAGE.read_text().split("<!-- table -->\n")[1]
    assert table == shown.split("<!-- end -->")[0]
    rows = statements.split("| of calibrations |\n")[1].splitlines()[1:]
    assert len(rows) == len(STATEMENTS) == 49
    told = f"Of {len({said.words for said in STATEMENTS})} sentences of the paper"
    assert told in PAGE.read_text() and f"which makes {len(rows)}" in PAGE.read_text()
    refuted = [row.split("|")[4].strip() for row in rows if "**no**" in row]
    assert "39 of the 49 come out" in PAGE.read_text() and len(refuted) == 10
    returns = [f"both end within {cm} cm of it" for cm in (1, 2, 5, 10)]
    assert refuted[3:7] == returns and refuted[0].startswith("by the least distance (")
    assert refuted[1:3] == [
        "the greatest size of Δω/dt is less with Eq. 7",
        "v of both keeps its sign in the zone; how often it does not",
    ]
    assert [words[:7] for words in refuted[7:]] == ["quicker", "quicker", "while b"]


@pytest.mark.parametrize(
    ("case", "method", "outcome", "x"),
    [
        ("figure_2a", "qp", "stalled", 1.74),
        ("figure_2a", "qp-ahead", "stalled", 5.0),
        ("figure_2a", "qp-ahead+guide", "arrived", 4.99),
    ],
)
def test_what_the_qp_does_before_a_front_edge(case, method, outcome, x):
    log = run(load_scenario(f"paper/{case}"), method)
    told = metrics(log)
    assert told["outcome"] == outcome and told["min_clearance_m"] > 0.168
    assert log.final[0] == pytest.approx(x, abs=0.01)


@pytest.mark.skipif(not SOURCE.is_file(), reason="wants the paper's text beside")
def test_the_papers_words_are_its_own():
    text = SOURCE.read_text()
    for statement in STATEMENTS:
        assert statement.words in text, statement.words


def test_a_method_that_raises_is_said_and_not_drawn(tmp_path, monkeypatch, capsys):
    (tmp_path / "raises_p.py").write_text(
        "def law(*given):\n    raise OSError('mine')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    drawn = []
    monkeypatch.setattr(paper, "draw", lambda names, *given: drawn.append(names))
    command = ["paper.py", "--methods", "eq5,raises_p:law", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", [*command, "--workers", "1"])
    with pytest.raises(SystemExit) as ended:
        paper.main()
    assert ended.value.code == 1 and "2 of 4 runs failed" in capsys.readouterr().err
    assert drawn == [["eq5"]]


def test_a_wrong_controller_is_a_usage_error(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["paper.py", "--methods", "x"])
    with pytest.raises(SystemExit) as ended:
        paper.main()
    assert ended.value.code == 2
    assert "unknown controller 'x'" in capsys.readouterr().err


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


def test_a_weaker_repulsion_than_is_shown_touches():
    base = load_scenario("paper/test_case_1")
    assert base.settings.repulsion.speed in STRENGTHS
    weak = replace(base.settings.repulsion, speed=2.5)
    settings = replace(base.settings, repulsion=weak)
    log = run(replace(base, settings=settings), "eq5")
    assert metrics(log)["min_clearance_m"] < 0.0
    assert all(room > 0.17 for law in ("eq5", "eq7") for room in by_strength(law)[0])
