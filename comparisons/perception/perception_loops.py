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
from typing import NamedTuple

import numpy as np
from perception_scenes import BODY, Mover, Scene, box_walls, gone_after, line

import qpavoid as qp
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.model.contacts import clearance_of
from qpavoid.model.kinematics import integrate, to_world
from qpavoid.model.obstacles import Obstacles

ROBOT = qp.Robot(
    "cart",
    qp.Footprint.rectangle(0.8, 0.5),
    qp.Limits(-0.6, 1.2, -1.5, 1.5, acceleration=1.0, angular_acceleration=3.0),
)
SETTINGS = qp.AvoidanceSettings(dt=0.05, radius=qp.SafetyRadius(0.10, 0.15))
SPEED = 0.7
"""m/s of the reference."""


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
        path = gone_after(line(begin, end, speed, start), start + lasts, -10.0)
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
        Scene("walkers", walls, [], movers, duration=45.0),
        (-5.5, 0.0, 0.0),
        (5.5, 0.0, 0.0),
    )


def shifted(path, x: float, y: float):
    """Return a path beside another one."""
    return lambda time: (path(time)[0] + x, path(time)[1] + y, path(time)[2])


def keep_apart(a: Mover, b: Mover) -> bool:
    """Return whether two people never meet."""
    times = np.arange(max(a.begins, b.begins, 0.0), 50.0, 0.1)
    return all(math.dist(a.path(t)[:2], b.path(t)[:2]) > 0.7 for t in times)


def corridor(seed: int) -> Task:
    """Return a corridor of 1.6 to 2.2 m with a person oncoming."""
    random = np.random.default_rng(seed)
    half = random.uniform(0.8, 1.1)
    y = random.uniform(-1.0, 1.0) * (half - BODY - 0.1)
    speed = random.uniform(0.5, 1.4)
    start = random.uniform(0.0, 3.0)
    path = line((8.0, y), (-30.0, y), speed, start)
    walls = [
        (-9, -half, 9, -half),
        (-9, half, 9, half),
        (9, -half, 9, half),
        (-9, -half, -9, half),
    ]
    mover = Mover(gone_after(path, start + 16.5 / speed, 0.0))
    return Task(
        Scene("corridor", walls, [], [mover], duration=40.0),
        (-5.0, 0.0, 0.0),
        (4.0, 0.0, 0.0),
    )


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
    movers = []
    for k in range(3):
        room = -1.0 if random.random() < 0.5 else 1.0
        begin = (room * random.uniform(1.3, 3.2), random.uniform(-1.5, -1.2))
        end = (room * random.uniform(1.3, 3.2), random.uniform(1.2, 1.5))
        path, phase = (
            line(begin, end, random.uniform(0.4, 1.1)),
            random.uniform(0.0, 12.0),
        )
        movers.append(Mover(lambda t, path=path, phase=phase: path(t + phase)))
    return Task(
        Scene("rooms", walls, posts, movers, duration=60.0),
        (-5.0, -0.6, 0.0),
        (5.0, 0.6, 0.0),
    )


KINDS = {
    "walkers": walkers,
    "shins": lambda seed: walkers(seed, "shins"),
    "corridor": corridor,
    "rooms": rooms,
}


def apart(pose, bodies: Obstacles) -> float:
    return float(clearance_of(ROBOT.footprint, bodies.seen_from(pose).arrays))


def drive(
    task: Task, sense: str, lidar: LidarSettings, seed: int, settings=None
) -> Outcome:
    """Drive a task; ``sense`` is ``true``, ``points`` or ``perception``."""
    scene, pose, dt = task.scene, task.start, SETTINGS.dt
    random, device = np.random.default_rng(seed), Lidar(lidar)
    wide, count = lidar.field_of_view, lidar.beams
    step, round_ = wide / count, wide > 6.28
    perception = qp.Perception(
        ROBOT,
        qp.Lidar(
            field_of_view=2 * math.pi if round_ else wide - step,
            mount=(*lidar.mount[:2], lidar.mount[2] + (0.5 * step if round_ else 0.0)),
            range_max=lidar.range,
        ),
        settings,
    )
    guide = qp.Guide(ROBOT, SETTINGS)
    warm, time = 1.0, 0.0
    x, y, g = lidar.mount
    angles = wide * ((np.arange(count) + 0.5) / count - 0.5) + g
    every, scan = round(1.0 / (lidar.rate * dt)), np.zeros((0, 2))
    still, touched = {}, {}
    furniture = False
    free = math.dist(task.start[:2], task.goal[:2]) / SPEED + 3.0
    for k in range(int((warm + 3.0 * free) / dt)):
        time = k * dt
        world = scene.obstacles(time)
        if k % every == 0:
            ranges = device.ranges(pose, world)
            none = ranges >= lidar.range
            ranges = np.maximum(
                ranges + lidar.noise * random.standard_normal(count), 0.0
            )
            ranges[none | (random.random(count) < lidar.dropout)] = math.inf
            echo = np.isfinite(ranges)
            r, a = ranges[echo], angles[echo]
            scan = to_world(
                np.column_stack([x + r * np.cos(a), y + r * np.sin(a)]), pose
            )
            if sense == "perception":
                perception.update(ranges, time, pose)
        if time < warm:
            continue
        if abs(time - warm) < 1e-9:
            guide.go_to(pose, task.goal, speed=SPEED)
        if sense == "true":
            near = [
                m
                for m in scene.movers
                if time >= m.begins and math.dist(m.path(time)[:2], pose[:2]) < 8.0
            ]
            discs = [(*m.motion(time)[:2], BODY) for m in near]
            speeds = [m.motion(time)[2:4] for m in near]
            seen = Obstacles(
                discs=np.array([*discs, *scene.posts]).reshape(-1, 3),
                disc_velocities=np.array(
                    [*speeds, *[(0.0, 0.0)] * len(scene.posts)]
                ).reshape(-1, 2),
                walls=np.array(scene.walls),
            ).seen_from(pose)
        elif sense == "points":
            seen = Obstacles(scan).seen_from(pose)
        else:
            seen = perception.obstacles(time, pose)
        v, omega = guide.step(pose, seen)[:2]
        pose = integrate(pose, (v, omega), 0.0, dt)
        for i, mover in enumerate(scene.movers):
            if time + dt < mover.begins:
                continue
            discs, _ = mover.outline(time + dt)
            if (
                math.dist(mover.path(time + dt)[:2], pose[:2]) < 2.0
                and apart(pose, Obstacles(discs=discs)) < 0.0
            ):
                moves = abs(v) > 0.02 or abs(omega) > 0.02
                (touched if moves else still).setdefault(i, time)
        rest = Obstacles(
            discs=np.array(scene.posts).reshape(-1, 3), walls=np.array(scene.walls)
        )
        furniture |= apart(pose, rest) < 0.0
        if math.dist(pose[:2], task.goal[:2]) < 0.15:
            return Outcome(
                True,
                len(touched),
                len(set(still) - set(touched)),
                furniture,
                time - warm,
            )
    return Outcome(
        False, len(touched), len(set(still) - set(touched)), furniture, time - warm
    )


def run(job) -> tuple[object, Outcome]:
    kind, seed, sense, lidar = job
    return job, drive(KINDS[kind](seed), sense, lidar, seed)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--senses", nargs="*", default=["true", "points", "perception"])
    parser.add_argument("--begin", type=int, default=0)
    options = parser.parse_args(arguments)
    round_ = LidarSettings(beams=360, rate=10.0, noise=0.01, range=10.0)
    part = LidarSettings(
        field_of_view=1.5 * math.pi,
        beams=270,
        rate=10.0,
        noise=0.01,
        range=10.0,
        mount=(0.35, 0.0, 0.0),
    )
    with ProcessPoolExecutor(2) as pool:
        for kind in options.kinds:
            lidar = part if kind == "rooms" else round_
            for sense in options.senses:
                seeds = range(options.begin, options.begin + options.scenes)
                done = list(pool.map(run, [(kind, s, sense, lidar) for s in seeds]))
                out = [o for _, o in done]
                failed = [(j[1], *o[:4]) for j, o in done if not o.success]
                print(
                    f"{kind:9s} {sense:10s} success {sum(o.success for o in out)} of {len(out)}, "
                    f"touched {sum(o.touched for o in out)} + {sum(o.touched_still for o in out)} at rest, "
                    f"furniture {sum(o.furniture for o in out)}, late {sum(not o.arrived for o in out)}, "
                    f"time {np.median([o.time for o in out]):.1f} s",
                    failed[:12],
                    flush=True,
                )


if __name__ == "__main__":
    main()
