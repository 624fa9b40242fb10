"""Rows of the committed tables are drawn, run again, and told apart."""

import csv
import subprocess
import sys

import numpy as np
import pytest

rerun = pytest.importorskip("rerun", reason="needs qpavoid[study]")

import tomllib

from page_studies import read_studies
from places import COMPARISONS

TEXTS = tomllib.loads((COMPARISONS / "page.toml").read_text())
STUDIES = rerun.reruns(read_studies(COMPARISONS / "results", TEXTS))


def test_most_rows_of_the_tables_may_be_drawn():
    names = {study.name for study in STUDIES}
    assert {"strangers", "forest", "barn", "crowd", "dynabarn", "maps"} <= names
    assert {"crowdnav", "encounters", "paper"} <= names and "ablation" not in names
    rows = rerun.drawn(STUDIES, 50, 1, set())
    assert len(rows) == 50 and rows == rerun.drawn(STUDIES, 50, 1, set())
    assert rows != rerun.drawn(STUDIES, 50, 2, set())
    mine = rerun.drawn(STUDIES, 50, 1, {"alone"})
    assert {row["method"] for _, row in mine} == {"alone"}


@pytest.mark.long
def test_a_row_that_is_run_again_agrees_and_a_changed_one_does_not(
    tmp_path, monkeypatch, capsys
):
    (study,) = (study for study in STUDIES if study.name == "strangers")
    same, other, *_ = (row for row in study.rows if row["method"] == "alone")
    argv = ["--data", str(tmp_path), "--count", "2", "--out", str(tmp_path)]
    for rows, agree in (([], 0), ([same, {**other, "min_room_m": -3.0}], 1)):
        monkeypatch.setattr(
            rerun, "drawn", lambda *_, rows=rows: [("strangers", row) for row in rows]
        )
        monkeypatch.setattr(sys, "argv", ["rerun.py", *argv])
        with pytest.raises(SystemExit) as left:
            rerun.main()
        assert left.value.code == (agree < len(rows))
        assert f"{agree} of {len(rows)} rows agree" in capsys.readouterr().out
    right, wrong = csv.DictReader((tmp_path / "rows.csv").read_text().splitlines())
    assert right["study"] == "strangers" and right["what"] == ""
    assert "min_room_m: -3" in wrong["what"]


def test_another_processor_is_what_numpy_takes_it_for():
    """A process with its switches finds no AVX-512, and all that numpy can do."""
    code = """if True:
        import numpy as np
        print(*np.show_config(mode="dicts")["SIMD Extensions"]["found"])
        print(np.sin(np.arange(3.0)).sum())
    """
    words = [sys.executable, "-W", "error", "-c", code]
    env = rerun.without_avx512()
    told = subprocess.run(words, env=env, capture_output=True, text=True, check=True)
    found, total = told.stdout.splitlines()
    assert "AVX512" not in found and "X86_V4" not in found
    assert float(total) == pytest.approx(np.sin([1.0, 2.0]).sum())


def test_a_row_that_did_not_run_is_said():
    row = {"method": "m", "setting": "s", "scene": "1", "outcome": "late"}
    assert rerun.difference(row, None)["what"] == "not run"
    assert rerun.difference(row, {"outcome": "late"})["what"] == ""
    assert "late / success" in rerun.difference(row, {"outcome": "success"})["what"]


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_the_command_of_every_study_can_be_made(study, tmp_path):
    words = rerun.command_of(study, study.rows[:2], tmp_path, tmp_path / "out")
    assert words.count("--methods") == words.count("--out") == 1
    assert words[words.index("--out") + 1] == str(tmp_path / "out")
    assert not {"PATH", "{scenes}"} & set(words)
