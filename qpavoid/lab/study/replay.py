"""A recorded drive through the filter: what it would have changed, when and why.

Not a closed loop. At every recorded command a step of the very guard that the node runs
(:mod:`qpavoid.ros.guard`) is asked, among what had been received until then, of a robot
that drives what was recorded: what odometry says, else the command before. Its answer
goes nowhere. A command beyond the robot's limits is cut to them first. ``changed`` is a
step whose twist is another one than that.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from qpavoid.avoidance.freshness import Freshness
from qpavoid.errors import ConfigError, DataError, InvalidInputError, did_you_mean
from qpavoid.lab.simulation.loop import differs
from qpavoid.lab.study.bags import BagWriter, Event, Recording
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.carmen import hold_time
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot
from qpavoid.ros.guard import Guard, GuardSetup, GuardStep, Wiring
from qpavoid.ros.messages import read_twist
from qpavoid.ros.parameters import PRESETS, Running, defaults, preset, setup_of
from qpavoid.ros.report import diagnose, markers
from qpavoid.types import Array, Twist

PIONEER = Robot("Pioneer", Footprint.rectangle(0.47, 0.41), Limits.symmetric(1.6, 2.6))
"""That of Freiburg-079, whose PARAM lines give its size, 0.47 × 0.41 m."""

PATIENCE = 3.0
"""Steps; so old may be what is known, where no parameters say."""


class Parameters(NamedTuple):
    """What a parameter file of the node says.

    Attributes:
        running: How the node runs.
        wiring: Of the node.
        setup: Robot, filter, freshness.
    """

    running: Running
    wiring: Wiring
    setup: GuardSetup


class Replayed(NamedTuple):
    """What became of a drive.

    Attributes:
        rows: A dict a command: time_s, the recorded twist, the given one, why.
        steps: Of the guard, one a row.
        guard: As it was left.
    """

    rows: list[dict[str, Any]]
    steps: list[GuardStep]
    guard: Guard

    @property
    def changed(self) -> float:
        """Share of the commands that were changed."""
        return sum(map(bool, (r["changed"] for r in self.rows))) / len(self.rows)


def read_parameters(path: Path) -> Parameters:
    """Return what a parameter file of ROS 2 says to the node.

    Raises:
        ConfigError: It is no such file, or a key is not known, or a value does not fit.
    """
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
        (nodes,) = document.values()
        given = _flat(nodes["ros__parameters"])
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError([f"{path}: cannot be read ({error})"]) from None
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ConfigError([f"{path}: wants one node with ros__parameters"]) from None
    try:
        robot = preset(given.get("robot_preset", Running().robot_preset))
        known = Running()._asdict() | Wiring()._asdict() | defaults(robot)
        unknown = [key for key in given if key not in known]
        if unknown:
            raise ConfigError(
                f"{path}: unknown key {key!r}{did_you_mean(key, known)}"
                for key in unknown
            )
        known |= {k: tuple(x) if isinstance(x, list) else x for k, x in given.items()}
        running = Running(**{key: known[key] for key in Running._fields})
        wiring = Wiring(**{key: known[key] for key in Wiring._fields})
        setup = setup_of(known, robot, running.dt_s)
    except (InvalidInputError, TypeError) as error:
        raise ConfigError([f"{path}: {error}"]) from None
    return Parameters(running, wiring, setup)


def _flat(table: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return a table of tables by dotted keys."""
    found: dict[str, Any] = {}
    for key, value in table.items():
        inner = isinstance(value, Mapping)
        found |= _flat(value, f"{above}{key}.") if inner else {f"{above}{key}": value}
    return found


def robot_of(text: str) -> Robot:
    """Return a preset by name, or a rectangle about the axle of ``LENGTH,WIDTH``, m.

    A rectangle drives as :data:`PIONEER` does.

    Raises:
        InvalidInputError: It is neither.
    """
    if text in PRESETS:
        return preset(text)
    try:
        length, width = map(float, text.split(","))
        return Robot(text, Footprint.rectangle(length, width), PIONEER.limits)
    except ValueError:
        names = ", ".join(PRESETS)
        said = f"{text!r} is neither LENGTH,WIDTH nor {names}"
        raise InvalidInputError(said) from None


def setup_for(drive: Recording, robot: Robot) -> GuardSetup:
    """Return default settings for a drive: its own step, ages that it can keep.

    Raises:
        DataError: It has fewer than two commands, or they are too far apart.
    """
    times = [event.time for event in drive.events if event.topic == "command"]
    if len(times) < 2:
        raise DataError("a replay wants two commands or more")
    dt, fresh = max(hold_time(times), 1e-3), Freshness()
    ages = {
        name: max(getattr(fresh, name), PATIENCE * dt)
        for name in ("points", "discs", "odometry", "command")
    }
    setup = setup_of(defaults(robot), robot, min(dt, 0.5))
    return setup._replace(freshness=replace(fresh, **ages))


def replay(drive: Recording, setup: GuardSetup) -> Replayed:
    """Return what the guard makes of every command of a drive.

    A fault ends with what caused it: the guard does not wait until inputs have been
    good for a while. Commands before all inputs have been seen once are left out.

    Raises:
        DataError: There are no others.
    """
    fresh = replace(setup.freshness, good=0.0)
    guard = Guard(setup._replace(freshness=fresh), drive.wiring)
    guard.sensors |= drive.sensors
    rows, steps, last = [], list[GuardStep](), (0.0, 0.0)
    for event in drive.events:
        now = event.time, event.time
        if event.topic != "command":
            guard.see(event.topic, event.message, *now)
            continue
        guard.command(event.message, *now)
        driven = guard.trail.twist if drive.wiring.odometry else last
        step, last = guard.step(*now, driven), _recorded(event)
        if not drive.wiring.odometry:
            guard.trail.twist = last
        if all(map(math.isfinite, step.ages.values())):
            rows.append(_row(event.time, last, step, setup.robot.limits))
            steps.append(step)
    if not rows:
        never = [name for name, age in step.ages.items() if age == math.inf]
        raise DataError(f"never seen before a command: {', '.join(never)}")
    return Replayed(rows, steps, guard)


def _recorded(event: Event) -> Twist:
    try:
        return read_twist(event.message)
    except InvalidInputError:
        return 0.0, 0.0


def _row(
    time: float, recorded: Twist, step: GuardStep, limits: Limits
) -> dict[str, Any]:
    v, omega = recorded
    free = (
        min(max(v, limits.v_min), limits.v_max),
        min(max(omega, limits.omega_min), limits.omega_max),
    )
    decision = step.decision
    faults = "; ".join(f"{name} {fault}" for name, fault in step.faults.items())
    return {
        "time_s": time,
        "v_mps": v,
        "omega_radps": omega,
        "v_given_mps": step.v,
        "omega_given_radps": step.omega,
        "cut": free != recorded,
        "changed": differs(free, (step.v, step.omega)),
        "why": faults if decision is None else str(decision.status),
        "clearance_m": math.nan if decision is None else decision.clearance,
        "slack_mps": 0.0 if decision is None else decision.slack,
        "age_s": max(step.ages.values()),
    }


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
        "episodes": episodes(rows),
    }


def save(replayed: Replayed, drive: Recording, folder: Path) -> list[Path]:
    """Write summary, table, figure, and a bag; return their paths.

    Raises:
        DataError: There is a bag already.
        MissingExtraError: ``rosbags`` is not installed; all else is written.
    """
    told, table, figure = (folder / f"replay.{end}" for end in ("json", "csv", "png"))
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(summary(replayed), indent=1)
    told.write_text(text + "\n", encoding="utf-8")
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
    """Write decisions and markers as a bag of MCAP, in the frame of the robot."""
    guard, base = replayed.guard, drive.wiring.base_frame
    with BagWriter(folder) as bag:
        for row, step in zip(replayed.rows, replayed.steps, strict=True):
            time = row["time_s"]
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
            kind = "sensor_msgs/msg/PointCloud2"
            seen = _cloud(bag, bag.stamped(kind, time, base), step.obstacles.points)
            bag.write("/qpavoid/points", kind, time, seen)


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
