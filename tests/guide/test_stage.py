"""The stage of the guide: out of every trap, and honest where there is no way."""

import math

import numpy as np
import pytest

from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.errors import InvalidInputError
from qpavoid.guide.guide import ROWS
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import CLEAR, Stage, Tracking, fresh_stage, start_stage
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot

DT = 0.02
STANDING = np.zeros((ROWS, 5))
SETTINGS = GuideSettings(), AvoidanceSettings(), np.zeros(9)


def test_a_robot_that_stands_where_it_should_is_never_stalled(robot):
    avoid = start_stage(Stage.of(robot, *SETTINGS), fresh_stage())
    beside = Obstacles(discs=[(1.0, 0.0, 0.2)])
    rests = Tracking((0.0, 0.0), (0.5, 0.0, 0.0), 0.0, (0.0, 0.0), DT, STANDING)
    for _ in range(1000):
        assert avoid(beside, rests) == (CLEAR, 0.0, 0.0)


def test_nothing_is_shared_between_runs(robot):
    stage = Stage.of(robot, *SETTINGS)
    wall = Obstacles(walls=[(0.86, -9.0, 0.86, 9.0)])

    def says(avoid, seconds):
        for _ in range(round(seconds / DT)):
            said, *_ = avoid(
                wall,
                Tracking((0.5, 0.0), (3.0, 0.0, 0.0), 0.5, (0.0, 0.0), DT, STANDING),
            )
        return said

    one = start_stage(stage, fresh_stage())
    assert says(one, 1.9) == CLEAR
    assert says(start_stage(stage, fresh_stage()), 1.9) == CLEAR
    assert says(one, 0.2) != CLEAR


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
    told = vars(radius) | vars(settings)
    del told["yielding"]  # not of the compiled part
    for name, value in told.items():
        assert record[name] == pytest.approx(value, rel=1e-12), name
    assert record["inner"] == robot.footprint.inner_radius
