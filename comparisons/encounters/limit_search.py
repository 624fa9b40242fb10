"""The limit of an encounter with acceleration limits: a search, and how good it is.

    python comparisons/encounters/limit_search.py --out out/limit

writes the tables, and to ``quality.csv`` how far they have converged and how much the
search misses where they know the answer.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from limit import (
    Grid,
    LimitTables,
    distance,
    extremal_twists,
    limit_tables,
    relative,
    relative_state,
)
from qpavoid.compiled import allocating
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.robot import Limits, Robot
from qpavoid.types import Array


@dataclass(frozen=True)
class Effort:
    """How hard :func:`search_limit` tries.

    Attributes:
        rounds: Random changes tried on each of the plans that are kept.
        kept: Number of plans that are kept and improved.
        phases: Twists of a plan.
        horizon: Time after which a plan brakes and stands, s.
        seed: Of the random changes.
    """

    rounds: int = 300
    kept: int = 3
    phases: int = 5
    horizon: float = 4.0
    seed: int = 0


@allocating
def ramp(now: float, target: float, rate: float, t: float) -> tuple[float, float]:
    """Return where a ramp towards a target is after t, and its mean until then."""
    need = abs(target - now) / rate
    if need <= t:
        return target, target + 0.5 * (now - target) * need / t
    end = now + math.copysign(rate * t, target - now)
    return end, 0.5 * (now + end)


@allocating
def distance_standing(edges: Array, s: float, n: float, phi: float) -> float:
    """Return the least d while the robot stands: d is convex along a line."""
    low, high = s, max(s, 0.0) + 1.0
    for _ in range(24):
        a, b = low + 0.382 * (high - low), low + 0.618 * (high - low)
        if distance(edges, a, n, phi) < distance(edges, b, n, phi):
            high = b
        else:
            low = a
    passing = distance(edges, 0.5 * (low + high), n, phi)
    return min(distance(edges, s, n, phi), passing)


@allocating
def plan_distance(
    edges: Array,
    limits: Array,
    encounter: Array,
    plan: Array,
    floor: float,
    fine: float,
) -> float:
    """Return the least d under a plan, m, or any number up to the floor below it.

    The twist ramps towards each target of the plan in turn at full acceleration, then
    to rest. d is sampled whenever the robot may have moved by the share ``fine`` of it,
    and not more often than every 0.02·fine seconds.

    Args:
        edges: Of the footprint.
        limits: As :func:`limit_numbers` gives them.
        encounter: A row as :func:`search_limit` takes.
        plan: (phases, 3) v, ω, s.
        floor: m.
        fine: Share of d.
    """
    s, n, phi, speed = relative_state(encounter)
    v, omega = encounter[4], encounter[5]
    reach = math.sqrt(np.max(edges[:, 0] ** 2 + edges[:, 1] ** 2))
    d = distance(edges, s, n, phi)
    least = d
    for p in range(len(plan) + 1):
        target, turn, left = 0.0, 0.0, max(abs(v) / limits[4], abs(omega) / limits[5])
        if p < len(plan):
            target, turn, left = plan[p]
        while left > 1e-9 and least > floor:
            pace = speed + abs(v) + reach * abs(omega) + 0.3
            t = min(max(fine * d / pace, 0.02 * fine), 0.15, left)
            for gap in (abs(target - v) / limits[4], abs(turn - omega) / limits[5]):
                if gap > 1e-9:
                    t = min(t, gap)
            v, v_mean = ramp(v, target, limits[4], t)
            omega, omega_mean = ramp(omega, turn, limits[5], t)
            s, n, phi = relative(s, n, phi, speed, v_mean, omega_mean, t)
            left -= t
            d = distance(edges, s, n, phi)
            least = min(least, d)
    return min(least, distance_standing(edges, s, n, phi)) if least > floor else least


@allocating
def checked_distance(
    edges: Array, limits: Array, encounter: Array, plan: Array, floor: float
) -> float:
    """Return :func:`plan_distance`, finely sampled where a coarse look beats floor.

    Args:
        edges: Of the footprint.
        limits: As :func:`limit_numbers` gives them.
        encounter: A row as :func:`search_limit` takes.
        plan: (phases, 3) v, ω, s.
        floor: m.
    """
    d = plan_distance(edges, limits, encounter, plan, floor, 0.5)
    if d > floor:
        d = plan_distance(edges, limits, encounter, plan, floor, 0.1)
    return d


@allocating
def fit_plan(plan: Array, limits: Array, horizon: float) -> None:
    """Move a plan into the limits and cut it at the horizon, in place."""
    for p in range(len(plan)):
        plan[p, 0] = min(max(plan[p, 0], limits[0]), limits[1])
        plan[p, 1] = min(max(plan[p, 1], limits[2]), limits[3])
        plan[p, 2] = min(max(plan[p, 2], 0.0), horizon)
        horizon -= plan[p, 2]


@allocating
def two_phase_plans(
    edges: Array,
    limits: Array,
    twists: Array,
    encounter: Array,
    kept: int,
    phases: int,
    horizon: float,
    enough: float,
) -> tuple[Array, Array]:
    """Return the best plans of two extremal twists, with different first twists.

    Args:
        edges: Of the footprint.
        limits: As :func:`limit_numbers` gives them.
        twists: (U, 2) the extremal ones.
        encounter: A row as :func:`search_limit` takes.
        kept: How many plans.
        phases: Of a plan.
        horizon: After which it brakes, s.
        enough: d with which the search ends, m.
    """
    best = np.full(kept, -np.inf)
    plans = np.zeros((kept, phases, 3))
    plan = np.empty((phases, 3))
    half = phases // 2
    for first in twists:
        slot = -1
        for second in twists:
            for change in (0.2, 0.4, 0.7, 1.0, 1.4, 2.0):
                plan[:half, :2] = first
                plan[half:, :2] = second
                plan[:, 2] = change / half
                plan[-1, 2] = horizon
                fit_plan(plan, limits, horizon)
                place = slot if slot >= 0 else int(np.argmin(best))
                d = checked_distance(edges, limits, encounter, plan, best[place])
                if d > best[place]:
                    best[place], plans[place], slot = d, plan, place
                    if d >= enough:
                        return best, plans
    return best, plans


@allocating
def search(
    edges: Array,
    limits: Array,
    twists: Array,
    encounters: Array,
    noise: Array,
    kept: int,
    horizon: float,
    cap: float,
) -> Array:
    """Return the least d under the best plan found for each encounter, m.

    Args:
        edges: Of the footprint.
        limits: As :func:`limit_numbers` gives them.
        twists: (U, 2) the extremal ones.
        encounters: (N, 6) as :func:`search_limit` takes them.
        noise: (rounds, phases, 3) random changes.
        kept: How many plans are improved.
        horizon: After which a plan brakes, s.
        cap: Greatest d that is told apart, m.
    """
    found = np.empty(len(encounters))
    spread = np.array([limits[1] - limits[0], limits[3] - limits[2], 1.0]) / 2.0
    for e in range(len(encounters)):
        encounter = encounters[e]
        s, n, phi, _ = relative_state(encounter)
        enough = min(distance(edges, s, n, phi), cap) - 1e-3
        best, plans = two_phase_plans(
            edges, limits, twists, encounter, kept, noise.shape[1], horizon, enough
        )
        for q in range(kept):
            scale = 1.0
            for r in range(len(noise)):
                if best.max() >= enough:
                    break
                plan = plans[q] + scale * noise[r] * spread
                fit_plan(plan, limits, horizon)
                d = checked_distance(edges, limits, encounter, plan, best[q])
                if d > best[q]:
                    best[q], plans[q] = d, plan
                    scale = min(1.5 * scale, 1.0)
                else:
                    scale = max(0.95 * scale, 0.02)
        found[e] = min(best.max(), cap)
    return found


def limit_numbers(limits: Limits) -> Array:
    """Return v_min, v_max, ω_min, ω_max, |v̇|, |ω̇| as the search takes them."""
    v, omega = (limits.v_min, limits.v_max), (limits.omega_min, limits.omega_max)
    return np.array([*v, *omega, limits.acceleration, limits.angular_acceleration])


def search_limit(
    robot: Robot,
    encounters: Array,
    radius: Array | float = 0.0,
    effort: Effort = Effort(),
    cap: float = 1.2,
) -> Array:
    """Return the greatest clearance that a plan was found to keep, m, ≤ cap − radius.

    A plan is a sequence of target twists, each held for a time. The best plans of two
    extremal twists are improved by random changes of targets and times. A lower bound
    of the limit, to the millimetre that sampling a plan costs; how near it comes is
    measured by :func:`quality` with infinite accelerations.

    Args:
        robot: Its limits, the accelerations with them, hold. A ramp is continuous; a
            controller whose twist steps every dt is ahead of it by dt/2.
        encounters: (N, 6) x, y of the disc, m, and v_x, v_y, its velocity over ground,
            m/s, both in the robot frame at the start; v, ω of the robot then.
        radius: Of the discs, m; (N,) or one for all.
        effort: How hard to try.
        cap: Greatest distance of the centre that is told apart, m.
    """
    rng = np.random.default_rng(effort.seed)
    shape = (effort.rounds, effort.phases, 3)
    noise = rng.standard_normal(shape) * (rng.random(shape) < 0.3)
    found = search(
        robot.footprint.edges,
        limit_numbers(robot.limits),
        extremal_twists(robot.limits),
        np.ascontiguousarray(encounters, dtype=np.float64),
        noise,
        effort.kept,
        effort.horizon,
        cap,
    )
    return found - radius


def sample_encounters(count: int, speed: float, seed: int) -> Array:
    """Return discs that are aimed at a parked robot from 0.9 to 2.9 m, (count, 6)."""
    rng = np.random.default_rng(seed)
    bearing, far = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.9, 2.9, count)
    x, y = far * np.cos(bearing), far * np.sin(bearing)
    aim = rng.uniform(-1.0, 1.0, (count, 2)) * (0.5, 0.3)
    course = np.arctan2(aim[:, 1] - y, aim[:, 0] - x)
    v_x, v_y = speed * np.cos(course), speed * np.sin(course)
    rest = np.zeros(count)
    return np.column_stack([x, y, v_x, v_y, rest, rest])


def quality(
    robot: Robot, tables: LimitTables, finer: Grid, count: int, seed: int = 0
) -> Iterator[dict[str, float]]:
    """Yield by speed how far tables have converged and what the search misses, m.

    ``grid`` is tables less finer ones, ``gap`` finer ones less the search at infinite
    accelerations: negative where the search beats even them, by what their grid costs.
    ``gain`` is what twice the effort adds with the robot's own accelerations. All over
    the encounters whose limit is below 0.9 of the cap.

    Args:
        robot: With its accelerations.
        tables: Whose convergence it is about.
        finer: Resolution of the tables that they are compared with.
        count: Encounters a speed.
        seed: Of the encounters.
    """
    double = Effort(rounds=2 * Effort.rounds)
    for speed in tables.speeds:
        encounters = sample_encounters(count, speed, seed)
        fine = limit_tables.__wrapped__(robot, (speed,), finer).clearance(encounters)
        below = fine < 0.9 * tables.grid.cap
        grid = (tables.clearance(encounters) - fine)[below]
        free = with_accelerations(robot, math.inf, math.inf)
        gap = (fine - search_limit(free, encounters))[below]
        gain = search_limit(robot, encounters, effort=double)
        gain = (gain - search_limit(robot, encounters))[below]
        row = {"speed_mps": float(speed), "encounters": int(below.sum())}
        for name, error in (("grid", grid), ("gap", gap), ("gain", gain)):
            for q in (0.0, 0.01, 0.5, 0.9, 0.99, 1.0):
                quantile = np.quantile(error, q) if len(error) else math.nan
                row[f"{name}_q{100 * q:g}_m"] = round(float(quantile), 4)
        yield row


def with_accelerations(robot: Robot, v: float, omega: float) -> Robot:
    """Return the robot with other acceleration limits, m/s² and rad/s²."""
    limits = replace(robot.limits, acceleration=v, angular_acceleration=omega)
    return replace(robot, limits=limits)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/limit"), metavar="DIR")
    parser.add_argument("--count", type=int, default=400, metavar="N")
    options = parser.parse_args()
    robot = with_accelerations(Robot.mir100(), 2.0, 2.5)
    tables = limit_tables(robot, folder=options.out)
    rows = quality(robot, tables, Grid(0.025, 192, 1), options.count)
    done = []
    for row in rows:
        print(row, flush=True)
        done.append(row)
        write_csv(options.out / "quality.csv", done)


if __name__ == "__main__":
    main()
