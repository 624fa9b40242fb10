"""The lines that encounters leave: of a controller, of a run, in the README."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from encounter_loop import Met
from encounter_scenes import MARGIN, Encounter
from qpavoid.avoidance.settings import Margins
from qpavoid.lab.simulation.outcome import OUTCOME, verdict
from qpavoid.lab.study.tables import markdown_table
from qpavoid.types import Array

UNTOUCHED = 1e-3
"""m; r_min counts as violated from here on."""

LABELS = {
    "parked": "parked",
    "path": "on a path",
    "accelerated": "with accelerations limited",
    "several": "two to five discs",
    "mixed": "points, walls and one or two discs",
    "corridor": "somebody in a corridor",
    "doorway": "somebody in a doorway",
    "turning": "a disc that turns",
    "stop-and-go": "a disc that stops and goes on",
    "accelerating": "a disc that gains or loses speed",
    "carts": "a cart",
}
HEADS = {
    "eq5": "Eq. 5",
    "eq7": "Eq. 7",
    "qp": "one-step QP",
    "qp-ahead": "look-ahead QP",
}
"""What the README calls families and controllers."""

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Limit:
    """What is possible in every encounter of a family.

    Attributes:
        clearance: (n,) the greatest clearance that can be kept, m; of a search that
            ends where it has found enough: at least so much.
        spare: (n,) what can be kept beyond r_min, m; the same.
        is_greatest: Whether it is the greatest, so that a share of it means something.
    """

    clearance: Array
    spare: Array
    is_greatest: bool = True

    @property
    def avoidable(self) -> Bools:
        """Where 2 cm can be kept."""
        return np.asarray(self.clearance >= MARGIN)

    @property
    def possible(self) -> Bools:
        """Where r_min and 2 cm can be kept."""
        return np.asarray(self.spare >= MARGIN)


@dataclass(frozen=True, eq=False)
class Runs:
    """All runs of a controller in a family.

    Attributes:
        controller: Its name.
        margins: That it ran with.
        met: What became of them.
    """

    controller: str
    margins: Margins
    met: Met


def named(margins: Margins) -> str:
    """Return margins in words."""
    if margins == Margins():
        return "none"
    return f"{margins.error:g} m, {margins.acceleration:g} m/s²"


def share(part: Bools, whole: Bools) -> float:
    """Return how much of ``whole`` is in ``part``; NaN for nothing."""
    return float(part[whole].mean()) if whole.any() else math.nan


def row(
    family: str,
    runs: Runs,
    alone: npt.NDArray[np.void],
    limit: Limit,
    encounters: Sequence[Encounter],
    quiet: Array,
) -> dict[str, Any]:
    """Return a line of the table.

    Args:
        family: Its name.
        runs: Of a controller.
        alone: Outcomes of tracking alone; where that keeps r_min nothing is needed.
        limit: What is possible.
        encounters: All of the family.
        quiet: (n,) s, when the movers have left.
    """
    outcome, avoidable, possible = runs.met.outcome, limit.avoidable, limit.possible
    contact, violated = outcome["clearance"] < 0.0, outcome["room"] < -UNTOUCHED
    touched = contact & avoidable
    on_path = np.array([encounter.speed > 0.0 for encounter in encounters])
    limited = np.array([encounter.limited for encounter in encounters])
    slow = np.array([encounter.pace for encounter in encounters]) <= 1.0
    back = np.isfinite(outcome["arrived"])
    delay = np.maximum(outcome["arrived"] - quiet, 0.0)[back]
    kept = math.nan
    if limit.is_greatest and avoidable.any():
        ratio = outcome["clearance"][avoidable] / limit.clearance[avoidable]
        kept = float(np.median(np.clip(ratio, 0.0, 1.0)))
    free = alone["room"] >= 0.0
    return {
        "family": family,
        "controller": runs.controller,
        "margins": named(runs.margins),
        "encounters": len(outcome),
        "avoidable": int(avoidable.sum()),
        "contacts_avoidable": int(touched.sum()),
        "contacts_at_rest": int((touched & ~on_path).sum()),
        "contacts_on_path": int((touched & on_path).sum()),
        "contacts_with_accelerations": int((touched & limited).sum()),
        "contacts_unavoidable": int((contact & ~avoidable).sum()),
        "r_min_possible": int(possible.sum()),
        "r_min_violations": int((violated & possible).sum()),
        "r_min_kept_to_1_mps": 1.0 - share(violated, possible & slow),
        "r_min_kept_above_1_mps": 1.0 - share(violated, possible & ~slow),
        "clearance_share_median": kept,
        "deviation_median_m": float(np.median(outcome["deviation"])),
        "not_returned": int((~back).sum()),
        "return_error_p95_m": float(np.quantile(outcome["error"], 0.95)),
        "return_time_p95_s": quantile(delay, 0.95),
        "arrived_median_s": quantile(outcome["arrived"][back], 0.5),
        "needless": share(outcome["changed"] > 0.0, free),
        "changed_median_s": float(np.median(outcome["changed"])),
        "chatter_runs": len(runs.met.chatter),
        "chatter_v_per_s": float(runs.met.chatter[:, 0].mean()),
        "chatter_omega_per_s": float(runs.met.chatter[:, 1].mean()),
        "chatter_p95_per_s": quantile(runs.met.chatter.sum(axis=1), 0.95),
        **solve_times(runs.met.times),
    }


def solve_times(times: Array) -> dict[str, float]:
    """Return median and 99th percentile of what deciding took in a step, µs."""
    middle, high = np.percentile(1e6 * times, (50.0, 99.0)).tolist()
    return {"solve_us": middle, "solve_p99_us": high}


def fallen(
    family: str, controller: str, margins: Margins, count: int
) -> dict[str, Any]:
    """Return the line of a controller that raised: nothing but how many runs failed."""
    place = {"family": family, "controller": controller, "margins": named(margins)}
    return place | {"encounters": count, "failed": count}


def quantile(values: Array, q: float) -> float:
    """Return a quantile; NaN of nothing."""
    return float(np.quantile(values, q)) if len(values) else math.nan


def lines(
    family: str,
    runs: Runs,
    limit: Limit,
    encounters: Sequence[Encounter],
) -> list[dict[str, Any]]:
    """Return a line for every run.

    Args:
        family: Of the encounters.
        runs: Of a controller, and with which margins.
        limit: What some plan could keep.
        encounters: What it meets.
    """
    found, took = [], solve_times(runs.met.times)
    for k, encounter in enumerate(encounters):
        x, y, course, speed = encounter.all_movers[0].at(0.0)
        found.append(
            {
                "family": family,
                "controller": runs.controller,
                "margins": named(runs.margins),
                "number": k,
                "robot_mps": encounter.speed,
                "limited": encounter.limited,
                "disc_mps": encounter.pace,
                "x_m": x,
                "y_m": y,
                "v_x_mps": speed * math.cos(course),
                "v_y_mps": speed * math.sin(course),
                "radius_m": encounter.all_movers[0].radius,
                "limit_m": float(limit.clearance[k]),
                "spare_m": float(limit.spare[k]),
                **{key: float(runs.met.outcome[key][k]) for key in OUTCOME.names or ()},
                **took,
            }
        )
    return found


def as_runs(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the avoidable encounters as the rows that every study leaves.

    A success touches nothing and is back within 1 cm and 1°.
    """
    return [
        {
            "method": run["controller"],
            "setting": setting(run),
            "scenario": "encounter",
            "seed": run["number"],
            "outcome": verdict(run),
            "success": run["clearance"] >= 0.0 and math.isfinite(run["arrived"]),
            "contact": run["clearance"] < 0.0,
            "arrived_s": run["arrived"] if math.isfinite(run["arrived"]) else "",
            "start_clearance_m": run["start"],
            "contacts_moving": run["struck"],
            "min_room_m": run["room"],
            "jerk_mps3": run["jerk"],
            "solve_us": run["solve_us"],
            "solve_p99_us": run["solve_p99_us"],
        }
        for run in runs
        if run["limit_m"] >= MARGIN
    ]


def setting(line: dict[str, Any]) -> str:
    """Return family and margins of a line in one word or two."""
    family, margins = line["family"], line["margins"]
    return family if margins == "none" else f"{family}, margins {margins}"


def percent(part: int, whole: int) -> str:
    """Return a share in %, with a second digit where the first says too little."""
    if not whole:
        return "–"
    value = 100.0 * part / whole
    return f"{value:.1f} %" if 1.0 <= value <= 99.0 else f"{value:.2f} %"


def readme(table: Sequence[dict[str, Any]]) -> str:
    """Return the README's table: contacts among avoidable, r_min kept of possible."""
    controllers = list(dict.fromkeys(line["controller"] for line in table))
    heads = [HEADS.get(name, f"`{name}`") for name in controllers]
    heads = ["contacts / r_min kept, of those possible", *heads]
    lines = []
    for key in dict.fromkeys((line["family"], line["margins"]) for line in table):
        cells = []
        for name in controllers:
            for line in table:
                if (line["family"], line["margins"], line["controller"]) == (
                    *key,
                    name,
                ):
                    possible = line["r_min_possible"]
                    kept = percent(possible - line["r_min_violations"], possible)
                    cell = percent(line["contacts_avoidable"], line["avoidable"])
                    cell = f"{cell} / {kept}"
                    cells.append(f"**{cell}**" if name == "qp-ahead" else cell)
        margins = "" if key[1] == "none" else f"; margins {key[1]}"
        lines.append([f"{LABELS[key[0]]}{margins}", *cells])
    return markdown_table(heads, lines, heads[1:])
