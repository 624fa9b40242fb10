"""Encounters as scenarios, people and their reactions, a robot parked among them."""

import math

import numpy as np
import pytest

from people import FRONT, NEAR, REACTIONS, SCARED_SPEED, People
from qpavoid.errors import ConfigError

encounters = pytest.importorskip("encounters", reason="needs qpavoid[study]")

import rows
import station
from places import COMPARISONS, ROOT, table
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
    found = table("station.csv")
    text = (ROOT / "docs/station.md").read_text()
    ours = [row for row in found if row["method"] == "ours"]
    for line in station.table(found, "method") + station.table(ours, "kind"):
        assert line in text
    total = station.totals(found, "method")["ours"]
    assert {row["kind"] for row in found} == set(station.KINDS)
    touched = total["by_robot"] + total["by_person"]
    assert touched <= 0.02 * total["visits"] and not total["bench"] + total["off"]
    assert math.isclose(total["visits"], 270)


ROBOT = (0.0, 0.0, 0.5 * math.pi)


def walk(people, seconds, robot=None, dt=0.1):
    """Places (k, n, 2) after every step; no one is ever faster than desired."""
    places = []
    for _ in range(round(seconds / dt)):
        people.step(*([] if robot is None else [robot]), dt=dt)
        assert (np.linalg.norm(people.velocities, axis=1) < people.speeds + 1e-9).all()
        places.append(people.places)
    return np.array(places)


def meeting(reaction, duration=40.0):
    """Somebody whose straight way leads past the robot's centre at 0.2 m."""
    people = People([(-6.0, 0.2)], [(6.0, 0.2)], 1.3, reactions=reaction)
    people.duration = duration
    return people


def apart(places):
    return np.linalg.norm(places[:, 0], axis=1)


def test_a_lone_person_walks_straight_to_the_goal_at_the_desired_speed():
    people = People([(0.0, 0.0)], [(6.0, 8.0)], 1.4)
    places = walk(people, 12.0)[:, 0]
    assert places[-1] == pytest.approx((6.0, 8.0), abs=0.31)
    assert places @ (0.8, -0.6) == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(places[50] - places[40]) == pytest.approx(1.4, abs=1e-4)
    assert np.linalg.norm(people.velocities) < 0.01


def corridor(mirror=1.0, seed=3, groups=None):
    random, n = np.random.default_rng(seed), 3
    y = np.append(np.linspace(-0.7, 0.7, n), np.linspace(-0.6, 0.8, n))
    x = np.repeat([-6.0, 6.0], n) + random.uniform(-0.5, 0.5, 2 * n)
    places = np.column_stack([x, mirror * y])
    goals = np.column_stack([np.repeat([9.0, -9.0], n), mirror * y])
    walls = [(-12, -1.5, 12, -1.5), (-12, 1.5, 12, 1.5)]
    speeds = random.uniform(0.8, 1.4, 2 * n)
    return People(places, goals, speeds, 0.25, groups, walls=walls, seed=seed)


def test_mirrored_people_walk_mirrored_ways():
    here, there = (walk(corridor(mirror), 20.0) for mirror in (1.0, -1.0))
    assert here * [1.0, -1.0] == pytest.approx(there, abs=1e-6)


@pytest.mark.parametrize("groups", [None, [0, 0, 0, 1, 1, 1]])
def test_two_groups_pass_each_other_in_a_corridor(groups):
    people = corridor(groups=groups)
    places = walk(people, 40.0)
    between = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
    assert between[:, ~np.eye(6, dtype=bool)].min() > 0.5
    assert abs(places[..., 1]).max() < 1.25
    assert np.linalg.norm(people.goals - people.places, axis=1).max() < 0.4


def test_a_group_stays_together_and_waits_for_the_slow():
    starts, goals = [(0, 0), (0, 1), (-1, 0)], [(20, 0), (20, 1), (20, 2)]
    widths = []
    for groups in (None, (0, 0, 0)):
        places = walk(People(starts, goals, (1.4, 1.0, 1.2), groups=groups), 12.0)
        widths.append(np.ptp(places[-1], axis=0)[0])
    assert widths[1] < 1.5 < 2.5 < widths[0]


def test_reactions_to_a_robot():
    found = {name: walk(meeting(name), 20.0, ROBOT) for name in REACTIONS}
    least = {name: apart(places).min() for name, places in found.items()}
    last = {name: places[-1, 0] for name, places in found.items()}
    goal = pytest.approx((6.0, 0.2), abs=0.4)
    assert last["regular"] == goal and least["regular"] > 0.6
    assert last["impassive"] == goal and 0.2 <= least["impassive"] < 0.21
    assert 3.0 < math.hypot(*last["surprised"]) < 4.0
    assert NEAR - 0.2 < math.hypot(*last["curious"]) < NEAR
    assert least["scared"] > 1.7
    assert last["threatening"] == pytest.approx((0.0, FRONT), abs=0.45)


def test_who_has_reacted_walks_on():
    for name in ("surprised", "curious", "scared", "threatening"):
        people = meeting(name, duration=6.0)
        places = walk(people, 12.0, ROBOT)
        assert people.speeds == 1.3
        assert places[-1, 0, 0] < 6.0
        assert walk(people, 20.0, ROBOT)[-1, 0] == pytest.approx((6.0, 0.2), abs=0.4)


def test_who_reacts_looks_at_the_robot_and_the_scared_are_slow():
    people = meeting("surprised")
    walk(people, 10.0, ROBOT)
    assert people.headings == pytest.approx(np.arctan2(*(-people.places.T[::-1])))
    scared = meeting("scared")
    walk(scared, 5.0, ROBOT)
    assert np.linalg.norm(scared.velocities) <= SCARED_SPEED + 1e-9


def test_who_looks_away_does_not_react():
    people = People([(1.0, 0.0)], [(9.0, 0.0)], reactions="threatening")
    assert walk(people, 10.0, ROBOT)[-1, 0, 0] > 8.5


def test_a_long_step_is_several_and_the_robot_moves_along():
    one, other = meeting("regular"), meeting("regular")
    one.step((0.0, 0.0, 0.0), (-0.5, 0.0), 0.2)
    for k in range(4):
        other.step((-0.5 * 0.05 * k, 0.0, 0.0), (-0.5, 0.0), 0.05)
    assert one.places == pytest.approx(other.places, abs=1e-12)


def test_bad_input():
    with pytest.raises(ConfigError, match="angry"):
        People([(0, 0)], [(1, 0)], reactions="angry")
    with pytest.raises(ConfigError, match="2 reactions"):
        People([(0, 0), (1, 0)], [(1, 0), (2, 0)], reactions=["regular"])
    with pytest.raises(ValueError, match="reshape"):
        People([(0, 0)], [(1, 0), (2, 0)])
