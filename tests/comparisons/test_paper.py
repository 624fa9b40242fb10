"""`comparisons/paper.py`: files, the page's table, and which statements hold."""

import sys

import pytest

import paper
from places import ROOT
from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.study import compare

PAGE = ROOT / "docs" / "test-cases.md"


def test_figures_tables_and_statements(tmp_path, monkeypatch, undrawn):
    """Without the QP of every step: two fifths of the time, and nothing shows it."""
    monkeypatch.setattr(compare, "run_fleet", lambda *given, explain: run_fleet(*given))
    studies = []
    monkeypatch.setattr(paper, "run_study", lambda *given: studies.append(given))
    monkeypatch.setattr(
        sys, "argv", ["paper.py", "--out", str(tmp_path), "--workers", "1"]
    )
    paper.main()
    ((_, scenes, options),) = studies  # how one is run: tests/comparisons/test_studies
    assert [scene.setting for scene in scenes] == [*paper.CASES]
    assert options.methods == paper.METHODS and options.out == tmp_path
    names = {path.name for path in tmp_path.glob("*.png")}
    kinds = ("frames", "poses", "twists", "distance")
    cases = "test_case_1", "test_case_2", "test_case_2_centre", "figure_2a", "figure_2b"
    assert names == {f"paper-{case}-{kind}.png" for case in cases for kind in kinds}
    written = (tmp_path / "tables.md").read_text()
    table, _, statements = written.partition("\n| case ")
    shown = PAGE.read_text().split("<!-- table -->\n")[1]
    assert table == shown.split("<!-- end -->")[0]
    rows = statements.split("| of calibrations |\n")[1].splitlines()[1:]
    assert len(rows) == 18
    refuted = [row.split("|")[2].strip() for row in rows if "**no**" in row]
    assert refuted == [
        "Once the obstacle has passed, the robot returns to its original position.",
        "Method 1 recovers sooner.",
    ]


def test_a_wrong_controller_is_a_usage_error(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["paper.py", "--methods", "x"])
    with pytest.raises(SystemExit) as ended:
        paper.main()
    assert ended.value.code == 2
    assert "unknown controller 'x'" in capsys.readouterr().err
