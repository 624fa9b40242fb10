"""Crowds: recorded scenes with a robot in place of one pedestrian.

Pedestrian tracks as ``obsmat.txt``: ETH [Pellegrini2009] and UCY [Lerner2007].

A line holds frame, id, x, z, y, v_x, v_z, v_y in metres: the height z is between x
and y; or frame, id, x, y alone, as in versions of these sets for learning. Samples
are 0.4 s apart: 6 frames in seq_eth (15 a second), 10 in seq_hotel and the UCY sets (25
a second).
"""

import math
import os
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.errors import DataError, UnknownNameError
from qpavoid.files import read_text, reading
from qpavoid.lab.planning.grid import length
from qpavoid.lab.worlds.source import FAR, find_file
from qpavoid.stamps import file_digest
from qpavoid.types import Array

SET_FPS = {
    "seq_eth": 15.0,
    "seq_hotel": 25.0,
    "zara01": 25.0,
    "students03_first_half": 25.0,
}
"""Frames a second of the published sets, by the folder of their ``obsmat.txt``."""


class Pedestrian(NamedTuple):
    """Track of one person.

    Attributes:
        number: The id in the file.
        times: (n,) s, increasing; all tracks of a file have the same clock.
        positions: (n, 2) m.
    """

    number: int
    times: Array
    positions: Array


def read_tracks(path: str | os.PathLike[str], fps: float) -> list[Pedestrian]:
    """Return the tracks of a file, by ascending id, each sorted by time.

    An id that is absent for more than 10 s is another person's afterwards.

    Args:
        path: The ``obsmat.txt``.
        fps: Frames a second of the recording; see :data:`SET_FPS`.

    Raises:
        DataError: The file is missing or empty, or a row is damaged, not finite, more
            than 1000 km away or repeats the frame of an id; the message names the row.
            No person moves along y, but heights change.
    """
    with reading(path, "not a readable track file"):
        text = read_text(path)
        table = np.loadtxt(text.splitlines(), ndmin=2) if text.strip() else np.empty(0)
    if table.shape[1:] not in ((4,), (8,)):
        raise DataError(f"{path}: holds no rows of 4 or 8 columns")
    if table.shape[1] == 8:
        if np.ptp(table[:, 4]) == 0.0 < np.ptp(table[:, 3]):
            raise DataError(f"{path}: only heights change: are y and z exchanged?")
        table = table[:, [0, 1, 2, 4]]
    _, first = np.unique(table[:, :2], axis=0, return_index=True)
    told = {
        "a number is not finite": ~np.isfinite(table).all(axis=1),
        "the id is not a whole number": table[:, 1] % 1.0 != 0.0,
        "the place is nowhere": np.abs(table[:, 2:]).max(axis=1) > FAR,
        "an id is at one frame twice": ~np.isin(np.arange(len(table)), first),
    }
    for what, rows in told.items():
        if rows.any():
            raise DataError(f"{path}: row {int(rows.argmax()) + 1}: {what}")
    table = table[np.lexsort(table.T[:2])]
    steps = np.diff(table[:, :2], axis=0)
    ends = np.flatnonzero((steps[:, 1] != 0.0) | (steps[:, 0] > REUSE_AFTER * fps))
    return [
        Pedestrian(int(one[0, 1]), one[:, 0] / fps, one[:, 2:])
        for one in np.split(table, ends + 1)
    ]


SCENES = {
    "eth": "ETH/seq_eth",
    "hotel": "ETH/seq_hotel",
    "zara01": "UCY/zara01",
    "students03": "UCY/students03_first_half",
}
"""Folders of the scenes below the data folder's ``opentraj``; the last is dense, and
for training."""

REUSE_AFTER = 10.0
"""s without a sample after which an id is another person's."""

MEDIAN_PACES = 0.1, 5.0
"""m/s; plausible median pace of tasks, else the units are wrong."""

FASTEST = 10.0
"""m/s; greatest plausible speed between two samples."""

LEAST_SAMPLES, LEAST_WAY = 10, 6.0
"""Tracks with fewer samples, or fewer metres between their ends, are no tasks."""

PATIENCE = 3.0
"""Time allowed, in times of the replaced human's."""

PERSON = 0.25
"""m; radius of a person, and circumradius of the robot."""


class Task(NamedTuple):
    """A pedestrian to be replaced, and the others.

    Attributes:
        human: The replaced one.
        others: Those that walk as recorded.
    """

    human: Pedestrian
    others: tuple[Pedestrian, ...]

    @property
    def time(self) -> float:
        """Duration of the human's track, s."""
        return float(self.human.times[-1] - self.human.times[0])

    @property
    def length(self) -> float:
        """Length of the human's track, m."""
        return length(self.human.positions)


def find_scene(scene: str, data: str | os.PathLike[str] | None) -> Path:
    """Return the track file of a scene.

    Raises:
        UnknownNameError: No such scene.
        DataError: No data folder, or no such file in it.
    """
    if scene not in SCENES:
        raise UnknownNameError("crowd", scene, SCENES)
    folders = [f"{folder}{SCENES[scene]}" for folder in ("opentraj/", "")]
    return find_file("pedestrian tracks", "obsmat.txt", data, folders)


@lru_cache(maxsize=8)
def read_tasks(path: Path) -> tuple[Task, ...]:
    """Return all tasks of a track file, by the id of the human.

    Args:
        path: The track file, in the folder of a published set.

    Raises:
        DataError: As :func:`read_tracks` does, no track is a task, speeds
            are implausible in m and s, or a track jumps.
    """
    people = read_tracks(path, SET_FPS[path.parent.name])
    tasks = tuple(
        Task(human, tuple(other for other in people if other is not human))
        for human in people
        if len(human.times) >= LEAST_SAMPLES
        and math.dist(human.positions[0], human.positions[-1]) >= LEAST_WAY
    )
    if not tasks:
        least = f"{LEAST_SAMPLES} samples and {LEAST_WAY:g} m between its ends"
        raise DataError(f"{path}: no track has {least}")
    pace = float(np.median([task.length / task.time for task in tasks]))
    if not MEDIAN_PACES[0] < pace < MEDIAN_PACES[1]:
        told = "are their places in m, and the frames a second the recording's?"
        raise DataError(f"{path}: people walk at {pace:.3g} m/s: {told}")
    for person in people:
        steps = np.hypot(*np.diff(person.positions, axis=0).T) / np.diff(person.times)
        for k in np.flatnonzero(steps > FASTEST):
            told = f"{person.times[k]:.6g} s at {steps[k]:.3g} m/s"
            raise DataError(f"{path}: id {person.number} jumps at {told}")
    return tasks


def task_document(task: Task) -> dict[str, Any]:
    """Return a task as a scenario file.

    The robot (a regular dodecagon of circumradius 0.25 m, |v| ≤ 1.6 m/s, |ω| ≤ 2 rad/s,
    3 m/s²) starts at the human's first position, heading for its last, on the same
    clock; it has arrived within 0.3 m of it. Its reference goes there straight, at the
    human's own pace over the straight way or a little faster.
    The run ends there. If no plan avoids a contact the robot should be at rest by then.
    """
    start, goal = task.human.positions[0], task.human.positions[-1]
    x, y = (goal - start).tolist()
    begin, duration = float(task.human.times[0]), PATIENCE * task.time
    pace = math.hypot(x, y) / task.time
    angles = 2.0 * np.pi * np.arange(12) / 12
    corners = PERSON * np.column_stack([np.cos(angles), np.sin(angles)])
    return {
        "title": f"In place of pedestrian {task.human.number}",
        "duration_s": duration,
        "dt_s": 0.05,
        "ends_at_goal": True,
        "settled_s": 0.0,
        "arrival_m": 0.3,
        "arrival_rad": 3.2,
        "start": {
            "x_m": float(start[0]),
            "y_m": float(start[1]),
            "heading_rad": math.atan2(y, x),
        },
        "robot": {
            "footprint_m": corners.tolist(),
            "v_min_mps": -1.6,
            "v_max_mps": 1.6,
            "omega_min_radps": -2.0,
            "omega_max_radps": 2.0,
            "acceleration_mps2": 3.0,
        },
        "reference": {
            "kind": "spline",
            "points_m": [start.tolist(), goal.tolist()],
            "speed_mps": min(1.5, 1.15 * pace),
            "acceleration_mps2": 1.5,
        },
        "tracking": {"waiting": True, "station_keeping": True, "k_y_rad_per_m2": 4.0},
        "filter": {"passive": True},
        "radius": SafetyRadius.keys_of(0.05, 0.1),
        "obstacles": [
            {
                "kind": "waypoints",
                "times_s": (other.times - begin).round(6).tolist(),
                "positions_m": other.positions.tolist(),
                "radius_m": PERSON,
                "fleeting": True,
            }
            for other in task.others
            if other.times[-1] > begin and other.times[0] < begin + duration
        ],
    }


@dataclass(frozen=True)
class Crowd:
    """Recorded pedestrians, one replaced, as a source of scenes.

    Attributes:
        scene: One of :data:`SCENES`.
        data: Folder of published data sets.
    """

    scene: Annotated[str, ("scene",)]
    data: str | None = None

    @property
    def name(self) -> str:
        """Label in tables."""
        return f"crowd {self.scene}"

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All of them, by the id of the human."""
        return read_tasks(find_scene(self.scene, self.data))

    def identity(self, data: str | None) -> str:
        """Return the scene, and the digest of its tracks."""
        return self.name + file_digest(find_scene(self.scene, self.data))

    def sample(self, seed: int | None = None) -> dict[str, Any]:
        """Return the scenario file of the task with this number."""
        return task_document(self.tasks[seed or 0])
