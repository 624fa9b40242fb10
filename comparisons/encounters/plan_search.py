"""A search of plans: what a robot that knew everything could keep from all obstacles.

A plan is a sequence of twists (with acceleration limits: of targets), each held for a
time, and then rest until all movers have left. Plans of two extremal twists come first;
the best of them, and of random ones, are improved by random changes. Where that does
not reach what is asked it begins anew, deeper: more pieces, more beginnings, more
changes. No controller is asked, and what it returns some plan attains; what it misses
is measured by :mod:`encounter_oracle` where dynamic programming knows the answer.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from os import cpu_count
from typing import NamedTuple

import numpy as np

from limit import extremal_twists
from limit_search import fit_plan, limit_numbers
from plan_room import Case, Scene, plan_room
from qpavoid.compiled import allocating
from qpavoid.model.robot import Robot
from qpavoid.types import Array

COARSE, FINE = 0.004, 0.0005
"""m; what may be missed between two looks, at first and of what is kept."""

CHANGES = np.array([0.2, 0.4, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0, 8.0])
"""s after which the first of two extremal twists gives way to the second."""


@dataclass(frozen=True)
class Effort:
    """How hard one round of the search tries.

    Attributes:
        pieces: Twists of a plan.
        beginnings: Number of random plans to begin with; the plans of two extremal
            twists are always among them.
        kept: Number of plans that are kept and improved.
        changes: Random changes tried on each.
        horizon: Time after which a plan comes to rest, s.
    """

    pieces: int
    beginnings: int
    kept: int
    changes: int
    horizon: float


DEEPENED = (
    Effort(3, 0, 3, 150, 5.0),
    Effort(4, 400, 8, 300, 9.0),
    Effort(5, 2000, 16, 500, 12.0),
)
"""The rounds, one after the other until the search reaches what is asked."""


class Tries(NamedTuple):
    """What a round tries.

    Attributes:
        twists: (U, 2) the extremal ones.
        known: (k, 3) a plan to begin with.
        randoms: (beginnings, pieces, 3) random plans.
        noise: (changes, pieces, 3) random changes.
        kept: Number of plans that are improved.
        horizon: Time after which a plan comes to rest, s.
        enough: Room with which the search ends, m.
    """

    twists: Array
    known: Array
    randoms: Array
    noise: Array
    kept: int
    horizon: float
    enough: float


@allocating
def checked_room(case: Case, plan: Array, floor: float, enough: float) -> float:
    """Return :func:`plan_room`, looked at finely where a coarse look is enough."""
    least = plan_room(case, plan, floor, COARSE)
    if least >= enough:
        least = plan_room(case, plan, floor, FINE)
    return least


@allocating
def begin(case: Case, tries: Tries) -> tuple[Array, Array]:
    """Return the best beginnings: known, of two extremal twists, and random ones."""
    twists, randoms, enough = tries.twists, tries.randoms, tries.enough
    slots, pieces = len(twists), randoms.shape[1]
    count = slots + 1 + (slots if len(randoms) else 0)
    best, plans = np.full(count, -np.inf), np.zeros((count, pieces, 3))
    plan = np.zeros((pieces, 3))
    plan[: len(tries.known)] = tries.known
    best[slots] = checked_room(case, plan, -np.inf, enough)
    plans[slots] = plan
    for i in range(slots):
        for j in range(slots):
            for change in CHANGES:
                if best.max() >= enough:
                    return best, plans
                plan[:-1, :2] = twists[i]
                plan[:-1, 2] = change / (pieces - 1)
                plan[-1, :2] = twists[j]
                plan[-1, 2] = tries.horizon
                fit_plan(plan, case.limits, tries.horizon)
                least = checked_room(case, plan, best[i], enough)
                if least > best[i]:
                    best[i], plans[i] = least, plan
    for r in range(len(randoms)):
        if best.max() >= enough:
            return best, plans
        slot = slots + 1 + r % slots
        plan[:] = randoms[r]
        fit_plan(plan, case.limits, tries.horizon)
        least = checked_room(case, plan, best[slot], enough)
        if least > best[slot]:
            best[slot], plans[slot] = least, plan
    return best, plans


@allocating
def improve(case: Case, best: Array, plans: Array, tries: Tries) -> None:
    """Improve plans by random changes, in place, until one has enough room."""
    limits, noise, enough = case.limits, tries.noise, tries.enough
    wide_v, wide_omega = 0.5 * (limits[1] - limits[0]), 0.5 * (limits[3] - limits[2])
    for q in range(len(best)):
        scale = 1.0
        for r in range(len(noise)):
            if best.max() >= enough:
                return
            change = scale * noise[(r + 97 * q) % len(noise)]
            plan = plans[q].copy()
            plan[:, 0] += wide_v * change[:, 0]
            plan[:, 1] += wide_omega * change[:, 1]
            plan[:, 2] += (0.4 + 0.2 * plan[:, 2]) * change[:, 2]
            fit_plan(plan, limits, tries.horizon)
            least = checked_room(case, plan, best[q], enough)
            if least > best[q]:
                best[q], plans[q] = least, plan
                scale = min(1.5 * scale, 1.0)
            else:
                scale = max(0.95 * scale, 0.02)


@allocating
def search_round(case: Case, tries: Tries) -> tuple[float, Array]:
    """Return the room and the plan of one round."""
    best, plans = begin(case, tries)
    if best.max() < tries.enough:
        order = np.argsort(-best)[: tries.kept]
        best, plans = best[order], plans[order]
        improve(case, best, plans, tries)
    plan = plans[np.argmax(best)]
    return plan_room(case, plan, -np.inf, FINE), plan


@lru_cache(maxsize=32)
def random_parts(robot: Robot, effort: Effort, number: int) -> tuple[Array, Array]:
    """Return random plans to begin with, and random changes, the same for all."""
    rng, low = np.random.default_rng(number), robot.limits
    shape = (effort.beginnings, effort.pieces)
    v = rng.uniform(low.v_min, low.v_max, shape)
    omega = rng.uniform(low.omega_min, low.omega_max, shape)
    corners = extremal_twists(low)[rng.integers(0, 9, shape)]
    v = np.where(rng.random(shape) < 0.6, corners[..., 0], v)
    omega = np.where(rng.random(shape) < 0.6, corners[..., 1], omega)
    held = rng.exponential(rng.choice([0.3, 0.8, 2.5], shape))
    changed = (effort.changes, effort.pieces, 3)
    noise = rng.standard_normal(changed) * (rng.random(changed) < 0.35)
    return np.stack([v, omega, held], axis=-1), noise


def search_plan(
    robot: Robot,
    scene: Scene,
    wanted: Array,
    start: tuple[float, float],
    enough: float,
    known: Array | None = None,
    efforts: Sequence[Effort] = DEEPENED,
) -> tuple[float, Array]:
    """Return the greatest room that was found, m, and its plan (pieces, 3).

    Args:
        robot: Its limits hold, the accelerations with them.
        scene: What it meets.
        wanted: (M + 1,) distance wanted from every mover, and at last from all that
            stands, m. Room is the least distance less that, over all time.
        start: v, ω at time 0.
        enough: m; the search ends where it has found so much.
        known: A plan to begin with.
        efforts: The rounds.
    """
    edges, limits = robot.footprint.edges, limit_numbers(robot.limits)
    case = Case(edges, limits, scene, wanted, np.array(start))
    twists, plan = extremal_twists(robot.limits), np.zeros((1, 3))
    plan = plan if known is None else known
    best = -np.inf
    for number, effort in enumerate(efforts):
        if len(plan) > effort.pieces:
            plan = plan[: effort.pieces]
        parts = random_parts(robot, effort, number)
        tries = Tries(twists, plan, *parts, effort.kept, effort.horizon, enough)
        least, found = search_round(case, tries)
        if least > best:
            best, plan = least, found
        if best >= enough:
            break
    return float(best), plan


def search_plans(
    robot: Robot,
    scenes: Sequence[Scene],
    wanted: Sequence[Array],
    starts: Sequence[tuple[float, float]],
    enough: float,
) -> list[tuple[float, Array]]:
    """Return what :func:`search_plan` does for many scenes, on all cores.

    Args:
        robot: Its limits hold.
        scenes: What it meets.
        wanted: Distances, of each scene.
        starts: v, ω at time 0, of each scene.
        enough: m; a search ends where it has found so much.
    """
    with ThreadPoolExecutor(cpu_count() or 1) as pool:
        parts = zip(scenes, wanted, starts, strict=True)
        found = pool.map(lambda p: search_plan(robot, p[0], p[1], p[2], enough), parts)
        return list(found)
