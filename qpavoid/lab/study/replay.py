"""A recorded drive through the guard of the ROS node (:mod:`qpavoid.ros.guard`).

Not a closed loop: the robot drives what was recorded. At every recorded command the
guard's answer is compared with it, among the obstacles perceived until then; the twist
driven is that of the odometry, else the command before. A command beyond the robot's
limits is cut to them first. ``changed`` is a step with another twist, or whose command
cannot be read. A drive without commands shows perception alone.
"""

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.inputs import Freshness
from qpavoid.errors import (
    ConfigError,
    DataError,
    InvalidInputError,
    QPAvoidError,
    did_you_mean,
)
from qpavoid.files import read_yaml
from qpavoid.lab.simulation.outcome import differs
from qpavoid.lab.study.bags import BagWriter, Recording
from qpavoid.lab.study.scene import BLUE, RED, SKY
from qpavoid.lab.study.tables import write_csv
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import relative, to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.ros.guard import Guard, GuardStep
from qpavoid.ros.messages import read_twist, seconds
from qpavoid.ros.parameters import (
    PRESETS,
    GuardSetup,
    Wiring,
    defaults,
    preset,
    setup_of,
)
from qpavoid.ros.report import Drawing, markers
from qpavoid.ros.sensing import ORIGIN
from qpavoid.settings import want
from qpavoid.types import Twist

PIONEER = Robot("Pioneer", Footprint.rectangle(0.47, 0.41), Limits.symmetric(1.6, 2.6))
"""Its limits are those of a robot given by its size."""

STALE_STEPS = 3.0
"""Greatest age of inputs in steps, where no parameters say."""

LONGEST_ROBOT, LONGEST_HOLD = 20.0, 1.0
"""m; s, greatest median time between two commands or scans."""

POSE = "x_m", "y_m", "heading_rad"
"""Columns of a pose by odometry."""

UNREAD = "command cannot be read"
"""Reason of a step whose command is not finite."""

PANELS, SHOWN = 6, 6.0
"""Of the figure of perception; m that it shows on each side of the robot."""


class Replayed(NamedTuple):
    """Result of a replay.

    Attributes:
        drive: The recording.
        guard: As it was left.
        rows: A dict a command: time_s, the pose by odometry; the recorded twist, the
            given one, why. Without commands one a scan, of time and pose.
        steps: Of the guard, one a row.
        drawn: Markers of each.
        names: Of each the numbers of the tracks of its discs.
    """

    drive: Recording
    guard: Guard
    rows: list[dict[str, Any]]
    steps: list[GuardStep]
    drawn: list[list[Drawing]]
    names: list[list[int]]

    @property
    def changed(self) -> float:
        """Share of the commands that were changed."""
        return sum(map(bool, (r["changed"] for r in self.rows))) / len(self.rows)


def read_parameters(path: Path) -> tuple[Wiring, GuardSetup]:
    """Return wiring and settings of the node from a parameter file of ROS 2.

    Raises:
        ConfigError: It is no such file, or a key is not known, or a value does not fit.
    """
    try:
        (nodes,) = read_yaml(path).values()
        given = _flat(nodes["ros__parameters"])
    except DataError as error:
        raise ConfigError([str(error)]) from None
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ConfigError([f"{path}: needs one node with ros__parameters"]) from None
    try:
        fixed = Wiring()._asdict()
        robot = preset(str((fixed | given)["robot_preset"]))
        known = fixed | defaults(robot)
        unknown = [key for key in given if key not in known]
        if unknown:
            raise ConfigError(
                f"{path}: unknown key {key!r}{did_you_mean(key, known)}"
                for key in unknown
            )
        known |= {k: tuple(x) if isinstance(x, list) else x for k, x in given.items()}
        wiring = Wiring(**{key: known[key] for key in fixed})
        setup = setup_of(known, robot, wiring.dt_s)
    except (QPAvoidError, TypeError, ValueError, OverflowError) as error:
        raise ConfigError([f"{path}: {error}"]) from None
    return wiring, setup


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
        InvalidInputError: It is neither, or longer than :data:`LONGEST_ROBOT`.
    """
    if text in PRESETS:
        return preset(text)
    try:
        length, width = map(float, text.split(","))
    except ValueError:
        names = ", ".join(PRESETS)
        said = f"{text!r} is neither LENGTH,WIDTH nor {names}"
        raise InvalidInputError(said) from None
    small = max(length, width) <= LONGEST_ROBOT
    want(small, f"LENGTH,WIDTH are in m, at most {LONGEST_ROBOT:g}, not {text}")
    return Robot(text, Footprint.rectangle(length, width), PIONEER.limits)


def setup_for(drive: Recording, robot: Robot) -> GuardSetup:
    """Return default settings for a drive: its own step, ages that it can keep.

    The step is that of its commands, else of the first topic of scans or clouds.

    Raises:
        DataError: It has fewer than two of these, or they are too far apart.
    """
    topic = "command" if drive.has_commands else next(iter(drive.wiring.topics))
    times = [event.time for event in drive.events if event.topic == topic]
    if len(times) < 2:
        raise DataError(f"a replay needs two messages or more on {topic}")
    dt, fresh = max(float(np.median(np.diff(times))), 1e-3), Freshness()
    if dt > LONGEST_HOLD:
        raise DataError(f"{topic}: {dt:.3g} s apart: no step is so long")
    ages = {
        name: max(getattr(fresh, name), STALE_STEPS * dt)
        for name in ("points", "discs", "odometry", "command")
    }
    setup = setup_of(defaults(robot), robot, min(dt, 0.5))
    return setup._replace(freshness=replace(fresh, **ages))


def replay(drive: Recording, setup: GuardSetup) -> Replayed:
    """Return a step of the guard for every command of a drive, else for every scan.

    A fault ends with what caused it: the guard does not wait until inputs have been
    good for a while. Steps before all inputs have been seen once are left out.

    Raises:
        DataError: There are no others, or a topic is stamped by another clock.
    """
    fresh = replace(setup.freshness, good=0.0)
    wired = drive.wiring._replace(role="filter")
    guard = Guard(setup._replace(freshness=fresh), wired)
    _want_one_clock(drive, guard)
    for message in drive.static:
        guard.sensing.frames.add(message, fixed=True)
    sensors = {*drive.wiring.scans, *drive.wiring.clouds}
    asked = {"command"} if drive.has_commands else sensors
    if "perception" in guard.errors:
        drive = drive._replace(notes=[*drive.notes, guard.errors["perception"]])
    done, last = Replayed(drive, guard, [], [], [], []), (0.0, 0.0)
    for event in drive.events:
        if event.topic == "tf":
            guard.transforms(event.message, event.time, event.time)
        elif event.topic == "command":
            guard.command(event.message, event.time, event.time)
        else:
            guard.see(event.topic, event.message, event.time, event.time)
        if event.topic not in asked:
            continue
        driven = guard.odometry.twist if drive.wiring.odometry else last
        step, row = guard.step(event.time, event.time, driven), dict[str, Any]()
        if drive.has_commands:
            last, unread = (0.0, 0.0), {}
            try:
                last = read_twist(event.message)
            except InvalidInputError:
                why = guard.errors.get("command", UNREAD)
                unread = {"changed": True, "why": UNREAD, "reason": why}
            row = _row(last, step, setup.robot.limits) | unread
        if not drive.wiring.odometry:
            guard.odometry.twist = last
        if all(map(math.isfinite, step.ages.values())):
            placed = zip(POSE, guard.odometry.at(event.time), strict=True)
            done.rows.append({"time_s": event.time, **dict(placed), **row})
            done.steps.append(step)
            done.drawn.append(markers(guard, step))
            known = guard.sensing.perceiver.explain()
            tracks = known.tracks if known else ()
            done.names.append([one.name for one in tracks if one.confirmed])
    if not done.rows:
        never = [name for name, age in step.ages.items() if age == math.inf]
        said = "; ".join(f"{name} ({_refusals(guard, name)})" for name in never)
        raise DataError(f"never seen before a command: {said}")
    if not drive.has_commands and all(one.decision is None for one in done.steps):
        raise DataError(f"neither commands nor obstacles. {step.sentence}")
    return done


def _want_one_clock(drive: Recording, guard: Guard) -> None:
    """Refuse a topic most of whose messages are too old, or ahead, when received."""
    late: dict[str, list[float]] = {}
    for time, topic, message in drive.events:
        if hasattr(message, "header"):
            late.setdefault(topic, []).append(time - seconds(message.header.stamp))
    ages = {topic: median(some) for topic, some in late.items()}
    said = ", ".join(f"{topic} {age:.3f} s" for topic, age in ages.items())
    fresh = guard.setup.freshness
    for topic, age in ages.items():
        watch = guard.inputs.watches.get(topic)
        oldest = fresh.command if watch is None else watch.oldest
        if not -fresh.future <= age <= oldest:
            raise DataError(
                f"{drive.name}: {topic} is stamped by another clock, or arrives too "
                f"late. Typical time of recording minus stamp: {said}; allowed for "
                f"{topic} is {-fresh.future:g} to {oldest:.3g} s"
            )


def _refusals(guard: Guard, topic: str) -> str:
    """Return why messages of a topic were refused."""
    refused = guard.inputs.watches[topic].refused.items()
    said = [f"{many} refused: {fault}" for fault, many in refused if many]
    return ", ".join([*said, guard.errors.get(topic, "")]).strip(", ") or "no message"


def _row(recorded: Twist, step: GuardStep, limits: Limits) -> dict[str, Any]:
    v, omega = recorded
    free = (
        min(max(v, limits.v_min), limits.v_max),
        min(max(omega, limits.omega_min), limits.omega_max),
    )
    decision = step.decision
    faults = "; ".join(f"{name} {fault}" for name, fault in step.faults.items())
    return {
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
        "reason": step.sentence,
    }


def episodes(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the stretches of changed commands: when, how long, how much, why."""
    groups = groupby(rows, lambda row: bool(row["changed"]))
    found, start = [[*some] for changed, some in groups if changed], rows[0]["time_s"]
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


def seen(replayed: Replayed, step: int) -> Obstacles:
    """Return the obstacles of a step, frame of the odometry."""
    x, y, heading = (replayed.rows[step][key] for key in POSE)
    back = relative((x, y, heading), ORIGIN)
    return replayed.steps[step].obstacles.seen_from(back)


def movers(replayed: Replayed) -> list[dict[str, Any]]:
    """Return the moving obstacles of every step, frame of the odometry."""
    keys, found = ("x_m", "y_m", "radius_m", "v_x_mps", "v_y_mps"), []
    for k, (row, names) in enumerate(zip(replayed.rows, replayed.names, strict=True)):
        there = seen(replayed, k)
        discs = np.hstack([there.discs, there.disc_velocities]).tolist()
        for name, disc in zip(names, discs, strict=False):
            place = dict(zip(keys, disc, strict=True))
            place["speed_mps"] = math.hypot(*disc[3:])
            found.append({"time_s": row["time_s"], "mover": name, **place})
    return found


def tracks(rows: Sequence[Mapping[str, Any]], start: float) -> list[dict[str, Any]]:
    """Return each moving obstacle: when (s after the start), where, and how fast."""
    found: dict[int, list[Mapping[str, Any]]] = {}
    for row in rows:
        found.setdefault(row["mover"], []).append(row)
    return [
        {
            "mover": name,
            "begins_s": round(some[0]["time_s"] - start, 3),
            "lasts_s": round(some[-1]["time_s"] - some[0]["time_s"], 3),
            "from_m": [round(some[0][key], 2) for key in POSE[:2]],
            "to_m": [round(some[-1][key], 2) for key in POSE[:2]],
            "median_mps": round(median(row["speed_mps"] for row in some), 3),
        }
        for name, some in found.items()
    ]


def summary(replayed: Replayed) -> dict[str, Any]:
    """Return the numbers of a replay, its moving obstacles, and its episodes."""
    rows, guard = replayed.rows, replayed.guard
    watches = guard.inputs.watches
    refused = [k for k in guard.wiring.topics if any(watches[k].refused.values())]
    found = {
        "steps": len(rows),
        "seconds": round(rows[-1]["time_s"] - rows[0]["time_s"], 3),
        "movers": tracks(movers(replayed), rows[0]["time_s"]),
        "notes": [
            *replayed.drive.notes,
            *(f"{name}: {_refusals(guard, name)}" for name in refused),
        ],
    }
    if not replayed.drive.has_commands:
        return found
    return found | {
        "commands": len(rows),
        "changed": sum(row["changed"] for row in rows),
        "share_changed": replayed.changed,
        "cut": sum(row["cut"] for row in rows),
        "least_clearance_m": _least(rows),
        "why": dict(Counter(row["why"] for row in rows if row["changed"])),
        "reasons": {row["why"]: row["reason"] for row in rows if row["changed"]},
        "episodes": episodes(rows),
    }


def save(replayed: Replayed, folder: Path) -> list[Path]:
    """Write summary, table, figure and a bag; return their paths.

    Raises:
        DataError: Where the bag is to be there is something else.
        MissingExtraError: ``rosbags`` is not installed; all else is written.
    """
    names = "replay.json", "replay.csv", "replay.png", "movers.csv", "perception.png"
    told, table, figure, moving, scene = paths = [folder / name for name in names]
    folder.mkdir(parents=True, exist_ok=True)
    found = summary(replayed)
    told.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    write_csv(table, replayed.rows)
    if replayed.drive.has_commands:
        draw(replayed, figure)
    write_csv(moving, movers(replayed))
    draw_scene(replayed, scene)
    write_bag(replayed, folder / "bag")
    return [*filter(Path.exists, paths), folder / "bag"]


def draw_scene(replayed: Replayed, path: Path) -> None:
    """Draw the obstacles from above, of each sixth of the steps where most move."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    rows, outline = replayed.rows, replayed.guard.setup.robot.footprint
    parts = filter(len, np.array_split(np.arange(len(rows))[::-1], PANELS)[::-1])
    figure = Figure(figsize=(9, 6.4), layout="constrained")
    for part, axes in zip(parts, figure.subplots(2, 3).flat, strict=False):
        k = max(part.tolist(), key=lambda k: len(replayed.names[k]))
        there, (x, y, heading) = seen(replayed, k), (rows[k][key] for key in POSE)
        axes.scatter(*there.points.T, s=1.5, color="0.5")
        for corners in outline.outlines:
            corners = to_world(corners, (x, y, heading))
            axes.fill(*corners.T, fc="white", ec="black", zorder=9)
        ways = there.disc_velocities.tolist()
        for (*centre, radius), way in zip(there.discs.tolist(), ways, strict=True):
            axes.add_patch(Circle(centre, radius, fc=SKY, ec=BLUE))
            axes.arrow(*centre, *way, color=RED, head_width=0.15)
        axes.set(title=f"{rows[k]['time_s'] - rows[0]['time_s']:.1f} s")
        axes.set(xlim=(x - SHOWN, x + SHOWN), ylim=(y - SHOWN, y + SHOWN))
        axes.set_aspect("equal")
    figure.supxlabel("x and y (m); arrows: way in 1 s")
    figure.savefig(path, dpi=130)


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


def write_bag(replayed: Replayed, folder: Path) -> None:
    """Write twists and markers as a bag of MCAP, on the robot, and tf of that."""
    base, odom = replayed.drive.wiring.base_frame, replayed.drive.wiring.odom_frame
    with BagWriter(folder) as bag:
        point = type(bag.blank("geometry_msgs/msg/Point"))
        kept = replayed.rows, replayed.steps, replayed.drawn
        for row, step, drawn in zip(*kept, strict=True):
            time = row["time_s"]
            if replayed.drive.has_commands:
                recorded = row["v_mps"], row["omega_radps"]
                twists = {"recorded": recorded, "given": (step.v, step.omega)}
                kind = "geometry_msgs/msg/TwistStamped"
                for name, (v, omega) in twists.items():
                    twist = bag.stamped(kind, time, base)
                    twist.twist.linear.x, twist.twist.angular.z = v, omega
                    bag.write(f"/qpavoid/{name}", kind, time, twist)
            kind, one = (f"visualization_msgs/msg/Marker{x}" for x in ("Array", ""))
            shown = bag.blank(kind)
            shown.markers = [x.on(bag.stamped(one, time, base), point) for x in drawn]
            bag.write("/qpavoid/markers", kind, time, shown)
            link = bag.stamped("geometry_msgs/msg/TransformStamped", time, odom)
            link.child_frame_id, half = base, 0.5 * row["heading_rad"]
            place, turn = link.transform.translation, link.transform.rotation
            place.x, place.y = row["x_m"], row["y_m"]
            turn.z, turn.w = math.sin(half), math.cos(half)
            kind = "tf2_msgs/msg/TFMessage"
            moved = bag.blank(kind)
            moved.transforms = [link]
            bag.write("/tf", kind, time, moved)
