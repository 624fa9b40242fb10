"""Metrics of one run: pure functions of its log."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeAlias, TypeVar

import numpy as np

from qpavoid.avoidance.decision import STATUSES
from qpavoid.lab.scenario.methods import NO_BACK_END
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.outcome import finite, outcome_of, verdict
from qpavoid.model.kinematics import wrap_angle
from qpavoid.types import Array

Value: TypeAlias = str | int | float | bool | None
Metrics: TypeAlias = dict[str, Value]
T = TypeVar("T")

NAMED = ("scenario", "controller", "solver", "number")
"""Keys that identify a row's run; ``number``: of a robot among several."""

BELOW = 1e-4
"""m that a clearance must lack of r_min: the filter, which keeps it to just that much,
is not below it by rounding."""


def metrics(log: Log) -> Metrics:
    """Return all metrics of a run; ``None`` where one does not apply.

    Final errors are those from the reference, ``rms_error_m`` is over the run.
    Roughness is the mean |Δv|/dt (m/s²) and |Δω|/dt (rad/s²) of successive commands.
    """
    noted = outcome_of(log)
    v, omega, dt = log["v_mps"], log["omega_radps"], log.meta["dt_s"]
    error = np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"])
    turn = float(wrap_angle(log.final_reference[2] - log.final[2]))
    return {
        **{key: log.meta[key] for key in NAMED if key in log.meta},
        "outcome": verdict(noted),
        **zone(log),
        **{name: finite(number) for name, number in noted.items()},
        "final_heading_error_rad": turn,
        "rms_error_m": float(np.sqrt(np.mean(error**2))),
        "v_min_mps": float(v.min()),
        "v_max_mps": float(v.max()),
        "omega_min_radps": float(omega.min()),
        "omega_max_radps": float(omega.max()),
        "roughness_v_mps2": _roughness(v, dt),
        "roughness_omega_radps2": _roughness(omega, dt),
        **effort(log),
    }


def run_name(run: Mapping[str, Any]) -> str:
    """Return what the files of a run are called, on every file system."""
    name = f"{run['scenario']}-{run['controller']}"
    name += f"-{run['number']}" if run.get("number") is not None else ""
    return name.replace("/", "-").replace(":", ".")


def by_fleet(
    runs: Iterable[T], meta: Callable[[T], Mapping[str, Any]]
) -> list[list[T]]:
    """Return runs, robot after robot, in lists of those that ran together."""
    fleets: list[list[T]] = []
    for run in runs:
        # Number 0, or none, of a robot alone: a new fleet begins.
        if not meta(run).get("number"):
            fleets.append([])
        fleets[-1].append(run)
    return fleets


def tally(words: Iterable[Value]) -> str:
    """Return how often each word was said."""
    counts = Counter(map(str, words)).most_common()
    return ", ".join(f"{count} {word}" for word, count in counts)


def zone(log: Log) -> Metrics:
    """Return when the nearest obstacle was inside r, and how near it came.

    Entry is the time of the first step that starts with a clearance below r, exit the
    end of the last one; from entry to exit the zone may have been left in between.
    A time below r_min counts where r_min is missed by more than 0.1 mm.
    """
    inside = np.flatnonzero(log["clearance_m"] < log["r_m"])
    entry = exit_ = duration = None
    dt = log.meta["dt_s"]
    if len(inside):
        entry = float(log["t_s"][inside[0]])
        exit_ = float(log["t_s"][inside[-1]] + dt)
        duration = exit_ - entry
    clearance = log["least_clearance_m"]
    return {
        "zone_entry_s": entry,
        "zone_exit_s": exit_,
        "zone_duration_s": duration,
        "time_below_r_s": dt * len(inside),
        "time_below_r_min_s": dt * int((clearance < log["r_min_m"] - BELOW).sum()),
    }


def effort(log: Log) -> Metrics:
    """Return solve times of the QP, and how often each status was met."""
    microseconds = 1e6 * log["solve_time_s"]
    solved = log.meta["solver"] not in NO_BACK_END
    numbers, counts = np.unique(log["status"].astype(int), return_counts=True)
    return {
        "solve_median_us": float(np.median(microseconds)) if solved else None,
        "solve_p99_us": float(np.percentile(microseconds, 99)) if solved else None,
        "solve_max_us": float(microseconds.max()) if solved else None,
        "max_slack_mps": float(log["slack_mps"].max()) if solved else None,
        "statuses": " ".join(
            f"{STATUSES[i]}:{n}" for i, n in zip(numbers, counts, strict=True)
        ),
    }


def _roughness(command: Array, dt: float) -> float:
    return float(np.abs(np.diff(command)).mean() / dt) if len(command) > 1 else 0.0
