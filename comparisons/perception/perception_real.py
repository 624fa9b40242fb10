"""Perception on recorded scans of a car with motion-capture truth.

The LiDAR of the car is calibrated as ``qpavoid calibrate`` does; its odometry is the
motion-capture pose, then with drift added. A mover is right as in perception_bench.py.

Run: python comparisons/perception/perception_real.py [--data PATH] [--out FILE.csv]
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np

import qpavoid as qp
from perception_bench import measure, row_of, tracker
from perception_scenes import DRIFTS, Recorded, drifted
from qpavoid.lab.study.bags import read_bag
from qpavoid.lab.study.calibrate import calibrate, poses_of, scans_of
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.source import find_file

Row: TypeAlias = dict[str, object]

OWN, OTHERS = "/mocap_pose", ["/robot_1", "/robot_2"]
"""Topics of the own pose and of those of other cars."""

REACH, AROUND = 0.25, 0.1
"""m of a car; s on both sides over which its velocity is taken."""

SET = {"angle_error": 0.05, "no_echo": "unknown"}, qp.PerceptionSettings(acceleration=3)
SETTINGS = {"default": ({}, qp.PerceptionSettings()), "cars": SET}


def cars(data: Path | None) -> Iterator[Row]:
    """Yield rows of the recording with motion capture."""
    path = find_file("recorded scans", "two_robots.bag", data, ("scans/datmo",))
    topics = [OWN, *OTHERS, "/scan"]
    events = read_bag(path, lambda held: {one: one for one in topics})[1]
    recording = scans_of(events, "/scan", poses_of(events, OWN))
    found = calibrate(recording, strict=False)
    row: Row = {"recording": path.stem, "scans": len(recording.stamps)}
    row["wall_m"] = round(found.thickness, 4)
    fitted = [one.value for one in found.estimates.values()]
    fit = ", ".join(f"{k} {v.value:.4f}" for k, v in found.estimates.items())
    poses = recording.pose_at(recording.stamps)
    places = [recording._replace(poses=poses_of(events, one)) for one in OTHERS]
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
            made = Recorded(*scans, [REACH] * len(OTHERS))
            part = {"setting": how, "drift": drift, "note": fit}
            yield row | part | row_of(measure(made, tracker(made, settings)))


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
