"""Closed loops by LiDAR: a guided robot among people who never yield.

Each scene is driven with true discs, with the points of the scan, and with perception.
A run succeeds if the robot reaches its goal without a contact in three times the
obstacle-free time.

Run: python comparisons/perception/perception_loops.py [--scenes 60] [--kinds walkers …]
"""

import argparse
import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import qpavoid as qp
from perception_scenes import (
    BODY,
    FAULTS,
    Mover,
    Scene,
    box_walls,
    gone_after,
    walk_line,
)
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.simulation.simulation import scanner
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import integrate
from qpavoid.model.obstacles import Obstacles

ROBOT = qp.Robot(
    "cart",
    qp.Footprint.rectangle(0.8, 0.5),
    qp.Limits(-0.6, 1.2, -1.5, 1.5, acceleration=1.0, angular_acceleration=3.0),
)
SETTINGS = qp.AvoidanceSettings(dt=0.05, radius=qp.SafetyRadius(0.10, 0.15))
SPEED, ARRIVED, WARM, SIGHT = 0.7, 0.15, 1.0, 8.0
"""m/s of the reference; m from the goal; s of scans before the start; m in which true
discs are known."""

START, FREE = 1.5, 0.75
"""m/s² with which people in rooms start and stop; m of a corridor beside a person, at
least: the robot's width and twice r_min, with 5 cm to spare."""

ROUND = LidarSettings(beams=360, noise=0.01)
PART = LidarSettings(
    field_of_view=1.5 * math.pi, beams=270, noise=0.01, mount=(0.35, 0.0, 0.0)
)
"""All round, and 270° at the front of the robot; both at 10 Hz."""


class Task(NamedTuple):
    """A scene with a start and a goal.

    Attributes:
        scene: World and movers; the robot's motion is not used.
        start: Pose, m and rad.
        goal: The same.
    """

    scene: Scene
    start: tuple[float, float, float]
    goal: tuple[float, float, float]


class Outcome(NamedTuple):
    """Of a run.

    Attributes:
        arrived: Whether it was at the goal in time.
        touched: People touched while the robot moved.
        touched_still: People who walked into it while it stood.
        furniture: Whether it touched anything at rest.
        time: s.
    """

    arrived: bool
    touched: int
    touched_still: int
    furniture: bool
    time: float

    @property
    def success(self) -> bool:
        """Whether it arrived in time and touched nothing."""
        return self.arrived and not (
            self.touched or self.touched_still or self.furniture
        )


def walkers(seed: int, shape: object = "person") -> Task:
    """Return a hall of 14 × 10 m that people cross, 40 % of them abreast in pairs."""
    random = np.random.default_rng(seed)
    movers: list[Mover] = []
    while len(movers) < 14:
        speed, start = random.uniform(0.4, 1.8), random.uniform(-4.0, 30.0)
        side = random.choice([-1.0, 1.0])
        x1, x2 = random.uniform(-4.5, 4.5, 2)
        begin, end = (x1, 4.6 * side), (x2, -4.6 * side)
        lasts = math.dist(begin, end) / speed
        path = gone_after(walk_line(begin, end, speed, start), start + lasts, start)
        c, s = (
            (end[0] - begin[0]) / (lasts * speed),
            (end[1] - begin[1]) / (lasts * speed),
        )
        pair = [
            Mover(shifted(path, -0.65 * i * s, 0.65 * i * c), shape, start)
            for i in range(2)
        ]
        pair = pair[: 2 if random.random() < 0.4 else 1]
        if all(keep_apart(a, b) for a in pair for b in movers):
            movers += pair
    walls = box_walls(-7, -5, 7, 5)
    return Task(
        Scene(walls, [], movers, duration=45.0),
        (-5.5, 0.0, 0.0),
        (5.5, 0.0, 0.0),
    )


def shifted(path, x: float, y: float):
    """Return a path beside another one."""
    return lambda time: (path(time)[0] + x, path(time)[1] + y, path(time)[2])


def keep_apart(a: Mover, b: Mover) -> bool:
    """Return whether two people never meet; a pair that has left together may."""
    times = np.arange(max(a.begins, b.begins, 0.0), 50.0, 0.2)
    here = [(a.path(t)[:2], b.path(t)[:2]) for t in times]
    return all(math.dist(p, q) > 0.7 or p[0] > 100.0 for p, q in here)


def corridor(seed: int) -> Task:
    """Return a corridor of 1.6 to 2.2 m with a person oncoming, who can be passed."""
    random, half, y = np.random.default_rng(seed), 0.0, 0.0
    while half + abs(y) - BODY < FREE:
        half = random.uniform(0.8, 1.1)
        y = random.uniform(-1.0, 1.0) * (half - BODY - 0.1)
    speed = random.uniform(0.5, 1.4)
    start = random.uniform(0.0, 3.0)
    path = walk_line((8.0, y), (-30.0, y), speed, start)
    walls = [
        (-9, -half, 9, -half),
        (-9, half, 9, half),
        (9, -half, 9, half),
        (-9, -half, -9, half),
    ]
    mover = Mover(gone_after(path, start + 16.5 / speed, 0.0))
    return Task(
        Scene(walls, [], [mover], duration=40.0),
        (-5.0, 0.0, 0.0),
        (4.0, 0.0, 0.0),
    )


def rooms(seed: int) -> Task:
    """Return two furnished rooms with a door, and three people who walk to and fro.

    They rest for 2 s at both ends.
    """
    random = np.random.default_rng(seed)
    walls = [*box_walls(-6, -3.5, 6, 3.5), (0, -3.5, 0, -0.8), (0, 0.8, 0, 3.5)]
    posts = []
    for x, y in ((-4.2, 2.4), (-2.0, -2.3), (2.4, 2.2), (4.2, -2.2)):
        x, y = x + random.uniform(-0.4, 0.4), y + random.uniform(-0.4, 0.4)
        if random.random() < 0.5:
            walls += box_walls(x - 0.5, y - 0.3, x + 0.5, y + 0.3)
        else:
            posts += [(x + a, y + b, 0.025) for a in (-0.5, 0.5) for b in (-0.3, 0.3)]
    movers = []
    while len(movers) < 3:
        room = -1.0 if random.random() < 0.5 else 1.0
        x = room * random.uniform(1.0, 5.2, 2)
        begin, end = np.column_stack([x, random.uniform(-1.5, 1.5, 2)])
        speed, phase = random.uniform(0.4, 1.1), random.uniform(0.0, 12.0)
        near = min(math.dist(begin, (-5.0, -0.6)), math.dist(end, (-5.0, -0.6)))
        if math.dist(begin, end) < 2.0 or near < 1.5:
            continue
        path = walk_line(begin, end, speed, 0.0, START)
        movers.append(Mover(lambda t, path=path, phase=phase: path(t + phase)))
    return Task(
        Scene(walls, posts, movers, duration=60.0),
        (-5.0, -0.6, 0.0),
        (5.0, 0.6, 0.0),
    )


KINDS = {
    "walkers": walkers,
    "shins": lambda seed: walkers(seed, "shins"),
    "corridor": corridor,
    "rooms": rooms,
}


class Drive:
    """A run of a task: the robot, its LiDAR and guide, and who was touched.

    Attributes:
        task: To be driven.
        pose: Of the robot, m and rad.
        touched: Rows of people touched while the robot moved.
        still: Rows of people who walked into it while it stood.
        furniture: Whether it touched anything at rest.
    """

    def __init__(self, task: Task, sense: str, lidar: LidarSettings, seed: int) -> None:
        self.task, self.pose, self._sense = task, task.start, sense
        perceives = sense == "perception"
        self._scan = scanner(ROBOT, replace(lidar, seed=seed, perception=perceives))
        self._guide = qp.Guide(ROBOT, SETTINGS)
        self.touched, self.still = set[int](), set[int]()
        self.furniture = False

    def see(self, time: float) -> Obstacles:
        """Return the obstacles that the guide is given, robot frame."""
        scene = self.task.scene
        if self._sense != "true":
            return self._scan(time, scene.obstacles(time), self.pose)
        near = [
            mover.motion(time)
            for mover in scene.movers
            if time >= mover.begins and apart(mover, time, self.pose) < SIGHT
        ]
        return Obstacles(
            discs=[*((x, y, BODY) for x, y, *_ in near), *scene.posts],
            disc_velocities=[
                *(m[2:4] for m in near),
                *((0.0, 0.0) for _ in scene.posts),
            ],
            walls=scene.walls,
        ).seen_from(self.pose)

    def step(self, time: float) -> None:
        """Drive one control step, and note who is touched."""
        seen = self.see(time)
        if time < WARM:
            return
        if time < WARM + SETTINGS.dt:
            self._guide.go_to(self.pose, self.task.goal, speed=SPEED)
        v, omega, *_ = self._guide.step(self.pose, seen)
        self.pose = integrate(self.pose, (v, omega), 0.0, SETTINGS.dt)
        moves = abs(v) > 0.02 or abs(omega) > 0.02
        scene, after = self.task.scene, time + SETTINGS.dt
        for i, mover in enumerate(scene.movers):
            if after >= mover.begins and apart(mover, after, self.pose) < 2.0:
                discs, _ = mover.outline(after)
                if self._touches(Obstacles(discs=discs)):
                    (self.touched if moves else self.still).add(i)
        self.furniture |= self._touches(Obstacles(discs=scene.posts, walls=scene.walls))

    def _touches(self, bodies: Obstacles) -> bool:
        arrays = bodies.seen_from(self.pose).arrays
        return clearance_of(ROBOT.footprint, arrays) < 0.0


def apart(mover: Mover, time: float, pose: Sequence[float]) -> float:
    """Return the distance of a mover from the robot, m."""
    return math.dist(mover.path(time)[:2], pose[:2])


def drive(task: Task, sense: str, lidar: LidarSettings, seed: int) -> Outcome:
    """Drive a task; ``sense`` is ``true``, ``points`` or ``perception``."""
    made, time = Drive(task, sense, lidar, seed), 0.0
    free = math.dist(task.start[:2], task.goal[:2]) / SPEED + 3.0
    while time < WARM + 3.0 * free:
        made.step(time)
        time += SETTINGS.dt
        if math.dist(made.pose[:2], task.goal[:2]) < ARRIVED:
            break
    arrived = math.dist(made.pose[:2], task.goal[:2]) < ARRIVED
    still = len(made.still - made.touched)
    return Outcome(arrived, len(made.touched), still, made.furniture, time - WARM)


def run(job: tuple[str, int, str, bool]) -> Outcome:
    """Return the outcome of a kind, seed and sense, with a faulty LiDAR or not."""
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
    with ProcessPoolExecutor(2) as pool:
        for kind in options.kinds:
            for sense in options.senses:
                jobs = [(kind, seed, sense, options.faulty) for seed in seeds]
                out = list(pool.map(run, jobs))
                row = {
                    "success": sum(one.success for one in out),
                    "touched": sum(one.touched for one in out),
                    "at rest": sum(one.touched_still for one in out),
                    "furniture": sum(one.furniture for one in out),
                    "late": sum(not one.arrived for one in out),
                    "median time": round(
                        float(np.median([one.time for one in out])), 1
                    ),
                }
                failed = [
                    s for s, one in zip(seeds, out, strict=True) if not one.success
                ]
                print(kind, sense, len(out), row, failed[:15], flush=True)


if __name__ == "__main__":
    main()
