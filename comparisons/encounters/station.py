"""A robot parked at a bench lets people pass and returns: number of contacts.

Three people walk past its place one after the other, straight on, at 0.5 to 1.5 m/s;
they never yield. The guide knows their places and velocities,
or has a LiDAR: points alone, or perception of its scans. A robot that does nothing
meets the same people.

Run: python comparisons/encounters/station.py [--scenes 120] [--film film.gif]
"""

import argparse
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
from matplotlib.patches import Circle

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "perception"))
from perception_loops import ROBOT, SETTINGS, touches  # type: ignore[import-not-found]
from qpavoid.guide.guide import Guide
from qpavoid.lab.sensing.lidar import LidarSettings, Sensor, scanner
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.kinematics import integrate, to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Pose

BENCH = (-0.6, -0.75, 0.9, -0.75)
"""x1, y1, x2, y2 of its edge, m."""

ROOM = ((-5, -4, 5, -4), (5, -4, 5, 4), (5, 4, -5, 4), (-5, 4, -5, -4))
"""Its walls, for the LiDAR, m."""

LIDAR = LidarSettings(range=12.0)
"""360 beams at 10 Hz, σ 1 cm."""

RADIUS, ASIDE, SIGHT, SECONDS = 0.25, 1.0, 6.0, 40.0
"""Of a person, m; greatest distance of a path from the station, m; range in which
people are known, m; of a scene, s."""

STATION = (0.0, 0.0, 0.0)
OUT = Path(__file__).parents[1] / "results/station.csv"


class Person:
    """A disc that moves past the station and past the bench, straight on."""

    def __init__(self, rng: np.random.Generator, arrives: float) -> None:
        x1, y1, x2, y2 = BENCH
        gap, share = 0.0, np.linspace(0.0, 1.0, 50)[:, None]
        while gap < RADIUS + 0.05:
            angle, aside = rng.uniform(-math.pi, math.pi), rng.uniform(-ASIDE, ASIDE)
            way = np.array([math.cos(angle), math.sin(angle)])
            left = np.array([-way[1], way[0]])
            bench = (1.0 - share) * [x1, y1] + share * [x2, y2]
            apart = (bench - aside * left) @ left
            gap = float(np.abs(apart).min())
        self.nearest, self.velocity = aside * left, rng.uniform(0.5, 1.5) * way
        self.arrives = arrives

    def at(self, time: float) -> Any:
        """Return the place at a time, m."""
        return self.nearest + (time - self.arrives) * self.velocity


def people_of(seed: int) -> list[Person]:
    """Return the people of a scene, about 8 s apart."""
    rng = np.random.default_rng(seed)
    return [Person(rng, 8.0 + 8.0 * k + rng.uniform(-2.0, 2.0)) for k in range(3)]


def seen(people: Sequence[Person], time: float) -> Obstacles:
    """Return the bench and the people in sight, world frame."""
    near = [one for one in people if np.hypot(*one.at(time)) < SIGHT]
    discs = [(*one.at(time), RADIUS) for one in near]
    return Obstacles(
        discs=np.reshape(discs, (-1, 3)),
        disc_velocities=np.reshape([one.velocity for one in near], (-1, 2)),
        walls=[BENCH],
    )


def drive(
    people: Sequence[Person], guided: bool, see: Sensor | None = None
) -> tuple[list[Pose], list[bool]]:
    """Return the poses, one a control step, and who of the people is touched.

    Without a sensor the guide knows the people in sight.
    """
    guide, poses, touched = Guide(ROBOT, SETTINGS), [STATION], [False] * len(people)
    guide.stay(STATION)
    for k in range(round(SECONDS / SETTINGS.dt)):
        time = k * SETTINGS.dt
        for i, one in enumerate(people):
            disc = Obstacles(discs=[(*one.at(time), RADIUS)])
            touched[i] |= touches(poses[-1], disc)
        if see is None:
            world = seen(people, time).seen_from(poses[-1])
        else:
            discs = [(*one.at(time), RADIUS) for one in people]
            there = Obstacles(discs=discs, walls=[BENCH, *ROOM])
            world = see(time, there, poses[-1])
        twist = guide.step(poses[-1], world)[:2] if guided else (0.0, 0.0)
        poses.append(integrate(poses[-1], twist, 0.0, SETTINGS.dt))
    return poses, touched


def row(seed: int) -> dict[str, float]:
    """Return the contacts of a scene, those of a robot at rest, and the final error."""
    people, lidar = people_of(seed), replace(LIDAR, seed=seed)
    points = scanner(ROBOT, replace(lidar, perception=False))
    poses, touched = drive(people, True)
    x, y, heading = poses[-1]
    turned = math.degrees(abs(math.remainder(heading, math.tau)))
    return {
        "seed": seed,
        "people": len(people),
        "touched": sum(touched),
        "touched_at_rest": sum(drive(people, False)[1]),
        "touched_by_points": sum(drive(people, True, points)[1]),
        "touched_by_scans": sum(drive(people, True, scanner(ROBOT, lidar))[1]),
        "error_mm": round(1000.0 * math.hypot(x, y), 2),
        "turned_deg": round(turned, 3),
    }


def study(scenes: int, path: Path) -> None:
    """Write a row per scene, and print their sums."""
    with ProcessPoolExecutor(2) as pool:
        rows = list(pool.map(row, range(scenes)))
    write_csv(path, rows)
    for name in list(rows[0])[1:6]:
        print(name, sum(one[name] for one in rows))
    print("greatest error", max(one["error_mm"] for one in rows), "mm")


def film(seed: int, path: str) -> None:
    """Draw a scene as a film, at twice its speed."""
    people = people_of(seed)
    poses, _ = drive(people, True)
    figure = Figure(figsize=(4.4, 3.6), dpi=80)
    figure.subplots_adjust(0.02, 0.02, 0.98, 0.92)
    axes = figure.add_subplot(xlim=(-2.75, 2.75), ylim=(-1.6, 2.6), aspect="equal")
    axes.set(xticks=[], yticks=[], title="Parked: it lets people pass, and returns")
    axes.plot(BENCH[::2], BENCH[1::2], color="0.35", linewidth=5)
    (robot,) = axes.fill(*ROBOT.footprint.vertices.T, color="tab:blue")
    axes.fill(*ROBOT.footprint.vertices.T, fill=False, linestyle=":", edgecolor="0.5")
    walkers: list[Any] = [axes.add_patch(circle(one.at(0.0))) for one in people]

    def show(k: int) -> list[Any]:
        robot.set_xy(to_world(ROBOT.footprint.vertices, poses[k]))
        for one, patch in zip(people, walkers, strict=True):
            patch.set_center(one.at(k * SETTINGS.dt))
        return [robot, *walkers]

    last = round((people[-1].arrives + 6.0) / SETTINGS.dt)
    frames = range(round((people[0].arrives - 4.0) / SETTINGS.dt), last, 4)
    FuncAnimation(figure, show, frames).save(path, PillowWriter(fps=10))


def circle(place: Any) -> Any:
    """Return a person as drawn."""
    return Circle(place, RADIUS, color="tab:orange")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=120)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--film")
    parser.add_argument("--seed", type=int, default=0, help="of the film")
    options = parser.parse_args()
    if options.film:
        film(options.seed, options.film)
    else:
        study(options.scenes, options.out)
