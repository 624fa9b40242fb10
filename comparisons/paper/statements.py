"""Statements of the paper about its footprint and its test cases, tested on runs.

``statements.toml`` has each sentence, or part of one, letter by letter, with the
reading that is tested here; another reading may have another result. Judgements
(*robust*, *flexible*, *efficient*) are left out.

Run: python comparisons/paper/calibrations.py
"""

import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from measures import (
    WIDTH,
    Runs,
    astray,
    backwards,
    before_zone,
    both,
    by_angle,
    by_strength,
    by_tip,
    circle_about,
    entered,
    fastest_turn,
    final,
    fluctuation,
    greatest_change,
    held_back,
    inside,
    least_clearance,
    left,
    nearest_at,
    numbers_of,
    off,
    recovered,
    recovery_after_exit,
    restored,
    retreat,
    rises,
    rms,
    rms_turned,
    roughness,
    roughness_after,
    share_of_both,
    sign_changes,
    slowest,
    throughout,
    turned,
    values,
)
from qpavoid.lab.simulation.log import Log

SHAPE = "footprint"
"""Case of the statements about the footprint, which need no run."""

FLAT, PASSING = "paper/figure_2a", "paper/figure_2a_passing"
TIP = "paper/figure_2b"
ONE, TWO = "paper/test_case_1", "paper/test_case_2"
CENTRE = "paper/test_case_2_centre"
CASES = PASSING, FLAT, TIP, ONE, TWO, CENTRE
"""Scenarios of the statements."""

Test: TypeAlias = tuple[Callable[[Runs], str], Callable[[Runs], bool]]
"""Measured values of the runs of a case in words, and whether the statement holds."""


def strengthened(pick: int) -> str:
    """Return the distances at each repulsive velocity in words."""
    return "; ".join(
        f"Eq. {law[-1]} " + ", ".join(f"{x:.3g}" for x in by_strength(law)[pick]) + " m"
        for law in ("eq5", "eq7")
    )


def period_off(runs: Runs, degrees: float) -> str:
    """Return from when to when each law is off its plan, in words."""
    return ", ".join(
        "Eq. {} {:.1f} to {:.1f} s".format(law[-1], *astray(runs[law], degrees))
        for law in ("eq5", "eq7")
    )


def lower(of: Callable[[Log], float], unit: str, law: str) -> Test:
    """Return the test that a number is lower for one law than for the other."""
    other = "eq7" if law == "eq5" else "eq5"
    return values(of, unit), lambda runs: of(runs[law]) < of(runs[other])


def each(of: Callable[[Log], float], unit: str, test: Callable[[float], bool]) -> Test:
    """Return the test that a number of each law passes a test."""
    return values(of, unit), both(lambda log: test(of(log)))


TESTS: dict[str, Test] = {
    "divisor": (
        lambda runs: by_tip(by_angle(1), "m at worst"),
        lambda runs: by_angle(1)[0] > 0.0 > by_angle(1)[1],
    ),
    "turn_of_tip": (
        lambda runs: by_tip(by_angle(0), "rad/s per m/s"),
        lambda runs: rises(by_angle(0)),
    ),
    "length_of_tip": (
        lambda runs: by_tip(by_angle(2), "m"),
        lambda runs: rises(by_angle(2)),
    ),
    "circle": (
        lambda runs: (
            f"by {circle_about()[0] - 0.5 * WIDTH:.2f} m; it has "
            f"{circle_about()[1]:.2f} times the area"
        ),
        lambda runs: circle_about()[0] > 0.5 * WIDTH,
    ),
    "distance_by_strength": (
        lambda runs: strengthened(0),
        lambda runs: all(rises(by_strength(law)[0]) for law in ("eq5", "eq7")),
    ),
    "error_by_strength": (
        lambda runs: strengthened(1),
        lambda runs: all(rises(by_strength(law)[1]) for law in ("eq5", "eq7")),
    ),
    "retreat": (
        lambda runs: (
            f"retreats {retreat(runs['eq5']):.3f} m, "
            f"{1000.0 * np.abs(runs['eq5']['y_m']).max():.2g} mm sideways"
        ),
        lambda runs: (
            retreat(runs["eq5"]) >= 0.02 and np.abs(runs["eq5"]["y_m"]).max() <= 0.001
        ),
    ),
    "return_in_figure": (
        lambda runs: f"{1000.0 * final(runs['eq5']):.2g} mm off",
        lambda runs: final(runs["eq5"]) <= 0.01,
    ),
    "stall": (
        lambda runs: (
            f"{final(runs['eq5']):.2f} m short, v changes its sign "
            f"{np.count_nonzero(np.diff(np.sign(runs['eq5']['v_mps'])))} times"
        ),
        lambda runs: final(runs["eq5"]) > 1.0 and bool(inside(runs["eq5"])[-1]),
    ),
    "both_velocities": (
        lambda runs: f"in {100.0 * share_of_both(runs['eq5']):.0f} % of them",
        lambda runs: share_of_both(runs["eq5"]) > 0.5,
    ),
    "passing": (
        lambda runs: (
            f"{values(lambda log: float(log.final[0]), 'm along x')(runs)}; "
            f"{values(least_clearance, 'm near')(runs)}; "
            f"{values(final, 'm off at the end')(runs)}"
        ),
        both(lambda log: log.final[0] > 4.0 and least_clearance(log) > 0.17),
    ),
    "heading_before": (
        values(
            lambda log: float(np.abs(turned(log)[before_zone(log)]).max()),
            "°",
        ),
        both(lambda log: bool(np.abs(turned(log)[before_zone(log)]).max() < 0.1)),
    ),
    "path_before": (
        values(
            lambda log: 1000.0 * float(off(log)[before_zone(log)].max()),
            "mm",
        ),
        both(lambda log: bool(off(log)[before_zone(log)].max() < 0.001)),
    ),
    "deviation": (
        lambda runs: period_off(runs, math.inf),
        both(
            lambda log: (
                4.75 < astray(log)[0]
                and 4.75 < float(log["t_s"][off(log).argmax()]) < 10.25
            )
        ),
    ),
    "backwards_at_times": (
        lambda runs: (
            f"v down to {slowest(runs['eq5']):.2f} m/s, negative in "
            f"{100.0 * backwards(runs['eq5']):.0f} % of the steps there"
        ),
        lambda runs: 0.0 < backwards(runs["eq5"]) < 0.5,
    ),
    "only_rotation": (
        lambda runs: f"less by {held_back(runs['eq7']):.2g} m/s",
        lambda runs: held_back(runs["eq7"]) < 1e-9,
    ),
    "bypass": lower(left, "s", "eq7"),
    "recovery": lower(recovered, "s", "eq7"),
    "inversion": (
        lambda runs: (
            f"backwards in {100.0 * backwards(runs['eq5']):.0f} % of the steps there; "
            f"{values(recovered, 's')(runs)}"
        ),
        lambda runs: (
            backwards(runs["eq5"]) > 0.0
            and recovered(runs["eq5"]) > recovered(runs["eq7"])
        ),
    ),
    "approach": (
        lambda runs: f"{least_clearance(runs['eq7']):.3f} m of 0.17 m",
        lambda runs: least_clearance(runs["eq7"]) >= 0.16,
    ),
    "greater_distance": lower(least_clearance, "m", "eq7"),
    "time_of_minimum": each(nearest_at, "s", lambda time: 5.0 <= time <= 10.0),
    "lower_distance": lower(least_clearance, "m", "eq5"),
    "margin": (
        lambda runs: f"{least_clearance(runs['eq5']):.3f} m of 0.17 m",
        lambda runs: least_clearance(runs["eq5"]) >= 0.16,
    ),
    "orientation": (
        values(final, "m off"),
        both(lambda log: numbers_of(log)["outcome"] == "arrived"),
    ),
    "smoothness": lower(roughness, "rad/s²", "eq7"),
    "deviations": lower(rms, "m", "eq7"),
    "sudden": lower(greatest_change, "rad/s²", "eq7"),
    "sign_of_eq7": (
        values(sign_changes, "times"),
        lambda runs: sign_changes(runs["eq7"]) == 0 < sign_changes(runs["eq5"]),
    ),
    "sign_of_both": each(sign_changes, "times", lambda count: count == 0),
    "entry": each(entered, "s", lambda time: abs(time - 2.9) <= 0.1),
    "exit": (
        values(left, "s"),
        lambda runs: (
            abs(left(runs["eq5"]) - 11.1) <= 0.1
            and abs(left(runs["eq7"]) - 14.1) <= 0.1
        ),
    ),
    "return_1_cm": each(final, "m off", lambda error: error < 0.01),
    "return_2_cm": each(final, "m off", lambda error: error < 0.02),
    "return_5_cm": each(final, "m off", lambda error: error < 0.05),
    "return_10_cm": each(final, "m off", lambda error: error < 0.1),
    "moves_backwards": (
        lambda runs: f"v down to {slowest(runs['eq5']):.2f} m/s",
        lambda runs: slowest(runs["eq5"]) < 0.0,
    ),
    "both_deviate": (
        lambda runs: period_off(runs, 5.0),
        both(lambda log: astray(log, 5.0)[1] > 3.0 and astray(log, 5.0)[0] < 12.0),
    ),
    "heading_error": (
        lambda runs: f"{values(rms_turned, '°')(runs)}; {values(rms, 'm')(runs)}",
        lambda runs: rms_turned(runs["eq5"]) < rms_turned(runs["eq7"]),
    ),
    "quicker": lower(restored, "s", "eq5"),
    "quicker_since_exit": lower(recovery_after_exit, "s", "eq5"),
    "smoother": lower(roughness_after, "rad/s²", "eq5"),
    "slower_turns": lower(fastest_turn, "rad/s", "eq5"),
    "fluctuation": (
        lambda runs: (
            f"{values(roughness, 'rad/s²')(runs)}: {fluctuation(runs):.3g} times"
        ),
        lambda runs: fluctuation(runs) >= 2.0,
    ),
    "spikes": lower(greatest_change, "rad/s²", "eq5"),
    "separation": (
        lambda runs: f"nearer by {throughout(runs):.3f} m at most",
        lambda runs: throughout(runs) <= 0.001,
    ),
    "safer_distance": (
        values(least_clearance, "m"),
        lambda runs: (
            least_clearance(runs["eq5"]) > max(least_clearance(runs["eq7"]), 0.17)
        ),
    ),
    "near_r_min": (
        values(least_clearance, "m"),
        lambda runs: abs(least_clearance(runs["eq7"]) - 0.17) < 0.02,
    ),
    "near_centre": (
        values(least_clearance, "m"),
        lambda runs: least_clearance(runs["eq7"]) < 0.0 < least_clearance(runs["eq5"]),
    ),
}
"""Test of each statement by its name in ``statements.toml``."""


class Statement(NamedTuple):
    """Statement of the paper and its test on the runs of its case."""

    case: str  # scenario, or SHAPE
    section: str  # of the paper
    words: str  # its own, letter by letter
    read: str  # reading that is tested
    measure: Callable[[Runs], str]  # measured values in words
    holds: Callable[[Runs], bool]


def read_statements() -> tuple[Statement, ...]:
    """Return all statements, in the order of ``statements.toml``."""
    path = Path(__file__).with_name("statements.toml")
    found = []
    for row in tomllib.loads(path.read_text(encoding="utf-8"))["statement"]:
        case = row["case"] if row["case"] == SHAPE else f"paper/{row['case']}"
        words = row["section"], row["words"], row["read"]
        found.append(Statement(case, *words, *TESTS[row["test"]]))
    return tuple(found)


STATEMENTS = read_statements()


def of_case(case: str) -> list[Statement]:
    """Return the statements of a case."""
    return [statement for statement in STATEMENTS if statement.case == case]


def statement_rows(
    runs: Mapping[tuple[str, str], Log],
) -> list[tuple[Statement, str, bool]]:
    """Return every statement with its measured values and whether it holds.

    Args:
        runs: Logs by scenario and law.
    """
    found = []
    for statement in STATEMENTS:
        case = statement.case
        logs = {law: log for (name, law), log in runs.items() if name == case}
        found.append((statement, statement.measure(logs), statement.holds(logs)))
    return found
