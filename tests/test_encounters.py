"""`comparisons/encounters.py`: scenes, and a small table of what is measured."""

import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from qpavoid.model.contact import point_contact

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "comparisons"))
import encounters

COLUMNS = (
    "family controller encounters avoidable contacts_avoidable r_min_possible "
    "r_min_violations return_error_p95_m solve_median_us"
).split()


@pytest.mark.parametrize("family", encounters.FAMILIES)
def test_discs_are_as_stated_and_aimed_at_the_robot(robot, family):
    drawn = encounters.draw_encounters(family, 60, 3, robot)
    for encounter in drawn:
        assert encounter.speed == 0.0 or 0.5 <= encounter.speed <= 1.0
        assert len(encounter.discs) == 1 or family == "several"
        for disc, velocity in zip(encounter.discs, encounter.velocities, strict=True):
            first = point_contact(robot.footprint.edges, *disc[:2])[4] - disc[2]
            assert 0.8 - 1e-6 <= first <= 2.5 + 1e-6
            assert 0.05 - 1e-9 <= np.hypot(*velocity) <= 1.5 + 1e-9
            times = np.linspace(0.0, 120.0, 4801)
            x = disc[0] + (velocity[0] - encounter.speed) * times
            y = disc[1] + velocity[1] * times
            inside = [
                point_contact(robot.footprint.edges, *p)[4]
                for p in zip(x, y, strict=True)
            ]
            assert min(inside) < disc[2] + 0.1 or encounter.speed > 0.0


def test_the_same_seed_gives_the_same_encounters(robot):
    first, again, other = (
        encounters.draw_encounters("several", 5, seed, robot) for seed in (1, 1, 2)
    )
    for a, b, c in zip(first, again, other, strict=True):
        assert np.array_equal(a.discs, b.discs)
        assert not np.array_equal(a.velocities, c.velocities)


@pytest.mark.parametrize(
    "family",
    [pytest.param("path", marks=pytest.mark.slow), "accelerated", "several"],
)
def test_the_default_filter_touches_nothing_that_it_could_avoid(family):
    rows, runs = encounters.study(family, 24, 5)
    table = {row["controller"]: row for row in rows}
    assert set(table) == set(encounters.CONTROLLERS)
    assert set(COLUMNS) <= set(rows[0])
    ahead = table["qp-ahead"]
    assert ahead["contacts_avoidable"] == ahead["r_min_violations"] == 0
    assert ahead["not_returned"] == 0
    assert table["eq7"]["contacts_avoidable"] > 0
    assert len(runs) == 24 * len(encounters.CONTROLLERS)


def test_the_command_writes_table_and_figures(tmp_path, monkeypatch, capsys):
    arguments = ["encounters.py", "--count", "12", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", [*arguments, "--families", "several"])
    encounters.main()
    with (tmp_path / "table.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["controller"] for line in lines] == list(encounters.CONTROLLERS)
    assert all(math.isfinite(float(line["solve_median_us"])) for line in lines)
    with (tmp_path / "runs.csv").open() as file:
        runs = list(csv.DictReader(file))
    avoidable = sum(int(line["avoidable"]) for line in lines)
    assert len(runs) == avoidable
    touched = sum(run["contact"] == "True" for run in runs)
    assert touched == sum(int(line["contacts_avoidable"]) for line in lines)
    assert (tmp_path / "failures.png").stat().st_size > 10_000
    assert "qp-ahead" in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["encounters.py", "--families", "none"])
    with pytest.raises(SystemExit):
        encounters.main()


@pytest.mark.parametrize("method", ["eq5", "qp-ahead"])
@pytest.mark.parametrize("family", ["parked", "several"])
def test_a_step_at_a_time_is_the_compiled_loop(robot, family, method):
    """The way of the methods of others, taken by ours: their outcomes compare."""
    loops = encounters.make_loops(
        [e for e in encounters.draw_encounters(family, 6, 8, robot) if not e.speed],
        robot,
    )
    batch = encounters.Batch(
        robot, encounters.station_tracker(robot), encounters.AvoidanceSettings(dt=0.05)
    )
    compiled = batch.run(method, loops, threads=1)
    scenarios = [encounters.as_scenario(batch, loop) for loop in loops]
    outcomes = [encounters.outcome_of(encounters.run(s, method)) for s in scenarios]
    stepped = np.concatenate(outcomes)
    for name in ("clearance", "room", "deviation", "moving"):
        np.testing.assert_allclose(
            stepped[name], compiled[name], atol=encounters.UNTOUCHED
        )


def test_methods_of_others(tmp_path):
    rows, runs = encounters.study("several", 4, 5, ["stop", "qp-ahead"])
    assert [row["controller"] for row in rows] == ["stop", "qp-ahead"]
    assert rows[0]["avoidable"] == rows[1]["avoidable"]
    assert 0 < rows[0]["contacts_avoidable"] <= rows[0]["avoidable"]
    assert rows[1]["contacts_avoidable"] == 0 and len(runs) == 8


@pytest.mark.slow
def test_targets_on_a_thousand_encounters_of_each_family():
    for family in encounters.FAMILIES:
        rows, _ = encounters.study(family, 1000, 11)
        row = next(r for r in rows if r["controller"] == "qp-ahead")
        assert row["contacts_avoidable"] <= 1e-3 * row["avoidable"]
        if family in ("parked", "path"):
            assert row["r_min_kept_to_1_mps"] >= 0.99
            assert row["r_min_kept_above_1_mps"] >= 0.97
            assert row["not_returned"] == 0
