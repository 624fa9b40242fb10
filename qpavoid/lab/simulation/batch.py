"""Thousands of closed loops on all cores: what they share, and what comes out."""

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.state import fresh_state, set_driven
from qpavoid.avoidance.workspace import memory_size
from qpavoid.errors import UnknownNameError
from qpavoid.guide.room import outline
from qpavoid.guide.settings import RECORD as DETOUR_RECORD
from qpavoid.guide.settings import DetourSettings
from qpavoid.guide.state import STATE_SIZE as STAGE_SIZE
from qpavoid.lab.simulation.loop import (
    RUN_SIZE,
    advance,
    begin,
    close_loop,
    differs,
    lead,
)
from qpavoid.lab.simulation.methods import REGISTRY, make_controller
from qpavoid.lab.simulation.outcome import OUTCOME, SETTLED, is_over
from qpavoid.lab.simulation.scenario import AT_LAST, Scenario
from qpavoid.model.contacts import most_contacts
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import Arrays, Obstacles
from qpavoid.model.robot import Robot, limit_twist
from qpavoid.qp.solve import find_back_end
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Reference, Tracker

NOTHING = Obstacles()
"""In view."""

IN_BATCH = tuple(n for n, e in REGISTRY.items() if e.compiled >= 0 or not e.solver)
"""Methods that are compiled, or need to know nothing but what is near."""

Shared: TypeAlias = tuple[
    Array,
    Array,
    npt.NDArray[np.void],
    Array,
    tuple[float, float, float],
    npt.NDArray[np.void],
    Array,
]
"""What all loops of a batch share, as :func:`close_loop` takes it: edges, robot and
settings; tracker, clock, detour, and the footprint that the detour keeps clear."""

LINE = 8
"""Numbers in a cache line."""


def apart(array: Array) -> Array:
    """Return a copy that shares no cache line with what another thread writes.

    Threads that write side by side wait for each other: up to half of the speed.
    """
    block = np.empty(array.size + 2 * LINE)
    copy = block[LINE : LINE + array.size].reshape(array.shape)
    copy[...] = array
    return copy


@dataclass(frozen=True, eq=False)
class Loop:
    """One closed loop of a batch; world frame.

    Attributes:
        plan: (n, 5) reference, a row a control step: x, y, γ, v, ω; n ≥ 2.
        obstacles: At time 0; they keep their velocities and rates of turn.
        start: Pose and twist at time 0.
        duration: s, at most.
        quiet: s; until then the run goes on even if the robot stands at its goal.
    """

    plan: Array
    obstacles: Obstacles
    start: tuple[float, float, float, float, float]
    duration: float
    quiet: float = 0.0


def as_loop(scenario: Scenario) -> "tuple[Batch, Loop] | None":
    """Return a scenario as a loop of a batch of its own.

    ``None`` where the compiled loop has no such thing: velocities that change or are
    estimated, a sight that ends, sensors, localisation, slip, another end.
    """
    seen = scenario.estimation or scenario.lidar or scenario.sensor
    sensed = seen or scenario.sight < math.inf
    inexact = scenario.localisation or scenario.plant or scenario.settled != SETTLED
    if sensed or inexact or not scenario.world.is_steady:
        return None
    n = scenario.steps
    plan = scenario.path.sample(scenario.dt * np.arange(n + 2, dtype=np.float64))
    plan[-1] = scenario.path.sample(AT_LAST)[0]
    batch = Batch(
        scenario.robot,
        scenario.tracker,
        scenario.settings,
        scenario.waiting,
        scenario.detour,
        scenario.arrival,
    )
    quiet = 0.0 if scenario.ends_at_goal else scenario.duration
    start = (*scenario.start, 0.0, 0.0)
    return batch, Loop(plan, scenario.world.at(0.0), start, scenario.duration, quiet)


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
        self,
        controller: str,
        loops: Sequence[Loop],
        threads: int | None = None,
        solver: str = "exact",
    ) -> npt.NDArray[np.void]:
        """Return the outcome of every loop, on all cores; see :data:`OUTCOME`.

        With another solver than our own, the filter's steps are taken in Python, one
        after the other; all else is the same.

        Raises:
            UnknownNameError: No back end of that name, or none of :data:`IN_BATCH`.
            MissingExtraError: The back end's package is not installed.
        """
        if controller not in IN_BATCH:
            raise UnknownNameError("controller", controller, IN_BATCH)
        find_back_end(solver)
        entry = REGISTRY[controller]
        outcomes = np.zeros((len(loops), len(OUTCOME.names or ())))
        run, shared = self._run_compiled, self._shared()
        by_step = solver != "exact" and not entry.solver
        if by_step or entry.compiled < 0:
            run = partial(self._run_stepwise, solver=solver)
            threads = 1
        else:  # compiled on its own first, or the whole loop takes minutes to compile
            make_controller("qp", self.robot, self.settings).start()(0.0, 0.0, NOTHING)

        def run_some(numbers: Iterable[int]) -> None:
            for i in numbers:
                outcomes[i] = run(controller, shared, loops[i])

        threads = threads or os.cpu_count() or 1
        shares = [range(k, len(loops), threads) for k in range(threads)]
        if threads == 1:
            run_some(shares[0])
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run_some, shares))
        return outcomes.view(OUTCOME)[:, 0]

    def _run_compiled(self, controller: str, shared: Shared, loop: Loop) -> Array:
        """Run a loop in one compiled call."""
        outcome, now, state, stage, seen, memory = self._memory(shared, loop)
        close_loop(
            REGISTRY[controller].compiled,
            *shared,
            loop.plan,
            loop.obstacles.arrays,
            loop.start[:3],
            self._goal(loop),
            self._steps(loop),
            loop.quiet,
            now,
            outcome,
            state,
            stage,
            seen,
            memory,
        )
        return outcome

    def _run_stepwise(
        self,
        controller: str,
        shared: Shared,
        loop: Loop,
        solver: str,
    ) -> Array:
        """Run a loop whose controller is no compiled function."""
        known, led, world = shared[:3], shared[3:], loop.obstacles.arrays
        numbers, dt = self.robot.numbers, self.settings.dt
        outcome, now, state, stage, seen, memory = self._memory(shared, loop)
        method = make_controller(controller, self.robot, self.settings, solver)
        step, plan = method.start(*loop.start[3:]), loop.plan
        begin(*known, world, loop.start[:3], now, outcome, seen, memory)
        for k in range(self._steps(loop)):
            time = k * dt
            wanted = lead(
                numbers, dt, *led, plan, world, time, now, outcome, state, stage, seen
            )
            decision = step(*wanted, Obstacles.of(*seen))
            last = state[0], state[1]
            driven = limit_twist(numbers, decision.v, decision.omega, *last, dt)
            changed = differs(limit_twist(numbers, *wanted, *last, dt), *driven)
            advance(
                *known,
                world,
                self._goal(loop),
                time,
                decision.status.number,
                driven,
                changed,
                decision.clearance,
                now,
                outcome,
                seen,
                memory,
            )
            state[:2] = driven
            if is_over(time, loop.quiet, outcome):
                break
        return outcome

    def _shared(self) -> Shared:
        """Return what all loops share, as the compiled functions take it."""
        return (
            self.robot.footprint.edges,
            self.robot.numbers,
            self.settings.record(),
            self.tracker.array,
            (self.waiting.free, self.waiting.wide, self.waiting.least_rate),
            self._detour(),
            outline(self.robot.footprint),
        )

    def _memory(
        self, shared: Shared, loop: Loop
    ) -> tuple[Array, Array, Array, Array, Arrays, Array]:
        """Return outcome, place, state, stage, and memory for obstacles and steps."""
        outcome = apart(np.empty(len(OUTCOME.names or ())))
        now = apart(np.empty(RUN_SIZE))
        state, stage = apart(fresh_state()), apart(np.zeros(STAGE_SIZE))
        set_driven(state, *loop.start[3:])
        points, capsules = map(apart, loop.obstacles.arrays)
        seen = points, capsules
        size = memory_size(most_contacts(shared[0], seen), shared[2])
        return outcome, now, state, stage, seen, np.empty(size)

    def _goal(self, loop: Loop) -> Reference:
        """Return the last pose of the plan, and the errors that count as arrived."""
        x, y, heading = loop.plan[-1, :3].tolist()
        return x, y, heading, *self.arrival

    def _steps(self, loop: Loop) -> int:
        return round(loop.duration / self.settings.dt)

    def _detour(self) -> npt.NDArray[np.void]:
        """Return the record of the stage, or none."""
        if self.detour is None:
            return np.zeros(0, dtype=DETOUR_RECORD)
        return self.detour.record(self.robot, self.settings.radius)
