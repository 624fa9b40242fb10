"""A scenario that is played: hands move its discs, settings change. No network here."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from qpavoid.avoidance.decision import STATUSES
from qpavoid.errors import ConfigError, InvalidInputError
from qpavoid.lab.play.hand import Disc, Place
from qpavoid.lab.play.live import Live
from qpavoid.lab.play.record import as_toml, obstacles_of
from qpavoid.lab.simulation.config import changed, find_config, read_document
from qpavoid.lab.simulation.methods import OURS
from qpavoid.lab.simulation.scenario import Scenario, make_scenario
from qpavoid.lab.simulation.simulation import StepRecord
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Pose

LONGEST = 600.0
"""s; so long a reference is planned, and so long a recording may last."""

SHOWN = {
    "t": "t_s",
    "x": "x_m",
    "y": "y_m",
    "heading": "heading_rad",
    "xr": "x_ref_m",
    "yr": "y_ref_m",
    "hr": "heading_ref_rad",
    "vd": "v_desired_mps",
    "wd": "omega_desired_radps",
    "v": "v_mps",
    "w": "omega_radps",
    "clearance": "clearance_m",
    "rmin": "r_min_m",
    "r": "r_m",
    "slack": "slack_mps",
}
"""Numbers of a frame, by the log's columns."""


class Session:
    """A scenario that is played, a control step at a time.

    The world is moved by hands of bounded speed. The velocities of discs are estimated
    from their positions, since nobody tells a robot how fast a hand is.

    Args:
        config: Path of a scenario file, or its shipped name.
        controller: Name of the controller that drives first.
        data: Folder of published data sets, where the scenario needs one.

    Attributes:
        document: The scenario file, with what has been set since.
        discs: All discs, of the scenario and added.
        time: Since the last restart, s.
        running: Whether the clock is to drive it; else it is paused.
        driving: Whether the scenario's reference is followed; else the robot is parked.
        recording: Whether steps are being recorded.

    Raises:
        UnknownNameError: No controller or scenario of that name.
        ConfigError: The scenario file is not valid.
    """

    def __init__(
        self, config: str, controller: str = "qp-ahead", data: str | None = None
    ) -> None:
        self._name, self._file = find_config(config)
        self._data = data
        document, _ = read_document(self._file)
        self.document = {"estimation": {}, **document}
        self._station: dict[str, Any] = {}
        self.running, self.driving, self.recording = True, True, False
        self._history: list[list[Place]] = []
        self._notes: list[str] = []
        self._saved = ""
        world = self._scenario(self.document).world
        still = world.discs.tolist()
        self.discs = [Disc(i, (x, y), radius) for i, (x, y, radius) in enumerate(still)]
        for i, track in enumerate(world.tracks, start=len(still)):
            self.discs.append(Disc(i, (0.0, 0.0), track.radius, track))
        self._next_number = len(self.discs)
        for name in (*OURS, controller):  # compiles
            self.restart(name)
            self.step()
        self.restart()

    @property
    def scenario(self) -> Scenario:
        """What is driven now: that of the document, or parked."""
        return self._robot.scenario

    @property
    def pose(self) -> Pose:
        """Where the robot is."""
        return self._robot.pose

    @property
    def recorded(self) -> bool:
        """Whether there is a finished recording."""
        return bool(self._saved)

    @property
    def duration(self) -> float:
        """Of the scenario file, s; the session goes on."""
        return float(self.document["duration_s"])

    @property
    def controller(self) -> str:
        """Name of the controller that drives."""
        return self._robot.controller

    def restart(self, controller: str | None = None) -> None:
        """Put the robot and all discs back to where they start."""
        scenario = self._scenario(self.document | self._station)
        self._robot = Live(scenario, controller or self.controller)
        self._on_path = self._robot if self.driving else None
        self.time, self._steps = 0.0, 0
        for disc in self.discs:
            disc.restart()

    def _scenario(self, document: dict[str, Any]) -> Scenario:
        """Return a document as a scenario that is long enough."""
        longest = {"duration_s": LONGEST, "ends_at_goal": False}
        made = make_scenario(document | longest, self._name, self._file, self._data)
        if made.robots:
            raise ConfigError([f"{self._file}: robots: play has one robot"])
        return made

    def change(
        self, controller: str | None = None, settings: dict[str, Any] | None = None
    ) -> None:
        """Drive on with another controller, or other settings at dotted keys.

        Raises:
            UnknownNameError: No controller of that name; all stays as it was.
            InvalidInputError: The settings are not valid; all stays as it was.
        """
        document = changed(self.document, settings or {})
        try:
            scenario = self._scenario(document | self._station)
        except ConfigError as error:
            problem = error.problems[0].removeprefix(f"{self._file}: ")
            raise InvalidInputError(problem.removeprefix("filter: ")) from None
        robot = Live(scenario, controller or self.controller)
        robot.take_over(self._robot, clock=self._robot)
        self.document, self._robot = document, robot
        if self.recording:
            what = settings or {"controller": controller}
            self._notes += [f"{self.time:.2f} s: {k} = {v}" for k, v in what.items()]

    def park(self) -> None:
        """Keep the present pose as a station."""
        x, y, heading = self._robot.pose
        pose = {"x_m": x, "y_m": y, "heading_rad": heading}
        self._station = {
            "start": pose,
            "reference": {"kind": "station", "pose": pose},
            "tracking": {**self.document.get("tracking", {}), "station_keeping": True},
        }
        self._set_out(None)

    def drive(self) -> None:
        """Follow the scenario's reference, from where it was left."""
        self._station = {}
        self._set_out(self._on_path)
        self._on_path = self._robot

    def _set_out(self, clock: Live | None, remember: bool = True) -> None:
        self.driving = not self._station
        scenario = self._scenario(self.document | self._station)
        robot = Live(scenario, self.controller)
        robot.take_over(self._robot, clock, remember)
        self._robot = robot

    def add(self, place: Place, radius: float) -> None:
        """Put a new disc into the world."""
        self.discs.append(Disc(self._next_number, place, radius))
        self._next_number += 1

    def remove(self, disc: Disc) -> None:
        """Take a disc away; the others are estimated anew, for their numbers change."""
        self.discs.remove(disc)
        self._set_out(self._robot, remember=False)

    def step(self) -> dict[str, Any]:
        """Drive one control step; return its frame: what the panels show."""
        dt = self.scenario.dt
        after = [disc.after(self.time, dt) for disc in self.discs]
        obstacles = self._obstacles(after)
        record = self._robot.step(self.time, obstacles)
        self._frame = _frame(record) | self._scene()
        # The places before the step: what the robot saw, and what a replay starts with.
        if self.recording:
            self._history.append([disc.place for disc in self.discs])
        for disc, place in zip(self.discs, after, strict=True):
            disc.place = place
        self._steps += 1
        self.time = self._steps * dt
        if self.recording and self.time >= LONGEST:
            self.end_recording()
        return self._frame

    def glance(self) -> dict[str, Any]:
        """Return the last frame, with robot and discs where they are now."""
        x, y, heading = self.pose
        here = {"t": self.time, "x": x, "y": y, "heading": heading}
        return self._frame | here | self._scene()

    def _scene(self) -> dict[str, Any]:
        polygons = self.scenario.world.polygons.moved(self.time).polygons
        return {
            "polygons": [corners.tolist() for corners in polygons],
            "discs": [(*disc.place, disc.radius) for disc in self.discs],
            "ids": [disc.number for disc in self.discs],
            "held": [disc.number for disc in self.discs if disc.target],
        }

    def _obstacles(self, after: Sequence[Place]) -> Obstacles:
        """Return everything as it is, discs on their way to where they are after dt."""
        world = self.scenario.world
        discs = np.array([(*disc.place, disc.radius) for disc in self.discs])
        discs = discs.reshape(-1, 3)
        way = np.array(after).reshape(-1, 2) - discs[:, :2]
        known = Obstacles(world.points, discs, way / self.scenario.dt, world.walls)
        return known.joined(world.polygons.moved(self.time))

    def record(self) -> None:
        """Restart, and record from now on."""
        self.end_recording()
        self.restart()
        self._history, self._notes = [], [f"driven by {self.controller}"]
        self.recording = True

    def end_recording(self) -> None:
        """End the recording; it stays to be saved until the next one."""
        self._saved, self.recording = self.recording_toml(), False

    def recording_toml(self) -> str:
        """Return the recording so far as a scenario file; empty if there is none."""
        if not self.recording or len(self._history) < 2:
            return self._saved
        x, y, heading = self.scenario.start
        recorded = {
            "title": f"{self.scenario.title}, recorded",
            "duration_s": round(self.time, 9),
            "start": {"x_m": x, "y_m": y, "heading_rad": heading},
            "obstacles": obstacles_of(self.scenario, self.discs, self._history),
        }
        left_out = ("published", "frames_s", "ends_at_goal")
        document = {k: v for k, v in self.document.items() if k not in left_out}
        comment = "Recorded with qpavoid play:\n" + "\n".join(self._notes)
        return as_toml(document | self._station | recorded, comment)


def _frame(record: StepRecord) -> dict[str, Any]:
    """Return what the panels show of a step; None for what is not finite."""
    row = record.row._asdict()
    frame: dict[str, Any] = {
        name: row[column] if math.isfinite(row[column]) else None
        for name, column in SHOWN.items()
    }
    obstacle, problem = int(row["obstacle"]), record.problem
    frame["va"], frame["wa"] = problem.limits[4:]
    frame["box"] = problem.limits[:4]
    frame["planes"] = problem.planes[np.isfinite(problem.planes).all(axis=1)].tolist()
    frame["status"] = STATUSES[int(row["status"])]
    frame["solve_us"] = 1e6 * row["solve_time_s"]
    frame["obstacle"] = obstacle
    frame["contact"] = (
        (row["contact_x_m"], row["contact_y_m"]) if obstacle >= 0 else None
    )
    return frame
