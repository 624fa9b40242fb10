"""One run of a study: where its scene comes from, how it is run, and its row."""

import json
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, TypeAlias

import numpy as np

from qpavoid.lab.scenario.config import changed
from qpavoid.lab.scenario.methods import solver_of
from qpavoid.lab.scenario.scenario import Scenario, make_scenario
from qpavoid.lab.simulation.outcome import (
    MEASURES,
    finite,
    outcome_of,
    verdict,
    worst_of,
)
from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.worlds.source import Source

Value: TypeAlias = str | float | bool | None
Row: TypeAlias = dict[str, Value]


class Job(NamedTuple):
    """One run.

    Attributes:
        run: Its name: a hash of everything that determines it.
        source: Of the scene.
        seed: Of the scene; ``None``: the file's own.
        changes: Settings by dotted key, as JSON.
        data: Folder of published data sets.
        controller: Name of the controller.
        solver: Back end of the QP.
        keep: Whose logs are kept: none, failures, all.
        label: Name of the variant in the row; empty: that of the controller.
        own: Settings of the variant by dotted key, as JSON; they override ``changes``.
    """

    run: str
    source: Source
    seed: int | None
    changes: str
    data: str | None
    controller: str
    solver: str
    keep: str
    label: str = ""
    own: str = "{}"

    def row(self, outcome: str, error: str = "") -> Row:
        """Return the row of a run that gave no numbers."""
        return {
            "run": self.run,
            "scenario": self.source.name,
            "seed": self.seed,
            "settings": self.changes,
            "controller": self.label or self.controller,
            "solver": solver_of(self.controller, self.solver),
            "outcome": outcome,
            "success": False,
            "contact": False,
            "duration_s": None,
            **dict.fromkeys(MEASURES),
            "error": error,
            **dict.fromkeys(CLOCK),
        }


CLOCK = "solve_us", "solve_p99_us", "wall_s"
"""Those that depend on it: median and 99th percentile of what deciding takes in a step,
µs, and time of all of the run, s."""


def run_job(job: Job) -> tuple[Row, bytes | None]:
    """Run and return the row, and the log where it is kept; errors become rows."""
    started, kept = perf_counter(), BytesIO()
    try:
        changes = json.dumps(json.loads(job.changes) | json.loads(job.own))
        scene = find_scene(job.source, job.seed, changes, job.data)
        logs = run_fleet(scene, job.controller, job.solver)
        noted = worst_of([outcome_of(log) for log in logs])
        word = verdict(noted)
        row = job.row(word) | {name: finite(x) for name, x in noted.items()}
        row |= {"duration_s": scene.duration, "success": word == "arrived"}
        row["contact"] = word == "touched"
        times = np.concatenate([log["solve_time_s"] for log in logs])
        row["solve_us"], row["solve_p99_us"] = np.percentile(
            1e6 * times, (50.0, 99.0)
        ).tolist()
        if job.keep == "all" or (job.keep == "failures" and not row["success"]):
            logs[0].save(kept)
    except (Exception, SystemExit) as error:  # of a method of one's own: any
        row = job.row("failed", f"{type(error).__name__}: {error}")
    row["wall_s"] = perf_counter() - started
    return row, kept.getvalue() or None


@lru_cache(maxsize=4)
def find_scene(
    source: Source, seed: int | None, changes: str, data: str | None
) -> Scenario:
    """Return the scene; controllers that come one after the other share it."""
    document = changed(source.sample(seed), json.loads(changes))
    path = Path(getattr(source, "path", source.name))
    return make_scenario(document, source.name, path, data)
