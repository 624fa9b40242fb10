"""OSQP [Stellato2020]: set up once, then updated and warm-started."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import osqp
from scipy.sparse import csc_matrix

from qpavoid.qp.accuracy import OSQP
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array

SETTINGS: Mapping[str, Any] = {
    **OSQP,
    "verbose": False,
    "warm_starting": True,
    "scaling": 0,  # rows come normalised
    "check_termination": 10,
}


class OSQPBackEnd:
    """One OSQP workspace for problems of up to ``capacity`` rows, grown by doubling.

    The matrix keeps its first sparsity pattern: every entry is stored, unused rows are
    zero and unbounded. After a failure the workspace is set up again.

    Args:
        settings: OSQP's, default :data:`SETTINGS`.
    """

    def __init__(self, settings: Mapping[str, Any] = SETTINGS) -> None:
        self.settings = settings
        self._capacity = 0
        self._solver = osqp.OSQP()

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z; NaN if OSQP solves it from neither a warm nor a cold start."""
        warm = 0 < self._capacity >= len(problem.offsets)
        z = self._solve(problem)
        if warm and not np.isfinite(z).all():
            z = self._solve(problem)
        return z

    def _solve(self, problem: ScaledProblem) -> Array:
        rows = len(problem.offsets)
        if rows > self._capacity or not self._capacity:
            capacity, self._capacity = max(4, 1 << rows.bit_length()), 0
            matrix, low, high = self._padded(problem, capacity)
            self._solver = osqp.OSQP()
            self._solver.setup(
                csc_matrix(np.eye(len(problem.target))),
                -problem.target,
                matrix,
                low,
                high,
                **self.settings,
            )
            self._capacity = capacity
        else:
            matrix, low, high = self._padded(problem, self._capacity)
            self._solver.update(q=-problem.target, Ax=matrix.data, l=low, u=high)
        result = self._solver.solve(raise_error=False)
        if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
            self._capacity = 0
            return np.full(len(problem.target), math.nan)
        return np.asarray(result.x, dtype=np.float64)

    def _padded(
        self, problem: ScaledProblem, capacity: int
    ) -> tuple[csc_matrix, Array, Array]:
        """Return the matrix and its bounds: the limits, then rows, then unused rows."""
        n = len(problem.target)
        size, used = n + capacity, n + len(problem.offsets)
        dense = np.zeros((size, n))
        dense[:n] = np.eye(n)
        dense[n:used] = problem.normals
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        low[:n], high[:n] = problem.lower, problem.upper
        low[n:used] = problem.offsets
        entries = dense.T.ravel(), np.tile(np.arange(size), n), np.arange(n + 1) * size
        return csc_matrix(entries, (size, n)), low, high


BACK_END = OSQPBackEnd
