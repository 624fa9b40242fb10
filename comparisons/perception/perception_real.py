"""Perception on recorded scans of cars with motion-capture truth.

The LiDAR of the cars is calibrated as ``qpavoid calibrate`` does; its odometry is the
motion-capture pose, then with drift added. A mover is right as in perception_bench.py.

Run: python comparisons/perception/perception_real.py [--data PATH] [--out FILE.csv]
"""

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np

import qpavoid as qp
from perception_bench import measure, row_of, tracker
from perception_scenes import DRIFTS, Recorded, drifted
from qpavoid.lab.study.bags import read_bag
from qpavoid.lab.study.calibrate import Recording, calibrate, poses_of, scans_of
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.source import find_file

Row: TypeAlias = dict[str, object]

CARS = {
    "two_robots": ("/mocap_pose", ["/robot_1", "/robot_2"]),
    "overtake_ego": ("/ego_pose", ["/red_pose"]),
    "intersection": ("/ego_pose", ["/red_pose"]),
}
"""Topics of the own pose and of those of other cars."""

REACH, AROUND = 0.25, 0.1
"""m of a car; s on both sides over which its velocity is taken."""

SET = {"angle_error": 0.05, "no_echo": "unknown"}, qp.PerceptionSettings(acceleration=3)
SETTINGS = {"default": ({}, qp.PerceptionSettings()), "cars": SET}


def bag(path: Path, topics: Iterable[str]) -> list:
    """Return the messages of some topics of a bag."""
    return read_bag(path, lambda held: {one: one for one in topics})[1]


def cars(data: Path | None) -> Iterator[Row]:
    """Yield rows of the recordings with motion capture."""
    for name, (own, others) in CARS.items():
        path = find_file("recorded scans", f"{name}.bag", data, ("scans/datmo",))
        events = bag(path, [own, *others, "/scan"])
        recording = scans_of(events, "/scan", poses_of(events, own))
        row: Row = {"recording": name}
        row["scans"] = len(recording.stamps)
        found = calibrate(recording, strict=False)
        row["wall_m"] = round(found.thickness, 4)
        if fault := frozen(recording) or found.unexcited:
            yield row | {"note": fault}
            continue
        fitted = [one.value for one in found.estimates.values()]
        fit = ", ".join(f"{k} {v.value:.4f}" for k, v in found.estimates.items())
        poses = recording.pose_at(recording.stamps)
        places = [recording._replace(poses=poses_of(events, one)) for one in others]
        before, now, after = (
            np.stack([one.pose_at(recording.stamps + h) for one in places], axis=1)
            for h in (-AROUND, 0.0, AROUND)
        )
        truth = np.dstack([now[..., :2], (after - before)[..., :2] / (2.0 * AROUND)])
        for how, (more, settings) in SETTINGS.items():
            lidar = recording.lidar(fitted, **more)
            for drift, errors in DRIFTS.items():
                odometry = drifted(poses, errors, np.random.default_rng(0))
                times = recording.stamps - recording.stamps[0]
                scans = lidar, times, recording.ranges, odometry, poses, truth
                made = Recorded(*scans, [REACH] * len(others))
                part = {"setting": how, "drift": drift, "note": fit}
                part |= row_of(measure(made, tracker(made, settings)))
                yield row | part


def frozen(recording: Recording) -> str:
    """Return where the own pose repeats for 0.5 s though echoes move."""
    time, poses = recording.poses[:, 0], recording.poses[:, 1:]
    moves = np.append(0, 1 + np.flatnonzero(np.diff(poses, axis=0).any(axis=1)))
    rests = time[np.append(moves[1:] - 1, len(time) - 1)] - time[moves]
    longest, begin = float(rests.max()), time[moves[rests.argmax()]]
    within = (recording.stamps > begin) & (recording.stamps < begin + longest)
    held = np.where(np.isfinite(recording.ranges), recording.ranges, 1e9)[within]
    if longest < 0.5 or not len(held):
        return ""
    change = np.abs(held[-3:].min(axis=0) - held[:3].min(axis=0))
    change = np.median(change[(change > 0.0) & (change < 1e3)])
    since = begin - recording.stamps[0]
    return (
        f"pose repeats for {longest:.1f} s from {since:.1f} s on, "
        f"echoes move by {change:.2f} m (median)"
    )


def main() -> None:
    """Print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="published data sets")
    parser.add_argument("--out", type=Path, help="table to write, .csv")
    options = parser.parse_args()
    table = []
    for row in cars(options.data):
        table.append(row)
        print(*row.values(), flush=True)
    if options.out:
        write_csv(options.out, table)


if __name__ == "__main__":
    main()
