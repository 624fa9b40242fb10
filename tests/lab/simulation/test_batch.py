"""Thousands of closed loops: what they say is what a single run says."""

import math

import numpy as np
import pytest

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import UnknownNameError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.simulation.batch import Batch, Loop
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.simulation.world import Track, World
from qpavoid.model.obstacles import Obstacles
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.path import SplinePath
from qpavoid.tracking.station import StationKeeping, StationTracker

DT, DURATION = 0.05, 24.0


def tracker(robot):
    return StationTracker(Gains(1.0, 4.0, 2.0), StationKeeping(), robot.limits)


def batch(robot, **more):
    return Batch(robot, tracker(robot), AvoidanceSettings(dt=DT), **more)


def world():
    discs = np.array([[2.0, 0.4, 0.3], [6.0, -2.5, 0.2]])
    return discs, np.array([[0.0, 0.0], [-0.1, 0.5]]), np.array([[4.0, 2.0, 5.0, 0.9]])


@pytest.fixture(scope="module")
def path():
    return SplinePath(np.array([(0.0, 0.0), (3.0, 0.0), (6.0, 0.0)]), 0.6)


def loop(path):
    discs, velocities, walls = world()
    plan = path.sample(np.arange(0.0, DURATION + DT, DT))
    things = Obstacles(discs=discs, disc_velocities=velocities, walls=walls)
    return Loop(plan, things, (0.0, 0.0, 0.0, 0.0, 0.0), DURATION, quiet=DURATION)


@pytest.mark.parametrize("waiting", [NEVER, Waiting()], ids=["clock", "waits"])
@pytest.mark.parametrize(
    "guide",
    [None, GuideSettings()],
    ids=["plain", "guide"],
)
@pytest.mark.parametrize("name", ["eq5", "eq7", "qp", "qp-repulsion", "qp-ahead"])
def test_a_loop_of_a_batch_is_a_run(robot, path, name, guide, waiting):
    discs, velocities, walls = world()
    moving = Track.straight(discs[1, :2], velocities[1], float(discs[1, 2]))
    scenario = Scenario(
        name="batch",
        title="",
        robot=robot,
        settings=AvoidanceSettings(dt=DT),
        tracker=tracker(robot),
        path=path,
        world=World(discs=discs[:1], tracks=(moving,), walls=walls),
        start=(0.0, 0.0, 0.0),
        duration=DURATION,
        dt=DT,
        waiting=waiting,
        guide=guide,
    )
    log = run(scenario, name)
    runs = batch(robot, waiting=waiting, guide=guide).run(name, [loop(path)])
    x, y, heading = log.final
    goal = path.sample(np.array([1e9]))[0]
    assert runs["error"][0] == pytest.approx(
        math.hypot(x - goal[0], y - goal[1]), abs=1e-9
    )
    assert runs["heading_error"][0] == pytest.approx(abs(heading - goal[2]), abs=1e-9)
    assert runs["clearance"][0] == pytest.approx(
        log["least_clearance_m"].min(), abs=1e-9
    )
    away = np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"]).max()
    assert runs["deviation"][0] == pytest.approx(away, abs=1e-9)


def test_threads_do_not_change_the_answer(robot, path):
    loops = [loop(path)] * 5
    one, four = (batch(robot).run("qp-ahead", loops, threads=n) for n in (1, 4))
    assert np.array_equal(one, four)
    assert len(set(one["clearance"])) == 1


def test_a_robot_at_its_goal_ends_early_but_not_before_it_is_quiet(robot):
    still = Loop(np.zeros((2, 5)), Obstacles(), (0.0,) * 5, 60.0, quiet=4.0)
    outcome = batch(robot).run("alone", [still])[0]
    assert outcome["arrived"] == DT
    assert 4.0 < outcome["time"] < 4.2
    assert outcome["clearance"] == math.inf


def test_unknown_controllers_are_named(robot):
    with pytest.raises(UnknownNameError, match="qp-ahed"):
        batch(robot).run("qp-ahed", [])
    with pytest.raises(UnknownNameError, match="nmpc"):
        batch(robot).run("nmpc", [])


@pytest.mark.parametrize("name", ["qp", "qp-ahead"])
def test_another_solver_takes_the_same_way(robot, path, name):
    """Without a compiled form: the ordinary steps behind the same call."""
    loops = [loop(path)]
    ours = batch(robot).run(name, loops)[0]
    theirs = batch(robot).run(name, loops, solver="qpsolvers:daqp")[0]
    for column in ("clearance", "room", "deviation", "error", "time"):
        assert theirs[column] == pytest.approx(ours[column], abs=1e-4)
    assert theirs["changed"] == pytest.approx(ours["changed"], abs=2 * DT)


def test_a_solver_that_is_not_there_is_refused(robot, path):
    with pytest.raises(UnknownNameError, match="daqb"):
        batch(robot).run("qp", [loop(path)], solver="daqb")


@pytest.mark.parametrize(
    ("disc", "speed", "struck"), [((-1.4, 0.0, 0.3), 0.6, 0), ((1.5, 0.0, 0.3), 0.0, 1)]
)
def test_who_moved_when_a_contact_began(robot, disc, speed, struck):
    """Stands for 3 s and drives on: run over from behind before, or into what is there.

    Once it drives it touches the first disc too, which is no contact of its own.
    """
    plan = np.zeros((160, 5))
    plan[60:, 0], plan[60:-1, 3] = 0.025 * np.arange(100), 0.5
    things = Obstacles(discs=np.array([disc]), disc_velocities=np.array([[speed, 0.0]]))
    ran = Loop(plan, things, (0.0,) * 5, 8.0, quiet=8.0)
    outcome = batch(robot).run("alone", [ran], threads=1)[0]
    assert outcome["clearance"] < 0.0 < outcome["start"]
    assert outcome["length"] > 1.0
    assert outcome["struck"] == struck
