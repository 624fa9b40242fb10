"""A replayed drive as a page: its changed stretches, and it step by step."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from qpavoid.avoidance.decision import STATUSES, Status
from qpavoid.lab.study.replay import Replayed
from qpavoid.lab.study.report.page import drive_page
from qpavoid.lab.study.report.payload import MOST_LOG_NUMBERS, MOST_LOG_STEPS, pack
from qpavoid.model.capsules import RADIUS, X1, Y1
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import to_world
from qpavoid.ros.guard import GuardStep
from qpavoid.types import Array, Pose

MOST_DISCS = 180
"""Things seen in a step that are shown, the nearest ones."""

NOWHERE = 1e5
"""m; where a disc is that is not there."""

DRIVEN = {
    "x": "x_m", "y": "y_m", "heading": "heading_rad",
    "xr": "x_m", "yr": "y_m", "hr": "heading_rad",
    "vd": "v_mps", "wd": "omega_radps", "v": "v_given_mps", "w": "omega_given_radps",
    "clearance": "clearance_m", "least": "clearance_m", "slack": "slack_mps",
}  # fmt: skip
"""Columns of the page by those of a replay; the reference is the recorded way."""

NEAREST = "cx", "cy", "obstacle"

NOTHING: dict[str, Array] = {
    "points": np.empty((0, 2)),
    "walls": np.empty((0, 4)),
    "corners": np.empty((1, 0, 2)),
    "polygons": np.empty(0),
}
"""What is not in a drive."""

UNKNOWN = "va wa vlo vhi wlo whi".split()
"""Columns of the page that a replay does not have."""


def drive_report(replayed: Replayed, name: str, found: Mapping[str, Any]) -> str:
    """Return one HTML file of a replay, that opens from disk and asks for nothing.

    Args:
        replayed: What became of the drive.
        name: Of the drive.
        found: Its numbers and changed stretches.
    """
    why = "; ".join(f"{word}: {count}" for word, count in found["why"].items())
    facts = (
        f"{found['changed']} of {found['commands']} commands changed "
        f"({found['share_changed']:.2%}) in {found['seconds']:.0f} s. {why}"
    )
    run = {"run": "0", "method": "filter", "controller": "qp-ahead"}
    run |= {"outcome": f"{found['share_changed']:.2%} changed", **_packed(replayed)}
    group = {"scenario": name, "title": "", "seed": None, "box": _box(replayed)}
    data = {
        "facts": facts,
        "episodes": found["episodes"],
        "replay": {"groups": [group | {"runs": [run]}], "left_out": 0},
    }
    return drive_page(f"Replay: {name}", data)


def _packed(replayed: Replayed) -> dict[str, Any]:
    """Return the steps of a drive as a run of the replay."""
    steps, setup = replayed.steps, replayed.guard.setup
    seen = [
        _seen(setup.robot.footprint, step, pose)
        for step, pose in zip(steps, _poses(replayed), strict=True)
    ]
    most = max(len(discs) for discs, _ in seen)
    numbers = len(steps) * (3 * most + len(DRIVEN))
    every = max(-(-len(steps) // MOST_LOG_STEPS), -(-numbers // MOST_LOG_NUMBERS))
    chosen = slice(None, None, every)
    rows, steps, seen = replayed.rows[chosen], steps[chosen], seen[chosen]
    discs = np.full((len(rows), most, 3), NOWHERE)
    for k, (there, _) in enumerate(seen):
        discs[k, : len(there)] = there
    sentences = list(dict.fromkeys(step.sentence for step in steps))
    columns = _columns(rows) | {
        "t": np.array([row["time_s"] - replayed.rows[0]["time_s"] for row in rows]),
        "rmin": np.full(len(rows), setup.settings.radius.r_min_slow),
        "r": np.full(len(rows), setup.settings.radius.r_min_fast),
        "said": np.array([sentences.index(step.sentence) for step in steps]),
        **dict(zip(NEAREST, np.array([one for _, one in seen]).T, strict=True)),
    }
    decided = [_decided(step) for step in steps]
    columns["status"], columns["solve"] = map(np.array, zip(*decided, strict=True))
    columns["status"] = columns["status"].astype(np.int8)
    vertices = {"discs": discs, "vertices": setup.robot.footprint.vertices}
    said = {"statuses": [str(one) for one in STATUSES], "sentences": sentences}
    nothing = NOTHING | {"planes": np.empty((len(rows), 0, 4))}
    return {"every": every, **said, **pack(columns | vertices | nothing)}


def _columns(rows: list[dict[str, Any]]) -> dict[str, Any]:
    known = {name: [row[key] for row in rows] for name, key in DRIVEN.items()}
    unknown = {name: np.full(len(rows), np.nan) for name in UNKNOWN}
    return {name: np.array(column) for name, column in (known | unknown).items()}


def _decided(step: GuardStep) -> tuple[int, float]:
    """Return the number of the status, and the time of the solution in s."""
    if step.decision is None:
        return Status.BRAKING.number, math.nan
    return step.decision.status.number, step.decision.solve_time_s


def _poses(replayed: Replayed) -> list[Pose]:
    return [(row["x_m"], row["y_m"], row["heading_rad"]) for row in replayed.rows]


def _box(replayed: Replayed) -> list[float]:
    """Return x_low, x_high, y_low, y_high round all that was driven, m."""
    guard, places = replayed.guard, np.array(_poses(replayed))[:, :2]
    reach = guard.setup.robot.footprint.circumradius + 1.0
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    return np.column_stack([low, high]).ravel().tolist()


def _seen(footprint: Footprint, step: GuardStep, pose: Pose) -> tuple[Array, Array]:
    """Return discs (n, 3), world frame, and P_r and number of the nearest, or −1."""
    points, capsules = step.obstacles.arrays
    flat = np.column_stack([points, np.zeros(len(points))])
    discs = np.vstack([flat, capsules[:, [X1, Y1, RADIUS]]])
    if not len(discs):
        return discs, np.array([np.nan, np.nan, -1.0])
    contacts = Contacts.of(footprint, step.obstacles)
    order = np.argsort(contacts.distance, kind="stable")
    _, first = np.unique(contacts.obstacle[order], return_index=True)
    kept = np.sort(contacts.obstacle[order][np.sort(first)[:MOST_DISCS]])
    discs = discs[kept]
    discs[:, :2] = to_world(discs[:, :2], pose)
    (place,) = to_world(contacts.point[order[:1]], pose)
    number = np.searchsorted(kept, contacts.obstacle[order[0]])
    return discs, np.array([*place, float(number)])
