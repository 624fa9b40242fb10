"""CrowdNav's cases: as the original draws, moves and judges them."""

import csv
import sys

import numpy as np
import pytest

from qpavoid.errors import ConfigError

pytest.importorskip("pyrvo", reason="needs qpavoid[baselines]")
crowdnav = pytest.importorskip("crowdnav", reason="needs qpavoid[study]")
world = pytest.importorskip("crowdnav_world")


def drawn_as_there(seed, count):
    """The original's loop, agent by agent; the robot is the first."""
    np.random.seed(seed)  # noqa: NPY002 - the generator that it seeds
    random = np.random.random
    agents = [(0.0, -4.0, 0.0, 4.0)]

    def apart(x, y):
        places = [(a[2 * end], a[2 * end + 1]) for a in agents for end in (0, 1)]
        return all(np.hypot(x - a, y - b) >= 0.3 + 0.3 + 0.2 for a, b in places)

    for _ in range(count):
        while True:
            angle = random() * np.pi * 2
            x = 4.0 * np.cos(angle) * 1.0
            noise = random() - 0.5, random() - 0.5
            x, y = x + noise[0], 4.0 * np.sin(angle) + noise[1]
            if apart(x, y):
                break
        agents.append((x, y, -x, -y))
    found = np.array(agents[1:])
    return found[:, :2], found[:, 2:]


@pytest.mark.parametrize(("seed", "count"), [(0, 5), (99, 5), (1000, 5), (1499, 10)])
def test_people_are_drawn_as_there(seed, count):
    for mine, theirs in zip(
        world.draw_people(seed, count), drawn_as_there(seed, count), strict=True
    ):
        assert mine == pytest.approx(theirs, abs=1e-12)


def test_phases_share_no_case():
    spans = {
        name: range(first, first + world.CASES[name])
        for name, first in world.FIRST_SEED.items()
    }
    assert spans["test"] == range(1000, 1500) and spans["val"] == range(100)
    assert spans["train"].start == 2000
    assert crowdnav.Crowd("test").meet(3).places == pytest.approx(
        world.draw_people(1003, 5)[0]
    )


def test_orca_is_as_published():
    """0.43 of 500 cases arrive and 0.57 touch, in 10.86 s; here the first 50."""
    crowd = crowdnav.Crowd()
    rows = [crowdnav.episode(crowdnav.HOLONOMIC, crowd, case) for case in range(50)]
    successes = sum(row["success"] for row in rows)
    assert 18 <= successes <= 26
    assert successes + sum(row["contact"] for row in rows) == 50
    times = [row["arrived_s"] for row in rows if row["success"]]
    assert np.mean(times) == pytest.approx(10.86, abs=0.5)


@pytest.mark.parametrize(
    ("place", "before", "end", "event"),
    [
        ((0.0, 4.7), (0.0, 0.0), (0.0, 4.15), "touched"),
        ((0.0, 4.7), (0.0, 4.0), (0.0, 4.15), "arrived"),
        ((0.0, 4.9), (0.0, 0.0), (0.0, 4.15), "arrived"),
        ((0.9, 4.0), (-8.0, 0.0), (0.0, 3.9), "touched"),
        ((0.9, 3.5), (0.0, 0.0), (0.0, 3.69), ""),
    ],
)
def test_a_tick_is_judged_by_the_velocities_before(place, before, end, event):
    people = world.People(np.array([place]), np.array([place]))
    people.before = np.array([before])
    assert world.judge_tick(people, np.array([0.0, 3.9]), np.array(end)) == event


def test_a_robot_sees_velocities_when_they_have_been_driven():
    seen = []

    def method(v, omega, obstacles, context):
        seen.append(np.hypot(*obstacles.disc_velocities.T))
        return 0.5, 0.0

    crowd = crowdnav.Crowd(people=3)
    robot, people = crowdnav.Driven(method, crowd), crowd.meet(0)
    speeds = [np.zeros(3)]
    for k in range(2):
        people.decide()
        way = robot.drive(world.TICK * k, people)
        speeds.append(np.linalg.norm(people.velocities, axis=1))
        people.move()
    assert way[0] == pytest.approx([0.0, -3.875]) and len(way) == 6
    assert way[-1] == pytest.approx([0.0, -3.75])
    now = [0, *[1] * 5, *[2] * 4]
    assert seen == [pytest.approx(speeds[k]) for k in now]


def study(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["crowdnav.py", "--workers", "1", *arguments])
    crowdnav.main()


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_two_cases(tmp_path, monkeypatch, capsys):
    options = ["--phase", "val", "--seed", "3", "--count", "2", "--people", "2,4"]
    options += ["--methods", "alone,qp-ahead"]
    study(monkeypatch, *options, "--out", str(tmp_path))
    runs = read(tmp_path / "runs.csv")
    assert [row["seed"] for row in runs] == ["3", "4"] * 4
    assert runs[0]["setting"] == "2 people"
    assert [row["method"] for row in runs[::2]] == ["alone", "qp-ahead"] * 2
    for row in runs:
        assert (row["success"] == "True") == (row["outcome"] == "arrived")
        assert (row["contact"] == "True") == (row["outcome"] == "touched")
        if row["success"] == "True":
            assert 7.0 < float(row["arrived_s"]) <= 24.0
    assert "qp-ahead, 2 people: {" in capsys.readouterr().out


def test_a_run_that_fails_is_a_row_and_the_exit_status(tmp_path, monkeypatch, capsys):
    """The people of the second of two cases find no places."""

    def meet(crowd, case):
        if case == 4:
            raise ConfigError(["no room"])
        return world.People(*world.draw_people(case, crowd.people))

    monkeypatch.setattr(crowdnav.Crowd, "meet", meet)
    options = ["--phase", "val", "--seed", "3", "--count", "2", "--people", "2"]
    with pytest.raises(SystemExit, match="1"):
        study(monkeypatch, *options, "--methods", "alone", "--out", str(tmp_path))
    runs = read(tmp_path / "runs.csv")
    assert [row["error"] for row in runs] == ["", "ConfigError: no room"]
    assert runs[1]["outcome"] == "failed" and runs[1]["min_room_m"] == ""
    assert "1 of 2 runs failed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--phase", "val", "--seed", "90", "--count", "11"], "cases 0 to 99"),
        (["--methods", "qp,nobody"], "nobody"),
        (["--people", "40", "--methods", "alone", "--count", "1"], "no room"),
    ],
)
def test_wrong_options_are_said(arguments, said, tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, *arguments, "--out", str(tmp_path / "out"))
    assert said in capsys.readouterr().err
