"""Encounters: scenes, and a small table of what is measured."""

import csv
import math
import sys

import numpy as np
import pytest

import encounter_loop
import encounter_scenes
import encounter_table
import encounters
import plan_room
from limit_search import with_accelerations
from qpavoid.model.contact import point_contact

COLUMNS = (
    "family controller margins encounters avoidable contacts_avoidable "
    "contacts_at_rest contacts_on_path contacts_with_accelerations r_min_possible "
    "r_min_violations return_error_p95_m arrived_median_s needless chatter_v_per_s "
    "chatter_omega_per_s solve_us solve_p99_us"
).split()
UNTOUCHED = encounter_table.UNTOUCHED
KNOWN = {
    "parked": (0.0, 0.123811442689, -1.597119103727, 0.161245194579, 0.169359808484),
    "path": (0.888940755495, 0.612012082796, 2.345007380879, 0.047059103301,
             0.002862408064),
    "accelerated": (0.82671802934, -1.212195395534, 1.221940791066, 0.207980812629,
                    0.225945710119),
    "several": (0.888551856418, -2.041842439061, 2.204897646454, 1.064911318507,
                0.068227097686),
}  # fmt: skip
"""Speed, sums of x, y and radius, and of v_x, of the fourth encounter of seed 1."""


@pytest.fixture(autouse=True)
def few_steps_in_python(monkeypatch):
    """Chatter is measured in the first runs of a family alone; here in two."""
    monkeypatch.setattr(encounters, "CHATTERING", 2)


@pytest.mark.parametrize("family", KNOWN)
def test_discs_are_drawn_as_ever(robot, family):
    fourth = encounters.draw_encounters(family, 4, 1, robot)[3]
    found = fourth.speed, *fourth.discs.sum(axis=0), fourth.velocities[:, 0].sum()
    assert found == pytest.approx(KNOWN[family], abs=1e-8)


@pytest.mark.parametrize("family", encounter_scenes.DISCS)
def test_discs_are_as_stated_and_aimed_at_the_robot(robot, family):
    drawn = encounters.draw_encounters(family, 60, 3, robot)
    for encounter in drawn:
        assert encounter.speed == 0.0 or 0.5 <= encounter.speed <= 1.0
        assert len(encounter.discs) == 1 or family == "several"
        for disc, velocity in zip(encounter.discs, encounter.velocities, strict=True):
            first = point_contact(robot.footprint.edges, *disc[:2]).distance - disc[2]
            assert 0.8 - 1e-6 <= first <= 2.5 + 1e-6
            assert 0.05 - 1e-9 <= np.hypot(*velocity) <= 1.5 + 1e-9
            times = np.linspace(0.0, 120.0, 4801)
            x = disc[0] + (velocity[0] - encounter.speed) * times
            y = disc[1] + velocity[1] * times
            inside = [
                point_contact(robot.footprint.edges, *p).distance
                for p in zip(x, y, strict=True)
            ]
            assert min(inside) < disc[2] + 0.1 or encounter.speed > 0.0


@pytest.mark.parametrize("family", encounter_scenes.FAMILIES)
def test_the_same_seed_gives_the_same_encounters(robot, family):
    first, again, other = (
        encounters.draw_encounters(family, 5, seed, robot) for seed in (1, 1, 2)
    )
    for a, b, c in zip(first, again, other, strict=True):
        for x, y, z in zip(a.all_movers, b.all_movers, c.all_movers, strict=False):
            assert np.array_equal(x.pieces, y.pieces)
            assert x.pieces.shape != z.pieces.shape or (x.pieces != z.pieces).any()
        assert np.array_equal(a.points, b.points)


@pytest.mark.parametrize("family", encounter_scenes.WORLDS)
def test_worlds_are_as_stated(robot, family):
    body, touched = robot.footprint.edges, 0
    drawn = encounters.draw_encounters(family, 40, 3, robot)
    assert [e.speed > 0.0 for e in drawn] == [False, True] * 20
    assert [e.limited for e in drawn] == [False, False, True, True] * 10
    for encounter in drawn:
        scene, movers = encounter.scene, encounter.all_movers
        assert 1 <= len(movers) <= 2 and (family == "mixed" or len(movers) == 1)
        assert 0.0 < encounter.pace <= 1.4 + 1e-9
        nothing = np.zeros(len(movers) + 1)
        reach = robot.footprint.circumradius
        for mover in movers:
            x, y, *_ = mover.at(0.0)
            assert point_contact(body, x, y).distance - mover.size >= 0.8 - 1e-6
            assert np.abs(mover.pieces[:, 6]).max() <= 1.0
            # what it does between two looks is what its speed and course say
            for t in (0.3, 1.7, 4.4, 9.0):
                (x_1, y_1, *_), (x_2, y_2, *_) = mover.at(t - 1e-4), mover.at(t + 1e-4)
                rate = np.array([x_2 - x_1, y_2 - y_1]) / 2e-4
                assert rate == pytest.approx(mover.velocity(t), abs=2e-3)
        # tracking alone touches nothing that stands, and keeps r_min from it
        times = np.arange(0.0, 6.0, 0.05)
        way = encounter_scenes.reference(encounter.speed, 0.05)[:, 0]
        way = np.resize(way, len(times)) if encounter.speed else 0.0 * times
        alone = plan_room.make_scene(encounter.posts, encounter.solid, (), 0.0)
        for x in way[::10]:
            room = plan_room.room(body, reach, alone, np.zeros(1), x, 0.0, 0.0, 0.0)
            assert room >= 0.2 - 1e-9
        least = [
            plan_room.room(body, reach, scene, nothing, x, 0.0, 0.0, t)
            for x, t in zip(way, times, strict=True)
        ]
        touched += min(least) < 0.05
    assert touched > 12  # most of them are aimed at the robot


def test_stops_turns_and_changes_of_speed(robot):
    def speeds(family):
        drawn = encounters.draw_encounters(family, 30, 1, robot)
        return np.array(
            [[e.movers[0].at(t)[3] for t in np.arange(0, 9, 0.1)] for e in drawn]
        )

    assert ((speeds("stop-and-go") == 0.0).any(axis=1)).all()
    changing = np.diff(speeds("accelerating"), axis=1) / 0.1
    assert np.abs(changing).max() <= 1.5 + 1e-6
    assert (np.abs(changing).max(axis=1) > 0.05).mean() > 0.8
    turning = encounters.draw_encounters("turning", 30, 1, robot)
    assert all(0.2 <= abs(e.movers[0].turn(0.0)) <= 1.0 for e in turning)
    assert all(e.movers[0].turn(100.0) == 0.0 for e in turning)
    assert all(
        e.movers[0].is_cart for e in encounters.draw_encounters("carts", 4, 1, robot)
    )


def test_walls_that_are_seen_as_points(robot):
    for encounter in encounters.draw_encounters("corridor", 20, 2, robot):
        dotted = 2 - len(encounter.walls)
        assert len(encounter.solid) == 2 and (len(encounter.points) > 0) == (dotted > 0)
        for side in (0, 1):
            y = encounter.solid[side, 1]
            seen = encounter.points[encounter.points[:, 1] == y]
            assert len(seen) == 0 or np.diff(np.sort(seen[:, 0])).max() <= 0.0501


@pytest.mark.long
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
    assert ahead["contacts_avoidable"] == 0
    assert ahead["r_min_violations"] <= 1 and ahead["not_returned"] <= 1
    assert table["eq7"]["contacts_avoidable"] > 0
    assert len(runs) == 24 * len(encounters.CONTROLLERS)


@pytest.mark.long
def test_movers_that_change_are_met_with_margins_and_without():
    rows, runs = encounters.study("turning", 8, 5, ["eq7", "qp-ahead"])
    keys = [(row["margins"], row["controller"]) for row in rows]
    wide = "0.3 m, 0.5 m/s²"
    assert keys == [(m, c) for m in ("none", wide) for c in ("eq7", "qp-ahead")]
    assert len(runs) == 32 and all(row["chatter_runs"] == 8 for row in rows)
    assert all(math.isfinite(row["chatter_v_per_s"]) for row in rows)
    assert math.isnan(rows[0]["clearance_share_median"])
    text = encounter_table.readme(rows).splitlines()
    assert (
        text[0]
        == "| contacts / r_min kept, of those possible | Eq. 7 | look-ahead QP |"
    )
    assert [line.split(" | ")[0] for line in text[2:]] == [
        "| a disc that turns", f"| a disc that turns; margins {wide}"
    ]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("family", ["mixed", "doorway", "carts"])
def test_worlds_are_in_the_table(family):
    rows, _ = encounters.study(family, 8, 5, ["qp", "qp-ahead"])
    for row in rows:
        assert row["encounters"] == 8 and row["avoidable"] >= row["r_min_possible"]
        sides = row["contacts_at_rest"] + row["contacts_on_path"]
        assert sides == row["contacts_avoidable"] <= row["avoidable"]
        assert row["contacts_with_accelerations"] <= sides


def test_chatter_counts_signs():
    twists = np.array([[0.1, 0.0], [-0.1, 0.5], [0.0, 0.5], [-0.1, -0.5], [0.1, 1e-4]])
    assert encounter_loop.chatter(twists, 0.1) == pytest.approx((2 / 0.5, 1 / 0.5))
    assert encounter_loop.chatter(0.0 * twists, 0.1) == (0.0, 0.0)


def test_shares_have_a_digit_more_where_one_says_too_little():
    percents = [encounter_table.percent(k, 1000) for k in (0, 4, 263, 995, 1000)]
    assert percents == ["0.00 %", "0.40 %", "26.3 %", "99.50 %", "100.00 %"]
    assert encounter_table.percent(0, 0) == "–"


@pytest.mark.long
def test_the_command_writes_table_and_figures(tmp_path, monkeypatch, capsys):
    arguments = ["encounters.py", "--count", "6", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", [*arguments, "--families", "several"])
    encounters.main()
    with (tmp_path / "table.csv").open() as file:
        lines = list(csv.DictReader(file))
    assert [line["controller"] for line in lines] == list(encounters.CONTROLLERS)
    assert all(math.isfinite(float(line["solve_us"])) for line in lines)
    with (tmp_path / "runs.csv").open() as file:
        runs = list(csv.DictReader(file))
    avoidable = sum(int(line["avoidable"]) for line in lines)
    assert len(runs) == avoidable
    touched = sum(run["contact"] == "True" for run in runs)
    assert touched == sum(int(line["contacts_avoidable"]) for line in lines)
    assert (tmp_path / "readme.md").read_text().count("\n") == 3
    assert (tmp_path / "failures.png").stat().st_size > 10_000
    assert "qp-ahead" in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["encounters.py", "--families", "none"])
    with pytest.raises(SystemExit):
        encounters.main()


def set_up(robot, family, drawn):
    batch = encounters.Batch(
        robot, encounters.station_tracker(robot), encounters.AvoidanceSettings(dt=0.05)
    )
    return batch, encounters.make_loops(drawn, robot)


@pytest.mark.parametrize("method", ["eq5", "qp-ahead"])
@pytest.mark.parametrize("family", ["parked", "several"])
def test_a_step_at_a_time_is_the_compiled_loop(robot, family, method):
    """The way of the methods of others, taken by ours: their outcomes compare.

    In encounters in which rounding does not decide between two plans.
    """
    drawn = encounters.draw_encounters(family, 5, 8, robot)
    batch, loops = set_up(robot, family, [e for e in drawn if not e.speed])
    compiled = batch.run(method, loops, threads=1)
    scenarios = [encounters.as_scenario(batch, loop) for loop in loops]
    outcomes = [encounters.outcome_of(encounters.run(s, method)) for s in scenarios]
    stepped = np.concatenate(outcomes)
    for name in ("clearance", "room", "deviation", "struck", "start"):
        np.testing.assert_allclose(stepped[name], compiled[name], atol=UNTOUCHED)


@pytest.mark.parametrize("method", ["alone", "qp"])
@pytest.mark.parametrize("family", ["mixed", "several", "carts"])
def test_the_loop_of_movers_that_change_is_the_compiled_loop(robot, family, method):
    """Where nothing changes both are the same: on a path, with accelerations."""
    slow = with_accelerations(robot, 2.0, 2.5)
    drawn = encounters.draw_encounters(family, 4, 8, robot)
    batch, loops = set_up(slow, family, drawn)
    compiled = batch.run(method, loops, threads=1)
    met, rates, times = encounters.meet_all(method, batch, drawn, loops)
    assert rates.shape == (4, 2) and (times >= 0.0).all()
    for name in (
        "clearance",
        "room",
        "deviation",
        "changed",
        "arrived",
        "length",
        "struck",
    ):
        np.testing.assert_allclose(met[name], compiled[name], atol=5 * UNTOUCHED)


def test_the_guide_of_movers_that_change_is_that_of_a_run(robot):
    """Where nothing changes both are the same: station and guide, a step at a time."""
    drawn = encounters.draw_encounters("several", 5, 8, robot)
    still = [e for e in drawn if not e.speed]
    batch, loops = set_up(robot, "several", still)
    met = encounters.meet_all("qp-ahead+guide", batch, still, loops)
    scenarios = [encounters.as_scenario(batch, loop) for loop in loops]
    logs = [encounters.run(s, "qp-ahead+guide") for s in scenarios]
    outcomes = np.concatenate([encounters.outcome_of(log) for log in logs])
    assert (met.outcome["length"] > 0.1).any()
    for name in ("clearance", "room", "deviation", "struck"):
        np.testing.assert_allclose(
            met.outcome[name], outcomes[name], atol=5 * UNTOUCHED
        )


@pytest.mark.long
def test_methods_of_others(tmp_path, monkeypatch):
    rows, runs = encounters.study("several", 4, 5, ["stop", "qp-ahead"])
    assert [row["controller"] for row in rows] == ["stop", "qp-ahead"]
    assert rows[0]["avoidable"] == rows[1]["avoidable"]
    assert 0 < rows[0]["contacts_avoidable"] <= rows[0]["avoidable"]
    assert rows[1]["contacts_avoidable"] == 0 and len(runs) == 8
    (tmp_path / "mine_e.py").write_text(
        "def still(v, omega, obstacles, context):\n    return 0.0, 0.0\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    rows, runs = encounters.study("corridor", 2, 5, ["mppi", "mine_e:still"])
    assert [row["chatter_runs"] for row in rows] == [2, 2] and len(runs) == 4
    assert runs[-1]["controller"] == "mine_e:still"


@pytest.mark.slow
def test_targets_on_a_thousand_encounters_of_each_family():
    for family in encounter_scenes.DISCS:
        rows, _ = encounters.study(family, 1000, 11)
        row = next(r for r in rows if r["controller"] == "qp-ahead")
        assert row["contacts_avoidable"] <= 1e-3 * row["avoidable"]
        if family in ("parked", "path"):
            assert row["r_min_kept_to_1_mps"] >= 0.99
            assert row["r_min_kept_above_1_mps"] >= 0.97
            assert row["not_returned"] == 0
