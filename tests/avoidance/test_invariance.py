"""Equivalent descriptions of a world give equal twists, over sequences of steps."""

from itertools import pairwise

import numpy as np
import pytest

from problems import ROBOTS, Scene, calls
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.obstacles import Obstacles

SETTINGS, STEPS, COUNT = AvoidanceSettings(dt=0.05), 6, 60
aheads = pytest.mark.parametrize("ahead", [False, True], ids=["present", "ahead"])
robots = pytest.mark.parametrize(
    "robot", list(ROBOTS.values())[:2], ids=["free", "limited"]
)


def permuted(seen, rng):
    """But for polygons."""
    discs, walls = rng.permutation(len(seen.discs)), seen.walls
    turned = rng.random(len(walls)) < 0.5
    walls = np.where(turned[:, None], walls[:, [2, 3, 0, 1]], walls)
    return Obstacles(
        seen.points[rng.permutation(len(seen.points))],
        seen.discs[discs],
        seen.disc_velocities[discs],
        walls[rng.permutation(len(walls))],
    )


def repeated(seen, rng):
    return Obstacles(
        np.repeat(seen.points, 10, axis=0),
        np.repeat(seen.discs, 2, axis=0),
        np.repeat(seen.disc_velocities, 2, axis=0),
        np.repeat(seen.walls, 3, axis=0),
    )


def with_far_ones(seen, rng):
    far = 200.0 * np.column_stack([np.cos(np.arange(8.0)), np.sin(np.arange(8.0))])
    return Obstacles(
        np.vstack([far[:2], seen.points, far[2:4]]),
        np.vstack([[[*far[4], 0.3]], seen.discs, [[*far[5], 0.2]]]),
        np.vstack([[[0.3, 0.1]], seen.disc_velocities, [[0.2, -0.4]]]),
        np.vstack([[[*far[6], *far[7]]], seen.walls]),
    )


def split(seen, rng):
    """Every wall in three collinear pieces."""
    rows = []
    for wall in seen.walls:
        one, other = wall[:2], wall[2:]
        shares = [0.0, *np.sort(rng.uniform(0.1, 0.9, 2)), 1.0]
        ends = [one + share * (other - one) for share in shares[:-1]] + [other]
        rows += [(*a, *b) for a, b in pairwise(ends)]
    walls = np.array(rows).reshape(-1, 4)
    return Obstacles(seen.points, seen.discs, seen.disc_velocities, walls)


def mirrored(seen, rng):
    """But for polygons."""
    return Obstacles(
        seen.points * [1, -1],
        seen.discs * [1, -1, 1],
        seen.disc_velocities * [1, -1],
        seen.walls * [1, -1, 1, -1],
    )


class Carts(Scene):
    """And one or two convex polygons, which move and turn or stand."""

    def __init__(self, rng, **more):
        super().__init__(rng, **more)
        self.carts = []
        for _ in range(rng.integers(1, 3)):
            angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 5))
            size, bearing = rng.uniform(0.1, 0.4), rng.uniform(-np.pi, np.pi)
            corners = size * np.column_stack([np.cos(angles), np.sin(angles)])
            far = rng.uniform(1.3, 2.5) * np.array([np.cos(bearing), np.sin(bearing)])
            motion = (*rng.normal(0.0, 0.4, 2), rng.normal(0.0, 0.5))
            motion = np.array(motion) * (rng.random() < 0.7)
            self.carts.append((corners, far, motion))

    def at(self, time):
        seen, polygons = super().at(time), []
        for corners, far, (v_x, v_y, turn) in self.carts:
            cos, sin = np.cos(turn * time), np.sin(turn * time)
            turned = corners @ np.array([[cos, sin], [-sin, cos]])
            polygons.append(turned + far + time * np.array([v_x, v_y]))
        return joined(seen, polygons, [motion for _, _, motion in self.carts])


def joined(seen, polygons, motions):
    parts = seen.points, seen.discs, seen.disc_velocities, seen.walls
    return Obstacles(*parts, polygons, np.array(motions).reshape(-1, 3))


def mirrored_carts(seen, rng):
    polygons = [(polygon * [1, -1])[::-1] for polygon in seen.polygons]
    motions = seen.polygon_velocities * [1, -1, -1]
    return joined(mirrored(seen, rng), polygons, motions)


def permuted_carts(seen, rng):
    order = rng.permutation(len(seen.polygons))
    polygons = [np.roll(seen.polygons[i], rng.integers(5), axis=0) for i in order]
    return joined(permuted(seen, rng), polygons, seen.polygon_velocities[order])


def differences(robot, ahead, change, seed, sign, kind):
    """The greatest difference of twists in every sequence."""
    worst = np.zeros(COUNT)
    for k in range(COUNT):
        rng = np.random.default_rng([seed, k])
        scene = kind(rng, least=0.1, movers=int(rng.integers(0, 4)))
        wishes = np.repeat(rng.uniform([-1, -1.5], [1, 1.5], (1, 2)), STEPS, axis=0)
        wishes *= rng.random() < 0.8
        one, other = (SafetyFilter(robot, SETTINGS, ahead=ahead) for _ in range(2))
        steps = calls(one, scene, wishes, SETTINGS.dt)
        told = next(steps)
        while told is not None:
            (v, omega), seen, _ = told
            decision = one.filter(v, omega, seen)
            same = other.filter(v, sign * omega, change(seen, rng))
            off = abs(decision.v - same.v), abs(decision.omega - sign * same.omega)
            worst[k] = max(worst[k], *off)
            try:
                told = steps.send(decision)
            except StopIteration:
                told = None
    return worst


CHANGES = {
    "order": (permuted, 1, 1.0, Scene),
    "repetition": (repeated, 1, 1.0, Scene),
    "far ones": (with_far_ones, 1, 1.0, Scene),
    "walls in pieces": (split, 2, 1.0, Scene),
    "mirror image": (mirrored, 3, -1.0, Scene),
    "order of polygons": (permuted_carts, 4, 1.0, Carts),
    "mirror image of polygons": (mirrored_carts, 4, -1.0, Carts),
}


@aheads
@robots
@pytest.mark.parametrize("name", CHANGES)
def test_what_is_the_same_world_gives_the_same_twists(name, robot, ahead):
    worst = differences(robot, ahead, *CHANGES[name])
    unlike = (worst > 1e-9).sum()
    assert unlike == 0, f"{unlike} of {len(worst)} differ, by up to {worst.max():.2g}"
