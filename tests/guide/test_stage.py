"""The stage of the guide: out of every trap, and honest where there is no way."""

import math

import numpy as np
import pytest

from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.errors import InvalidInputError
from qpavoid.guide.guide import ROWS
from qpavoid.guide.rollout import TICK, fill_ahead
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import GuideStage, Tracking
from qpavoid.guide.state import PROGRESS, Progress
from qpavoid.lab.scenario.methods import make_controller
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.tracking.kanayama import Gains, tracking_error
from qpavoid.tracking.path import SplinePath
from qpavoid.tracking.station import StationKeeping, StationTracker

DT = 0.02
STANDING = np.zeros((ROWS, 5))
GOAL = 8.0


TRAPS = {
    "a disc exactly ahead": Obstacles(discs=[(4.0, 0.0, 0.4)]),
    "two discs, too close": Obstacles(discs=[(4.0, 0.7, 0.4), (4.0, -0.7, 0.4)]),
    "a U": Obstacles(
        walls=[(4.5, -1.0, 4.5, 1.0), (2.5, 1.0, 4.5, 1.0), (2.5, -1.0, 4.5, -1.0)]
    ),
    "a wall with a gap": Obstacles(walls=[(4.0, -4.0, 4.0, 0.8), (4.0, 2.0, 4.0, 6.0)]),
    "a wall of points": Obstacles(points=[(4.0, 0.1 * k) for k in range(-10, 11)]),
    "a slalom": Obstacles(walls=[(2.5, -3.0, 2.5, 0.6), (5.2, -0.6, 5.2, 3.0)]),
}


def drive(robot, world, seconds, waits=False):
    """Return pose, twist, desired twist in and out, what was said, and clearance."""
    path = SplinePath(np.array([(0.0, 0.0), (GOAL, 0.0)]), 0.5)
    law = StationTracker(Gains(1, 1, 2), StationKeeping(), robot.limits)
    track, ahead = law.start(), np.empty((ROWS, 5))
    avoid = GuideStage(
        robot, GuideSettings(), AvoidanceSettings(dt=DT), law.array
    ).start()
    step = make_controller("qp", robot, AvoidanceSettings(dt=DT)).start()
    pose, driven, clock, rows = (0.0, 0.0, 0.0), (0.0, 0.0), 0.0, []
    plan = path.sample(np.arange(0.0, path.duration + DT, DT))
    for k in range(round(seconds / DT)):
        seen = (world(k * DT) if callable(world) else world).seen_from(pose)
        place = min(round(clock / DT), len(plan) - 1)
        reference = tuple(plan[place].tolist())
        fill_ahead(plan, float(place), pose, TICK / DT, ahead)
        error = tracking_error(pose, reference[:3])
        desired = track(pose, reference)
        said, *wish = avoid(
            seen, Tracking(desired, error, reference[3], driven, DT, ahead)
        )
        decision = step(*wish, seen)
        driven = decision.v, decision.omega
        rows.append(
            (*pose, *driven, *desired, *wish, PROGRESS.index(said), decision.clearance)
        )
        pose = arc(*pose, *driven, DT)
        clock += 0.0 if waits and pose[0] < reference[0] - 0.5 else DT
    return np.array(rows)


def first(rows, progress):
    """Return the first row in which something is said; −1 for never."""
    found = np.flatnonzero(rows[:, 9] == PROGRESS.index(progress))
    return int(found[0]) if len(found) else -1


def arrived(rows):
    turned = abs(wrap_angle(rows[-1, 2]))
    return math.hypot(rows[-1, 0] - GOAL, rows[-1, 1]) < 0.02 and turned < 0.02


@pytest.mark.parametrize("waits", [False, True], ids=["own time", "waiting"])
@pytest.mark.parametrize("trap", TRAPS)
def test_out_of_every_trap(robot, trap, waits):
    rows = drive(robot, TRAPS[trap], 51.0, waits)
    assert arrived(rows)
    assert rows[:, 10].min() > 0.16
    assert first(rows, Progress.BLOCKED) == -1


def test_a_robot_that_stands_where_it_should_is_never_stalled(robot):
    avoid, beside = GuideStage(robot).start(), Obstacles(discs=[(1.0, 0.0, 0.2)])
    rests = Tracking((0.0, 0.0), (0.5, 0.0, 0.0), 0.0, (0.0, 0.0), DT, STANDING)
    for _ in range(1000):
        assert avoid(beside, rests) == (Progress.CLEAR, 0.0, 0.0)


def test_a_robot_that_cannot_back_up_is_not_asked_to():
    mir = Robot.mir100()
    robot = Robot("forwards only", mir.footprint, Limits(0.0, 1.0, -1.5, 1.5))
    rows = drive(robot, TRAPS["a U"], 51.0)
    detour = rows[:, 9] == PROGRESS.index(Progress.DETOUR)
    assert detour.any()
    assert rows[:, 3].min() >= 0.0
    assert first(rows, Progress.BACKING) == -1


def test_nothing_is_shared_between_runs(robot):
    stage = GuideStage(robot)
    wall = Obstacles(walls=[(0.86, -9.0, 0.86, 9.0)])

    def says(avoid, seconds):
        for _ in range(round(seconds / DT)):
            said, *_ = avoid(
                wall,
                Tracking((0.5, 0.0), (3.0, 0.0, 0.0), 0.5, (0.0, 0.0), DT, STANDING),
            )
        return said

    one = stage.start()
    assert says(one, 1.9) is Progress.CLEAR
    assert says(stage.start(), 1.9) is Progress.CLEAR
    assert says(one, 0.2) is not Progress.CLEAR


@pytest.mark.parametrize(
    "settings",
    [
        {"stall_time": 0.0},
        {"progress": -1.0},
        {"speed": math.nan},
        {"clearance": -0.01},
        {"reach": 1.0},
        {"reach": 50.0},
        {"blocked_time": 1.0},
    ],
)
def test_bad_settings(settings):
    with pytest.raises(InvalidInputError, match="a guide needs"):
        GuideSettings(**settings)


def test_a_robot_that_cannot_turn_has_no_guide():
    footprint = Robot.mir100().footprint
    robot = Robot("rail", footprint, Limits(-1.0, 1.0, 0.0, 1.0))
    with pytest.raises(InvalidInputError, match="drives and turns"):
        GuideSettings().record(robot, SafetyRadius())


def test_the_record_holds_each_setting_under_its_name():
    robot, radius = Robot.mir100(), SafetyRadius(0.1, 0.2, 0.3, 0.4, 1.5, 0.6)
    settings = GuideSettings(speed=0.3, turn_rate=0.4, reach=4.0, clearance=0.07)
    record = settings.record(robot, radius)[0]
    for name, value in (vars(radius) | vars(settings)).items():
        assert record[name] == pytest.approx(value, rel=1e-12), name
    assert record["inner"] == robot.footprint.inner_radius
