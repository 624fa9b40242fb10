"""Forests: scenes that are what they claim to be."""

import json
from dataclasses import dataclass

import numpy as np
import pytest

from qpavoid.lab.worlds import forest as scenes
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles

job = pytest.importorskip("qpavoid.lab.study.sweep.job")


def exact_clearance(footprint, scene, poses):
    world = Obstacles(discs=scene.discs, walls=scene.walls)
    return np.array(
        [
            Contacts.of(footprint, world.seen_from(tuple(p))).distance.min()
            for p in poses
        ]
    )


@pytest.fixture(scope="module")
def some(robot):
    return [scenes.make_scene(robot.footprint, 3, k) for k in range(12)]


def test_scenes_are_as_described(robot, some):
    for scene in some:
        assert 8.0 <= scene.length <= 12.0
        assert 6 <= len(scene.discs) <= 15 and 0 <= len(scene.walls) <= 4
        assert ((scene.discs[:, 2] >= 0.1) & (scene.discs[:, 2] <= 0.5)).all()
        ends = [(x, y, 0.0) for x, y in scene.points]
        start, goal = exact_clearance(robot.footprint, scene, ends)
        assert min(start, goal) >= 0.17
        end = scene.path.sample(np.array([1e9]))[0]
        np.testing.assert_allclose(end, [scene.length, 0.0, 0.0, 0.0, 0.0], atol=1e-6)


def test_the_reference_runs_through_an_obstacle(robot, some):
    for scene in some:
        line = np.zeros((400, 3))
        line[:, 0] = np.linspace(0.0, scene.length, 400)
        assert exact_clearance(robot.footprint, scene, line).min() < 0.0


def wall_with_gap(width):
    walls = [(4.0, -5.0, 4.0, -width / 2), (4.0, width / 2, 4.0, 5.0)]
    return scenes.ForestScene(8.0, np.empty((0, 3)), np.array(walls))


@pytest.mark.parametrize(("width", "passable"), [(0.8, False), (1.2, True)])
def test_a_gap_is_passable_if_the_footprint_fits(robot, width, passable):
    """0.58 m wide, 0.22 m clear on both sides: 1.02 m; turned across it would not."""
    assert scenes.is_passable(robot.footprint, wall_with_gap(width)) is passable


def test_a_dead_end_is_not_passable(robot):
    walls = np.array([(4.0, -5.0, 4.0, 5.0)])
    scene = scenes.ForestScene(8.0, np.empty((0, 3)), walls)
    assert not scenes.is_passable(robot.footprint, scene)


@dataclass(frozen=True)
class Drawn:
    """One scene, whatever the seed."""

    text: str
    name: str = "drawn"

    def sample(self, seed=None):
        return json.loads(self.text)


def test_outcomes():
    """Free, touched by one that sees nothing, held up by a wall, and led round it."""
    empty = scenes.ForestScene(8.0, np.array([(4.0, 2.4, 0.1)]), np.empty((0, 4)))
    ahead = scenes.ForestScene(8.0, np.array([(4.0, 0.0, 0.5)]), np.empty((0, 4)))
    wall = scenes.ForestScene(8.0, np.empty((0, 3)), np.array([(4.0, -1.5, 4.0, 1.5)]))

    def row(method, scene):
        source = Drawn(json.dumps(scenes.scene_document(scene)))
        wanted = job.Job("", source, 0, "{}", None, method, "exact", "none")
        return job.run_job(wanted)[0]

    free = row("qp", empty)
    assert (free["outcome"], free["success"]) == ("arrived", True)
    assert 0.3 <= free["arrived_s"] / free["duration_s"] <= 0.44
    ghost = row("alone", ahead)
    assert (ghost["outcome"], ghost["success"]) == ("touched", False)
    held = row("qp", wall)
    assert (held["outcome"], held["success"]) == ("stalled", False)
    assert row("qp-ahead+guide", wall)["success"]
