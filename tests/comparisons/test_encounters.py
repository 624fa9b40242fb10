"""Encounters: discs aimed at the robot, as scenarios; a robot parked among people."""

import csv
import math

import numpy as np
import pytest

encounters = pytest.importorskip("encounters", reason="needs qpavoid[study]")

import rows
import station
from places import COMPARISONS, ROOT
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.study.sweep.job import run_job
from qpavoid.lab.study.sweep.study import read_study
from qpavoid.model.contact import point_contact

FAMILIES = "parked", "several"


@pytest.mark.parametrize("family", FAMILIES)
def test_discs_are_as_stated_and_aimed_at_the_robot(robot, family):
    edges = robot.footprint.edges
    for encounter in encounters.draw_encounters(family, 40):
        assert encounter.speed == 0.0 or 0.5 <= encounter.speed <= 1.0
        assert len(encounter.discs) == 1 or family == "several"
        for disc, velocity in zip(encounter.discs, encounter.velocities, strict=True):
            first = point_contact(edges, *disc[:2]).distance - disc[2]
            assert 0.8 - 1e-6 <= first <= 2.5 + 1e-6
            assert 0.05 - 1e-9 <= np.hypot(*velocity) <= 1.5 + 1e-9
            times = np.linspace(0.0, 120.0, 4801)[:, None]
            places = disc[:2] + (velocity - [encounter.speed, 0.0]) * times
            least = min(point_contact(edges, *place).distance for place in places)
            assert least < disc[2] + 0.1 or encounter.speed > 0.0


@pytest.mark.parametrize("seed", [2, 3])
def test_an_encounter_is_a_scenario(seed, tmp_path):
    source = encounters.Encounters("several")
    encounter = encounters.draw_encounters("several", 4)[seed]
    scene = make_scenario(source.sample(seed), source.name, tmp_path / "x.toml")
    plan = scene.path.sample(np.array([0.0, 2.0, 5.5, 20.0]))
    speed = encounter.speed
    assert plan[:, 3] == pytest.approx([speed, speed, 0.5 * speed, 0.0], abs=0.01)
    assert plan[-1, 0] == pytest.approx(5.5 * speed, abs=1e-6)
    seen = scene.world.at(2.0)
    moved = encounter.discs[:, :2] + 2.0 * encounter.velocities
    assert seen.discs[:, :2] == pytest.approx(moved)
    late = scene.world.at(scene.duration - encounters.RETURN).discs
    away = np.hypot(*(late[:, :2] - plan[-1, :2]).T) - late[:, 2]
    assert (away > 0.3).all()


def test_a_run_is_that_of_the_rows():
    path = COMPARISONS / "encounters" / "encounters.toml"
    kept = dict(rows.read_cells("encounters"))
    jobs = [x for x in read_study(path).jobs() if x.controller == "ttc"]
    for job in (jobs[0], jobs[2]):
        row, _ = run_job(job)
        known = dict(kept[job.source.name, str(job.seed)])["ttc"]
        assert rows.cell_of(row) == known


@pytest.mark.parametrize("kind", station.KINDS)
def test_a_visitor_comes_by_and_leaves_and_keeps_off_the_bench(kind):
    walls, step = station.box_walls(*station.BENCH), station.SETTINGS.dt
    for seed in range(3):
        visitor, gaps, seconds = station.Visitor(kind, seed), [], 0.0
        while not visitor.gone:
            bodies = station.seen([visitor])
            gaps.append(station.clearance(station.STATION, bodies))
            for wall in np.reshape(walls, (-1, 2, 2)):
                ends = np.linspace(*wall, 20)
                place = np.array(visitor.disc[:2])
                assert np.linalg.norm(ends - place, axis=1).min() > station.RADIUS
            speed = np.linalg.norm(visitor.people.velocities)
            assert speed <= visitor.people.speeds.max() + 1e-9 <= 1.5 + 1e-9
            visitor.step(station.STATION, (0.0, 0.0), step)
            seconds += step
        assert min(gaps) < 2.5 and gaps[0] > 3.0 and gaps[-1] > 3.0
        assert seconds < station.LATE - station.RETURN
        if kind == "beside":
            near = step * sum(gap < min(gaps) + 0.15 for gap in gaps)
            assert 0.2 < min(gaps) < 1.2 and near > 5.0
        bodies = visitor.outlines
        assert len(bodies) == (kind in station.BODIES)


def test_a_parked_robot_lets_a_cart_pass_and_returns():
    ours, still = (station.visit((x, "cart", 0)) for x in ("ours", "nothing"))
    assert still["touched"] == "person" and not still["driven_m"]
    assert not ours["touched"] and not ours["bench"]
    assert ours["off_mm"] < 20.0 and ours["off_deg"] < 2.0
    least = station.SETTINGS.radius.r_min()
    found = station.summary([ours, ours], [still, {**ours, "distance_m": least}])
    assert found["visits"] == 2 and found["free"] == 1 and found["clear"] == 0
    assert found["driven_free_m"] == round(ours["driven_m"], 2)


def test_the_page_has_the_rows_of_the_station():
    with (COMPARISONS / "results/station.csv").open() as file:
        found = list(csv.DictReader(file))
    text = (ROOT / "docs/station.md").read_text()
    ours = [row for row in found if row["method"] == "ours"]
    for line in station.table(found, "method") + station.table(ours, "kind"):
        assert line in text
    total = station.totals(found, "method")["ours"]
    assert {row["kind"] for row in found} == set(station.KINDS)
    touched = total["by_robot"] + total["by_person"]
    assert touched <= 0.02 * total["visits"] and not total["bench"] + total["off"]
    assert math.isclose(total["visits"], 270)
