"""What the search of plans says is possible, and what it misses.

For one disc and no limits of acceleration dynamic programming knows the answer
(:mod:`limit`, to the error of its grid). The search is asked there for what the table
allows: 2 cm, r_min and 2 cm, and, harder than any question of the study, all of the
limit but 5 cm or 2 cm; and for more than the table allows, which it should not find.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from encounter_scenes import MARGIN, Encounter, draw_encounters
from limit import limit_tables
from limit_search import limit_numbers
from plan_room import Case, plan_room
from plan_search import FINE, search_plans
from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.model.contact import point_contact
from qpavoid.model.robot import Robot
from qpavoid.types import Array

GRID = 0.03
"""m by which the tables may err."""


def wanted_radii(encounter: Encounter, radius: SafetyRadius) -> Array:
    """Return r_min for every mover at its fastest, and at last for what stands, m."""
    fastest = [radius.r_min(mover.fastest) for mover in encounter.all_movers]
    return np.array([*fastest, radius.r_min()])


def search_limits(
    robot: Robot, encounters: Sequence[Encounter], radius: SafetyRadius
) -> tuple[Array, Array]:
    """Return the clearance and what is left beyond r_min that a plan was found for, m.

    The search ends where it has found 2 cm; the clearance is looked for only where
    r_min and 2 cm were not found, since else the same plan keeps both.
    """
    scenes = [encounter.scene for encounter in encounters]
    starts = [(encounter.speed, 0.0) for encounter in encounters]
    radii = [wanted_radii(encounter, radius) for encounter in encounters]
    found = search_plans(robot, scenes, radii, starts, MARGIN)
    spare = np.array([least for least, _ in found])
    clearance = np.empty(len(encounters))
    for k, (_, plan) in enumerate(found):
        clearance[k] = plan_clearance(robot, encounters[k], plan)
    rest = np.flatnonzero(clearance < MARGIN)
    again = search_plans(
        robot,
        [scenes[k] for k in rest],
        [0.0 * radii[k] for k in rest],
        [starts[k] for k in rest],
        MARGIN,
    )
    clearance[rest] = np.maximum(clearance[rest], [least for least, _ in again])
    return clearance, spare


def plan_clearance(robot: Robot, encounter: Encounter, plan: Array) -> float:
    """Return the least clearance under a plan, m."""
    case = Case(
        robot.footprint.edges,
        limit_numbers(robot.limits),
        encounter.scene,
        np.zeros(len(encounter.all_movers) + 1),
        np.array((encounter.speed, 0.0)),
    )
    return float(plan_room(case, plan, -np.inf, FINE))


def misses(
    robot: Robot, count: int, seed: int, radius: SafetyRadius, folder: Path | None
) -> list[dict[str, Any]]:
    """Return, by family and question, how often the search misses what is possible.

    ``possible`` is what the tables allow, ``missed`` what of it the search does not
    find, ``beyond`` what it finds although the tables deny it by more than their error.
    The hard questions are asked only where the limit is 5 cm below the clearance at the
    start, elsewhere it is enough to get away, and below what the tables tell apart.

    Args:
        robot: Without limits of acceleration.
        count: Encounters a family.
        seed: Of the encounters.
        radius: r_min.
        folder: Where the tables of the limit are kept.
    """
    table, tables = [], limit_tables(robot, folder=folder)
    for family in ("parked", "path"):
        drawn = draw_encounters(family, count, seed, robot)
        rows = np.vstack([encounter.rows() for encounter in drawn])
        radii = np.array([encounter.discs[0, 2] for encounter in drawn])
        limits = tables.clearance(rows, radii)
        zones = np.array([radius.r_min(encounter.pace) for encounter in drawn])
        first = [first_clearance(robot, encounter) for encounter in drawn]
        pressed = limits < np.array(first) - 0.05
        pressed &= limits + radii < 0.9 * tables.grid.cap
        every = np.ones(count, dtype=bool)
        for name, wanted, asked in (
            ("2 cm", np.full(count, MARGIN), every),
            ("r_min and 2 cm", zones + MARGIN, every),
            ("all of the limit but 5 cm", limits - 0.05, pressed),
            ("all of the limit but 2 cm", limits - 0.02, pressed),
            ("3 cm more than the limit", limits + GRID, pressed),
        ):
            chosen = np.flatnonzero(asked)
            found = search_plans(
                robot,
                [drawn[k].scene for k in chosen],
                [np.array([wanted[k], 0.0]) for k in chosen],
                [(drawn[k].speed, 0.0) for k in chosen],
                0.0,
            )
            reached = np.array([least for least, _ in found]) >= 0.0
            spare = (limits - wanted)[chosen]
            possible = spare >= 0.0
            table.append(
                {
                    "family": family,
                    "asked": name,
                    "encounters": len(chosen),
                    "possible": int(possible.sum()),
                    "missed": int((possible & ~reached).sum()),
                    "beyond": int((reached & (spare <= 1e-9 - GRID)).sum()),
                }
            )
    return table


def first_clearance(robot: Robot, encounter: Encounter) -> float:
    """Return the clearance of the first disc at the start, m."""
    x, y, radius = encounter.discs[0]
    return float(point_contact(robot.footprint.edges, x, y).distance - radius)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300, metavar="N")
    parser.add_argument("--seed", type=int, default=1, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/limit"), metavar="DIR")
    options = parser.parse_args()
    for line in misses(
        Robot.mir100(), options.count, options.seed, SafetyRadius(), options.out
    ):
        print(line, flush=True)


if __name__ == "__main__":
    main()
