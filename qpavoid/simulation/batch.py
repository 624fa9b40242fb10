"""Thousands of closed loops on all cores: what they share, and what comes out."""

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass, field

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.ahead import fresh_state
from qpavoid.avoidance.controllers import check_controllers
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import memory_rows
from qpavoid.detour.room import outline
from qpavoid.detour.settings import RECORD as DETOUR_RECORD
from qpavoid.detour.settings import DetourSettings
from qpavoid.detour.state import STATE_SIZE as STAGE_SIZE
from qpavoid.model.contacts import most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Obstacles, like
from qpavoid.model.robot import Robot
from qpavoid.motion.tracking import Tracker
from qpavoid.motion.waiting import NEVER, Waiting
from qpavoid.qp.exact import WIDTH
from qpavoid.simulation.loop import METHODS, OUTCOME, close_loop


@dataclass(frozen=True, eq=False)
class Loop:
    """One closed loop of a batch; world frame.

    Attributes:
        plan: (n, 5) reference, a row a control step: x, y, γ, v, ω; n ≥ 2.
        obstacles: At time 0; discs keep their velocities.
        start: Pose and twist at time 0.
        duration: s, at most.
        quiet: s; until then the run goes on even if the robot stands at its goal.
    """

    plan: Array
    obstacles: Obstacles
    start: tuple[float, float, float, float, float]
    duration: float
    quiet: float = 0.0


@dataclass(frozen=True)
class Batch:
    """What all loops of a batch have in common.

    Attributes:
        robot: Footprint and limits.
        settings: Of the controllers; its dt is the control step.
        tracker: The tracking law.
        waiting: The reference's clock.
        detour: The stage against stalls; None: there is none.
        arrival: Errors that count as arrived, m and rad.
    """

    robot: Robot
    tracker: Tracker
    settings: AvoidanceSettings = field(default_factory=AvoidanceSettings)
    waiting: Waiting = NEVER
    detour: DetourSettings | None = None
    arrival: tuple[float, float] = (0.01, math.radians(1.0))

    def run(
        self, controller: str, loops: Sequence[Loop], threads: int | None = None
    ) -> npt.NDArray[np.void]:
        """Return the outcome of every loop, on all cores; see :data:`OUTCOME`.

        Raises:
            UnknownNameError: No controller of that name (``none``: tracking alone).
        """
        if controller != "none":
            check_controllers([controller])
        outcomes = np.zeros((len(loops), len(OUTCOME.names or ())))
        known = (
            METHODS[controller],
            self.robot.footprint.edges,
            self.robot.numbers,
            self.settings.record(),
            self.tracker.array,
            astuple(self.waiting),
            self._detour(),
            outline(self.robot.footprint),
        )

        def run_some(numbers: Iterable[int]) -> None:
            for i in numbers:
                loop, world, state = loops[i], loops[i].obstacles.arrays, fresh_state()
                state[:2] = loop.start[3:]
                x, y, heading = loop.plan[-1, :3].tolist()
                most = most_contacts(self.robot.footprint.edges, world)
                close_loop(
                    *known,
                    loop.plan,
                    world,
                    loop.start[:3],
                    (x, y, heading, *self.arrival),
                    round(loop.duration / self.settings.dt),
                    loop.quiet,
                    outcomes[i],
                    state,
                    np.zeros(STAGE_SIZE),
                    like(world),
                    np.empty((memory_rows(most), WIDTH)),
                )

        threads = threads or os.cpu_count() or 1
        with ThreadPoolExecutor(threads) as pool:
            list(
                pool.map(
                    run_some, (range(k, len(loops), threads) for k in range(threads))
                )
            )
        return outcomes.view(OUTCOME)[:, 0]

    def _detour(self) -> npt.NDArray[np.void]:
        """Return the record of the stage, or none."""
        if self.detour is None:
            return np.zeros(0, dtype=DETOUR_RECORD)
        return self.detour.record(self.robot, self.settings.radius)
