"""Perception against truth in simulated scenes: one row for each scene and sensor.

Moving scenes are seen at 5, 10 and 25 Hz, all round and with 270°, with noise of 1 and
3 cm; static ones besides with five strengths of odometry drift. The faulty sensor loses
echoes, sweeps and is stamped as the one of the real recordings.

Run: python comparisons/perception/perception_bench.py [--seeds 3] [--out FILE.csv]
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np

import qpavoid as qp
from perception_scenes import DRIFTS, FAULTS, SCENES, STATIC, Recorded, record
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.kinematics import to_world
from qpavoid.types import Array, Pose

Tracker: TypeAlias = Callable[[float, Pose, Array], Array]
"""From stamp, odometry and ranges to movers (m, 4): x, y, v_x, v_y, robot frame."""

Figures: TypeAlias = Mapping[str, list[float]]
"""Of each scan ``false`` and ``false_near``; of each mover and scan ``right`` and
errors; of each mover ``waits``, s from the first sight in motion."""

NEAR, PLACE, SPEED = 4.0, 0.5, 0.35
"""m within which movers are to be known; m and m/s to which they are known right."""

SKIPPED, SETTLED, MOVES, FALSE = 1.5, 0.6, 0.1, 0.2
"""s at the start of a recording that are not counted; s after the first sight in motion
from which on a mover is to be known; m/s of motion; m/s that are false without it."""

EXACT = LidarSettings(beams=360, rate=10.0, noise=0.01)
FAULTY = replace(EXACT, **FAULTS)
PART = replace(EXACT, beams=270, field_of_view=1.5 * math.pi)
OTHERS = [replace(EXACT, rate=5.0), replace(EXACT, rate=25.0), PART]
SENSORS = {
    "exact": [EXACT, *OTHERS, replace(EXACT, noise=0.03)],
    "faulty": [FAULTY],
}


def tracker(made: Recorded, settings: qp.PerceptionSettings | None = None) -> Tracker:
    """Return perception as a tracker of recorded scans."""
    perception = qp.Perception(qp.Robot.mir100_rectangle(), made.lidar, settings)

    def track(time: float, odometry: Pose, ranges: Array) -> Array:
        found = perception.update(ranges, time, odometry)
        return np.hstack([found.discs[:, :2], found.disc_velocities])

    return track


def echoes_of(made: Recorded, k: int) -> Array:
    """Return the echoes (n, 2) of a scan in the world frame, m."""
    lidar, ranges = made.lidar, made.ranges[k]
    echo = np.flatnonzero(np.isfinite(ranges))
    angles = lidar.step(len(ranges)) * echo - 0.5 * lidar.field_of_view
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(to_world(ranges[echo, None] * rays, lidar.mount), made.poses[k])


def distances(places: Array, place: Array) -> Array:
    """Return the distances (n,) of places (n, 2) from one, m."""
    return np.hypot(*(places - place).T)


def measure(made: Recorded, track: Tracker) -> Figures:
    """Return the figures of a tracker on recorded scans."""
    figures, first = defaultdict[str, list[float]](list), dict[int, float]()
    done, past = set[int](), np.searchsorted(made.stamps, made.stamps - 1.2)
    for k, (time, pose) in enumerate(
        zip(made.stamps.tolist(), made.poses, strict=True)
    ):
        found = track(time, tuple(made.odometry[k].tolist()), made.ranges[k])
        if time < SKIPPED:
            continue
        places = to_world(found[:, :2], pose)
        speeds = to_world(found[:, 2:], (0.0, 0.0, pose[2]))
        recent = made.truth[past[k] : k + 1, :, :2].reshape(-1, 2)
        lone = [not (distances(recent, one) < 1.0).any() for one in places]
        false = np.array(lone, bool) & (np.hypot(*speeds.T) > FALSE)
        figures["false"].append(false.any())
        figures["false_near"].append((distances(places, pose[:2])[false] < 5.0).any())
        echoes = echoes_of(made, k)
        for i, (reach, truth) in enumerate(zip(made.reach, made.truth[k], strict=True)):
            seen = distances(echoes, truth[:2]) < reach + 0.1
            if seen.sum() < 2 or math.hypot(*truth[2:]) < MOVES:
                continue
            since = time - first.setdefault(i, time)
            off = error(places, speeds, truth)
            if since > SETTLED and math.dist(truth[:2], pose[:2]) < NEAR:
                figures["right"].append(off[1] < SPEED)
                if off[0] < PLACE:
                    figures["place_errors"].append(off[0])
                    figures["speed_errors"].append(off[1])
            if off[1] < SPEED and i not in done:
                done.add(i)
                figures["waits"].append(since)
    return figures


def error(places: Array, speeds: Array, truth: Array) -> tuple[float, float]:
    """Return the errors (m, m/s) of the nearest mover; infinite beyond PLACE."""
    apart = distances(places, truth[:2])
    if apart.min(initial=math.inf) >= PLACE:
        return math.inf, math.inf
    near = apart.argmin()
    return float(apart[near]), math.dist(speeds[near], truth[2:])


def row_of(figures: Figures) -> dict[str, object]:
    """Return shares, medians and 90 % quantiles; m, s."""
    row: dict[str, object] = {"scans": len(figures["false"])}
    for name in ("false_near", "false"):
        row[f"{name}_percent"] = round(100.0 * float(np.mean(figures[name])), 2)
    right = figures["right"]
    row |= {"right": round(float(np.mean(right)), 3) if right else ""}
    row |= {"right_of": len(right)}
    for name in ("speed_errors", "place_errors", "waits"):
        for mark, q in (("median", 0.5), ("p90", 0.9)) if figures[name] else ():
            row[f"{name}_{mark}"] = round(float(np.quantile(figures[name], q)), 3)
    return row


def run(job: tuple[str, LidarSettings, str, int]) -> Figures:
    """Return the figures of a scene, sensor, drift and seed."""
    scene, lidar, drift, seed = job
    made = record(SCENES[scene](seed), lidar, DRIFTS[drift], seed)
    return measure(made, tracker(made))


def main() -> None:
    """Print and write a row for each scene, static ones with each drift."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--out", type=Path, help="table to write, .csv")
    options = parser.parse_args()
    cases = [(x, y, z) for x in SENSORS for y in SCENES for z in DRIFTS]
    table = []
    with ProcessPoolExecutor(2) as pool:
        for sensor, scene, drift in cases:
            if scene not in STATIC and drift != "none":
                continue
            whole = defaultdict[str, list[float]](list)
            seeds = range(options.seeds)
            jobs = [(scene, x, drift, seed) for x in SENSORS[sensor] for seed in seeds]
            for figures in pool.map(run, jobs):
                for name, values in figures.items():
                    whole[name] += values
            row = {"sensor": sensor, "scene": scene, "drift": drift, "method": "ours"}
            table.append(row | row_of(whole))
            print(*table[-1].values(), flush=True)
    if options.out:
        write_csv(options.out, table)


if __name__ == "__main__":
    main()
