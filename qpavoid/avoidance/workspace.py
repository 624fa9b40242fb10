"""Memory of a control step, and obstacles at the time when its twist takes effect."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.body_table import BODY
from qpavoid.avoidance.groups import FEW
from qpavoid.avoidance.linearisation import SIDE, Tables, most_sides
from qpavoid.avoidance.prediction import ARC, most_arcs
from qpavoid.avoidance.scene import Scene, Setup
from qpavoid.avoidance.settings import MOST_PENDING, FilterSettings
from qpavoid.avoidance.state import PAST_OMEGA, PAST_V, frame_of_effect, pending_pace
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.model.capsules import CAPSULE_WIDTH, in_robot_frame, join_walls
from qpavoid.model.contacts import CONTACT_WIDTH
from qpavoid.model.robot import RELATIVE_ROUNDING
from qpavoid.qp.exact import ROW_WIDTH
from qpavoid.types import Array, Arrays, Edges, LimitVector


class Workspace(NamedTuple):
    """Memory of a control step, as views of one array.

    Attributes:
        contacts: (n, :data:`CONTACT_WIDTH`) of all obstacles.
        rows: Of the QP.
        bodies: In reach.
        groups: Of bodies.
        arcs: Of a rollout.
        tables: Of the look-ahead.
        points: In the robot frame when the twist takes effect.
        capsules: In that frame, with joined walls.
        problem: See :func:`qpavoid.avoidance.step.set_problem`.
    """

    contacts: Array
    rows: Array
    bodies: Array
    groups: Array
    arcs: Array
    tables: Tables
    points: Array
    capsules: Array
    problem: Array


PROBLEM_SIZE = 8
"""Numbers of a QP besides its rows."""

MOST_TICKS = 1e6
"""Greatest number of control steps or ticks of a horizon."""


@entry
@compiled_once
def is_counted(edges: Edges, robot: LimitVector, settings: FilterSettings) -> bool:
    """Return whether the settings give a valid layout of the memory."""
    s = settings[0]
    ticks = 0.0 < s.tick and s.horizon <= MOST_TICKS * s.tick
    steps = 0.0 < s.dt and 0.0 <= s.horizon <= MOST_TICKS * s.dt
    pending = 0.0 <= s.delay <= MOST_PENDING * s.dt * (1.0 + RELATIVE_ROUNDING)
    counted: bool = ticks and steps and pending and 0.0 <= s.jitter < math.inf
    return counted


@entry
@compiled
def look_ticks(settings: FilterSettings) -> int:
    """Return the number of ticks of the horizon."""
    ticks: int = round(settings[0].horizon / settings[0].tick)
    return ticks


@entry
@compiled_once
def memory_size(contacts: int, settings: FilterSettings) -> int:
    """Return the numbers of memory that a step with so many contacts needs."""
    # The sizes of `carve`: 8 rows more for the four of the wheels and the four limits
    # of the solver. A float: an int of C could overflow.
    sides, many = most_sides(look_ticks(settings)), float(contacts)
    rows = many + sides + 8
    tables = (many + contacts // FEW) * BODY
    tables += most_arcs(settings) * ARC + sides * SIDE
    tables += 4 * (look_ticks(settings) + 1)
    each = CONTACT_WIDTH + 2 + CAPSULE_WIDTH
    return int(many * each + rows * ROW_WIDTH + tables + PROBLEM_SIZE)


@compiled_once
def carve(memory: Array, contacts: int, settings: npt.NDArray[np.void]) -> Workspace:
    """Return the memory as the tables of a step."""
    sides, arcs = most_sides(look_ticks(settings)), most_arcs(settings)
    a = contacts * CONTACT_WIDTH
    b = a + (contacts + sides + 8) * ROW_WIDTH
    d = b + contacts * BODY
    e = d + contacts // FEW * BODY
    f = e + arcs * ARC
    g = f + sides * SIDE
    h = g + 2 * contacts
    i = h + CAPSULE_WIDTH * contacts
    ticks = look_ticks(settings) + 1
    frames = memory[i : i + 4 * ticks].reshape(ticks, 4)
    end = i + 4 * ticks
    return Workspace(
        memory[:a].reshape(contacts, CONTACT_WIDTH),
        memory[a:b].reshape(contacts + sides + 8, ROW_WIDTH),
        memory[b:d].reshape(contacts, BODY),
        memory[d:e].reshape(contacts // FEW, BODY),
        memory[e:f].reshape(arcs, ARC),
        Tables(memory[f:g].reshape(sides, SIDE), frames),
        memory[g:h].reshape(contacts, 2),
        memory[h:i].reshape(contacts, CAPSULE_WIDTH),
        memory[end : end + PROBLEM_SIZE],
    )


@compiled
def new_scene(
    setup: Setup, state: Array, space: Workspace, count: int, clearance: float
) -> Scene:
    """Return the scene of a control step with so many bodies."""
    (edges, robot, settings), s = setup, setup.settings[0]
    last, pending = (state[PAST_V], state[PAST_OMEGA]), pending_pace(settings, state)
    longest = s.dt * (1.0 + s.jitter)
    # fmt: off
    return Scene(edges, robot, settings, space.bodies[:count], last, pending,
                 space.arcs, space.groups, longest, 0.0, clearance)
    # fmt: on


@compiled_once
def seen_then(
    setup: Setup, obstacles: Arrays, state: Array, space: Workspace
) -> Arrays:
    """Return the obstacles in the robot frame when the next twist takes effect."""
    (_, robot, settings), (points, capsules) = setup, obstacles
    count = join_walls(capsules, space.capsules)
    capsules = space.capsules[:count]
    if settings[0].delay == 0.0:
        return points, capsules
    at = frame_of_effect(robot, settings, state)
    pose, seen = (at.x, at.y, math.atan2(at.sin, at.cos)), space.points
    now, then = (points, capsules), (seen[: points.shape[0]], capsules)
    in_robot_frame(pose, settings[0].delay, now, then)
    return then
