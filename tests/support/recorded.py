"""Answers on record, of filters and guides: of each scene a few sums.

Scenes are drawn from continuous distributions: no answer hangs by a last bit. Their
answers become one number a column: a sum in which each has its own weight, so that what
changes anywhere shows. They say that something has changed, not what is right: that
other tests say. A change that is meant is recorded by

    python tests/support/recorded.py
"""

import math
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from hostile_filters import FILTERS
from qpavoid import AvoidanceSettings, Guide, Obstacles, Robot, SafetyFilter
from qpavoid.avoidance.settings import Actuation, LookAhead, Margins, SafetyRadius
from qpavoid.guide.settings import GuideSettings
from qpavoid.model.kinematics import integrate
from shapes import regular

RECORD = Path(__file__).parents[1] / "recorded.toml"
MIR = Robot.mir100()
FORWARD = replace(MIR, limits=replace(MIR.limits, v_min=0.0, v_max=0.8))
HEAVY = replace(
    MIR, limits=replace(MIR.limits, acceleration=1.0, angular_acceleration=2.0)
)
MOST = 50.0
"""Upper bound of recorded numbers; larger and infinite ones are cut to it."""


def sums(rows: list[list[float]]) -> list[float]:
    """Return a weighted sum of every column."""
    table = np.clip(np.nan_to_num(np.array(rows, float), nan=-7.0), -MOST, MOST)
    return [float(f"{x:.10g}") for x in np.cos(np.arange(1, len(table) + 1)) @ table]


def world(rng, far: float, points: int = 6) -> Obstacles:
    """Return things of every kind round a robot that is at the origin."""

    def places(count: int, least: float = 0.75) -> np.ndarray:
        bearing = rng.uniform(-math.pi, math.pi, count)
        away = least + rng.random(count) * far
        return np.column_stack([away * np.cos(bearing), away * np.sin(bearing)])

    discs, lines = rng.integers(0, 4), rng.integers(0, 3)
    ends = places(lines)
    turning = [
        regular(n, rng) * 0.3 + places(1, 1.6) for n in rng.choice((3, 4, 5), lines)
    ]
    return Obstacles(
        places(rng.integers(points // 2, points + 1)),
        np.column_stack([places(discs, 0.9), rng.uniform(0.05, 0.3, discs)]),
        rng.uniform(-0.6, 0.6, (discs, 2)),
        np.column_stack([ends, ends + rng.uniform(-0.5, 0.5, (lines, 2))]),
        turning,
        rng.uniform(-0.4, 0.4, (lines, 3)) * (rng.random((lines, 1)) < 0.5),
    )


def decisions(
    safety: SafetyFilter, count: int, seed: int, age: float = 0.0, points: int = 6
) -> list[list[float]]:
    """Return what a filter decides in short drives, among things near and far."""
    rng, rows, dt = np.random.default_rng(seed), [], 0.1
    for _ in range(count):
        things = world(rng, rng.choice((1.2, 2.0, 4.0)), points)
        pose, v, omega = (0.0, 0.0, 0.0), rng.uniform(-0.6, 1.2), rng.normal()
        safety.reset(rng.uniform(-0.1, 0.4), 0.3 * rng.normal())
        for k in range(5):
            seen = things.seen_from(pose, k * dt)
            d = safety.filter(v, omega, seen, age=age * rng.random())
            numbers = d.v, d.omega, d.clearance, d.slack, d.shortfall, d.lateral
            owners = len(d.active) + 0.1 * sum(d.active)
            rows.append([*numbers, float(d.status.number), owners])
            pose = integrate(pose, (d.v, d.omega), d.lateral, dt)
    return rows


MORE = {
    "passive": (MIR, AvoidanceSettings(passive=True), {}),
    "wary": (
        HEAVY,
        AvoidanceSettings(
            margins=Margins(error=0.03, acceleration=0.5),
            radius=SafetyRadius(closing_gain=0.1),
        ),
        {},
    ),
    "slow base": (
        HEAVY,
        AvoidanceSettings(actuation=Actuation(delay=0.15, jitter=0.4, ramps=True)),
        {},
    ),
    "short": (
        MIR,
        AvoidanceSettings(ahead=LookAhead(horizon=1.2, horizon_still=0.4, tick=0.1)),
        {},
    ),
    "forward": (FORWARD, AvoidanceSettings(gamma=4.0, weights=(1.0, 0.3)), {}),
}
"""Robot, settings and options of filters besides those that are exported."""


def filters() -> dict[str, Callable[[], list[list[float]]]]:
    """Return the scenes of filters."""
    made = {name: (*of[:2], {"ahead": of[2]}) for name, of in FILTERS.items()} | MORE
    made["ahead-parts"] = made.pop("ahead-parts")  # seeds are in this order
    found: dict[str, Callable[[], list[list[float]]]] = {}
    for seed, (name, (robot, settings, options)) in enumerate(made.items()):

        def drives(robot=robot, settings=settings, options=options, seed=seed):
            return decisions(SafetyFilter(robot, settings, **options), 80, seed, 0.1)

        found[name] = drives
    found["scan"] = lambda: decisions(SafetyFilter(MIR), 30, 77, 0.0, 150)
    found["old scan"] = lambda: decisions(SafetyFilter(HEAVY), 50, 78, 1.5)
    return found


def guided(
    guide: Guide, things: Obstacles, steps: int, pose=(0.0, 0.0, 0.0), dt: float = 0.1
) -> Iterator[list[float]]:
    """Yield what a guide decides, and where it has come."""
    for k in range(steps):
        d = guide.step(pose, things.seen_from(pose, k * dt))
        pose = integrate(pose, (d.v, d.omega), 0.0, dt)
        yield [d.v, d.omega, d.clearance, float(d.status.number), *pose]


def box(x, y, half_x, half_y) -> np.ndarray:
    """Return the corners of a box."""
    return np.array([(x - half_x, y - half_y), (x + half_x, y - half_y),
                     (x + half_x, y + half_y), (x - half_x, y + half_y)])  # fmt: skip


def worlds_of_guides() -> dict[str, Obstacles]:
    """Return places with a way, without, and with people."""
    rng = np.random.default_rng(5)

    def discs(count: int, least: float, most: float) -> np.ndarray:
        ends = (1.2, -1.8, least), (5.0, 1.8, most)
        return rng.uniform(*ends, (count, 3))

    pocket = [(2.2, -1.1, 2.2, 1.3), (0.4, 1.3, 2.2, 1.3), (0.4, -1.1, 2.2, -1.1)]
    room = [(-1.1, -1, 2.4, -1.1), (2.4, -1.1, 2.5, 1.2), (2.5, 1.2, -1, 1.1)]
    return {
        **{f"trees {k}": Obstacles(discs=discs(8 + k, 0.05, 0.2)) for k in range(4)},
        **{
            f"people {k}": Obstacles(
                discs=discs(5, 0.2, 0.3), disc_velocities=rng.uniform(-0.6, 0.6, (5, 2))
            )
            for k in range(4)
        },
        "pocket": Obstacles(walls=pocket),
        "gap": Obstacles(polygons=[box(2.3, 0.8, 0.4, 0.3), box(2.1, -0.8, 0.3, 0.3)]),
        "carts": Obstacles(
            polygons=[box(2.2, 1.1, 0.4, 0.3), box(3.5, -0.9, 0.3, 0.3)],
            polygon_velocities=[(0.1, -0.35, 0.2), (-0.4, 0.2, 0.0)],
        ),
        "room": Obstacles(walls=[*room, (-1, 1.1, -1.1, -1)], points=[(1.4, 0.05)]),
    }  # fmt: skip


def guides() -> dict[str, Callable[[], list[list[float]]]]:
    """Return the scenes of guides: a goal, a path, and a station in each world."""
    short = GuideSettings(stall_time=0.8, blocked_time=3.0, interval=0.3)
    settings = AvoidanceSettings(dt=0.1)
    found: dict[str, Callable[[], list[list[float]]]] = {}
    path = [(0, 0), (1.5, 0.4), (3.0, -0.3), (4.5, 0.5)]
    for name, things in worlds_of_guides().items():
        for robot, kind in (
            (MIR, "goal"),
            (HEAVY, "path"),
            (MIR, "stay"),
            (FORWARD, "goal, forward"),
        ):

            def drives(things=things, robot=robot, kind=kind):
                guide = Guide(robot, settings, short)
                if kind.startswith("goal"):
                    guide.go_to((0.0, 0.0, 0.0), (4.6, 0.1, 0.4), 0.7)
                elif kind == "path":
                    guide.follow(path)
                else:
                    guide.stay((0.9, 0.1, 0.2))
                return [*guided(guide, things, 100)]

            found[f"{name}, {kind}"] = drives
    return found


def recorded() -> dict[str, list[float]]:
    """Return what is on record."""
    return tomllib.loads(RECORD.read_text(encoding="utf-8"))


def main() -> None:
    scenes = filters() | guides()
    lines = [
        f"{name!r} = {sums(make())}".replace("'", '"') for name, make in scenes.items()
    ]
    RECORD.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
