"""Perception against truth in simulated scenes: one row a scene, sensor and method.

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
from perception_measures import Measured, echoes_of, measure
from perception_peer import Peer
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


METHODS = {"ours": tracker, "circles": lambda made: Peer(made.lidar).track}


def run(job: tuple[str, LidarSettings, str, int, str]) -> Measured:
    """Return the measures of a scene, sensor, drift, seed and method."""
    scene, lidar, drift, seed, method = job
    made = record(SCENES[scene](seed), lidar, DRIFTS[drift], seed)
    return measure(made, METHODS[method](made))


def total(parts: Iterable[Measured]) -> Measured:
    """Return the sum of measures."""
    whole = Measured()
    for part in parts:
        for name, value in vars(part).items():
            setattr(whole, name, getattr(whole, name) + value)
    return whole


def draw(path: Path, begin: float = 2.0, end: float = 13.5, every: int = 6) -> None:
    """Draw people in a corridor, with true and estimated velocities, faulty sensor."""
    import matplotlib.pyplot as plt

    made = record(corridor(seed=3), FAULTY, seed=3)
    track, known, echoes, truth = tracker(made), [], [], []
    for k, time in enumerate(made.stamps):
        found = track(time, made.odometry[k], made.ranges[k])
        if begin < time < end and k % every == 0:
            cos, sin = np.cos(made.poses[k, 2]), np.sin(made.poses[k, 2])
            turn = np.array([[cos, sin], [-sin, cos]])
            places = found[:, :2] @ turn + made.poses[k, :2]
            known.append(np.hstack([places, found[:, 2:] @ turn]))
            echoes.append(echoes_of(made, k) @ turn + made.poses[k, :2])
            truth.append(made.truth[k])
    figure, axes = plt.subplots(figsize=(9, 2.6))
    axes.plot(*np.vstack(echoes).T, ".", color="0.75", ms=1, label="echoes")
    way = made.poses[(made.stamps > begin) & (made.stamps < end), :2]
    axes.plot(*way.T, "k", lw=1, label="robot")
    how = {"angles": "xy", "scale_units": "xy", "scale": 2.0}
    for rows, name, color, width in (
        (truth, "true, m in 0.5 s", "#9fd8ae", 0.007),
        (known, "estimated", "#d95f02", 0.0025),
    ):
        row = np.vstack(rows).T
        axes.quiver(*row, color=color, width=width, label=name, **how)
    axes.set(
        xlim=(-3, 9), ylim=(-1.2, 1.9), aspect="equal", xlabel="x, m", ylabel="y, m"
    )
    axes.legend(ncols=4, loc="upper center", frameon=False)
    figure.tight_layout()
    figure.savefig(path, dpi=120, metadata={"Software": ""})


def main() -> None:
    """Print and write a row for each scene, static ones with each drift."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--figure", type=Path, help="only draw a corridor, .png")
    parser.add_argument("--out", type=Path, help="table to write, .csv")
    options = parser.parse_args()
    if options.figure:
        draw(options.figure)
        return
    table = []
    with ProcessPoolExecutor(2) as pool:
        for sensor, views in SENSORS.items():
            for scene in SCENES:
                for drift in DRIFTS if scene in STATIC else ["none"]:
                    for method in METHODS:
                        jobs = [
                            (scene, view, drift, seed, method)
                            for view in views
                            for seed in range(options.seeds)
                        ]
                        row = {"sensor": sensor, "scene": scene, "drift": drift}
                        row |= {"method": method} | total(pool.map(run, jobs)).row()
                        table.append(row)
                        print(*row.values(), flush=True)
    if options.out:
        write_csv(options.out, table)


if __name__ == "__main__":
    main()
