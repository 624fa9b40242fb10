"""The study of fleets: a row a run, a table of them, and nothing done twice."""

import sys

import pytest

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


def test_of_all_seeds_the_table_has_sums_worst_and_mean():
    seen = {"method": "m", "setting": "s", "robots": 2, "success": 0, "contacts": 1}
    first = seen | {"arrived": 0, "touched": 2, "least_m": -0.1, "room_m": -0.3}
    second = seen | {"arrived": 2, "touched": 1, "least_m": 0.1, "room_m": 0.0}
    (line,) = fleet.table([first | {"ratio": ""}, second | {"ratio": "1.5"}])
    assert (line["runs"], line["arrived"], line["contacts"]) == (2, 2, 2)
    assert (line["least_m"], line["room_m"], line["ratio"]) == (-0.1, -0.3, 1.5)
