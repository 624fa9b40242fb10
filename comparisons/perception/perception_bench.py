"""Perception against truth in simulated scenes: one line a scene.

Moving scenes are seen at 5, 10 and 25 Hz, all round and with 270°, with noise of 1 and
3 cm; static ones besides with five strengths of odometry drift.

Run: python comparisons/perception/perception_bench.py [--seeds 3]
"""

import argparse
import math
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import qpavoid as qp
from perception_measures import Measured, measure
from perception_scenes import (
    DRIFTS,
    Recorded,
    along_wall,
    corridor,
    crossings,
    flat,
    large,
    occlusion,
    pickets,
    record,
    spin,
    stop_and_go,
)
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings

MOVING = {
    "alone": lambda seed: crossings(seed=seed),
    "two abreast": lambda seed: crossings(abreast=2, seed=seed),
    "three abreast": lambda seed: crossings(abreast=3, seed=seed),
    "shins": lambda seed: crossings("shins", seed=seed),
    "corridor": corridor,
    "along a wall": along_wall,
    "out of an occlusion": occlusion,
    "stop and go": stop_and_go,
    "cart": lambda _: large("cart"),
    "robot": lambda _: large("robot"),
    "door": lambda _: large("door"),
}
STATIC = {"furnished flat": flat, "turning": spin, "pickets": pickets}
SCENES = MOVING | STATIC

VIEWS = {
    "10 Hz": (10.0, 360, 0.01),
    "5 Hz": (5.0, 360, 0.01),
    "25 Hz": (25.0, 360, 0.01),
    "270°": (10.0, 270, 0.01),
    "3 cm": (10.0, 360, 0.03),
}
"""Rate, Hz; field of view, degrees, and as many beams; noise, m."""


def tracker(made: Recorded):
    """Return perception as a tracker of recorded scans."""
    device = Lidar(made.lidar)
    perception = qp.Perception(qp.Robot.mir100_rectangle(), device.settings.geometry)

    def track(time, odometry, ranges):
        found = perception.update(ranges, time, odometry)
        return np.hstack([found.discs[:, :2], found.disc_velocities])

    return track


def run(job: tuple[str, str, str, int]) -> Measured:
    """Return the measures of a scene, view, drift and seed."""
    scene, view, drift, seed = job
    rate, degrees, noise = VIEWS[view]
    lidar = LidarSettings(math.radians(degrees), degrees, rate=rate, noise=noise)
    made = record(SCENES[scene](seed), lidar, DRIFTS[drift], seed)
    return measure(made, tracker(made))


def total(parts: Iterable[Measured]) -> Measured:
    """Return the sum of measures."""
    whole = Measured()
    for part in parts:
        for name, value in vars(part).items():
            setattr(whole, name, getattr(whole, name) + value)
    return whole


def main() -> None:
    """Print a line for each moving scene, and for each static one with its drift."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = range(parser.parse_args().seeds)
    with ProcessPoolExecutor(2) as pool:
        for scene in MOVING:
            jobs = [(scene, view, "none", seed) for view in VIEWS for seed in seeds]
            print(f"{scene}: {total(pool.map(run, jobs)).row()}", flush=True)
        for scene in STATIC:
            for drift in DRIFTS:
                jobs = [(scene, view, drift, seed) for view in VIEWS for seed in seeds]
                print(
                    f"{scene}, {drift}: {total(pool.map(run, jobs)).row()}", flush=True
                )


if __name__ == "__main__":
    main()
