"""People: the social force model with groups, and six reactions to a robot.

Forces are accelerations, m/s², as in lightsfm (BSD) of HuNavSim: goal and walls after
Helbing and Molnár, Phys. Rev. E 51, 1995; people after Moussaïd et al., Proc. R. Soc. B
276, 2009; groups after Moussaïd et al., PLoS ONE 5(4), 2010; bodies that touch after
Helbing et al., Nature 407, 2000. Reactions after Pérez-Higueras et al., HuNavSim, RA-L
8(11), 2023, and its sources. Differences: distances are between bodies; forces of walls
add up; impassive people do not see the robot at all; threatening ones walk round it;
people slow down instead of halting at once. World frame, SI units.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from qpavoid.errors import ConfigError
from qpavoid.types import Array, Pose

REACTIONS = "regular", "impassive", "surprised", "curious", "scared", "threatening"
REGULAR, IMPASSIVE, SURPRISED, CURIOUS, SCARED, THREATENING = range(6)
"""Regular people take the robot for one of them, impassive ones ignore it. From when
they see it, surprised ones stop and look at it, curious ones walk up to it, scared ones
keep away, threatening ones go to a place in front of it; then they are regular."""

GOAL, RELAX, ARRIVED = 2.0, 0.5, 0.3
"""Goal force: factor; relaxation time, s; distance from the goal that is enough, m."""

WALL, WALL_RANGE, BODY, CLEAR = 10.0, 0.2, 400.0, 0.1
"""Force of a wall that is touched, m/s², and its range, m; of bodies nearer than a
distance, 1/s², and that distance, m."""

SOCIAL, LAMBDA, GAMMA, ALONG, TURN, USUAL = 5.0, 2.0, 0.35, 3.0, 2.0, 0.3
"""Force between people: factor, m/s²; λ, s/m; γ, m; n′ and n of its two parts; radius
of a person, m, for whom the model's distance between centres holds."""

GAZE, COHERENCE, REPULSION = 3.0, 2.0, 1.0
"""Factors of the group's forces."""

SEES, LOSES, VIEW = 4.0, 10.0, 0.5 * math.pi + 0.17
"""Distance at which the robot is seen, and at which by curious people and lost by all,
m; half angle of the view, rad."""

NEAR, FRONT, SCARED_SPEED, SCARE = 1.5, 1.4, 0.6, 20.0
"""Distances from the robot's centre at which curious and threatening people stop, m;
greatest speed of scared people, m/s, and factor of their force."""

TICK, TINY, NOWHERE = 0.05, 1e-9, (1e6, 1e6, 0.0)
"""Longest step of the integration, s; least divisor; pose without a robot."""

Pair: TypeAlias = tuple[Array, Array]


class People:
    """Pedestrians who walk to their goals, and stop there.

    Attributes:
        places, velocities, headings: (n, 2) m; (n, 2) m/s; (n,) rad, where they look.
        goals: (n, 2) m; may be replaced between steps.
        robot_radius, duration: m; s for which somebody reacts.
        period: m, after which the world repeats in x and y; the robot is then taken to
            be within half of it.

    Args:
        places, goals: (n, 2) m.
        speeds, radii: One or (n,), m/s, desired and greatest; m.
        groups: (n,) numbers of groups; negative, or nothing: alone.
        reactions: One or n names; unknown ones raise a ConfigError.
        walls: (k, 4) ends x1, y1, x2, y2 of segments, m.
        seed: Of the side to which each one evades somebody exactly ahead.
    """

    robot_radius, duration, period = USUAL, 40.0, math.inf

    def __init__(
        self,
        places: ArrayLike,
        goals: ArrayLike,
        speeds: ArrayLike = 1.0,
        radii: ArrayLike = USUAL,
        groups: ArrayLike | None = None,
        reactions: str | Sequence[str] = "regular",
        walls: ArrayLike = (),
        seed: int = 0,
    ) -> None:
        self.places = np.array(places, float).reshape(-1, 2)
        n = len(self.places)
        self.goals = np.array(goals, float).reshape(n, 2)
        self.speeds, self.radii = (np.full(n, x, float) for x in (speeds, radii))
        named = [reactions] * n if isinstance(reactions, str) else list(reactions)
        if not set(named) <= set(REACTIONS) or len(named) != n:
            raise ConfigError([f"{n} reactions of {REACTIONS} are needed, not {named}"])
        self.reactions = np.array([REACTIONS.index(x) for x in named], int)
        self.walls = np.array(walls, float).reshape(-1, 2, 2)
        group = np.full(n, -1) if groups is None else np.array(groups).reshape(n)
        same = (group[:, None] == group) & (group >= 0) & ~np.eye(n, dtype=bool)
        self._same, self._reacted = same.astype(float), np.zeros(n)
        self._side = np.random.default_rng(seed).choice([-1.0, 1.0], n)
        self.velocities = np.zeros((n, 2))
        self.headings = angle(self.goals - self.places)

    def step(
        self, robot: Pose = NOWHERE, velocity: ArrayLike = (0, 0), dt: float = TICK
    ) -> None:
        """Move everybody by dt, s; robot: x, y (m), γ (rad), and its velocity, m/s."""
        count = max(1, math.ceil(dt / TICK - TINY))
        speed = np.append(np.broadcast_to(np.asarray(velocity, float), 2), 0.0)
        for k in range(count):
            self._move(robot + k * dt / count * speed, speed[:2], dt / count)

    def _move(self, robot: Array, velocity: Array, dt: float) -> None:
        targets, speeds = self.goals.copy(), self.speeds.copy()
        acting, force = self._react(robot, targets, speeds)
        reacts = acting > IMPASSIVE
        self._reacted += dt * reacts
        ahead, left = unit(targets - self.places)
        pull = np.where(left > ARRIVED, GOAL, 0.0)[:, None]
        pull = pull * speeds[:, None] * ahead - np.maximum(pull, 1.0) * self.velocities
        others = np.vstack([self.places, robot[:2]])
        moves = np.vstack([self.velocities, velocity])
        sees = np.isin(acting, (REGULAR, SCARED, THREATENING)).astype(float)
        force += pull / RELAX + self._social(others, moves, sees)
        force += self._from_walls() + self._group(ahead)
        ways, fast = unit(self.velocities + dt * force)
        self.velocities = np.minimum(fast, speeds)[:, None] * ways
        self.places = self.places + dt * self.velocities
        looks = np.where(reacts, angle(robot[:2] - self.places), self.headings)
        self.headings = np.where(fast > 0.1, angle(self.velocities), looks)

    def _react(self, robot: Array, targets: Array, speeds: Array) -> Pair:
        """Return present reactions, and forces; change targets and speeds in place."""
        to_robot, apart = unit(robot[:2] - self.places)
        turned = (angle(to_robot) - self.headings + math.pi) % math.tau - math.pi
        sight = np.where(self.reactions == CURIOUS, LOSES, SEES)
        seen = (apart < sight) & (abs(turned) < VIEW)
        seen |= (self._reacted > 0.0) & (apart < LOSES)
        seen &= self._reacted < self.duration
        acting = np.where(seen | (self.reactions == IMPASSIVE), self.reactions, REGULAR)
        curious, scared = acting == CURIOUS, acting == SCARED
        front = FRONT * np.array([math.cos(robot[2]), math.sin(robot[2])])
        targets[curious], targets[acting == THREATENING] = robot[:2], robot[:2] + front
        rests = (acting == SURPRISED) | (curious & (apart < NEAR))
        targets[rests] = self.places[rests]
        speeds *= np.where(curious, np.minimum(apart / LOSES, 1.0), 1.0)
        speeds[scared] = np.minimum(speeds[scared], SCARED_SPEED)
        push = SCARE * WALL_RANGE / np.maximum(apart - self.radii, 0.1)
        return acting, -(push * scared)[:, None] * to_robot

    def _offsets(self, others: Array) -> Array:
        """Return offsets (n, m, 2), m, from everybody to others (m, 2)."""
        away: Array = others - self.places[:, None]
        if self.period < math.inf:
            away -= self.period * np.round(away / self.period)
        return away

    def _social(self, others: Array, moves: Array, sees: Array) -> Array:
        """Return the force of the others, and of the robot, the last, if it is seen."""
        ahead, apart = unit(self._offsets(others))
        gap = apart - self.radii[:, None] - np.append(self.radii, self.robot_radius)
        along, length = unit(LAMBDA * (self.velocities[:, None] - moves) + ahead)
        left = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        theta = np.arctan2((left * ahead).sum(axis=-1), (along * ahead).sum(axis=-1))
        reach = np.maximum(GAMMA * length, TINY)
        base = np.maximum(gap + 2.0 * USUAL, 0.0) / reach
        ahead_side = self._side[:, None] * (length > 1.0 + TINY)  # not at rest
        side = np.where(abs(theta) < 1e-6, ahead_side, np.sign(theta))
        turn = side * np.exp(-base - (TURN * reach * theta) ** 2)
        slow = np.exp(-base - (ALONG * reach * theta) ** 2)
        force = SOCIAL * (slow[..., None] * along + turn[..., None] * left)
        force += BODY * np.maximum(CLEAR - gap, 0.0)[..., None] * ahead
        counts = np.column_stack([1.0 - np.eye(len(sees)), sees])
        return np.asarray(-(counts[..., None] * force).sum(axis=1))

    def _from_walls(self) -> Array:
        begin, along = self.walls[:, 0], self.walls[:, 1] - self.walls[:, 0]
        reach = self.places[:, None] - begin
        share = (reach * along).sum(axis=-1) / np.maximum((along**2).sum(axis=-1), TINY)
        away, gap = unit(reach - np.clip(share, 0.0, 1.0)[..., None] * along)
        force = WALL * np.exp((self.radii[:, None] - gap) / WALL_RANGE)
        return np.asarray((force[..., None] * away).sum(axis=1))

    def _group(self, ahead: Array) -> Array:
        """Return the forces of gaze, coherence and repulsion within groups."""
        same, count = self._same, self._same.sum(axis=1)[:, None]
        apart = self._offsets(self.places)
        total = (same[..., None] * apart).sum(axis=1)
        to_others, to_centre = total / np.maximum(count, 1.0), total / (count + 1.0)
        behind = np.minimum((to_others * ahead).sum(axis=1), 0.0)[:, None]
        far = np.linalg.norm(to_centre, axis=1)[:, None] - 0.5 * count
        force = GAZE * behind * ahead
        force += COHERENCE * 0.5 * (np.tanh(far) + 1.0) * to_centre
        wide = self.radii[:, None] + self.radii
        meets = same * (np.linalg.norm(apart, axis=-1) < wide)
        force -= REPULSION * (meets[..., None] * apart).sum(axis=1)
        return np.where(count > 0.0, force, 0.0)


def unit(vectors: Array) -> Pair:
    """Return directions and lengths of vectors (…, 2); of none, (0, 0) and 0."""
    lengths = np.linalg.norm(vectors, axis=-1)
    return vectors / np.maximum(lengths, TINY)[..., None], lengths


def angle(vectors: Array) -> Array:
    """Return the directions of vectors (…, 2), rad."""
    return np.asarray(np.arctan2(vectors[..., 1], vectors[..., 0]))
