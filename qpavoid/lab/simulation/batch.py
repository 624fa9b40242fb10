"""Thousands of closed loops on all cores: what they share, and what comes out."""

import math
import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.scene import Setup
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.state import fresh_state, set_driven
from qpavoid.avoidance.step import filter_step
from qpavoid.avoidance.workspace import memory_size
from qpavoid.compiled import is_cached
from qpavoid.errors import UnknownNameError
from qpavoid.guide.guide import memory_ahead
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import GuideStage, fresh_stage, stage_memory
from qpavoid.lab.simulation.loop import (
    RUN_SIZE,
    Driven,
    Run,
    Shared,
    Task,
    close_loop,
    differs,
    record,
    reset,
    track,
)
from qpavoid.lab.simulation.methods import REGISTRY, make_controller
from qpavoid.lab.simulation.outcome import (
    NOTED,
    OUTCOME,
    SETTLED,
    Goal,
    Outcome,
    is_over,
)
from qpavoid.lab.simulation.scenario import AT_LAST, Scenario
from qpavoid.model.contacts import most_contacts
from qpavoid.model.obstacles import NO_OBSTACLES, Obstacles
from qpavoid.model.robot import Robot, limit_twist
from qpavoid.qp.solve import find_back_end
from qpavoid.tracking.clock import NEVER, Waiting
from qpavoid.tracking.kanayama import Tracker
from qpavoid.types import Array

IN_BATCH = tuple(n for n, e in REGISTRY.items() if e.compiled >= 0 or not e.solver)
"""Methods that are compiled, or need to know nothing but what is near."""

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


def compile_filter(setup: Setup) -> None:
    """Let numba compile the filter alone, or a loop that is not kept takes minutes."""
    if is_cached(close_loop):
        return
    none = NO_OBSTACLES.arrays
    memory = np.empty(memory_size(most_contacts(setup.edges, none), setup.settings))
    given = *setup, *none, 0.0, True, 0.0, 0.0, fresh_state(), memory
    filter_step.compile_alone(*given)  # type: ignore[attr-defined]


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

    ``None`` where the compiled loop has no such thing: several robots, velocities that
    change or are estimated, a sight that ends, sensors, localisation, slip, another
    end.
    """
    seen = scenario.estimation or scenario.lidar or scenario.sensor
    sensed = seen or scenario.sight < math.inf
    inexact = scenario.localisation or scenario.plant or scenario.settled != SETTLED
    several = len(scenario.robots) > 0
    if several or sensed or inexact or not scenario.world.is_steady:
        return None
    n = scenario.steps
    # Two rows beyond the last step: the clock interpolates between a row and the next,
    # and the last one must be the goal itself, which arrival is measured from.
    plan = scenario.path.sample(scenario.dt * np.arange(n + 2, dtype=np.float64))
    plan[-1] = scenario.path.sample(AT_LAST)[0]
    batch = Batch(
        scenario.robot,
        scenario.tracker,
        scenario.settings,
        scenario.waiting,
        scenario.guide,
        scenario.arrival,
    )
    quiet = 0.0 if scenario.ends_at_goal else scenario.duration
    start = (*scenario.start, 0.0, 0.0)
    return batch, Loop(plan, scenario.world.at(0.0), start, scenario.duration, quiet)


@dataclass(frozen=True)
class Batch:
    """Common data of all loops of a batch.

    Attributes:
        robot: Footprint and limits.
        settings: Of the controllers; its dt is the control step.
        tracker: The tracking law.
        waiting: The reference's clock.
        guide: Of the stage after tracking; None: there is none.
        arrival: Errors that count as arrived, m and rad.
    """

    robot: Robot
    tracker: Tracker
    settings: AvoidanceSettings = field(default_factory=AvoidanceSettings)
    waiting: Waiting = NEVER
    guide: GuideSettings | None = None
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
        outcomes = np.zeros(len(loops), OUTCOME)
        run, shared = self._run_compiled, self._shared()
        by_step = solver != "exact" and not entry.solver
        if by_step or entry.compiled < 0:
            run = partial(self._run_stepwise, solver=solver)
            threads = 1
        else:
            compile_filter(shared.setup)

        def run_some(numbers: Iterable[int]) -> None:
            for i in numbers:
                # Each thread writes rows of its own; compiled loops run without the
                # GIL.
                outcomes[i : i + 1] = run(controller, shared, loops[i])

        threads = threads or os.cpu_count() or 1
        # Interleaved, not in blocks: neighbours in a list of loops tend to be alike,
        # and a block of long ones would keep one thread busy while the others are done.
        shares = [range(k, len(loops), threads) for k in range(threads)]
        if threads == 1:
            run_some(shares[0])
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run_some, shares))
        return outcomes

    def _run_compiled(self, controller: str, shared: Shared, loop: Loop) -> Outcome:
        """Run a loop in one compiled call."""
        run = self._new_run(shared, loop)
        close_loop(REGISTRY[controller].compiled, shared, self._task(loop), run)
        return run.outcome

    def _run_stepwise(
        self, controller: str, shared: Shared, loop: Loop, solver: str
    ) -> Outcome:
        """Run a loop whose controller is no compiled function."""
        numbers, dt, task = self.robot.limit_vector, self.settings.dt, self._task(loop)
        run = self._new_run(shared, loop)
        method = make_controller(controller, self.robot, self.settings, solver)
        step = method.start(*loop.start[3:])
        reset(shared.setup, task, run)
        for k in range(task.steps):
            time = k * dt
            wanted = track(shared, task, run, time)
            decision = step(*wanted, Obstacles.of(*run.seen))
            # Only what drives is Python here; reset, track and record are the compiled
            # loop's own functions, so that outcomes do not depend on who solves.
            last = run.state[0], run.state[1]
            twist = limit_twist(numbers, (decision.v, decision.omega), last, dt)
            changed = differs(limit_twist(numbers, wanted, last, dt), twist)
            code, distance = decision.status.number, decision.clearance
            driven = Driven(time, code, twist, changed, distance)
            record(shared.setup, task, run, driven)
            run.state[:2] = twist
            if is_over(time, loop.quiet, run.outcome):
                break
        return run.outcome

    def _shared(self) -> Shared:
        """Return what all loops share, as the compiled functions take it."""
        law, settings = self.tracker.array, self.guide or GuideSettings()
        stage = GuideStage(self.robot, settings, self.settings, law).stage
        if self.guide is None:
            stage = stage._replace(settings=stage.settings[:0])
        return Shared(stage.setup, law, self.waiting.lags, stage)

    def _task(self, loop: Loop) -> Task:
        """Return what a loop is about; its goal is the last pose of the plan."""
        x, y, heading = loop.plan[-1, :3].tolist()
        goal = Goal((x, y, heading), *self.arrival)
        steps, start = round(loop.duration / self.settings.dt), loop.start[:3]
        return Task(loop.plan, loop.obstacles.arrays, start, goal, steps, loop.quiet)

    def _new_run(self, shared: Shared, loop: Loop) -> Run:
        """Return the memory of a loop."""
        state, (points, capsules) = apart(fresh_state()), loop.obstacles.arrays
        set_driven(state, *loop.start[3:])
        seen, setup = (apart(points), apart(capsules)), shared.setup
        most = most_contacts(setup.edges, seen)
        return Run(
            now=apart(np.empty(RUN_SIZE)),
            outcome=apart(np.zeros(len(NOTED))).view(OUTCOME),
            state=state,
            stage=apart(fresh_stage()),
            guiding=stage_memory(most, shared.stage.settings),
            ahead=memory_ahead(self.guide),
            seen=seen,
            memory=np.empty(memory_size(most, setup.settings)),
        )
