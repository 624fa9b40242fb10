"""From what was played to a scenario file that ``run`` and ``compare`` take."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from qpavoid.errors import MissingExtraError
from qpavoid.lab.play.hand import Disc, Place
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.model.capsules import TURN, V_X, X1, Y1
from qpavoid.types import Array

try:
    import tomli_w
except ImportError:
    raise MissingExtraError("tomli-w", "play") from None

TOLERANCE = 1e-6
"""m; no position of the file is farther than this from the recorded one. A millimetre
can already make a robot that has the choice pass on the other side."""


def thin(times: Array, positions: Array, tolerance: float = TOLERANCE) -> list[int]:
    """Return the rows to keep so that all others lie on straight lines between them.

    Ramer, Douglas and Peucker's method, with the distance taken at equal times: a disc
    that moves straight at a constant velocity needs two rows.

    Args:
        times: (n,) s, increasing.
        positions: (n, 2) m.
        tolerance: Greatest distance of a row left out, m.
    """
    kept, open_spans = {0, len(times) - 1}, [(0, len(times) - 1)]
    while open_spans:
        first, last = open_spans.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        share = (times[inner] - times[first]) / (times[last] - times[first])
        way = positions[last] - positions[first]
        line = positions[first] + share[:, None] * way
        off = np.hypot(*(positions[inner] - line).T)
        worst = int(off.argmax())
        if off[worst] > tolerance:
            middle = first + 1 + worst
            kept.add(middle)
            open_spans += [(first, middle), (middle, last)]
    return sorted(kept)


def obstacles_of(
    scenario: Scenario, discs: Sequence[Disc], history: Sequence[Sequence[Place]]
) -> list[dict[str, Any]]:
    """Return the obstacles of a recording, as a scenario file lists them.

    Args:
        scenario: What was played: its time step, and what stands.
        discs: The discs.
        history: Their places, m, at every control step; at least two.
    """
    times = scenario.dt * np.arange(len(history), dtype=np.float64)
    places = np.array(history, dtype=np.float64)
    points, walls = scenario.world.points, scenario.world.walls
    found: list[dict[str, Any]] = [
        {"kind": "disc", "position_m": point} for point in _rounded(points)
    ]
    found += [
        {"kind": "wall", "start_m": wall[:2], "end_m": wall[2:]}
        for wall in _rounded(walls)
    ]
    for chain in scenario.world.polygons.chains:
        v_x, v_y, turn = chain[0, V_X : TURN + 1].tolist()
        corners = chain[:, X1 : Y1 + 1].tolist()
        motion = {"velocity_mps": [v_x, v_y], "turn_rate_radps": turn}
        found.append({"kind": "polygon", "vertices_m": corners, **motion})
    for i, disc in enumerate(discs):
        found.append(_disc(times, places[:, i], disc.radius))
    return found


def _disc(times: Array, places: Array, radius: float) -> dict[str, Any]:
    """Return a disc's places over time; as standing where it never moved."""
    rows = thin(times, places)
    if np.ptp(places, axis=0).max() == 0.0:
        (place,) = _rounded(places[:1])
        return {"kind": "disc", "position_m": place, "radius_m": radius}
    return {
        "kind": "waypoints",
        "radius_m": radius,
        "times_s": np.round(times[rows], 9).tolist(),
        "positions_m": _rounded(places[rows]),
    }


def _rounded(array: Array) -> list[list[float]]:
    """Return rows in m to 10 nm."""
    rounded: list[list[float]] = np.round(array, 8).tolist()
    return rounded


def as_toml(document: Mapping[str, Any], comment: str = "") -> str:
    """Return a scenario document as the text of its file."""
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    text: str = tomli_w.dumps(document)
    return head + text
