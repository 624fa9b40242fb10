"""Forests: scenes that are what they claim to be."""

import json
import math
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


def test_scenes_repeat_and_differ(robot, some):
    again = scenes.make_scene(robot.footprint, 3, 5)
    np.testing.assert_array_equal(again.discs, some[5].discs)
    np.testing.assert_array_equal(again.walls, some[5].walls)
    other = scenes.make_scene(robot.footprint, 4, 5)
    assert other.length != again.length
    assert len({scene.length for scene in some}) == len(some)


def test_clear_agrees_with_the_contacts(robot, some):
    """Never clear where the exact distance says no; and mostly clear where it is."""
    rng, agreed = np.random.default_rng(0), []
    for scene in some:
        poses = rng.uniform((0, -2.5, -3), (scene.length, 2.5, 3), (40, 3))
        clear = scenes.clear(
            robot.footprint.edges, poses, scene.discs, scene.walls, 0.22
        )
        truth = exact_clearance(robot.footprint, scene, poses) >= 0.22
        assert not (clear & ~truth).any()
        agreed.extend(clear == truth)
    assert np.mean(agreed) > 0.97


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


def test_a_step_of_the_lattice_goes_along_its_heading():
    along = scenes.STEPS / np.hypot(*scenes.STEPS.T)[:, None]
    expected = np.column_stack([np.cos(scenes.HEADINGS), np.sin(scenes.HEADINGS)])
    np.testing.assert_allclose(along, expected, atol=1e-12)
    turns = np.diff(np.unwrap([*scenes.HEADINGS, scenes.HEADINGS[0]]))
    assert ((turns > math.radians(18)) & (turns < math.radians(27))).all()


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
