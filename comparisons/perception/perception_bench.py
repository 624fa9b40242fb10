"""Perception against truth in simulated scenes: one row for each scene and sensor.

Moving scenes are seen at 5, 10 and 25 Hz, all round and with 270°, with noise of 1 and
3 cm; static ones besides with five strengths of odometry drift. The faulty sensor loses
echoes, sweeps and is stamped as the one of the real recordings.

Run: python comparisons/perception/perception_bench.py [--seeds 3] [--out FILE.csv]
"""

import argparse
import math
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

import qpavoid as qp
from perception_measures import Measured, measure
from perception_scenes import (
    DRIFTS,
    FAULTS,
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
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.study.tables import write_csv

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

EXACT = LidarSettings(beams=360, rate=10.0, noise=0.01)
FAULTY = replace(EXACT, **FAULTS)
PART = replace(EXACT, beams=270, field_of_view=1.5 * math.pi)
SENSORS = {
    "exact": [
        EXACT,
        replace(EXACT, rate=5.0),
        replace(EXACT, rate=25.0),
        PART,
        replace(EXACT, noise=0.03),
    ],
    "faulty": [FAULTY],
}


def tracker(made: Recorded, settings: qp.PerceptionSettings | None = None):
    """Return perception as a tracker of recorded scans."""
    perception = qp.Perception(qp.Robot.mir100_rectangle(), made.lidar, settings)

    def track(time, odometry, ranges):
        found = perception.update(ranges, time, odometry)
        return np.hstack([found.discs[:, :2], found.disc_velocities])

    return track


def run(job: tuple[str, LidarSettings, str, int]) -> Measured:
    """Return the measures of a scene, sensor, drift and seed."""
    scene, lidar, drift, seed = job
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
    """Print and write a row for each scene, static ones with each drift."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, help="table to write, .csv")
    options = parser.parse_args()
    table = []
    with ProcessPoolExecutor(2) as pool:
        for sensor, views in SENSORS.items():
            for scene in SCENES:
                for drift in DRIFTS if scene in STATIC else ["none"]:
                    seeds = range(options.seeds)
                    jobs = [(scene, x, drift, seed) for x in views for seed in seeds]
                    row = {"sensor": sensor, "scene": scene, "drift": drift}
                    row |= {"method": "ours"} | total(pool.map(run, jobs)).row()
                    table.append(row)
                    print(*row.values(), flush=True)
    if options.out:
        write_csv(options.out, table)


if __name__ == "__main__":
    main()
