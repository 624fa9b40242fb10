"""OSQP [Stellato2020]: set up once, then updated and warm-started."""

import math

import numpy as np
import osqp
from scipy.sparse import csc_matrix

from qpavoid.model.footprint import Array
from qpavoid.qp.problem import ScaledProblem

SETTINGS = {
    "verbose": False,
    "eps_abs": 1e-10,
    "eps_rel": 1e-10,
    "max_iter": 20_000,
    "warm_starting": True,
    "scaling": 0,  # rows come normalised
    "adaptive_rho_interval": 50,  # fixed, or it follows the wall clock
    "check_termination": 10,
}


class OSQPBackEnd:
    """One OSQP workspace for problems of up to ``capacity`` rows, grown by doubling.

    The matrix keeps its first sparsity pattern: every entry is stored, rows that are
    not used are zero and unbounded. After a failure the workspace is set up afresh.
    """

    def __init__(self) -> None:
        self._capacity = 0
        self._solver = osqp.OSQP()

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z, or NaN if OSQP does not say ``solved``."""
        rows = len(problem.offsets)
        if rows > self._capacity or not self._capacity:
            self._capacity = max(4, 1 << rows.bit_length())
            matrix, low, high = self._padded(problem)
            self._solver = osqp.OSQP()
            self._solver.setup(
                csc_matrix(np.eye(2)), -problem.target, matrix, low, high, **SETTINGS
            )
        else:
            matrix, low, high = self._padded(problem)
            self._solver.update(q=-problem.target, Ax=matrix.data, l=low, u=high)
        result = self._solver.solve(raise_error=False)
        if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
            self._capacity = 0
            return np.full(2, math.nan)
        return np.asarray(result.x, dtype=np.float64)

    def _padded(self, problem: ScaledProblem) -> tuple[csc_matrix, Array, Array]:
        """Return the matrix and its bounds: the limits first, then rows, then none."""
        size, used = 2 + self._capacity, 2 + len(problem.offsets)
        dense = np.zeros((size, 2))
        dense[:2] = np.eye(2)
        dense[2:used] = problem.normals
        low, high = np.full(size, -np.inf), np.full(size, np.inf)
        low[:2], high[:2] = problem.lower, problem.upper
        low[2:used] = problem.offsets
        columns = np.tile(np.arange(size), 2)
        starts = np.array([0, size, 2 * size])
        return csc_matrix((dense.T.ravel(), columns, starts), (size, 2)), low, high
