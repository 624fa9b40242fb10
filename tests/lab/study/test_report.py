"""The report: its rankings, failures and figures."""

import re

import pytest

pytest.importorskip("pyarrow", reason="needs qpavoid[study]")

from qpavoid.errors import DataError
from qpavoid.lab.study.report import method_of, ranking, write_report
from qpavoid.lab.study.sweep.engine import sweep
from qpavoid.lab.study.sweep.study import read_study
from scenario_files import CROSSING, SLOW


def row(controller="qp", success=True, **more):
    return {
        "run": f"{controller}-{more.get('seed', 0)}",
        "scenario": "s",
        "seed": 0,
        "controller": controller,
        "solver": "exact",
        "outcome": "arrived" if success else "stalled",
        "success": success,
        "contact": False,
        "arrived_s": 4.0 if success else None,
        "min_clearance_m": 0.2,
        **more,
    }


def test_methods_are_named_after_all_that_makes_them():
    varied = row(**{"filter.gamma_per_s": 2.0, "path.k_m": None})
    for one, name in (
        (row(), "qp"),
        (row(solver="osqp"), "qp (osqp)"),
        (varied, "qp, filter.gamma_per_s 2"),
    ):
        assert method_of(one) == name


def test_ranking_is_by_success_then_contacts_then_time():
    rows = [
        *(row("slow", arrived_s=9.0, seed=i) for i in range(4)),
        *(row("fast", arrived_s=3.0, seed=i) for i in range(4)),
        *(row("rough", success=i > 0, contact=i < 1, seed=i) for i in range(4)),
        *(row("stuck", success=i > 0, seed=i) for i in range(4)),
        *(row("lost", success=False, min_clearance_m=None) for i in range(4)),
    ]
    lines = ranking(rows).splitlines()[2:]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    names = [line[0] for line in cells]
    assert names == ["fast", "slow", "stuck", "rough", "lost"]
    assert cells[0][1:3] == ["4", "100.0 (51–100)"] and cells[0][5] == "3"
    assert cells[-1][2] == "0.0 (0–49)" and cells[-1][5:7] == ["–", "–"]


def test_a_report_has_rankings_failures_and_figures(tmp_path):
    (tmp_path / "slow.toml").write_text(CROSSING + SLOW)
    (tmp_path / "study.toml").write_text(
        'title = "t"\ncontrollers = ["eq7", "qp-ahead", "missing_r:broken"]\n'
        'trajectories = "all"\nscenarios = [{ config = "slow.toml" }]\n'
    )
    (tmp_path / "missing_r.py").write_text(
        "def broken(v, omega, obstacles, context):\n    raise ValueError('a | b\\nc')\n"
    )
    sweep(read_study(tmp_path / "study.toml"), tmp_path / "out", workers=1)
    file = write_report(tmp_path / "out", tmp_path / "made" / "report.md")
    text = file.read_text()
    assert "\n3 runs, qpavoid " in text and "| qp-ahead | 1 | 0.0 (0–79) |" in text
    assert "| slow |  | qp-ahead | off goal |" in text
    assert re.search(r"\| missing_r:broken \| failed \|.*ValueError: a / b c \|", text)
    (picture,) = re.findall(r"!\[slow\]\((.+)\)", text)
    assert (file.parent / picture).read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_runs_is_an_error(tmp_path):
    with pytest.raises(DataError, match="no results of qpavoid sweep"):
        write_report(tmp_path, tmp_path / "report.md")
