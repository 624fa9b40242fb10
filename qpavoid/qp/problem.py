"""The QP as a value: it can be inspected, solved by any solver, certified."""

from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from qpavoid.errors import InvalidInputError
from qpavoid.qp.exact import (
    A_OMEGA,
    A_V,
    N_1,
    N_2,
    ROW_WIDTH,
    B,
    C,
    Terms,
    certificate,
    half_planes,
)
from qpavoid.types import Array, Box

FIELDS = ("desired", "weights", "A", "b", "lower", "upper", "obstacle")
"""Arrays of a problem; the rest is the number of hard rows."""


@dataclass(frozen=True, eq=False)
class FilterProblem:
    """min (u − u_f)ᵀ W (u − u_f) subject to A u ≥ b and lower ≤ u ≤ upper; u = (v, ω).

    All arrays are read-only.

    Attributes:
        desired: (2,) u_f = (v_f, ω_f), m/s and rad/s.
        weights: (2,) diagonal of W, positive: 1 and m²/rad².
        A: (m, 2) d̂_oᵀ J_0 of a contact each: 1 and m/rad.
        b: (m,) least speed of P_r away from the obstacle, m/s.
        lower: (2,) v_min, ω_min.
        upper: (2,) v_max, ω_max.
        obstacle: (m,) number of the row's obstacle; −1 for a limit.
        n_hard: Number of rows, the last ones, that are limits of the robot (its wheels)
            and never relaxed.

    Raises:
        InvalidInputError: Shapes that do not fit, data that are not finite (limits may
            be infinite), weights that are not positive, or limits that cross.
    """

    desired: Array
    weights: Array
    A: Array
    b: Array
    lower: Array
    upper: Array
    obstacle: npt.NDArray[np.int64]
    n_hard: int = 0

    def __post_init__(self) -> None:
        rows = np.shape(self.A)[0] if np.ndim(self.A) == 2 else -1
        shapes = {"A": (rows, 2), "b": (rows,), "obstacle": (rows,)}
        for name in FIELDS:
            kind = np.int64 if name == "obstacle" else np.float64
            array = np.array(getattr(self, name), dtype=kind, order="C")
            shape = shapes.get(name, (2,))
            if array.shape != shape:
                raise InvalidInputError(
                    f"{name} must have shape {shape}, not {array.shape}"
                )
            limit = name in ("lower", "upper")
            if np.isnan(array).any() or not (limit or np.isfinite(array).all()):
                raise InvalidInputError(f"{name} is not finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not 0 <= self.n_hard <= rows:
            raise InvalidInputError(f"n_hard must be 0 to {rows}, not {self.n_hard}")
        if not (self.weights > 0).all():
            raise InvalidInputError("weights must be positive")
        if not (self.lower <= self.upper).all():
            raise InvalidInputError("limits cross: lower > upper")

    @property
    def terms(self) -> Terms:
        """All but the rows, for the compiled functions."""
        v_min, omega_min = self.lower.tolist()
        v_max, omega_max = self.upper.tolist()
        (v, omega), (w_v, w_omega) = self.desired.tolist(), self.weights.tolist()
        box = Box(v_min, v_max, omega_min, omega_max)
        return Terms(box, (v, omega), (w_v, w_omega), self.n_hard)

    def table(self) -> tuple[Array, float]:
        """Return all rows with their half-planes, and the slack of null rows.

        See :data:`qpavoid.qp.exact.ROW_WIDTH`.
        """
        rows = np.zeros((len(self.b) + 4, ROW_WIDTH))
        rows[:-4, A_V : A_OMEGA + 1], rows[:-4, B] = self.A, self.b
        return rows, half_planes(rows, self.terms)

    def relaxed(self, slack: float) -> "FilterProblem":
        """Return the problem with all rows but hard ones relaxed by ``slack``, m/s."""
        lowered = self.b.copy()
        lowered[: len(lowered) - self.n_hard] -= slack
        return replace(self, b=lowered)

    def certify(self, v: float, omega: float) -> tuple[float, float]:
        """Return (violation, suboptimality) of a twist; see :func:`certificate`."""
        rows, _ = self.table()
        return certificate(rows, self.terms, 0.0, (v, omega))

    def scaled(self) -> "ScaledProblem":
        """Return the problem as the projection that back ends solve."""
        table, _ = self.table()
        scale = np.sqrt(self.weights)
        rows = table[:-4]
        rows = rows[rows[:, C] > -np.inf]
        return ScaledProblem(
            target=self.desired * scale,
            normals=np.ascontiguousarray(rows[:, N_1 : N_2 + 1]),
            offsets=np.ascontiguousarray(rows[:, C]),
            lower=self.lower * scale,
            upper=self.upper * scale,
            scale=scale,
            table=table,
        )


@dataclass(frozen=True, eq=False)
class ScaledProblem:
    """min ½‖z − target‖² subject to normals z ≥ offsets, lower ≤ z ≤ upper; z = √W u.

    Rows are normalised, and rows that no twist can influence left out, since solvers
    skip short rows or call them infeasible.

    Attributes:
        target: (2,) √W u_f.
        normals: (m, 2) unit rows.
        offsets: (m,).
        lower: (2,) and
        upper: (2,) limits, possibly infinite.
        scale: (2,) √w; u = z / scale.
        table: (m + 4, 9) rows and limits together, for the exact solver; see
            :data:`qpavoid.qp.exact.ROW_WIDTH`.
    """

    target: Array
    normals: Array
    offsets: Array
    lower: Array
    upper: Array
    scale: Array
    table: Array


class SolveStatus(StrEnum):
    """Status of an answer, decided by its certificate and not by the solver."""

    OPTIMAL = "optimal"
    RELAXED = "relaxed"
    FAILED = "failed"


@dataclass(frozen=True, eq=False)
class Solution:
    """A certified answer of a solver.

    Attributes:
        u: (2,) twist (v, ω); NaN if the status is ``failed``.
        status: ``optimal``; ``relaxed``: infeasible, with the least violation;
            ``failed``: the solver's answer did not pass the certificate.
        slack: Least violation that had to be allowed, m/s; 0 if optimal.
        violation: Greatest violation of rows (slack allowed) and limits, m/s.
        suboptimality: Residual of the optimality conditions, scaled m/s.
        active: Numbers of the active rows.
        solver: Name of the back end.
        solve_time_s: Wall time of the call.
    """

    u: Array
    status: SolveStatus
    slack: float
    violation: float
    suboptimality: float
    active: tuple[int, ...]
    solver: str
    solve_time_s: float
