"""CrowdNav's cases: as the original draws, moves and judges them."""

import sys

import numpy as np
import pytest

from places import COMPARISONS, table
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


def test_orca_is_as_published():
    """0.43 of 500 cases arrive and 0.57 touch, in 10.86 s; here the first 50.

    Where goals change 0.688 of 250 arrive, 0.264 touch, in 23.4 s; here 20.
    """
    for crowd, cases, arrive, touch, time in (
        (crowdnav.Crowd(), 50, (0.36, 0.52), (0.48, 0.64), 10.86),
        (crowdnav.Crowd(people=20, changing="circle"), 20, (0.5, 0.85), (0.1, 0.4), 23),
    ):
        rows = [crowdnav.run_case(crowdnav.HOLONOMIC, crowd, k) for k in range(cases)]
        total = crowdnav.summary(rows)
        assert arrive[0] <= total["success"] <= arrive[1]
        assert touch[0] <= total["collision"] <= touch[1]
        assert total["time_s"] == pytest.approx(time, rel=0.15)


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
    assert people.judge(np.array([[0.0, 3.9], end])) == event


def test_a_robot_sees_velocities_when_they_have_been_driven():
    seen = []

    def method(v, omega, obstacles, context):
        seen.append(np.hypot(*obstacles.disc_velocities.T))
        return 0.5, 0.0

    crowd = crowdnav.Crowd(people=3)
    people = crowd.meet(0)
    robot = crowdnav.Driven(
        method, crowd, people, crowdnav.make_scene(people, crowd.ticks)
    )
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


@pytest.mark.parametrize("crossing", ["circle", "square"])
def test_people_change_their_goals_and_are_replaced_when_they_arrive(crossing):
    people = crowdnav.Crowd(people=20, changing=crossing).meet(0)
    assert np.linalg.norm(people.start - people.goal) >= 8.0
    if crossing == "circle":
        assert people.goals == pytest.approx(-people.places)
    assert 0.3 <= people.radii.min() < 0.35 and 0.45 < people.radii.max() <= 0.5
    changed = replaced = 0
    for tick in range(1, 81):
        people.decide()
        goals, radii, came = people.goals.copy(), people.radii.copy(), people.at(0.25)
        people.move()
        new = people.radii != radii
        other = (people.goals != goals).any(axis=1) & ~new
        near = np.linalg.norm(came - people.goals, axis=1) < radii
        assert not (near & ~new).any() and not people.before[new].any()
        assert tick % 20 == 0 or not other.any()
        changed, replaced = changed + other.sum(), replaced + new.sum()
    assert 25 <= changed <= 55 and replaced > 0  # half of 20 people four times


def test_a_changing_crowd_is_judged_by_present_discs():
    people = crowdnav.Crowd(people=1, changing="circle").meet(0)
    people.decide()
    place = people.at(0.25)[0]
    for gap, event in ((-1e-6, "touched"), (1e-6, "")):
        end = place + [people.radii[0] + 0.3 + gap, 0.0]
        assert people.judge(np.array([people.start, end])) == event
    people.places -= 50.0
    assert (
        people.judge(np.array([people.start, people.goal + [0.29, 0.0]])) == "arrived"
    )


def test_a_robot_among_changing_people_sees_those_within_five_metres():
    seen = []

    def method(v, omega, obstacles, context):
        seen.append(len(obstacles.discs))
        return 0.0, 0.0

    crowd = crowdnav.Crowd(people=20, changing="circle")
    people = crowd.meet(0)
    people.decide()
    crowdnav.Driven(
        method, crowd, people, crowdnav.make_scene(people, crowd.ticks)
    ).drive(0.0, people)
    gaps = np.linalg.norm(people.places - people.start, axis=1) - people.radii
    assert seen[0] == (gaps < 5.3).sum() and 0 < seen[0] < 20


def reacting(kind, count=40):
    return crowdnav.Crowd("val", count, reacting=kind).meet(2)


@pytest.mark.parametrize("kind", ["orca", "force"])
def test_a_reacting_crowd_repeats_without_a_seam(kind):
    """Where the square begins changes no velocity of people who are alone."""
    people, other = reacting(kind), reacting(kind)
    for some in (people, other):
        some._present = False
    other._robot = other._robot + [3.0, -2.0]
    other.places = other._near(other.places)
    assert abs(people.places - other.places).max() == pytest.approx(8.0)
    people.decide()
    other.decide()
    assert other.velocities == pytest.approx(people.velocities, abs=1e-3)


@pytest.mark.parametrize("kind", ["orca", "force"])
def test_reacting_people_walk_round_each_other_and_a_robot_at_rest(kind):
    people, way, nearest = reacting(kind), np.array([[-3.0, 0.0]] * 3), []
    for _ in range(80):
        people.decide()
        assert people.judge(way) == ""
        people.move()
        apart = people.places[:, None] - people.places
        apart -= 8.0 * np.round(apart / 8.0)
        nearest.append((np.linalg.norm(apart, axis=-1) + np.eye(40)).min())
    assert min(nearest) > 0.4 - 0.02
    speeds = (people.velocities * people._ahead).sum(axis=1) / people._pace
    assert 0.6 < speeds.mean() <= 1.1


@pytest.mark.parametrize("kind", ["orca", "force"])
def test_who_walks_round_a_robot_has_a_delay_and_a_detour(kind):
    people, length = reacting(kind, 1), 0.0
    people.places = people.start - 2.0 * people._ahead + [[0.05, 0.05]]
    for _ in range(40):
        people.decide()
        assert people.judge(np.array([people.start] * 3)) == ""
        people.move()
        length += 0.1 * np.linalg.norm(people.before)
    way = float(((people.places - people.start) @ people._ahead.T)[0, 0]) + 2.0
    effect = people.effect()
    assert effect["lasted_s"] == pytest.approx(4.0)
    assert effect["people_detour_m"] == pytest.approx(length - way, abs=0.06)
    assert effect["people_delay_s"] == pytest.approx(4 - way / people._pace[0], abs=0.1)
    assert min(effect.values()) > 0.01


def test_a_reacting_crowd_is_judged_from_step_to_step():
    people = reacting("orca", 1)
    people.places, people.velocities = np.array([[0.0, 0.6]]), np.zeros((1, 2))
    for near, event in ((0.099, ""), (0.101, "touched")):
        way = np.array([[-0.05, 0.0], [0.0, near], [0.05, 0.0]])
        assert people.judge(way) == event
    assert people.judge(np.array([[2.0, 0.0], [2.71, 0.0]])) == "arrived"


def test_the_page_shows_the_results():
    page = (COMPARISONS / "README.md").read_text("utf-8")
    for row in table("crowdnav_changing.csv"):
        setting, method, n, *shares, time, share = row.values()
        cells = [f"{float(x):.3f}" for x in shares]
        cells += f"{float(time):.1f}", f"{float(share):.1f}"
        assert f"| `{method}` | {setting} | {n} | {' | '.join(cells)} |" in page


def test_the_page_of_crowds_that_react_shows_the_results():
    page = (COMPARISONS / "crowdnav/README.md").read_text("utf-8")
    for row in table("crowdnav_reacting_people.csv"):
        setting, method, n, *shares, time, delay, error, detour, other = row.values()
        cells = [f"{float(x):.2f}" for x in shares]
        cells += [f"{float(time):.1f}" if time else "–"]
        cells += f"{float(delay):.2f} ± {float(error):.2f}", f"{float(detour):.2f} ± "
        assert f"| {setting} | `{method}` | {n} | {' | '.join(cells)}" in page
        assert f"{float(other):.2f} |" in page


def study(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["crowdnav.py", "--workers", "1", *arguments])
    crowdnav.main()


def test_two_cases(tmp_path, monkeypatch, capsys):
    options = ["--phase", "val", "--seed", "3", "--count", "2", "--people", "2,4"]
    options += ["--methods", "alone,qp-ahead"]
    study(monkeypatch, *options, "--out", str(tmp_path))
    runs = table(tmp_path / "runs.csv")
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
    runs = table(tmp_path / "runs.csv")
    assert [row["error"] for row in runs] == ["", "ConfigError: no room"]
    assert runs[1]["outcome"] == "failed" and runs[1]["min_room_m"] == ""
    assert "1 of 2 runs failed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--phase", "val", "--seed", "90", "--count", "11"], "cases 0 to 99"),
        (["--methods", "qp,nobody"], "nobody"),
        (["--people", "40", "--methods", "alone", "--count", "1"], "no room"),
        (["--changing", "triangle"], "triangle"),
        (["--methods", "qp@radar"], "radar"),
        (["--changing", "circle", "--reacting", "orca"], "not allowed"),
    ],
)
def test_wrong_options_are_said(arguments, said, tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        study(monkeypatch, *arguments, "--out", str(tmp_path / "out"))
    assert said in capsys.readouterr().err
