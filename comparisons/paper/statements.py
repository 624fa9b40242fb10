"""What the paper says of its footprint and its test cases, held against our runs.

Every statement is a sentence, or the part of one, letter by letter, with what it is
taken to mean: another reading may come out otherwise. What is a judgement (*robust*,
*flexible*, *efficient*), and not to be measured in a run, is left out.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.tables import markdown_table
from statement_measures import (
    STRENGTHS,
    WIDTH,
    Runs,
    afterwards,
    astray,
    backwards,
    both,
    by_angle,
    by_strength,
    circle_about,
    entered,
    fastest_turn,
    final,
    fluctuation,
    held_back,
    inside,
    left,
    less,
    lively,
    nearest_at,
    numbered,
    numbers_of,
    off,
    outset,
    recovered,
    restlessness,
    restored,
    retreat,
    rises,
    rms,
    rms_turned,
    room,
    slowest,
    sudden,
    throughout,
    together,
    told,
    turned,
    turned_back,
    within,
)

SHAPE = "footprint"
"""The case of what is said of the footprint: no run is looked at."""

FLAT, PASSING = "paper/figure_2a", "paper/figure_2a_passing"
TIP = "paper/figure_2b"
ONE, TWO = "paper/test_case_1", "paper/test_case_2"
CENTRE = "paper/test_case_2_centre"
MORE = FLAT, PASSING, TIP, CENTRE
"""Scenarios beside the two test cases."""


SPEEDS = ", ".join(f"{x:g}" for x in STRENGTHS) + " m/s"


def strengthened(pick: int) -> str:
    """Return what each repulsive velocity gives, in words."""
    return "; ".join(
        f"Eq. {law[-1]} " + ", ".join(f"{x:.3g}" for x in by_strength(law)[pick]) + " m"
        for law in ("eq5", "eq7")
    )


class Statement(NamedTuple):
    """What the paper says, and whether our runs agree.

    Attributes:
        case: The scenario whose runs are looked at, or :data:`SHAPE`.
        where: Section of the paper.
        words: Its own, letter by letter.
        read: What they are taken to mean.
        measure: What is measured for it, in words.
        holds: Whether that agrees.
    """

    case: str
    where: str
    words: str
    read: str
    measure: Callable[[Runs], str]
    holds: Callable[[Runs], bool]


STATEMENTS = (
    Statement(
        SHAPE,
        "2",
        "To ensure that the platform rotates in the correct direction, the following "
        "geometric condition must be satisfied",
        "Eq. 7's divisor has one sign along the tip at 40°, and not at 30°",
        lambda runs: numbered(by_angle(1), "m at worst"),
        lambda runs: by_angle(1)[0] > 0.0 > by_angle(1)[1],
    ),
    Statement(
        SHAPE,
        "2",
        "results in a greater contribution from the angular velocity",
        "ω of Eq. 5 at the middle of an edge grows with the tip's angle",
        lambda runs: numbered(by_angle(0), "rad/s per m/s"),
        lambda runs: rises(by_angle(0)),
    ),
    Statement(
        SHAPE,
        "2",
        "the tip of the robot may become excessively large",
        "how far it sticks out grows with its angle; what is excessive is not said",
        lambda runs: numbered(by_angle(2), "m"),
        lambda runs: rises(by_angle(2)),
    ),
    Statement(
        SHAPE,
        "5",
        "conventional circular models, which tend to overestimate safety margins",
        "the least circle about the footprint sticks out beside it",
        lambda runs: (
            f"by {circle_about()[0] - 0.5 * WIDTH:.2f} m; it has "
            f"{circle_about()[1]:.2f} times the area"
        ),
        lambda runs: circle_about()[0] > 0.5 * WIDTH,
    ),
    Statement(
        SHAPE,
        "2",
        "more aggressive avoidance behaviour, which increases safety",
        f"test case 1: the least distance grows with the repulsive velocity, {SPEEDS}",
        lambda runs: strengthened(0),
        lambda runs: all(rises(by_strength(law)[0]) for law in ("eq5", "eq7")),
    ),
    Statement(
        SHAPE,
        "2",
        "may compromise trajectory accuracy",
        f"test case 1: the rms distance from the plan grows with it, {SPEEDS}",
        lambda runs: strengthened(1),
        lambda runs: all(rises(by_strength(law)[1]) for law in ("eq5", "eq7")),
    ),
    Statement(
        PASSING,
        "2, Figure 2a",
        "causing the robot to move backwards along a straight path",
        "Eq. 5 retreats 2 cm or more, and leaves its line by 1 mm at most",
        lambda runs: (
            f"retreats {retreat(runs['eq5']):.3f} m, "
            f"{1000.0 * np.abs(runs['eq5']['y_m']).max():.2g} mm sideways"
        ),
        lambda runs: (
            retreat(runs["eq5"]) >= 0.02 and np.abs(runs["eq5"]["y_m"]).max() <= 0.001
        ),
    ),
    Statement(
        PASSING,
        "2, Figure 2a",
        "the control system orders the platform to return to its previous position",
        "Eq. 5 ends within 1 cm",
        lambda runs: f"{1000.0 * final(runs['eq5']):.2g} mm off",
        lambda runs: final(runs["eq5"]) <= 0.01,
    ),
    Statement(
        FLAT,
        "2, Figure 2a",
        "resulting in a repetitive stall scenario",
        "Eq. 5 ends in the zone more than 1 m short; how often v changes its sign",
        lambda runs: (
            f"{final(runs['eq5']):.2f} m short, v changes its sign "
            f"{np.count_nonzero(np.diff(np.sign(runs['eq5']['v_mps'])))} times"
        ),
        lambda runs: final(runs["eq5"]) > 1.0 and bool(inside(runs["eq5"])[-1]),
    ),
    Statement(
        TIP,
        "2, Figure 2b",
        "the simultaneous generation of rotational and translational velocities",
        "Eq. 5 changes v and ω both in most of the steps in the zone",
        lambda runs: f"in {100.0 * together(runs['eq5']):.0f} % of them",
        lambda runs: together(runs["eq5"]) > 0.5,
    ),
    Statement(
        TIP,
        "2, Figure 2b",
        "allowing the robot to circumvent obstacles more effectively",
        "both get past the disc and keep r_min",
        lambda runs: (
            f"{told(lambda log: float(log.final[0]), 'm along x')(runs)}; "
            f"{told(room, 'm near')(runs)}; {told(final, 'm off at the end')(runs)}"
        ),
        both(lambda log: log.final[0] > 4.0 and room(log) > 0.17),
    ),
    Statement(
        ONE,
        "Abstract",
        "The robot's direction only changes when the obstacle enters the zone of "
        "influence.",
        "before that its heading is within 0.1° of the plan's",
        told(lambda log: float(np.abs(turned(log)[outset(log)]).max()), "°"),
        both(lambda log: bool(np.abs(turned(log)[outset(log)]).max() < 0.1)),
    ),
    Statement(
        ONE,
        "3.1",
        "to faithfully follow the desired trajectory",
        "before the zone it is within 1 mm of the plan",
        told(lambda log: 1000.0 * float(off(log)[outset(log)].max()), "mm"),
        both(lambda log: bool(off(log)[outset(log)].max() < 0.001)),
    ),
    Statement(
        ONE,
        "3.1",
        "a deviation of the trajectory from the planned path is observed",
        "between 5 and 10 s: the first 5 cm and the greatest lie there; from when to "
        "when it is 5 cm off",
        lambda runs: ", ".join(
            "Eq. {} {:.1f} to {:.1f} s".format(law[-1], *astray(log))
            for law, log in sorted(runs.items())
            if law in ("eq5", "eq7")
        ),
        both(
            lambda log: (
                4.75 < astray(log)[0]
                and 4.75 < float(log["t_s"][off(log).argmax()]) < 10.25
            )
        ),
    ),
    Statement(
        ONE,
        "3.1",
        "resulting in a total velocity v that occasionally becomes negative",
        "Eq. 5 drives backwards in the zone, in less than half of the time",
        lambda runs: (
            f"v down to {slowest(runs['eq5']):.2f} m/s, negative in "
            f"{100.0 * backwards(runs['eq5']):.0f} % of the steps there"
        ),
        lambda runs: 0.0 < backwards(runs["eq5"]) < 0.5,
    ),
    Statement(
        ONE,
        "3.1",
        "only the rotational velocity is used for the repulsive action",
        "v of Eq. 7 is nowhere less than tracking wants and limits allow",
        lambda runs: f"less by {held_back(runs['eq7']):.2g} m/s",
        lambda runs: held_back(runs["eq7"]) < 1e-9,
    ),
    Statement(
        ONE,
        "3.1",
        "allows to bypass and subsequently recover the trajectory more quickly than "
        "method 1",
        "bypass: Eq. 7 leaves the zone earlier",
        told(left, "s"),
        less(left, "eq7", "eq5"),
    ),
    Statement(
        ONE,
        "3.1",
        "allows to bypass and subsequently recover the trajectory more quickly than "
        "method 1",
        "recover: Eq. 7 is within 5 cm of the plan for good earlier",
        told(recovered, "s"),
        less(recovered, "eq7", "eq5"),
    ),
    Statement(
        ONE,
        "3.1",
        "This temporary inversion of motion leads to an increase in the time needed to "
        "recover the planned trajectory.",
        "Eq. 5 drives backwards in the zone, and is within 5 cm of the plan for good "
        "later than Eq. 7",
        lambda runs: (
            f"backwards in {100.0 * backwards(runs['eq5']):.0f} % of the steps there; "
            f"{told(recovered, 's')(runs)}"
        ),
        lambda runs: (
            backwards(runs["eq5"]) > 0.0
            and recovered(runs["eq5"]) > recovered(runs["eq7"])
        ),
    ),
    Statement(
        ONE,
        "3.1, Figure 7",
        "while still limiting excessive approach",
        "Eq. 7 is nearer than r_min by 1 cm at most",
        lambda runs: f"{room(runs['eq7']):.3f} m of 0.17 m",
        lambda runs: room(runs["eq7"]) >= 0.16,
    ),
    Statement(
        ONE,
        "3.1, Figure 7",
        "method 1 allows to maintain a slightly greater distance than method 2",
        "by the least distance",
        told(room, "m"),
        less(room, "eq7", "eq5"),
    ),
    Statement(
        ONE,
        "3.1, Figure 7",
        "In the interval between 5 and 10 seconds, the robot approaches the obstacle "
        "until it reaches a minimum distance.",
        "both are nearest between 5 and 10 s; the zone's times are calibrated for",
        told(nearest_at, "s"),
        both(lambda log: 5.0 <= nearest_at(log) <= 10.0),
    ),
    Statement(
        ONE,
        "3.1, Figure 7",
        "method 1 shows a tendency to reach lower distances",
        "by the least distance (the contrary of the sentence before)",
        told(room, "m"),
        less(room, "eq5", "eq7"),
    ),
    Statement(
        ONE,
        "3.1, Figure 7",
        "avoiding to significantly fall below the safety margin",
        "Eq. 5 is nearer than r_min by 1 cm at most",
        lambda runs: f"{room(runs['eq5']):.3f} m of 0.17 m",
        lambda runs: room(runs["eq5"]) >= 0.16,
    ),
    Statement(
        ONE,
        "3.1",
        "ensuring that the destination is reached with the correct final orientation",
        "both end within 0.1 m and 0.1 rad",
        told(final, "m off"),
        both(lambda log: numbers_of(log)["outcome"] == "arrived"),
    ),
    Statement(
        ONE,
        "4",
        "its ability to avoid obstacles is less smooth",
        "Eq. 5 has the greater mean size of Δω/dt",
        told(lively, "rad/s²"),
        less(lively, "eq7", "eq5"),
    ),
    Statement(
        ONE,
        "4",
        "with more marked deviations from the desired path",
        "Eq. 5 has the greater rms distance from it",
        told(rms, "m"),
        less(rms, "eq7", "eq5"),
    ),
    Statement(
        ONE,
        "4",
        "reducing sudden deviations",
        "the greatest size of Δω/dt is less with Eq. 7",
        told(sudden, "rad/s²"),
        less(sudden, "eq7", "eq5"),
    ),
    *(
        Statement(
            ONE,
            where,
            words,
            f"v of {who} keeps its sign in the zone; how often it does not",
            told(turned_back, "times"),
            holds,
        )
        for where, words, who, holds in (
            (
                "4",
                "improving continuity of motion",
                "Eq. 7, but not of Eq. 5,",
                lambda runs: turned_back(runs["eq7"]) == 0 < turned_back(runs["eq5"]),
            ),
            (
                "5",
                "reduces the risk of emergency stops and ensures continuous movement",
                "both",
                both(lambda log: turned_back(log) == 0),
            ),
        )
    ),
    Statement(
        TWO,
        "3.2, Figure 12",
        "Both methods detect the obstacle at the same time, at 2.9 s",
        "within 0.1 s: what is calibrated for",
        told(entered, "s"),
        both(lambda log: abs(entered(log) - 2.9) <= 0.1),
    ),
    Statement(
        TWO,
        "3.2, Figure 12",
        "method 1 exits at 11.1 s, with an overall duration of 8.2 s, while method 2 "
        "exits at 14.1 s, with an overall duration of 11.2 s",
        "within 0.1 s: what is calibrated for",
        told(left, "s"),
        lambda runs: (
            abs(left(runs["eq5"]) - 11.1) <= 0.1
            and abs(left(runs["eq7"]) - 14.1) <= 0.1
        ),
    ),
    *(
        Statement(
            TWO,
            "3.2",
            "Once the obstacle has passed, the robot returns to its original position.",
            f"both end within {cm} cm of it",
            told(final, "m off"),
            both(partial(within, 0.01 * cm)),
        )
        for cm in (1, 2, 5, 10)
    ),
    Statement(
        TWO,
        "3.2, Figure 8",
        "avoids obstacles by allowing the robot to move backwards",
        "v of Eq. 5 is negative in the zone",
        lambda runs: f"v down to {slowest(runs['eq5']):.2f} m/s",
        lambda runs: slowest(runs["eq5"]) < 0.0,
    ),
    Statement(
        TWO,
        "3.2, Figure 10",
        "both methods result in deviations from the planned path",
        "5 cm or 5° off the plan at some time between 3 and 12 s",
        lambda runs: ", ".join(
            "Eq. {} {:.1f} to {:.1f} s".format(law[-1], *astray(log, 5.0))
            for law, log in sorted(runs.items())
            if law in ("eq5", "eq7")
        ),
        both(lambda log: astray(log, 5.0)[1] > 3.0 and astray(log, 5.0)[0] < 12.0),
    ),
    Statement(
        TWO,
        "3.2, Figure 10",
        "enables the robot to maintain a trajectory closer to the planned one",
        "by the rms of γ; in x and y Eq. 7 does not move by construction",
        lambda runs: f"{told(rms_turned, '°')(runs)}; {told(rms, 'm')(runs)}",
        less(rms_turned, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 10",
        "with method 1 achieving a smoother and quicker recovery",
        "quicker: Eq. 5 is within 5 cm and 5° for good earlier; the times asked for "
        "give it 3 s",
        told(restored, "s"),
        less(restored, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 10",
        "with method 1 achieving a smoother and quicker recovery",
        "quicker, each counted from when it has left the zone itself",
        told(afterwards, "s"),
        less(afterwards, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 10",
        "with method 1 achieving a smoother and quicker recovery",
        "smoother: Eq. 5 has the less mean size of Δω/dt after the zone; v of Eq. 7 is "
        "0",
        told(restlessness, "rad/s²"),
        less(restlessness, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 11",
        "the velocity profile remains smooth throughout the trajectory, with minor "
        "deviations in both linear and angular velocities",
        "Eq. 5 turns less fast than Eq. 7 at most, whose v is 0",
        told(fastest_turn, "rad/s"),
        less(fastest_turn, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 11",
        "exhibits significant fluctuations in angular velocity",
        "the mean size of Δω/dt of Eq. 7 is twice that of Eq. 5 or more",
        lambda runs: f"{told(lively, 'rad/s²')(runs)}: {fluctuation(runs):.3g} times",
        lambda runs: fluctuation(runs) >= 2.0,
    ),
    Statement(
        TWO,
        "3.2, Figure 11",
        "large spikes in ω indicate abrupt rotational adjustments",
        "the greatest size of Δω/dt is greater with Eq. 7",
        told(sudden, "rad/s²"),
        less(sudden, "eq5", "eq7"),
    ),
    Statement(
        TWO,
        "3.2, Figure 12",
        "maintains a greater separation from the obstacle throughout the interaction",
        "while both have it in the zone Eq. 5 is nowhere nearer by 1 mm",
        lambda runs: f"nearer by {throughout(runs):.3f} m at most",
        lambda runs: throughout(runs) <= 0.001,
    ),
    Statement(
        TWO,
        "3.2, Figure 12",
        "the translational method consistently maintains a safer distance",
        "Eq. 5 has the greater least distance, 0.17 m or more",
        told(room, "m"),
        lambda runs: room(runs["eq5"]) > max(room(runs["eq7"]), 0.17),
    ),
    Statement(
        TWO,
        "3.2, Figure 12",
        "a much closer interaction, particularly around the minimum distance threshold",
        "Eq. 7 comes within 2 cm of 0.17 m, above or below",
        told(room, "m"),
        lambda runs: abs(room(runs["eq7"]) - 0.17) < 0.02,
    ),
    Statement(
        CENTRE,
        "3.2",
        "unable to avoid obstacles that pass close to the center of the robot base",
        "Eq. 7 is touched, Eq. 5 is not",
        told(room, "m"),
        lambda runs: room(runs["eq7"]) < 0.0 < room(runs["eq5"]),
    ),
)


def of_case(case: str) -> list[Statement]:
    """Return the statements of a case."""
    return [statement for statement in STATEMENTS if statement.case == case]


def statement_rows(
    runs: Mapping[tuple[str, str], Log],
) -> list[tuple[Statement, str, bool]]:
    """Return every statement with what is measured of it and whether it holds.

    Args:
        runs: Logs by scenario and law.
    """
    found = []
    for statement in STATEMENTS:
        case = statement.case
        logs = {law: log for (name, law), log in runs.items() if name == case}
        found.append((statement, statement.measure(logs), statement.holds(logs)))
    return found


def statement_table(
    runs: Mapping[tuple[str, str], Log], shares: Mapping[tuple[str, str], str]
) -> str:
    """Return all statements as a Markdown table.

    Args:
        runs: Logs by scenario and law.
        shares: Of the calibrations in which one holds, by its words and how they are
            read, where known.
    """
    heads = ["case", "section", "the paper says", "read as", "measured", "reproduced"]
    lines = [
        [
            *(s.case.removeprefix("paper/").replace("_", " "), s.where),
            *(f"“{s.words}”", s.read, measured, "yes" if holds else "**no**"),
            shares.get((s.words, s.read), "–"),
        ]
        for s, measured, holds in statement_rows(runs)
    ]
    return markdown_table([*heads, "of calibrations"], lines)
