"""DynaBARN worlds [Nair2022] as JSON: cylinders that move along key frames.

Key frames are repeated for ever. 438 of the 469 different trajectories do not end
where they began: there the cylinder *jumps* when its loop restarts, and no method can
be safe. An episode therefore ends at the first jump, or the cylinders go back along
their paths.

A kinematic Jackal starts at several times of their motion. The robot drives straight
from the published start, which lies just outside the open side of the field, to the
published goal 20 m on, and has arrived within 1 m of it. The episode is over at the
published 100 s of the world's clock, or at the first jump.
"""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, Field, model_validator

from qpavoid.errors import DataError
from qpavoid.files import read_json
from qpavoid.lab.worlds.barn import jackal
from qpavoid.lab.worlds.source import Number, find_file, parsed
from qpavoid.settings import POSITIVE, Range
from qpavoid.stamps import file_digest
from qpavoid.types import Array

Restart = Literal["end", "reverse"]


class Frames(BaseModel):
    """Key frames of a cylinder: times (s), places (m), and the time of a loop (s)."""

    t: Annotated[list[Number], Field(min_length=2)]
    x: list[Number]
    y: list[Number]
    period: Number

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if not len(self.t) == len(self.x) == len(self.y):
            raise ValueError("t, x and y need the same length")
        if self.t[0] != 0.0 or min(np.diff(self.t)) <= 0.0:
            raise ValueError("times must increase from 0")
        if self.period != self.t[-1]:
            raise ValueError("the last key frame is not at the period")
        return self


class Wall(BaseModel):
    """A wall: its middle and its sizes along x and y, m."""

    center: tuple[Number, Number]
    size: tuple[Number, Number]


class Published(BaseModel):
    """A file of worlds."""

    timeout_s: Annotated[Number, Field(gt=0.0)]
    robot_start: tuple[Number, Number, Number]
    robot_goal: tuple[Number, Number]
    goal_radius: Number
    obstacle_radius: Number
    walls: list[Wall]
    worlds: dict[str, list[Frames]]


class Cylinder(NamedTuple):
    """A disc between key frames, straight lines in between.

    Attributes:
        times: (n,) s, increasing from 0 to the end of the episode or beyond.
        positions: (n, 2) m.
        jump: s, when it would jump as published; inf for a closed loop.
    """

    times: Array
    positions: Array
    jump: float


@dataclass(frozen=True, eq=False)
class DynaBarnWorld:
    """One world, in its own frame.

    Attributes:
        cylinders: Moving obstacles.
        radius: Of every cylinder, m.
        walls: (K, 4) sides of the walls, m.
        start: x, y (m), γ (rad).
        goal: x, y, m.
        goal_radius: m; distance at which the goal is reached.
        duration: s, after which the episode is over.
    """

    cylinders: tuple[Cylinder, ...]
    radius: float
    walls: Array
    start: tuple[float, float, float]
    goal: tuple[float, float]
    goal_radius: float
    duration: float


def read_world(
    path: str | os.PathLike[str], world: int, restart: Restart = "end"
) -> DynaBarnWorld:
    """Return one world of a ``dynabarn.json``.

    Args:
        path: The file.
        world: Number of the world.
        restart: At a jump of a cylinder: ``"end"`` ends the episode at the first one,
            ``"reverse"`` moves the cylinder back along its path.

    Raises:
        DataError: The file is missing or damaged, or has no such world.
    """
    file = parsed(Published, read_json(path), path)
    if str(world) not in file.worlds:
        raise DataError(f"{path}: there is no world {world}")
    read, duration = list[Cylinder](), file.timeout_s
    for one in file.worlds[str(world)]:
        places = np.column_stack([one.x, one.y])
        closed = bool((places[0] == places[-1]).all())
        read.append(Cylinder(np.array(one.t), places, np.inf if closed else one.period))
    if restart == "end":
        duration = min([duration, *(cylinder.jump for cylinder in read)])
    frames = sum(len(x.times) * (1.0 + duration / float(x.times[-1])) for x in read)
    if frames > MOST_FRAMES:
        raise DataError(f"{path}: world {world}: {frames:g} key frames")
    return DynaBarnWorld(
        tuple(_unrolled(cylinder, duration) for cylinder in read),
        file.obstacle_radius,
        np.vstack([_sides(wall) for wall in file.walls]),
        file.robot_start,
        file.robot_goal,
        file.goal_radius,
        duration,
    )


def _unrolled(cylinder: Cylinder, until: float) -> Cylinder:
    """Return a cylinder repeated, or moved back and forth, for a time."""
    times, positions, jump = cylinder
    legs, places, begin = [times[:1]], [positions[:1]], 0.0
    while begin < until:
        legs.append(begin + times[1:])
        places.append(positions[1:])
        begin = float(legs[-1][-1])
        # An open path is followed back, then forth again.
        if np.isfinite(jump):
            times, positions = times[-1] - times[::-1], positions[::-1]
    return Cylinder(np.concatenate(legs), np.concatenate(places), jump)


def _sides(wall: Wall) -> Array:
    (length, width) = wall.size
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (length / 2, width / 2)
    corners += wall.center
    return np.hstack([corners, np.roll(corners, -1, axis=0)])


MOST_FRAMES = 1_000_000
"""Greatest number of key frames of all cylinders of a world, repeated until its end."""

DYNABARN_FOLDERS = ("dynabarn", "")


@dataclass(frozen=True)
class DynaBarn:
    """DynaBARN episodes; seeds are ``phases`` · world + phase.

    In phase k of n the robot starts after k/n of the time to the world's first jump.

    Attributes:
        jumps: At a jump of a cylinder: ``end`` or ``reverse``.
        speed: Greatest speed, m/s.
        data: Folder of published data sets.
        phases: n, start times in a world, evenly up to its first jump.
    """

    jumps: Restart = "reverse"
    speed: Annotated[float, "mps", POSITIVE] = 1.0
    data: str | None = None
    phases: Annotated[int, Range(ge=1)] = 3

    @property
    def name(self) -> str:
        """Label in tables."""
        return f"DynaBARN, jumps {self.jumps}, v <= {self.speed:g} m/s"

    def identity(self, data: str | None) -> str:
        """Return kind, rule and phases, and the digest of the worlds."""
        return f"{self.name}, {self.phases}" + file_digest(find_worlds(self.data))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the episode with this number."""
        return episode_document(*self.episode(seed or 0), self)

    def episode(self, seed: int) -> tuple[DynaBarnWorld, float]:
        """Return the world of an episode, and the robot's start on its clock, s."""
        file, (number, phase) = find_worlds(self.data), divmod(seed, self.phases)
        first_jump = read_world(file, number).duration
        return read_world(file, number, self.jumps), phase / self.phases * first_jump


def find_worlds(data: str | os.PathLike[str] | None) -> Path:
    """Return the file of the worlds.

    Raises:
        DataError: No data folder, or no such file in it.
    """
    return find_file("DynaBARN worlds", "dynabarn.json", data, DYNABARN_FOLDERS)


def episode_document(
    world: DynaBarnWorld, start: float, source: DynaBarn
) -> dict[str, Any]:
    """Return a world as a scenario file for a robot that starts at ``start``, s."""
    x, y, heading = world.start
    return {
        "title": source.name,
        "duration_s": world.duration - start,
        "dt_s": 0.05,
        "ends_at_goal": True,
        "arrival_m": world.goal_radius,
        "arrival_rad": 3.2,
        "start": {"x_m": x, "y_m": y, "heading_rad": heading},
        "reference": {
            "kind": "spline",
            "points_m": [[x, y], list(world.goal)],
            "speed_mps": source.speed,
            "acceleration_mps2": 1.5,
        },
        **jackal(source.speed),
        "obstacles": [
            *(
                {
                    "kind": "waypoints",
                    "times_s": (cylinder.times - start).tolist(),
                    "positions_m": cylinder.positions.tolist(),
                    "radius_m": world.radius,
                }
                for cylinder in world.cylinders
            ),
            *(
                {"kind": "wall", "start_m": wall[:2], "end_m": wall[2:]}
                for wall in world.walls.tolist()
            ),
        ],
    }
