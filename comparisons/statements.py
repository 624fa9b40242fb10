"""What the paper says of its test cases, each sentence held against our runs."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.metrics import Metrics, metrics
from qpavoid.lab.study.tables import markdown_table
from qpavoid.types import Array

Runs = Mapping[str, Log]
"""Logs of one test case by controller."""


class Statement(NamedTuple):
    """A sentence of the paper, what is measured for it, and whether that agrees."""

    case: str
    text: str
    measure: Callable[[Runs], str]
    holds: Callable[[Runs], bool]


@lru_cache(maxsize=16)
def numbers_of(log: Log) -> Metrics:
    return metrics(log)


def value(runs: Runs, law: str, key: str) -> float:
    return float(numbers_of(runs[law])[key] or 0.0)


def both(key: str, unit: str) -> Callable[[Runs], str]:
    return lambda runs: ", ".join(
        f"{name} {value(runs, law, key):.4g} {unit}"
        for name, law in (("Eq. 5", "eq5"), ("Eq. 7", "eq7"))
    )


def recovered(log: Log) -> float:
    """Return the last time, s, at which the robot was 5 cm off its plan."""
    error = np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"])
    late = np.flatnonzero(error > 0.05)
    return float(log["t_s"][late[-1]]) if len(late) else 0.0


def turned(log: Log) -> Array:
    """Return by how much the heading is off its plan, step by step, °."""
    off = log["heading_rad"] - log["heading_ref_rad"]
    return np.degrees(np.arctan2(np.sin(off), np.cos(off)))


def rms_turned(log: Log) -> float:
    return float(np.sqrt(np.mean(turned(log) ** 2)))


def restored(log: Log) -> float:
    """Return the last time, s, at which the pose was 5 cm or 5° off its plan."""
    late = np.flatnonzero(np.abs(turned(log)) > 5.0)
    return max(recovered(log), float(log["t_s"][late[-1]]) if len(late) else 0.0)


def restlessness(log: Log) -> float:
    """Return the mean |Δω|/dt, rad/s², from when the zone was last left."""
    left = np.flatnonzero(log["clearance_m"] < log["r_m"])[-1]
    return float(np.abs(np.diff(log["omega_radps"][left:])).mean() / log.meta["dt_s"])


def slowest(log: Log) -> float:
    """Return the least v, m/s, from the first time that the zone was entered."""
    inside = np.flatnonzero(log["clearance_m"] < log["r_m"])
    return float(log["v_mps"][inside[0] : inside[-1]].min())


ONE, TWO = "paper/test_case_1", "paper/test_case_2"
CENTRE = "paper/test_case_2_centre"
FLAT, TIP = "paper/figure_2a", "paper/figure_2b"
MORE = CENTRE, FLAT, TIP

STATEMENTS = (
    Statement(
        FLAT,
        "Before the front edge of a rectangle the robot backs up straight, comes back, "
        "and stalls (method 1).",
        lambda runs: (
            f"v down to {slowest(runs['eq5']):.2f} m/s, turning at most "
            f"{np.abs(runs['eq5']['omega_radps']).max():.2g} rad/s, ends "
            f"{value(runs, 'eq5', 'final_error_m'):.2f} m short"
        ),
        lambda runs: (
            slowest(runs["eq5"]) < 0.0
            and np.abs(runs["eq5"]["omega_radps"]).max() < 1e-6
            and value(runs, "eq5", "final_error_m") > 1.0
        ),
    ),
    Statement(
        TIP,
        "With the tip it goes round.",
        both("final_error_m", "m off"),
        lambda runs: all(
            value(runs, law, "final_error_m") < 0.5
            and value(runs, law, "min_clearance_m") > 0.17
            for law in ("eq5", "eq7")
        ),
    ),
    Statement(
        ONE,
        "Between 5 and 10 s, near the obstacle, the path deviates from the plan.",
        lambda runs: ", ".join(
            f"{name} in the zone {value(runs, law, 'zone_entry_s'):.2f} to "
            f"{value(runs, law, 'zone_exit_s'):.2f} s"
            for name, law in (("Eq. 5", "eq5"), ("Eq. 7", "eq7"))
        ),
        lambda runs: all(
            4.75 < value(runs, law, "zone_entry_s") < 5.25
            and value(runs, law, "zone_exit_s") < 10.5
            for law in ("eq5", "eq7")
        ),
    ),
    Statement(
        ONE,
        "Method 1 backs up now and then.",
        lambda runs: f"v down to {slowest(runs['eq5']):.2f} m/s",
        lambda runs: slowest(runs["eq5"]) < 0.0,
    ),
    Statement(
        ONE,
        "Method 2 does not.",
        lambda runs: f"v down to {slowest(runs['eq7']):.2f} m/s",
        lambda runs: slowest(runs["eq7"]) >= 0.0,
    ),
    Statement(
        ONE,
        "Method 2 recovers the path more quickly than method 1.",
        lambda runs: (
            f"within 5 cm from {recovered(runs['eq7']):.1f} s on, method 1 "
            f"from {recovered(runs['eq5']):.1f} s"
        ),
        lambda runs: recovered(runs["eq7"]) < recovered(runs["eq5"]),
    ),
    Statement(
        ONE,
        "The destination is reached with the correct orientation.",
        both("final_error_m", "m off"),
        lambda runs: all(
            metrics(runs[law])["outcome"] == "arrived" for law in ("eq5", "eq7")
        ),
    ),
    Statement(
        ONE,
        "Method 1 keeps a slightly greater distance than method 2 (and, two sentences "
        "on, the contrary).",
        both("min_clearance_m", "m"),
        lambda runs: (
            value(runs, "eq5", "min_clearance_m")
            > value(runs, "eq7", "min_clearance_m")
        ),
    ),
    Statement(
        ONE,
        "Method 2 is smoother (section 4).",
        both("roughness_omega_radps2", "rad/s² mean |Δω|/dt"),
        lambda runs: (
            value(runs, "eq7", "roughness_omega_radps2")
            < value(runs, "eq5", "roughness_omega_radps2")
        ),
    ),
    Statement(
        TWO,
        "Both methods detect the obstacle at 2.9 s.",
        both("zone_entry_s", "s"),
        lambda runs: all(
            abs(value(runs, law, "zone_entry_s") - 2.9) <= 0.1 for law in ("eq5", "eq7")
        ),
    ),
    Statement(
        TWO,
        "Method 1 leaves the safety beam at 11.1 s, method 2 at 14.1 s.",
        both("zone_exit_s", "s"),
        lambda runs: (
            abs(value(runs, "eq5", "zone_exit_s") - 11.1) <= 0.1
            and abs(value(runs, "eq7", "zone_exit_s") - 14.1) <= 0.1
        ),
    ),
    Statement(
        TWO,
        "Method 1 keeps a safer distance; method 2 comes close to the minimum.",
        both("min_clearance_m", "m"),
        lambda runs: (
            value(runs, "eq5", "min_clearance_m") > 0.17
            and abs(value(runs, "eq7", "min_clearance_m") - 0.17) < 0.02
        ),
    ),
    Statement(
        TWO,
        "Method 2 shows significant fluctuations in ω, method 1 is smooth.",
        both("roughness_omega_radps2", "rad/s² mean |Δω|/dt"),
        lambda runs: (
            value(runs, "eq5", "roughness_omega_radps2")
            < 0.1 * value(runs, "eq7", "roughness_omega_radps2")
        ),
    ),
    Statement(
        TWO,
        "Once the obstacle has passed, the robot returns to its original position.",
        both("final_error_m", "m off"),
        lambda runs: all(
            value(runs, law, "final_error_m") < 0.01 for law in ("eq5", "eq7")
        ),
    ),
    Statement(
        TWO,
        "Method 1 keeps closer to the planned trajectory (Figure 10: x, y and γ).",
        lambda runs: (
            f"γ: Eq. 5 {rms_turned(runs['eq5']):.1f}° rms, "
            f"Eq. 7 {rms_turned(runs['eq7']):.1f}°; "
            f"x and y: {both('rms_error_m', 'm rms')(runs)}"
        ),
        lambda runs: rms_turned(runs["eq5"]) < rms_turned(runs["eq7"]),
    ),
    Statement(
        TWO,
        "Method 1 recovers sooner.",
        lambda runs: (
            f"within 5 cm and 5° from {restored(runs['eq5']):.1f} s on, method 2 "
            f"from {restored(runs['eq7']):.1f} s"
        ),
        lambda runs: restored(runs["eq5"]) < restored(runs["eq7"]),
    ),
    Statement(
        TWO,
        "Method 1 recovers more smoothly.",
        lambda runs: (
            f"after the zone {restlessness(runs['eq5']):.3g} rad/s² mean |Δω|/dt, "
            f"method 2 {restlessness(runs['eq7']):.3g} rad/s²"
        ),
        lambda runs: restlessness(runs["eq5"]) < restlessness(runs["eq7"]),
    ),
    Statement(
        CENTRE,
        "Method 2 is unable to avoid obstacles that pass close to the centre.",
        both("min_clearance_m", "m"),
        lambda runs: (
            value(runs, "eq7", "min_clearance_m")
            < 0.0
            < value(runs, "eq5", "min_clearance_m")
        ),
    ),
)


def statement_table(
    runs: Mapping[tuple[str, str], Log], shares: Mapping[str, str]
) -> str:
    """Return all statements as a Markdown table.

    Args:
        runs: Logs by scenario and law.
        shares: Of the calibrations in which it holds, by statement, where known.
    """
    lines = []
    for case, text, measure, holds in STATEMENTS:
        logs = {law: log for (scenario, law), log in runs.items() if scenario == case}
        verdict = "yes" if holds(logs) else "**no**"
        share = shares.get(text, "")
        lines.append(
            [
                case.removeprefix("paper/").replace("_", " "),
                text,
                measure(logs),
                verdict,
                share,
            ]
        )
    heads = ["case", "the paper says", "measured", "reproduced", "of calibrations"]
    return markdown_table(heads, lines)
