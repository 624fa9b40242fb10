"""The study of fleets: a row a run, a table of them, and nothing done twice."""

import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from qpavoid.errors import DataError

fleet = pytest.importorskip("fleet", reason="needs qpavoid[study]")


def test_two_robots_swap_their_places(tmp_path, monkeypatch, capsys):
    command = [
        "fleet.py",
        "--scenes",
        "swap",
        "--methods",
        "qp-ahead",
        "--seeds",
        "0:1",
    ]
    command += ["--workers", "1", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    fleet.main()
    (row,) = fleet.done(tmp_path / "runs.csv")
    assert (row["robots"], row["arrived"], row["contacts"]) == ("2", "2", "0")
    assert float(row["least_m"]) > 0.17 and 1.0 < float(row["ratio"]) < 2.0
    monkeypatch.setattr(fleet, "run_once", None)
    fleet.main()
    assert "successes=1 robots=2 arrived=2 contacts=0" in capsys.readouterr().out


def test_a_failed_run_is_a_row_a_column_and_the_exit_status(
    tmp_path, monkeypatch, capsys
):
    def broken(*task):
        raise DataError("cut")

    monkeypatch.setattr(fleet, "numbers_of", broken)
    monkeypatch.setattr(fleet, "ProcessPoolExecutor", ThreadPoolExecutor)
    command = ["fleet.py", "--scenes", "swap", "--methods", "qp", "--seeds", "0:2"]
    monkeypatch.setattr(sys, "argv", [*command, "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        fleet.main()
    assert ended.value.code == 1 and "2 of 2 runs failed" in capsys.readouterr().err
    (line,) = fleet.done(tmp_path / "table.csv")
    assert (line["runs"], line["failed"], line["successes"]) == ("2", "2", "0")
    assert fleet.done(tmp_path / "runs.csv")[0]["error"] == "DataError: cut"


def test_of_all_seeds_the_table_has_sums_worst_and_mean():
    seen = {"method": "m", "setting": "s", "robots": 2, "success": 0, "contacts": 1}
    first = seen | {"arrived": 0, "touched": 2, "least_m": -0.1, "room_m": -0.3}
    second = seen | {"arrived": 2, "touched": 1, "least_m": 0.1, "room_m": 0.0}
    (line,) = fleet.table([first | {"ratio": ""}, second | {"ratio": "1.5"}])
    assert (line["runs"], line["arrived"], line["contacts"]) == (2, 2, 2)
    assert (line["least_m"], line["room_m"], line["ratio"]) == (-0.1, -0.3, 1.5)
