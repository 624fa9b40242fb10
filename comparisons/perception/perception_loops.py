"""Closed loops by LiDAR: a guided robot among people who never yield.

Each scene is driven with true discs, with the points of the scan, and with perception.
A run succeeds if the robot reaches its goal without a contact in three times the
obstacle-free time.

Run: python comparisons/perception/perception_loops.py [--scenes 60] [--kinds walkers …]
"""

import argparse
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from scipy.interpolate import make_interp_spline

import qpavoid as qp
from perception_scenes import BODY, FAULTS, Mover, Scene, box_walls, passer
from qpavoid.lab.sensing.lidar import LidarSettings, scanner
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import integrate
from qpavoid.types import Array, Pose

Row: TypeAlias = dict[str, float]
"""Figures of a run: counts, and its time, s."""

Task: TypeAlias = tuple[Scene, Pose, Pose]
"""A scene, a start and a goal."""

ROBOT = qp.Robot(
    "cart",
    qp.Footprint.rectangle(0.8, 0.5),
    qp.Limits(-0.6, 1.2, -1.5, 1.5, acceleration=1.0, angular_acceleration=3.0),
)
SETTINGS = qp.AvoidanceSettings(dt=0.05, radius=qp.SafetyRadius(0.10, 0.15))
SPEED, ARRIVED, WARM, SIGHT = 0.7, 0.15, 1.0, 8.0
"""m/s of the reference; m from the goal; s of scans before the start; m in which true
discs are known."""

REST, START, FREE = 2.0, 1.5, 0.75
"""s for which people in rooms rest; m/s² with which they start and stop; m of a
corridor beside a person, at least: the robot's width and twice r_min, with 5 cm to
spare."""

ROUND = LidarSettings(beams=360, noise=0.01)
PART = LidarSettings(
    field_of_view=1.5 * math.pi, beams=270, noise=0.01, mount=(0.35, 0.0, 0.0)
)
"""All round, and 270° at the front of the robot; both at 10 Hz."""


def walkers(seed: int, shape: str = "person") -> Task:
    """Return a hall of 14 × 10 m that people cross, 40 % of them abreast in pairs."""
    random = np.random.default_rng(seed)
    movers: list[Mover] = []
    while len(movers) < 14:
        speed, start = random.uniform(0.4, 1.8), random.uniform(-4.0, 30.0)
        side = random.choice([-1.0, 1.0])
        x1, x2 = random.uniform(-4.5, 4.5, 2)
        ends = np.array([(x1, 4.6 * side), (x2, -4.6 * side)])
        x, y = (ends[1] - ends[0]) / math.dist(*ends)
        offsets = np.array([(0.0, 0.0), (-0.65 * y, 0.65 * x)])
        offsets = offsets[: 2 if random.random() < 0.4 else 1]
        pair = [(ends + offset).tolist() for offset in offsets]
        group = [passer(*one, speed, start, shape) for one in pair]
        if all(keep_apart(a, b) for a in group for b in movers):
            movers += group
    scene = Scene(box_walls(-7, -5, 7, 5), [], movers)
    return scene, (-5.5, 0.0, 0.0), (5.5, 0.0, 0.0)


def keep_apart(a: Mover, b: Mover) -> bool:
    """Return whether two people never meet; a pair that has left together may."""
    times = np.arange(max(a.begins, b.begins, 0.0), min(a.ends, b.ends, 50.0), 0.2)
    return all(math.dist(a.path(t)[:2], b.path(t)[:2]) > 0.7 for t in times)


def corridor(seed: int) -> Task:
    """Return a corridor of 1.6 to 2.2 m with a person oncoming, who can be passed."""
    random, half, y = np.random.default_rng(seed), 0.0, 0.0
    while half + abs(y) - BODY < FREE:
        half = random.uniform(0.8, 1.1)
        y = random.uniform(-1.0, 1.0) * (half - BODY - 0.1)
    speed, start = random.uniform(0.5, 1.4), random.uniform(0.0, 3.0)
    mover = passer((8.0, y), (-8.5, y), speed, start)._replace(begins=0.0)
    scene = Scene(box_walls(-9, -half, 9, half), [], [mover])
    return scene, (-5.0, 0.0, 0.0), (4.0, 0.0, 0.0)


def rooms(seed: int) -> Task:
    """Return two furnished rooms with a door, and three people who walk to and fro."""
    random = np.random.default_rng(seed)
    walls = [*box_walls(-6, -3.5, 6, 3.5), (0, -3.5, 0, -0.8), (0, 0.8, 0, 3.5)]
    posts = []
    for x, y in ((-4.2, 2.4), (-2.0, -2.3), (2.4, 2.2), (4.2, -2.2)):
        x, y = x + random.uniform(-0.4, 0.4), y + random.uniform(-0.4, 0.4)
        if random.random() < 0.5:
            walls += box_walls(x - 0.5, y - 0.3, x + 0.5, y + 0.3)
        else:
            posts += [(x + a, y + b, 0.025) for a in (-0.5, 0.5) for b in (-0.3, 0.3)]
    movers: list[Mover] = []
    while len(movers) < 3:
        room = -1.0 if random.random() < 0.5 else 1.0
        x = room * random.uniform(1.0, 5.2, 2)
        begin, end = np.column_stack([x, random.uniform(-1.5, 1.5, 2)])
        speed, phase = random.uniform(0.4, 1.1), random.uniform(0.0, 12.0)
        near = min(math.dist(one, (-5.0, -0.6)) for one in (begin, end))
        if math.dist(begin, end) >= 2.0 and near >= 1.5:
            movers.append(to_and_fro(begin, end, speed, phase))
    return Scene(walls, posts, movers), (-5.0, -0.6, 0.0), (5.0, 0.6, 0.0)


def to_and_fro(begin: Array, end: Array, speed: float, phase: float) -> Mover:
    """Return a person walking between two places (x, y, m), with a rest at both.

    ``phase``: s for which the person has walked at time 0.
    """
    length, ramp = math.dist(begin, end), speed / START
    steps = [0.0, ramp, length / speed - ramp, ramp, REST]
    times = np.cumsum([*steps, *steps[1:]])
    speeds = speed * np.array([0, 1, 1, 0, 0, -1, -1, 0, 0])
    walked = make_interp_spline(times, speeds, k=1).antiderivative()
    way = np.subtract(end, begin) / length

    def path(time: float) -> Pose:
        x, y = begin + float(walked((time + phase) % times[-1])) * way
        return float(x), float(y), 0.0

    return Mover(path)


KINDS = {
    "walkers": walkers,
    "shins": lambda seed: walkers(seed, "shins"),
    "corridor": corridor,
    "rooms": rooms,
}


def known(scene: Scene, time: float, pose: Pose) -> qp.Obstacles:
    """Return people within :data:`SIGHT` with their velocities, and the rest."""
    people = [mover.motion(time) for mover in nearby(scene, time, pose, SIGHT)]
    at_rest = np.zeros((len(scene.posts), 2))
    return qp.Obstacles(
        discs=[*((x, y, BODY) for x, y, *_ in people), *scene.posts],
        disc_velocities=[*(one[2:] for one in people), *at_rest],
        walls=scene.walls,
    ).seen_from(pose)


def nearby(scene: Scene, time: float, pose: Pose, reach: float) -> list[Mover]:
    """Return the movers within a distance of the robot, m."""
    there = [mover for mover in scene.movers if mover.is_there(time)]
    return [one for one in there if math.dist(one.path(time)[:2], pose[:2]) < reach]


def touches(pose: Pose, bodies: qp.Obstacles) -> bool:
    """Return whether the robot touches bodies, world frame."""
    return clearance_of(ROBOT.footprint, bodies.seen_from(pose).arrays) < 0.0


def drive(task: Task, sense: str, lidar: LidarSettings, seed: int) -> Row:
    """Return the figures of a run; ``sense``: ``true``, ``points`` or ``perception``.

    ``touched`` are people touched while the robot moved, ``at rest`` those who walked
    into it while it stood.
    """
    scene, pose, goal = task
    time, bodies = 0.0, qp.Obstacles(discs=scene.posts, walls=scene.walls)
    see = scanner(ROBOT, replace(lidar, seed=seed, perception=sense == "perception"))
    guide = qp.Guide(ROBOT, SETTINGS)
    guide.go_to(pose, goal, speed=SPEED)
    touched, still, furniture = set[int](), set[int](), False
    late = WARM + 3.0 * (math.dist(pose[:2], goal[:2]) / SPEED + 3.0)
    while time < late and math.dist(pose[:2], goal[:2]) >= ARRIVED:
        if sense == "true":
            seen = known(scene, time, pose)
        else:
            seen = see(time, scene.obstacles(time), pose)
        warm, time = time >= WARM, time + SETTINGS.dt
        if not warm:
            continue
        v, omega, *_ = guide.step(pose, seen)
        pose = integrate(pose, (v, omega), 0.0, SETTINGS.dt)
        moves = abs(v) > 0.02 or abs(omega) > 0.02
        for mover in nearby(scene, time, pose, 2.0):
            if touches(pose, qp.Obstacles(discs=mover.outline(time)[0])):
                (touched if moves else still).add(id(mover))
        furniture |= touches(pose, bodies)
    arrived = math.dist(pose[:2], goal[:2]) < ARRIVED
    return {
        "success": arrived and not (touched or still or furniture),
        "touched": len(touched),
        "at rest": len(still - touched),
        "furniture": furniture,
        "late": not arrived,
        "median time": time - WARM,
    }


def run(job: tuple[str, int, str, bool]) -> Row:
    """Return the figures of a kind, seed and sense, with a faulty LiDAR or not."""
    kind, seed, sense, faulty = job
    lidar = PART if kind == "rooms" else ROUND
    lidar = replace(lidar, **FAULTS) if faulty else lidar
    return drive(KINDS[kind](seed), sense, lidar, seed)


def main() -> None:
    """Drive the scenes and print a line for each kind and sense."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--begin", type=int, default=0, help="first seed")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--faulty", action="store_true", help="faults as measured")
    parser.add_argument("--senses", nargs="*", default=["true", "points", "perception"])
    options = parser.parse_args()
    seeds = range(options.begin, options.begin + options.scenes)
    cases = [(kind, sense) for kind in options.kinds for sense in options.senses]
    with ProcessPoolExecutor(2) as pool:
        for kind, sense in cases:
            jobs = [(kind, seed, sense, options.faulty) for seed in seeds]
            out = list(pool.map(run, jobs))
            row = {name: sum(one[name] for one in out) for name in out[0]}
            times = [one["median time"] for one in out]
            row["median time"] = round(float(np.median(times)), 1)
            failed = [
                k for k, one in zip(seeds, out, strict=True) if not one["success"]
            ]
            print(kind, sense, len(out), row, failed[:15], flush=True)


if __name__ == "__main__":
    main()
