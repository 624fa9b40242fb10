"""Logs to what the replay reads: float32, column after column, gzip, base64."""

import base64
import gzip
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from qpavoid.avoidance.decision import STATUSES
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.outcome import outcome_of, verdict
from qpavoid.lab.study.report.ranking import Row
from qpavoid.lab.study.scene import view_box
from qpavoid.types import Array

Group: TypeAlias = dict[str, Any]
"""Runs of one scenario and seed, with ``runs`` and what they share."""

BUDGET = 3_500_000
"""Characters of packed logs in a page."""

MOST_LOG_STEPS, MOST_LOG_NUMBERS = 4000, 1_200_000
"""A log with more steps, or more numbers in them, is thinned."""

MOST_REPLAYED = 12
"""Runs of one scenario in the replay."""

PAIRS = (
    "t=t_s x=x_m y=y_m heading=heading_rad xr=x_ref_m yr=y_ref_m "
    "hr=heading_ref_rad vd=v_desired_mps wd=omega_desired_radps "
    "v=v_mps w=omega_radps clearance=clearance_m "
    "least=least_clearance_m rmin=r_min_m r=r_m slack=slack_mps "
    "solve=solve_time_s cx=contact_x_m cy=contact_y_m obstacle=obstacle"
)
COLUMNS = dict(pair.split("=") for pair in PAIRS.split())
"""Columns of a log by their names in a frame of the replay."""


def pack_groups(
    rows: Sequence[Row], logs: Mapping[str, Path]
) -> tuple[list[Group], int]:
    """Return whole groups of runs until the budget is spent, and how many are left out.

    First come those scenarios and seeds in which the outcomes of the methods differ.

    Args:
        rows: With ``run``, ``method`` and ``outcome``.
        logs: Paths of the logs, by ``run``.
    """
    outcomes, kept = defaultdict(set), defaultdict(list)
    for row in rows:
        place = row["scenario"], row.get("seed")
        outcomes[place].add(row["outcome"])
        if row["run"] in logs:
            kept[place].append(row)
    groups: list[Group] = []
    spent = shown = 0
    for place in sorted(kept, key=lambda x: (-len(outcomes[x]), -len(kept[x]))):
        chosen, (scenario, seed) = kept[place][:MOST_REPLAYED], place
        named = [(r["run"], _called(r), Log.load(logs[r["run"]])) for r in chosen]
        group = pack_group(named) | {"scenario": scenario}
        group |= {} if seed is None else {"seed": seed}
        for run, row in zip(group["runs"], chosen, strict=True):
            run["outcome"] = row["outcome"]
        while not groups and len(group["runs"]) > 1 and size(group) > BUDGET:
            group["runs"].pop()
        spent += size(group)
        if groups and spent > BUDGET:
            break
        groups.append(group)
        shown += len(group["runs"])
    return groups, len(rows) - shown


def pack_group(named: Iterable[tuple[str, str, Log]]) -> Group:
    """Return runs of one scenario: name, method and log of each."""
    names, methods, logs = zip(*named, strict=True)
    runs = zip(names, methods, map(pack_run, logs), strict=True)
    return {
        **{key: logs[0].meta.get(key) for key in ("scenario", "title", "seed")},
        "box": view_box(logs),
        "runs": [{"run": name, "method": what, **run} for name, what, run in runs],
    }


def _called(row: Row) -> str:
    """Return method and, of several robots, which of them."""
    number = row.get("number")
    return str(row["method"]) + ("" if number is None else f", robot {number}")


def size(group: Group) -> int:
    """Return the characters of a group's logs."""
    return sum(len(run["data"]) for run in group["runs"])


def pack_run(log: Log) -> dict[str, Any]:
    """Return one run: what is said of it, and its arrays in ``data``."""
    discs = log.discs if np.ptp(log.discs, axis=0).any() else log.discs[:1]
    corners = log.corners if np.ptp(log.corners, axis=0).any() else log.corners[:1]
    numbers = len(log) * len(COLUMNS) + discs.size + corners.size
    every = max(-(-len(log) // MOST_LOG_STEPS), -(-numbers // MOST_LOG_NUMBERS))
    chosen = slice(None, None, every)
    arrays = {name: log[column][chosen] for name, column in COLUMNS.items()}
    arrays |= {
        "discs": discs[chosen],
        "corners": corners[chosen],
        "polygons": log.polygons,
        "points": log.points,
        "walls": log.walls,
        "vertices": log.vertices,
        "status": log["status"][chosen].astype(np.int8),
    }
    return {
        "controller": str(log.meta["controller"]),
        "outcome": verdict(outcome_of(log)[0]),
        "every": every,
        "statuses": [str(status) for status in STATUSES],
        **pack(arrays),
    }


def pack(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Return ``data`` and the ``parts`` in it: name, shape and kind, in order.

    Floats come first, so that each stands at a multiple of its size.
    """
    kinds = {name: "i1" if x.dtype == np.int8 else "f4" for name, x in arrays.items()}
    order = sorted(arrays, key=lambda name: kinds[name])
    raw = b"".join(arrays[name].astype(f"<{kinds[name]}").tobytes() for name in order)
    return {
        "parts": [[name, list(arrays[name].shape), kinds[name]] for name in order],
        "data": base64.b64encode(gzip.compress(raw, mtime=0)).decode("ascii"),
    }
