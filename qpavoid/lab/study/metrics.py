"""Metrics of one run: pure functions of its log."""

import math
from typing import TypeAlias

import numpy as np

from qpavoid.avoidance.decision import STATUSES
from qpavoid.lab.simulation.log import NO_BACK_END, Log
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.model.footprint import Array
from qpavoid.model.kinematics import wrap_angle

Value: TypeAlias = str | int | float | bool | None
Metrics: TypeAlias = dict[str, Value]


def metrics(log: Log) -> Metrics:
    """Return all metrics of a run; ``None`` where one does not apply."""
    return {
        **{key: log.meta[key] for key in ("scenario", "controller", "solver")},
        "outcome": outcome(log),
        **zone(log),
        **tracking(log),
        **motion(log),
        **effort(log),
        **noted(log),
    }


def outcome(log: Log) -> str:
    """Return what became of the run in a word.

    ``touched``: the footprint met an obstacle. Else ``arrived``: it ended within the
    scenario's tolerance of the final reference. Else ``stalled``: in the last second it
    wanted to move on and did not get 2 cm far. Else ``off goal``.
    """
    if log["least_clearance_m"].min() < 0.0:
        return "touched"
    final_error, heading_error = _final_errors(log)
    near, aligned = log.meta["arrival"]
    if final_error <= near and abs(heading_error) <= aligned:
        return "arrived"
    last = log["t_s"] > log["t_s"][-1] - 1.0
    wanted = np.abs(log["v_desired_mps"][last]).mean()
    moved = np.hypot(np.ptp(log["x_m"][last]), np.ptp(log["y_m"][last]))
    return "stalled" if wanted > 0.02 and moved < 0.02 else "off goal"


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
    least = float(clearance.min())
    return {
        "zone_entry_s": entry,
        "zone_exit_s": exit_,
        "zone_duration_s": duration,
        "min_clearance_m": least if math.isfinite(least) else None,
        "time_below_r_s": dt * len(inside),
        "time_below_r_min_s": dt * int((clearance < log["r_min_m"] - 1e-4).sum()),
    }


def tracking(log: Log) -> Metrics:
    """Return distances from the reference over the run and at its end."""
    error = np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"])
    final_error, heading_error = _final_errors(log)
    return {
        "rms_error_m": float(np.sqrt(np.mean(error**2))),
        "max_error_m": float(error.max()),
        "final_error_m": final_error,
        "final_heading_error_rad": heading_error,
    }


def motion(log: Log) -> Metrics:
    """Return path length, extreme speeds, and roughness.

    Roughness is the mean |Δv|/dt (m/s²) and |Δω|/dt (rad/s²) of successive commands.
    """
    dt = log.meta["dt_s"]
    return {
        "path_length_m": float(np.abs(log["v_mps"]).sum() * dt),
        "v_min_mps": float(log["v_mps"].min()),
        "v_max_mps": float(log["v_mps"].max()),
        "omega_min_radps": float(log["omega_radps"].min()),
        "omega_max_radps": float(log["omega_radps"].max()),
        "roughness_v_mps2": _roughness(log["v_mps"], dt),
        "roughness_omega_radps2": _roughness(log["omega_radps"], dt),
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


def noted(log: Log) -> Metrics:
    """Return when it arrived for good, clearance less r_min, and time changed."""
    outcome = outcome_of(log)
    names = {"arrived_s": "arrived", "min_room_m": "room", "changed_s": "changed"}
    values = {key: float(outcome[name][0]) for key, name in names.items()}
    return {k: v if math.isfinite(v) else None for k, v in values.items()}


def _final_errors(log: Log) -> tuple[float, float]:
    x, y, heading = log.final
    x_r, y_r, heading_r = log.final_reference[:3]
    return math.hypot(x_r - x, y_r - y), float(wrap_angle(heading_r - heading))


def _roughness(command: Array, dt: float) -> float:
    return float(np.abs(np.diff(command)).mean() / dt) if len(command) > 1 else 0.0
