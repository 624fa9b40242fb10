"""``closest``: r_min of what stands gives way where what moves would touch else."""

import math

import numpy as np
import pytest

from driven import least_on_way
from problems import ROBOTS, Scene, loop
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead
from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.world import Track, World
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot

ROBOT, R_MIN, DT = Robot.mir100(), 0.17, 0.05
EPSILON = 1e-3 + 1e-6
HALF = 0.8


def settings(closest):
    return AvoidanceSettings(dt=DT, ahead=LookAhead(closest=closest))


def overtaken(closest, speed, side):
    """A robot parked in a corridor, and somebody who walks by: distances, decisions."""
    walls = np.array([[-4.0, y, 8.0, y] for y in (-HALF, HALF)])
    way = Track.straight(np.array([-1.8, 0.2 * side]), np.array([speed, 0.0]), 0.2)
    world = World(tracks=(way,), walls=walls)
    safety, pose = SafetyFilter(ROBOT, settings(closest)), (0.0, 0.0, 0.0)
    decisions, from_walls = [], []
    for k in range(140):
        seen = world.at(k * DT).seen_from(pose)
        decisions.append(safety.filter(0.0, 0.0, seen))
        wall = Contacts.of(ROBOT.footprint, Obstacles(walls=seen.walls))
        from_walls.append(wall.distance.min())
        pose = arc(*pose, *decisions[-1][:2], DT)
    return min(d.clearance for d in decisions), min(from_walls), decisions


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("speed", [1.2, 1.35])
def test_a_wall_is_come_nearer_to_rather_than_touched_by_somebody(speed, side):
    least, wall, decisions = overtaken(0.02, speed, side)
    assert least > 0.02 - EPSILON
    assert 0.02 - EPSILON < wall < R_MIN - EPSILON
    near = [d for d in decisions if d.clearance < R_MIN - EPSILON]
    assert all(d.status is Status.RELAXED or d.status is Status.PLANNED for d in near)
    told = max(d.shortfall for d in decisions if d.status is Status.RELAXED)
    assert told >= R_MIN - wall - EPSILON


@pytest.mark.parametrize("speed", [1.2, 1.35])
def test_never_where_that_is_not_wanted(speed):
    least, wall, _ = overtaken(math.inf, speed, 1)
    assert least < 0.0 and wall >= R_MIN - EPSILON


@pytest.mark.parametrize("closest", [0.02, 0.08, math.inf])
@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_so_much_is_always_kept(robot, closest):
    """From what stands, among one to three who move, whatever is asked for."""
    undercut, kept = 0, min(closest, R_MIN)
    for i in range(12):
        rng = np.random.default_rng([9, i])
        scene = Scene(rng, least=0.25, movers=int(rng.integers(1, 4)))
        wishes = np.repeat(rng.uniform([-1, -1.5], [1, 1.5], (4, 2)), 20, axis=0)
        safety = SafetyFilter(robot, settings(closest))
        _, trace, _ = loop(safety, scene, wishes, DT, lambda v, omega, seen: None)
        least = least_on_way(robot.footprint.vertices, trace, DT, scene.lines)
        still = np.hypot(*scene.lines[:, 5:7].T) == 0.0
        from_standing = least[:, still].min(initial=math.inf)
        assert from_standing >= kept - EPSILON
        undercut += from_standing < R_MIN - EPSILON
    assert closest != math.inf or undercut == 0


@pytest.mark.parametrize("closest", [0.0, -0.1, 0.005, math.nan])
def test_it_is_at_least_a_centimetre(closest):
    with pytest.raises(InvalidInputError, match=r"closest >= 0.01"):
        LookAhead(closest=closest)
