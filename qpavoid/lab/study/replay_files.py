"""Files of a replay: summary, table, figure, bag of decisions."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from qpavoid.lab.study.bags import BagWriter, Recording
from qpavoid.lab.study.replay import Replayed
from qpavoid.lab.study.tables import write_csv
from qpavoid.ros.guard import Guard, GuardStep
from qpavoid.ros.report import diagnose, markers
from qpavoid.types import Array


def episodes(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the stretches of changed commands: when, how long, how much, why."""
    found: list[list[Mapping[str, Any]]] = []
    for before, row in zip([None, *rows], rows, strict=False):
        if row["changed"]:
            if before is None or not before["changed"]:
                found.append([])
            found[-1].append(row)
    start = rows[0]["time_s"]
    return [
        {
            "begins_s": round(some[0]["time_s"] - start, 3),
            "lasts_s": round(some[-1]["time_s"] - some[0]["time_s"], 3),
            "commands": len(some),
            "most_dv_mps": _most(some, "v", "mps"),
            "most_domega_radps": _most(some, "omega", "radps"),
            "least_clearance_m": _least(some),
            "why": ", ".join(dict.fromkeys(row["why"] for row in some)),
        }
        for some in found
    ]


def _most(rows: Sequence[Mapping[str, Any]], name: str, unit: str) -> float:
    gaps = (abs(row[f"{name}_given_{unit}"] - row[f"{name}_{unit}"]) for row in rows)
    return round(float(max(gaps)), 4)


def _least(rows: Sequence[Mapping[str, Any]]) -> float | None:
    known = [x for row in rows if math.isfinite(x := row["clearance_m"])]
    return round(min(known), 4) if known else None


def summary(replayed: Replayed) -> dict[str, Any]:
    """Return the numbers of a replay, and its episodes."""
    rows = replayed.rows
    return {
        "commands": len(rows),
        "seconds": round(rows[-1]["time_s"] - rows[0]["time_s"], 3),
        "changed": sum(row["changed"] for row in rows),
        "share_changed": replayed.changed,
        "cut": sum(row["cut"] for row in rows),
        "least_clearance_m": _least(rows),
        "why": dict(Counter(row["why"] for row in rows if row["changed"])),
        "reasons": {row["why"]: row["reason"] for row in rows if row["changed"]},
        "episodes": episodes(rows),
    }


def save(replayed: Replayed, drive: Recording, folder: Path) -> list[Path]:
    """Write summary, table, figure and a bag; return their paths.

    Raises:
        DataError: Where the bag is to be there is something else.
        MissingExtraError: ``rosbags`` is not installed; all else is written.
    """
    ends = "json", "csv", "png"
    told, table, figure = (folder / f"replay.{end}" for end in ends)
    folder.mkdir(parents=True, exist_ok=True)
    found = summary(replayed)
    told.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    write_csv(table, replayed.rows)
    draw(replayed, figure)
    write_bag(replayed, drive, folder / "bag")
    return [told, table, figure, folder / "bag"]


def draw(replayed: Replayed, path: Path) -> None:
    """Draw v, ω and clearance over time; where a command was changed is shaded."""
    from matplotlib.figure import Figure

    rows = replayed.rows
    time = np.array([row["time_s"] for row in rows])
    time -= time[0]
    changed = np.array([row["changed"] for row in rows])
    figure = Figure(figsize=(9, 6), layout="constrained")
    grid = figure.subplots(3, 1, sharex=True)
    names = ("v", "mps", "v (m/s)"), ("omega", "radps", "ω (rad/s)")
    for axes, (name, unit, label) in zip(grid, names, strict=False):
        for kind, look in (("", {"color": "0.5"}), ("_given", {"color": "#0072b2"})):
            values = [row[f"{name}{kind}_{unit}"] for row in rows]
            axes.plot(time, values, lw=1, label=kind[1:] or "recorded", **look)
        axes.set_ylabel(label)
    grid[2].plot(time, [row["clearance_m"] for row in rows], color="0.3", lw=1)
    grid[2].set(ylabel="clearance (m)", xlabel="t (s)", ylim=(-0.1, 2.0))
    for axes in grid:
        look = {"transform": axes.get_xaxis_transform(), "color": "#d55e00"}
        axes.fill_between(time, 0.0, 1.0, where=changed, alpha=0.2, lw=0, **look)
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper right")
    figure.savefig(path, dpi=120)


def write_bag(replayed: Replayed, drive: Recording, folder: Path) -> None:
    """Write decisions and markers as a bag of MCAP, on the robot, and tf of that.

    What was seen comes before what was commanded: the bag can be replayed again.
    """
    guard, base = replayed.guard, drive.wiring.base_frame
    with BagWriter(folder) as bag:
        for row, step in zip(replayed.rows, replayed.steps, strict=True):
            time = row["time_s"]
            kind = "sensor_msgs/msg/PointCloud2"
            seen = _cloud(bag, bag.stamped(kind, time, base), step.obstacles.points)
            bag.write("/qpavoid/points", kind, time, seen)
            for name, v, omega in (
                ("recorded", row["v_mps"], row["omega_radps"]),
                ("given", step.v, step.omega),
            ):
                kind = "geometry_msgs/msg/TwistStamped"
                twist = bag.stamped(kind, time, base)
                twist.twist.linear.x, twist.twist.angular.z = v, omega
                bag.write(f"/qpavoid/{name}", kind, time, twist)
            kind = "diagnostic_msgs/msg/DiagnosticArray"
            told = bag.stamped(kind, time, base)
            told.status = [_status(bag, guard, step)]
            bag.write("/qpavoid/decision", kind, time, told)
            kind = "visualization_msgs/msg/MarkerArray"
            drawn = bag.blank(kind)
            drawn.markers = list(_markers(bag, guard, step, time))
            bag.write("/qpavoid/markers", kind, time, drawn)
            kind = "tf2_msgs/msg/TFMessage"
            bag.write("/tf", kind, time, _frame(bag, drive, row))


def _frame(bag: BagWriter, drive: Recording, row: Mapping[str, Any]) -> Any:
    """Return where the robot is in the frame of odometry."""
    kind, wired = "geometry_msgs/msg/TransformStamped", drive.wiring
    link = bag.stamped(kind, row["time_s"], wired.odom_frame)
    link.child_frame_id, half = wired.base_frame, 0.5 * row["heading_rad"]
    place, turn = link.transform.translation, link.transform.rotation
    place.x, place.y = row["x_m"], row["y_m"]
    turn.z, turn.w = math.sin(half), math.cos(half)
    message = bag.blank("tf2_msgs/msg/TFMessage")
    message.transforms = [link]
    return message


def _status(bag: BagWriter, guard: Guard, step: GuardStep) -> Any:
    found = diagnose(guard, step, (), math.nan)
    status = bag.blank("diagnostic_msgs/msg/DiagnosticStatus")
    status.level, status.message, status.name = found.level, found.message, "qpavoid"
    for key, value in found.values.items():
        pair = bag.blank("diagnostic_msgs/msg/KeyValue")
        pair.key, pair.value = key, value
        status.values.append(pair)
    return status


def _markers(
    bag: BagWriter, guard: Guard, step: GuardStep, time: float
) -> Iterator[Any]:
    """Yield the node's markers."""
    kind, frame = "visualization_msgs/msg/Marker", guard.wiring.base_frame
    for one in markers(guard, step):
        marker = bag.stamped(kind, time, frame)
        marker.ns, marker.type = one.name, 5 if one.pairs else 4
        marker.action = 0 if len(one.points) else 2
        marker.scale.x, marker.pose.orientation.w = 0.02, 1.0
        for name, share in zip("rgba", one.colour, strict=True):
            setattr(marker.color, name, share)
        marker.points = [_point(bag, place) for place in one.points.tolist()]
        yield marker


def _cloud(bag: BagWriter, cloud: Any, points: Array) -> Any:
    """Return a cloud with points (N, 2) as its x, y, z."""
    data = np.zeros((len(points), 3), dtype="<f4")
    data[:, :2] = points
    for k, name in enumerate("xyz"):
        field = bag.blank("sensor_msgs/msg/PointField")
        field.name, field.offset, field.datatype, field.count = name, 4 * k, 7, 1
        cloud.fields.append(field)
    cloud.height, cloud.width, cloud.point_step = 1, len(points), 12
    cloud.row_step, cloud.is_dense = 12 * len(points), True
    cloud.data = np.frombuffer(data.tobytes(), dtype=np.uint8)
    return cloud


def _point(bag: BagWriter, place: Sequence[float]) -> Any:
    point = bag.blank("geometry_msgs/msg/Point")
    point.x, point.y = place
    return point
