"""Perception on recorded scans: cars with motion-capture truth, walkers, a building.

The LiDAR of the cars is calibrated as ``qpavoid calibrate`` does; its odometry is the
motion-capture pose, then with drift added. A mover is right as in perception_bench.py.
Recordings of a sensor at rest have no truth: a track is lone, and its velocity false,
if echoes before their background are near it in less than 20 % of its scans. In the
building all tracks count as lone, those of people too.

Run: python comparisons/perception/perception_real.py [--data PATH] [--out FILE.csv]
"""

import argparse
import math
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

import qpavoid as qp
from perception_bench import METHODS, tracker
from perception_measures import FALSE, measure
from perception_scenes import DRIFTS, Recorded, drifted
from qpavoid.lab.study.bags import read_bag
from qpavoid.lab.study.calibrate import Recording, calibrate, poses_of, scans_of
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.carmen import NO_ECHO, in_order, read_scans
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

AT_REST = {
    ("leg_tracker", "demo_stationary_simple_environment"): {"/scan": (0.0, 0.0, 0.0)},
    ("leg_tracker", "positive_1"): {"right_scan": (0.0, 0.0, 0.0)},
    ("leg_tracker", "positive_2"): {"right_scan": (0.0, 0.0, 0.0)},
    ("leg_tracker", "positive_3"): {"right_scan": (0.0, 0.0, 0.0)},
    ("obstacle_detector", "scans_demo"): {
        "/front_scan": (0.23565, -0.0005, 0.0),
        "/rear_scan": (-0.23832, 0.00542, math.pi),
    },
}
"""Mounts of the scans' topics: the latter of the demo's launch file."""

BUILDING: dict[str, dict[str, Any]] = {
    "default": {},
    "unknown": {"no_echo": "unknown"},
    "unknown, 0.05": {"no_echo": "unknown", "angle_error": 0.05},
    "unknown, 0.12": {"no_echo": "unknown", "angle_error": 0.12},
}
"""Meaning of no echo, and angle_error, rad."""

LOG = "freiburg-079-corrected.log.gz"

LEAST, BESIDE, BEFORE, SHARE = 1.0, 0.5, 0.15, 0.2
"""s of a long track; m from a track to moving echoes; m of these before their
background; least share of scans with such echoes of a track that is not lone."""

SPECK = qp.Robot("speck", qp.Footprint.rectangle(0.1, 0.1), qp.Limits(-1, 1, -1, 1))


class Seen(NamedTuple):
    """A scan, and the confirmed tracks after it.

    Attributes:
        time: s.
        echoes: (n,) that may move, complex, odometry frame, m.
        tracks: By name x, y, v_x, v_y, odometry frame, m and m/s.
        pose: x, y (m), heading (rad).
    """

    time: float
    echoes: np.ndarray
    tracks: dict[int, np.ndarray]
    pose: np.ndarray


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
                part |= measure(made, tracker(made, settings)).row()
                yield row | part
        peer = measure(made, METHODS["circles"](made._replace(odometry=poses))).row()
        yield row | {"setting": "circles", "drift": "none"} | peer


def frozen(recording: Recording) -> str:
    """Return where the own pose repeats for 0.5 s though echoes move."""
    time, poses = recording.poses[:, 0], recording.poses[:, 1:]
    ends = np.flatnonzero(np.append((np.diff(poses, axis=0) != 0).any(axis=1), True))
    begins = np.append(0, ends[:-1] + 1)
    longest = int((time[ends] - time[begins]).argmax())
    begin, end = time[begins[longest]], time[ends[longest]]
    held = np.where(np.isfinite(recording.ranges), recording.ranges, 1e9)
    held = held[(recording.stamps > begin) & (recording.stamps < end)]
    if end - begin < 0.5 or not len(held):
        return ""
    change = np.abs(held[-3:].min(axis=0) - held[:3].min(axis=0))
    change = np.median(change[(change > 0.0) & (change < 1e3)])
    since = begin - recording.stamps[0]
    return (
        f"pose repeats for {end - begin:.1f} s from {since:.1f} s on, "
        f"echoes move by {change:.2f} m (median)"
    )


def seen_at_rest(path: Path, mounts: dict[str, tuple[float, ...]]) -> list[Seen]:
    """Return the scans of sensors that do not move, echoes before their background."""
    events = bag(path, mounts)
    nowhere = np.zeros((2, 4))
    recordings = {one: scans_of(events, one, nowhere) for one in mounts}
    lidars = {t: one.lidar([*mounts[t], 0, 0]) for t, one in recordings.items()}
    rows, perception = [], qp.Perception(SPECK, lidars)
    for topic, one in recordings.items():
        valid = (one.ranges > one.limits[0]) & (one.ranges < one.limits[1])
        ranges = np.where(valid, one.ranges, np.inf)
        moves = ranges < np.median(ranges, axis=0) - BEFORE
        beams = one.first + one.step * np.arange(ranges.shape[1]) + mounts[topic][2]
        places = np.where(moves, ranges, 0.0) * np.exp(1j * beams)
        places += complex(*mounts[topic][:2])
        for k, stamp in enumerate(one.stamps):
            rows.append((stamp, topic, one.ranges[k], places[k][moves[k]]))
    rows.sort(key=lambda row: row[0])
    begin = rows[0][0]
    return [
        taken(perception, stamp - begin, ranges, np.zeros(3), topic, echoes)
        for stamp, topic, ranges, echoes in rows
    ]


def taken(perception, time, ranges, pose, sensor="", echoes=None) -> Seen:
    """Take a scan; return it with the tracks after it."""
    perception.update(ranges, time, pose, sensor=sensor)
    found = perception.explain()
    turn = np.exp(1j * (pose[2] - found.pose[2]))
    known = {}
    for one in (track for track in found.tracks if track.confirmed):
        place = (complex(*one.position) - complex(*found.pose[:2])) * turn
        moves = complex(*one.velocity) * turn
        known[one.name] = np.array([place + complex(*pose[:2]), moves]).view(float)
    return Seen(time, np.array([]) if echoes is None else echoes, known, pose)


def followed(seen: list[Seen]) -> dict[int, np.ndarray]:
    """Return time, x, y, v_x, v_y (n, 5) of every track."""
    found: dict[int, list[np.ndarray]] = {}
    for one in seen:
        for name, state in one.tracks.items():
            found.setdefault(name, []).append(np.append(one.time, state))
    return {name: np.array(rows) for name, rows in found.items()}


def of_tracks(seen: list[Seen]) -> Row:
    """Return numbers of tracks."""
    minutes = (seen[-1].time - seen[0].time) / 60.0
    lasting = [np.ptp(one[:, 0]) for one in followed(seen).values()]
    long = sum(bool(one >= LEAST) for one in lasting)
    return {
        "scans": len(seen),
        "tracks_per_minute": round(len(lasting) / minutes, 2),
        "long_tracks_per_minute": round(long / minutes, 2),
        "tracks_at_once": round(float(np.mean([len(s.tracks) for s in seen])), 2),
    }


def lone(seen: list[Seen]) -> Row:
    """Return the shares of scans with a velocity of a lone track."""
    beside: dict[int, list[bool]] = {}
    for one in seen:
        for name, x in one.tracks.items():
            near = np.abs(one.echoes - complex(*x[:2])) < BESIDE
            beside.setdefault(name, []).append(bool(near.any()))
    alone = {name for name, found in beside.items() if np.mean(found) < SHARE}
    far = near = 0
    for one in seen:
        fast = [
            x
            for name, x in one.tracks.items()
            if name in alone and math.hypot(*x[2:]) > FALSE
        ]
        far += bool(fast)
        near += any(math.dist(x[:2], one.pose[:2]) < 5.0 for x in fast)
    share = 100.0 / len(seen)
    return {
        "lone_tracks": len(alone),
        "false_near_percent": round(share * near, 2),
        "false_percent": round(share * far, 2),
    }


def without_truth(data: Path | None) -> Iterator[Row]:
    """Yield rows of the sensors at rest, and of the building."""
    for (folder, name), mounts in AT_REST.items():
        path = find_file("scans", f"{name}.bag", data, (f"scans/{folder}",))
        seen = seen_at_rest(path, mounts)
        yield {"recording": name, "setting": "default"} | of_tracks(seen) | lone(seen)
    log = find_file("CARMEN logs", LOG, data, ("carmen",))
    for how, more in BUILDING.items():
        seen = building(log, **more)
        row = {"recording": "freiburg-079", "setting": how}
        yield row | of_tracks(seen) | lone(seen)


def building(path: Path, **more) -> list[Seen]:
    """Return the scans of a CARMEN log; the pose is that of the laser."""
    scans = in_order(list(read_scans(path)))
    angles = scans[0].angles
    wide, middle = float(angles[-1] - angles[0]), 0.5 * float(angles[0] + angles[-1])
    limits = {"range_max": NO_ECHO, "range_min": 0.02}
    lidar = qp.Lidar(field_of_view=wide, mount=(0.0, 0.0, middle), **limits, **more)
    perception, seen = qp.Perception(SPECK, lidar), []
    for one in scans:
        ranges = np.where(one.ranges < NO_ECHO, one.ranges, np.inf)
        seen.append(taken(perception, one.time, ranges, np.array(one.pose)))
    return seen


def main() -> None:
    """Print and write the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, help="published data sets")
    parser.add_argument("--out", type=Path, help="table to write, .csv")
    options = parser.parse_args()
    table = []
    for row in chain(cars(options.data), without_truth(options.data)):
        table.append(row)
        print(*row.values(), flush=True)
    if options.out:
        write_csv(options.out, table)


if __name__ == "__main__":
    main()
