"""One run from beginning to end, and its log."""

from collections.abc import Callable
from typing import Any

import numpy as np

from qpavoid.lab.simulation.log import COLUMNS, Log, LogRow, provenance, read_only
from qpavoid.lab.simulation.methods import name_of, solver_of
from qpavoid.lab.simulation.outcome import OUTCOME, Goal, is_over, note_arrival
from qpavoid.lab.simulation.scenario import AT_LAST, Scenario
from qpavoid.lab.simulation.simulation import Simulation
from qpavoid.model.given import NO_POINTS
from qpavoid.types import Array


def run(
    scenario: Scenario,
    controller: Any,
    solver: str = "exact",
    progress: Callable[[int], None] = lambda steps: None,
    explain: bool = False,
) -> Log:
    """Simulate one controller on a scenario.

    Deterministic: two runs of the same scenario give the same columns bit for bit, but
    for ``solve_time_s``. All controllers get the same desired twist and observation,
    and all twists are cut to the same limits.

    Args:
        scenario: What to run.
        controller: Name of the controller, see
            :mod:`qpavoid.lab.simulation.methods`; or one's own: a function
            (v, ω, obstacles, context) → (v, ω), or a class, see
            :class:`~qpavoid.lab.simulation.own.OwnController`.
        solver: Back end of the QP filter; other methods have none.
        progress: Called after every step with the number of steps done.
        explain: Log the QP of every step too, for replays; costs about another step.

    Raises:
        UnknownNameError: No controller or back end of that name.
        MissingExtraError: The back end's package is not installed.
        ConfigError: A method of one's own cannot be loaded.
        InvalidInputError: It cannot drive, or returns what is no finite twist.
    """
    simulation = Simulation(scenario, controller, solver, explain)
    first = Simulation(scenario, controller, solver)
    first.step(0.0, scenario.world.at(0.0))  # compiles, before the clock runs
    n, end, times = scenario.steps, scenario.path.sample(AT_LAST)[0], scenario.times
    goal = Goal(simulation.goal, *scenario.arrival)
    rows: list[LogRow] = []
    discs, corners, planes = [], [], []
    arrival = np.full(1, np.inf, OUTCOME)
    for k in range(n):
        obstacles = scenario.world.at(times[k])
        row, _, problem = simulation.step(times[k], obstacles)
        rows.append(row)
        planes.append(problem.planes)
        discs.append(obstacles.discs)
        corners.append(np.vstack([NO_POINTS, *obstacles.polygons]))
        progress(k + 1)
        note_arrival(arrival, goal, simulation.pose, times[k + 1])
        if scenario.ends_at_goal and is_over(times[k], 0.0, arrival, scenario.settled):
            break
    return Log(
        meta=_meta(scenario, controller, solver),
        columns=dict(
            zip(COLUMNS, map(read_only, zip(*rows, strict=True)), strict=True)
        ),
        final=read_only(simulation.pose),
        final_reference=read_only(end),
        planes=read_only(planes),
        discs=read_only(discs),
        corners=read_only(corners),
        **_standing(scenario),
    )


def _standing(scenario: Scenario) -> dict[str, Array]:
    """Return the arrays of a log that do not change in a run."""
    world = scenario.world
    return {
        "points": world.points,
        "walls": world.walls,
        "polygons": read_only([len(one) for one in world.polygons.polygons]),
        "vertices": scenario.robot.footprint.vertices,
    }


def _meta(scenario: Scenario, controller: Any, solver: str) -> dict[str, object]:
    return {
        "scenario": scenario.name,
        "title": scenario.title,
        "controller": name_of(controller),
        "solver": solver_of(controller, solver),
        "robot": scenario.robot.name,
        "dt_s": scenario.dt,
        "duration_s": scenario.duration,
        "seed": scenario.seed,
        "arrival": list(scenario.arrival),
        "frames_s": list(scenario.frames),
        "settings": repr(scenario.settings),
        "digest": scenario.digest,
        **provenance(),
    }
