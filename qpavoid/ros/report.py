"""Diagnostics and markers of the node, as plain values."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.plan import Plan, places_of
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint, offset_outline
from qpavoid.model.obstacles import Obstacles
from qpavoid.perception.perception import Explanation, Perception
from qpavoid.ros.guard import Guard, GuardStep
from qpavoid.ros.sensing import ORIGIN
from qpavoid.types import Array

OK, WARN, ERROR = range(3)
"""Levels of diagnostics, as in ``diagnostic_msgs``."""

DRAW, DELETE, LINE_STRIP, LINE_LIST = 0, 2, 4, 5
"""Actions and types of ``visualization_msgs/Marker``."""

HINDERED = {Status.BLOCKED, Status.HOLDING, Status.STOPPED, Status.RELAXED}

DRAWN_EVERY = 0.1
"""s; spacing of the drawn points of a plan."""

BRAKE = Plan(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

CORNERS = 16
"""Of a drawn circle."""

FORESEEN = 1.0
"""s; a velocity is drawn as the path in that time, its σ as a circle about the end."""


class Drawing(NamedTuple):
    """A line drawing in the robot frame.

    Attributes:
        name: Its namespace.
        points: (N, 2) m.
        colour: Red, green, blue, opaque; 0 to 1.
        pairs: Each two points are a line; else all are one.
    """

    name: str
    points: Array
    colour: tuple[float, float, float, float]
    pairs: bool = False

    def on(self, marker: Any, point: Any) -> Any:
        """Return a ``Marker`` of ROS, filled in; ``point``: type of its points."""
        marker.ns, marker.type = self.name, LINE_LIST if self.pairs else LINE_STRIP
        marker.action = DRAW if len(self.points) else DELETE
        marker.scale.x, marker.pose.orientation.w = 0.02, 1.0
        for name, share in zip("rgba", self.colour, strict=True):
            setattr(marker.color, name, share)
        marker.points = [point(x=x, y=y, z=0.0) for x, y in self.points.tolist()]
        return marker


def diagnose(
    guard: Guard, step: GuardStep, latency: Sequence[float] = ()
) -> tuple[int, dict[str, str]]:
    """Return the level of a step, and its diagnostics by key.

    Args:
        guard: Guard of the step.
        step: The latest.
        latency: Recent ones, from the arrival of a scan to the twist, s.
    """
    decision, values = step.decision, dict[str, str]()
    (v, omega), numbers = step.desired, {"v_mps": step.v, "omega_radps": step.omega}
    numbers |= {"desired_v_mps": v, "desired_omega_radps": omega}
    if decision is None:
        level = ERROR if step.faults else WARN
    else:
        warns = decision.status in HINDERED or bool(step.notes)
        level, values["status"] = int(warns), decision.status
        held = bounds(guard.setup.robot.footprint, step)[1]
        limited = (step.v, step.omega) != step.desired and guard.guide is None
        values["bound by"] = "; ".join(held) or "limits of the robot" * limited
        numbers |= {"clearance_m": decision.clearance, "slack_mps": decision.slack}
        numbers |= {"shortfall_m": decision.shortfall, "solve_s": decision.solve_time_s}
    if latency:
        p50, p99 = np.quantile(latency, (0.5, 0.99)).tolist()
        numbers |= {"latency_p50_s": p50, "latency_p99_s": p99}
    numbers |= dict(zip(("left_m", "left_rad"), guard.tasks.left, strict=True))
    values |= {key: f"{number:.4g}" for key, number in numbers.items()}
    values |= {"arrived": str(guard.has_arrived), "role": guard.wiring.role}
    values |= {f"steps with {why}": str(n) for why, n in guard.inputs.faults.items()}
    values["mode"] = guard.setup.drive.mode
    for name, age in step.ages.items():
        refused = guard.inputs.watches[name].refused.items()
        reasons = ", ".join(f"{n} {why}" for why, n in refused if n) or "none"
        state = step.faults.get(name, "fresh")
        values[name] = f"{state}, {age:.3g} s old; refused: {reasons}"
    values |= {f"{name} error": error for name, error in guard.errors.items()}
    return level, values


def markers(guard: Guard, step: GuardStep) -> list[Drawing]:
    """Return footprint, zones, active contacts, plan and discs of a step."""
    robot, settings = guard.setup.robot, guard.setup.settings
    brakes, (held, _) = step.decision is None, bounds(robot.footprint, step)
    plan = BRAKE if brakes else guard.safety.plan
    footprint, radius = robot.footprint, settings.radius
    slow, fast = (
        sides([offset_outline(x, r, 5) for x in footprint.parts])
        for r in (radius.r_min(), radius.r_min(math.inf))
    )
    body = (0.8, 0.1, 0.1, 1.0) if brakes else (0.1, 0.4, 0.8, 1.0)
    made = Setup.of(robot, settings)
    path = places_of(made, plan, (step.v, step.omega), DRAWN_EVERY)
    return [
        Drawing("footprint", sides(footprint.outlines), body, pairs=True),
        Drawing("zone of slow obstacles", slow, (0.9, 0.6, 0.0, 0.8), pairs=True),
        Drawing("zone of fast obstacles", fast, (0.9, 0.6, 0.0, 0.4), pairs=True),
        Drawing(
            "active contacts", held.reshape(-1, 2), (0.9, 0.0, 0.0, 1.0), pairs=True
        ),
        Drawing("plan", path, (0.0, 0.6, 0.3, 1.0)),
        *movers(step, guard.sensing.perceiver.explain()),
    ]


def movers(step: GuardStep, known: Explanation | None) -> list[Drawing]:
    """Return the discs given to the filter, their velocities, and σ of those known."""
    discs, colour = step.obstacles.discs, (0.6, 0.0, 0.8, 1.0)
    ends = discs[:, :2] + FORESEEN * step.obstacles.disc_velocities
    ways = np.stack([discs[:, :2], ends], axis=1).reshape(-1, 2)
    sigmas = [FORESEEN * x.sigma for x in known.tracks if x.confirmed] if known else []
    doubts = circles(ends[: len(sigmas)], sigmas[: len(ends)])
    return [
        Drawing("discs", circles(discs[:, :2], discs[:, 2]), colour, pairs=True),
        Drawing("velocities", ways, colour, pairs=True),
        Drawing("sigmas", doubts, colour, pairs=True),
    ]


def circles(centres: Array, radii: npt.ArrayLike) -> Array:
    """Return the sides (2 n, 2) of circles about centres (m, 2), m."""
    angles = 2.0 * np.pi / CORNERS * np.arange(CORNERS + 1)
    rim = np.column_stack([np.cos(angles), np.sin(angles)])
    corners = centres[:, None] + np.reshape(radii, (-1, 1, 1)) * rim
    return np.stack([corners[:, :-1], corners[:, 1:]], axis=2).reshape(-1, 2)


def sides(polygons: Sequence[Array]) -> Array:
    """Return the sides (2 n, 2) of polygons, m."""
    ends = [np.stack([x, np.roll(x, -1, axis=0)], axis=1) for x in polygons]
    return np.concatenate(ends).reshape(-1, 2)


def bounds(footprint: Footprint, step: GuardStep) -> tuple[Array, list[str]]:
    """Return the contacts whose constraints bound a step, and a sentence of each.

    Contacts are rows of (2 n, 2) in m: ends on robot and obstacle.
    """
    active, seen = step.decision.active if step.decision else (), step.obstacles
    contacts = Contacts.of(footprint, seen)
    rows = np.flatnonzero(np.isin(contacts.obstacle, active))
    start, gaps = contacts.point[rows], contacts.distance[rows]
    end, sentences = start + gaps[:, None] * contacts.normal[rows], []
    speeds = np.append(np.zeros(len(seen.points)), seen.speeds[seen.starts])
    for number, gap, (x, y) in zip(contacts.obstacle[rows], gaps, end, strict=True):
        kind = "moving" if speeds[number] > 0.0 else "static"
        sentences.append(f"{kind} obstacle at {x:.2f}, {y:.2f} m, {gap:.3f} m away")
    return np.stack([start, end], axis=1).reshape(-1, 2), sentences


def warm(guard: Guard) -> None:
    """Compile all functions that a step calls."""
    seen = Obstacles(points=[(9.0, 9.0)], discs=[(9.0, -9.0, 0.1)])
    guard.safety.filter(0.0, 0.0, seen)
    if guard.guide is not None:
        guard.guide.step(ORIGIN, seen)
    Perception(guard.setup.robot).update([9.0] * 9, 0.0, ORIGIN)
    markers(guard, guard.step(0.0, 0.0))
