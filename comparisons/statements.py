"""What the paper says of its test cases, each sentence held against our runs."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.metrics import metrics
from qpavoid.lab.study.tables import markdown_table

Runs = Mapping[str, Log]
"""Logs of one test case by controller."""


class Statement(NamedTuple):
    """A sentence of the paper, what is measured for it, and whether that agrees."""

    case: str
    text: str
    measure: Callable[[Runs], str]
    holds: Callable[[Runs], bool]


def value(runs: Runs, law: str, key: str) -> float:
    return float(metrics(runs[law])[key] or 0.0)


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


def slowest(log: Log) -> float:
    """Return the least v, m/s, from the first time that the zone was entered."""
    inside = np.flatnonzero(log["clearance_m"] < log["r_m"])
    return float(log["v_mps"][inside[0] : inside[-1]].min())


ONE, TWO = "paper/test_case_1", "paper/test_case_2"

STATEMENTS = (
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
        "Method 1 stays closer to the planned position.",
        both("rms_error_m", "m rms"),
        lambda runs: (
            value(runs, "eq5", "rms_error_m") < value(runs, "eq7", "rms_error_m")
        ),
    ),
)


def statement_table(runs: Mapping[tuple[str, str], Log]) -> str:
    """Return all statements as a Markdown table; logs are by (scenario, law)."""
    lines = []
    for case, text, measure, holds in STATEMENTS:
        logs = {law: log for (scenario, law), log in runs.items() if scenario == case}
        verdict = "yes" if holds(logs) else "**no**"
        lines.append([case[-1], text, measure(logs), verdict])
    return markdown_table(["case", "the paper says", "measured", "reproduced"], lines)
