"""A recorded drive through the filter: what it would have changed, when and why.

Not a closed loop. At every recorded command a step of the very guard that the node runs
(:mod:`qpavoid.ros.guard`) is asked, among what had been received until then, of a robot
that drives what was recorded: what odometry says, else the command before. Its answer
goes nowhere. A command beyond the robot's limits is cut to them first. ``changed`` is a
step whose twist is another one than that, or whose command cannot be read.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from qpavoid.avoidance.freshness import Fault, Freshness
from qpavoid.errors import (
    ConfigError,
    DataError,
    InvalidInputError,
    QPAvoidError,
    did_you_mean,
)
from qpavoid.files import read_yaml
from qpavoid.lab.simulation.loop import differs
from qpavoid.lab.study.bags import Event, Recording
from qpavoid.lab.worlds.carmen import LONGEST_ROBOT, hold_time
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot
from qpavoid.ros.guard import Guard, GuardSetup, GuardStep, Wiring
from qpavoid.ros.messages import read_twist, seconds
from qpavoid.ros.parameters import PRESETS, Running, defaults, preset, setup_of
from qpavoid.settings import want
from qpavoid.types import Pose, Twist

PIONEER = Robot("Pioneer", Footprint.rectangle(0.47, 0.41), Limits.symmetric(1.6, 2.6))
"""That of Freiburg-079, whose PARAM lines give its size, 0.47 × 0.41 m."""

STALE_STEPS = 3.0
"""Steps; so old may be what is known, where no parameters say."""


UNREAD = "command cannot be read"
"""Why, where it is not finite; the robot is told to stand."""


OF_CONTENT = {Fault.INVALID, Fault.BLIND, Fault.JUMPED}
"""Faults that the guard has an error text of."""


class Parameters(NamedTuple):
    """Parameters of the node from a file.

    Attributes:
        running: How the node runs.
        wiring: Of the node.
        setup: Robot, filter, freshness.
    """

    running: Running
    wiring: Wiring
    setup: GuardSetup


class Replayed(NamedTuple):
    """Result of a replay.

    Attributes:
        rows: A dict a command: time_s, the recorded twist, the given one, why; the
            pose by odometry.
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
        (nodes,) = read_yaml(path).values()
        given = _flat(nodes["ros__parameters"])
    except DataError as error:
        raise ConfigError([str(error)]) from None
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ConfigError([f"{path}: needs one node with ros__parameters"]) from None
    try:
        robot = preset(str(given.get("robot_preset", Running().robot_preset)))
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
    except (QPAvoidError, TypeError, ValueError, OverflowError) as error:
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

    Raises:
        DataError: It has fewer than two commands, or they are too far apart.
    """
    times = [event.time for event in drive.events if event.topic == "command"]
    if len(times) < 2:
        raise DataError("a replay needs two commands or more")
    dt, fresh = max(hold_time(times), 1e-3), Freshness()
    ages = {
        name: max(getattr(fresh, name), STALE_STEPS * dt)
        for name in ("points", "discs", "odometry", "command")
    }
    setup = setup_of(defaults(robot), robot, min(dt, 0.5))
    return setup._replace(freshness=replace(fresh, **ages))


def replay(drive: Recording, setup: GuardSetup) -> Replayed:
    """Return what the guard makes of every command of a drive.

    A fault ends with what caused it: the guard does not wait until inputs have been
    good for a while. Commands before all inputs have been seen once are left out.

    Raises:
        DataError: There are no others, or a topic is stamped by another clock.
    """
    fresh = replace(setup.freshness, good=0.0)
    guard = Guard(setup._replace(freshness=fresh), drive.wiring)
    _want_one_clock(drive, guard)
    for message in drive.static:
        guard.frames.add(message, fixed=True)
    rows, steps, last = [], list[GuardStep](), (0.0, 0.0)
    for event in drive.events:
        now = event.time, event.time
        if event.topic == "tf":
            guard.frames.add(event.message)
        elif event.topic != "command":
            guard.see(event.topic, event.message, *now)
        if event.topic != "command":
            continue
        guard.command(event.message, *now)
        driven = guard.trail.twist if drive.wiring.odometry else last
        step, recorded = guard.step(*now, driven), _recorded(event)
        last = recorded or (0.0, 0.0)
        if not drive.wiring.odometry:
            guard.trail.twist = last
        if all(map(math.isfinite, step.ages.values())):
            row = _row(event.time, last, step, setup.robot.limits)
            row |= _posed(guard.trail.at(event.time))
            row["reason"] = _reason(guard, step)
            if recorded is None:
                why = guard.errors.get("command", UNREAD)
                row |= {"changed": True, "why": UNREAD, "reason": why}
            rows.append(row)
            steps.append(step)
    if not rows:
        never = [name for name, age in step.ages.items() if age == math.inf]
        said = "; ".join(f"{name} ({_refusals(guard, name)})" for name in never)
        raise DataError(f"never seen before a command: {said}")
    return Replayed(rows, steps, guard)


def _want_one_clock(drive: Recording, guard: Guard) -> None:
    """Refuse a topic most of whose messages are too old, or ahead, when received."""
    received: dict[str, list[tuple[float, float]]] = {}
    for time, topic, message in drive.events:
        if hasattr(message, "header"):
            pair = time, seconds(message.header.stamp)
            received.setdefault(topic, []).append(pair)
    ages = {
        topic: float(np.median([time - stamp for time, stamp in some]))
        for topic, some in received.items()
    }
    said = ", ".join(f"{topic} {age:.3f} s" for topic, age in ages.items())
    fresh = guard.setup.freshness
    for topic, age in ages.items():
        watch = guard.watches.get(topic)
        oldest = fresh.command if watch is None else watch.oldest
        if not -fresh.future <= age <= oldest:
            raise DataError(
                f"{drive.name}: {topic} is stamped by another clock, or arrives too "
                f"late. Typical time of recording minus stamp: {said}; allowed for "
                f"{topic} is {-fresh.future:g} to {oldest:.3g} s"
            )


def _refusals(guard: Guard, topic: str) -> str:
    """Return why messages of a topic were refused."""
    refused = guard.watches[topic].refused.items()
    said = [f"{many} refused: {fault}" for fault, many in refused if many]
    return ", ".join([*said, guard.errors.get(topic, "")]).strip(", ") or "no message"


def _reason(guard: Guard, step: GuardStep) -> str:
    """Return the sentence of a step; of faults of content with the last error."""
    if step.decision is not None or not step.faults:
        return step.sentence
    said = []
    for name, fault in step.faults.items():
        why = guard.errors.get(name) if fault in OF_CONTENT else None
        said.append(f"{name}: {fault.sentence}" + (f" ({why})" if why else ""))
    return " ".join(said)


def _posed(pose: Pose) -> dict[str, float]:
    return dict(zip(("x_m", "y_m", "heading_rad"), pose, strict=True))


def _recorded(event: Event) -> Twist | None:
    try:
        return read_twist(event.message)
    except InvalidInputError:
        return None


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
