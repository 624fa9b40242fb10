"""The physical limit of an encounter with one disc: what any controller could keep.

A disc moves at a constant velocity over ground; the robot may drive any admissible
sequence of twists. The limit is the greatest least clearance,

    W = max over (v, ω)(·) of min over t ≥ 0 of d(t),  less the radius,

with d the signed distance of the disc's centre to the footprint. The radius only
shifts it, so all that follows is about a point. Both ways to W know the obstacle's
motion exactly and for ever, which no controller does:

- without acceleration limits dynamic programming, :func:`limit_tables`;
- with them a search, :mod:`limit_search`. What it returns some plan attains.

State: the obstacle seen from the axle's middle along its own velocity, s ahead in its
direction of motion (negative while it approaches) and n to the left of it, m, and φ,
the robot's heading against that direction. Turning moves φ alone and standing still s
alone, so that interpolation hardly smears the table. Per unit of time
ṡ = v_o − v cos φ, ṅ = −v sin φ, φ̇ = ω, integrated exactly.
"""

import math
from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.compiled import allocating
from qpavoid.errors import InvalidInputError
from qpavoid.model.contact import point_contact
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Limits, Robot
from qpavoid.types import Array

Singles: TypeAlias = npt.NDArray[np.float32]
Integers: TypeAlias = npt.NDArray[np.int64]

SPEEDS = (0.05, *(k / 10 for k in range(1, 11)), 1.05, *(k / 10 for k in range(11, 16)))
"""Speeds of the obstacle that are tabulated, m/s.

Denser where it becomes faster than the robot, which can then no longer flee from it.
"""


@dataclass(frozen=True)
class Grid:
    """Resolution of the tables.

    Attributes:
        spacing: Between neighbouring s and n, m.
        headings: Number of φ in a full turn.
        turn: Number of headings that the greatest yaw rate passes in a time step.
        ahead: From where on an obstacle is told apart, m; farther away the robot
            waits until it has come as near, which never flatters the limit.
        cap: Greatest d that is told apart, m; just below it W is 1 to 3 cm low.
    """

    spacing: float = 0.04
    headings: int = 120
    turn: int = 1
    ahead: float = 3.6
    cap: float = 1.2


class Axes(NamedTuple):
    """Values of s, n (m) and φ (rad) that a table has."""

    s: Array
    n: Array
    phi: Array


@allocating
def relative(
    s: float, n: float, phi: float, speed: float, v: float, omega: float, t: float
) -> tuple[float, float, float]:
    """Return s, n, φ after a twist was driven for a time.

    Args:
        s: Ahead, m.
        n: To the left, m.
        phi: φ, rad.
        speed: v_o of the obstacle, m/s.
        v: Of the robot, m/s.
        omega: Of the robot, rad/s.
        t: s.
    """
    x, y, heading = arc(0.0, 0.0, phi, v, omega, t)
    return s + speed * t - x, n - y, heading


@allocating
def distance(edges: Array, s: float, n: float, phi: float) -> float:
    """Return d, the signed distance of the obstacle to the footprint, m."""
    cos, sin = math.cos(phi), math.sin(phi)
    return point_contact(edges, cos * s + sin * n, cos * n - sin * s).distance


@allocating
def step_minima(
    edges: Array,
    axes: Axes,
    speed: float,
    twists: Array,
    steps: Array,
    samples: int,
    cap: float,
) -> Singles:
    """Return the least d within a step, at most the cap, by s, φ, twist and n.

    Args:
        edges: Of the footprint.
        axes: Where; :class:`Axes`.
        speed: v_o of the obstacle, m/s.
        twists: (U, 2) v, ω.
        steps: (U,) how long each is driven, s.
        samples: Looks in a step.
        cap: Greatest d that is told apart, m.
    """
    s, n, phi = axes
    least = np.full((len(s), len(phi), len(twists), len(n)), cap, dtype=np.float32)
    far = cap + math.sqrt(np.max(edges[:, 0] ** 2 + edges[:, 1] ** 2))
    for j in range(len(phi)):
        for u in range(len(twists)):
            for m in range(samples + 1):
                t = steps[u] * m / samples
                v, omega = twists[u]
                s_t, n_t, phi_t = relative(0.0, 0.0, phi[j], speed, v, omega, t)
                cos, sin = math.cos(phi_t), math.sin(phi_t)
                for i in range(len(s)):
                    for k in range(len(n)):
                        a, b = s[i] + s_t, n[k] + n_t
                        if a * a + b * b < far * far:
                            x, y = cos * a + sin * b, cos * b - sin * a
                            d = point_contact(edges, x, y).distance
                            least[i, j, u, k] = min(least[i, j, u, k], d)
    return least


@allocating
def sweep(
    values: Singles, least: Singles, shifts: Integers, weights: Singles, pad: int
) -> float:
    """Apply W ← max over twists of min(d within the step, W after it) once, in place.

    Against the obstacle's motion, since W depends on what lies behind s. A step moves
    all s and n alike, so shifts and weights depend on φ and the twist alone. Returns
    the greatest change.

    Args:
        values: W so far, m, by s, φ and n, with a margin of the cap about n.
        least: As :func:`step_minima` gives it.
        shifts: Cells that a step moves, as :func:`stencil` gives them.
        weights: Of the corners of the cell, the same.
        pad: Width of the margin.
    """
    n_s, n_phi, n_u, n_n = least.shape
    best = np.empty(n_n, dtype=np.float32)
    change = 0.0
    for i in range(n_s - 1, -1, -1):
        for j in range(n_phi):
            best[:] = -np.inf
            for u in range(n_u):
                low, high = shifts[j, u, 0] + i, shifts[j, u, 0] + i + 1
                left = (shifts[j, u, 1] + j) % n_phi
                right = (left + 1) % n_phi
                k = shifts[j, u, 2] + pad
                a = values[max(low, 0), left, k : k + n_n + 1]
                b = values[max(low, 0), right, k : k + n_n + 1]
                c = values[max(high, 0), left, k : k + n_n + 1]
                d = values[max(high, 0), right, k : k + n_n + 1]
                a_0, a_1, b_0, b_1, c_0, c_1, d_0, d_1 = weights[j, u]
                for m in range(n_n):
                    after = a_0 * a[m] + a_1 * a[m + 1] + b_0 * b[m] + b_1 * b[m + 1]
                    after += c_0 * c[m] + c_1 * c[m + 1] + d_0 * d[m] + d_1 * d[m + 1]
                    best[m] = max(best[m], min(after, least[i, j, u, m]))
            for m in range(n_n):
                change = max(change, values[i, j, pad + m] - best[m])
                values[i, j, pad + m] = best[m]
    return change


def extremal_twists(limits: Limits) -> Array:
    """Return the (9, 2) twists {v_min, 0, v_max} × {ω_min, 0, ω_max}.

    The rate of W is linear in the twist, so the corners of the box attain its maximum.

    Raises:
        InvalidInputError: The wheels limit the twist too: that is no box.
    """
    if limits.wheel_speed < math.inf:
        raise InvalidInputError("the limit is computed for robots without wheel_speed")
    v = (limits.v_min, 0.0, limits.v_max)
    omega = (limits.omega_min, 0.0, limits.omega_max)
    return np.array([(a, b) for a in v for b in omega])


def stencil(
    phi: Array, speed: float, twists: Array, steps: Array, cells: Array
) -> tuple[Integers, Singles]:
    """Return by φ and twist the cell (s, φ, n) moved to, and its corners' weights.

    Args:
        phi: (P,) headings, rad.
        speed: v_o of the obstacle, m/s.
        twists: (U, 2) v, ω.
        steps: (U,) how long each is driven, s.
        cells: Spacing of s, φ and n.
    """
    shifts = np.empty((len(phi), len(twists), 3), dtype=np.int64)
    weights = np.empty((len(phi), len(twists), 8), dtype=np.float32)
    for j, heading in enumerate(phi):
        for u, (v, omega) in enumerate(twists):
            s, n, turned = relative(0.0, 0.0, heading, speed, v, omega, steps[u])
            moved = np.round(np.array([s, turned - heading, n]) / cells, 9)
            shifts[j, u] = np.floor(moved)
            part = np.stack([1.0 - moved % 1.0, moved % 1.0], axis=1)
            weights[j, u] = np.einsum("i,j,k", *part).ravel()
    return shifts, weights


def limit_table(robot: Robot, speed: float, grid: Grid = Grid()) -> Singles:
    """Return W for one speed of the obstacle, m, by s, φ and n.

    The greatest fixed point of W = min(d, max_u W(next(u))), by value iteration
    downwards from d until it changes by less than 10⁻⁴ m. Where |n| or s exceeds the
    circumradius by the cap, standing still keeps the cap: there W is known.

    Args:
        robot: Without acceleration limits (they are not looked at).
        speed: v_o of the obstacle, m/s.
        grid: Resolution. Standing still has a step of its own, a whole number of
            cells, so that a slow obstacle does not creep.
    """
    h, twists = grid.spacing, extremal_twists(robot.limits)
    beside = math.ceil((robot.footprint.circumradius + grid.cap) / h)
    s = np.arange(-math.ceil(grid.ahead / h), beside + 1, dtype=np.float64) * h
    n = np.arange(-beside, beside + 1, dtype=np.float64) * h
    phi = np.arange(grid.headings, dtype=np.float64) * (2.0 * math.pi / grid.headings)
    dt = grid.turn * phi[1] / np.abs(twists[:, 1]).max()
    still = ~twists.any(axis=1)
    wait = max(1, round(speed * dt / h)) * h / speed if speed > 0.0 else dt
    steps = np.where(still, wait, dt)
    fastest = speed + np.abs(twists).max(axis=0) @ (1.0, robot.footprint.circumradius)
    samples = math.ceil(fastest * dt / (0.75 * h))
    edges = robot.footprint.edges
    least = step_minima(edges, Axes(s, n, phi), speed, twists, steps, samples, grid.cap)
    cells = np.array([h, phi[1], h])
    shifts, weights = stencil(phi, speed, twists, steps, cells)
    pad = int(np.abs(shifts[:, :, 2]).max()) + 1
    top = max(int(shifts[:, :, 0].max()), 0) + 1
    shape = (len(s) + top, len(phi), len(n) + 2 * pad)
    values = np.full(shape, grid.cap, dtype=np.float32)
    inside = values[: len(s), :, pad : pad + len(n)]
    inside[:] = least.max(axis=2)
    while sweep(values, least, shifts, weights, pad) > 1e-4:
        pass
    return inside.copy()


@allocating
def table_value(values: Singles, h: float, s: float, n: float, phi: float) -> float:
    """Return W interpolated linearly in s, φ and n; ``inf`` where W is the cap.

    Args:
        values: W by s, φ and n, m.
        h: Spacing of s and n, m.
        s: Ahead, m.
        n: To the left, m.
        phi: φ, rad.
    """
    n_s, n_phi, n_n = values.shape
    i = max(s / h + (n_s - 1 - n_n // 2), 0.0)
    j = phi / (2.0 * math.pi) * n_phi % n_phi
    k = n / h + n_n // 2
    if not (i < n_s - 1 and 0.0 <= k < n_n - 1):
        return math.inf
    total = 0.0
    for a in range(2):
        for b in range(2):
            for c in range(2):
                weight = abs(1 - a - i % 1.0) * abs(1 - b - j % 1.0)
                weight *= abs(1 - c - k % 1.0)
                total += weight * values[int(i) + a, (int(j) + b) % n_phi, int(k) + c]
    return total


class Relative(NamedTuple):
    """The state: s, n (m), φ (rad), and v_o of the obstacle (m/s)."""

    s: float
    n: float
    phi: float
    speed: float


@allocating
def relative_state(encounter: Array) -> Relative:
    """Return the state of an encounter, a row as :func:`search_limit` takes."""
    x, y, v_x, v_y = encounter[:4]
    theta = math.atan2(v_y, v_x)
    cos, sin = math.cos(theta), math.sin(theta)
    speed = math.sqrt(v_x**2 + v_y**2)
    return Relative(cos * x + sin * y, cos * y - sin * x, -theta, speed)


@allocating
def clearance_limits(
    edges: Array,
    speeds: Array,
    values: Singles,
    h: float,
    cap: float,
    encounters: Array,
) -> Array:
    """Return W of many encounters, m; linear in v_o between the tables.

    Args:
        edges: Of the footprint.
        speeds: (m,) v_o of the tables, m/s.
        values: (m, s, φ, n) W, m.
        h: Spacing of s and n, m.
        cap: Greatest d that is told apart, m.
        encounters: (N, ≥ 4) as :func:`search_limit` takes them.
    """
    limits = np.empty(len(encounters))
    for e in range(len(encounters)):
        s, n, phi, speed = relative_state(encounters[e])
        d = min(distance(edges, s, n, phi), cap)
        limits[e] = d
        if speed > 0.0:
            k = min(int(np.searchsorted(speeds, speed)), len(speeds) - 1)
            share = 1.0
            if k > 0:
                share = (speed - speeds[k - 1]) / (speeds[k] - speeds[k - 1])
            elif speed < speeds[0]:
                share = speed / speeds[0]
            at = min(table_value(values[k], h, s, n, phi), d)
            before = d if k == 0 else min(table_value(values[k - 1], h, s, n, phi), d)
            limits[e] = share * at + (1.0 - share) * before
    return limits


@dataclass(frozen=True, eq=False)
class LimitTables:
    """The limit of a robot without acceleration limits, for every encounter.

    Attributes:
        robot: The robot.
        grid: Resolution.
        speeds: (m,) tabulated v_o, m/s, increasing. At v_o = 0, W = d.
        values: (m, s, φ, n) W, m.
    """

    robot: Robot
    grid: Grid
    speeds: Array
    values: Singles

    def clearance(self, encounters: Array, radius: Array | float = 0.0) -> Array:
        """Return the greatest clearance that can be kept, m, at most cap − radius.

        Args:
            encounters: (N, ≥ 4) x, y, v_x, v_y as :func:`search_limit` takes them.
            radius: Of the discs, m; (N,) or one for all.

        Raises:
            InvalidInputError: A disc is faster than the fastest table.
        """
        encounters = np.ascontiguousarray(encounters, dtype=np.float64)
        fastest = np.hypot(encounters[:, 2], encounters[:, 3]).max(initial=0.0)
        if not fastest <= self.speeds[-1] + 1e-9:
            raise InvalidInputError(
                f"the tables end at {self.speeds[-1]:g} m/s, not {fastest:g}"
            )
        edges, grid = self.robot.footprint.edges, self.grid
        tables = (self.speeds, self.values, grid.spacing, grid.cap)
        return clearance_limits(edges, *tables, encounters) - radius


@lru_cache(maxsize=4)
def limit_tables(
    robot: Robot,
    speeds: tuple[float, ...] = SPEEDS,
    grid: Grid = Grid(),
    folder: Path | None = None,
) -> LimitTables:
    """Return the tables of a robot, kept for the process and, if named, in a folder.

    A file in the folder that belongs to another robot, grid or set of speeds is
    written anew.
    """
    edges = robot.footprint.edges.ravel()
    twists = extremal_twists(robot.limits).ravel()
    key = np.concatenate([edges, twists, astuple(grid), speeds])
    file = None if folder is None else folder / "limit.npz"
    if file is not None and file.exists():
        with np.load(file) as saved:
            if np.array_equal(saved["key"], key):
                return LimitTables(robot, grid, np.array(speeds), saved["values"])
    values = np.stack([limit_table(robot, speed, grid) for speed in speeds])
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(file, key=key, values=values)
    return LimitTables(robot, grid, np.array(speeds), values)
