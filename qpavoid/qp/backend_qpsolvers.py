"""Any solver of qpsolvers [Caron], with tolerances as tight as each one allows."""

import math
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import qpsolvers
from scipy.sparse import csc_matrix

from qpavoid.errors import UnknownNameError
from qpavoid.qp.accuracy import DAQP, OSQP, PIQP
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array

TIGHT: Mapping[str, Mapping[str, Any]] = {
    "daqp": {**DAQP, "dual_tol": 1e-12},
    "osqp": OSQP,
    "piqp": PIQP,
    "proxqp": {
        "eps_abs": 1e-12,
        "eps_rel": 0.0,
        "mu_in": 1e-2,
        "check_duality_gap": True,
        "eps_duality_gap_abs": 1e-9,
        "max_iter": 1_000,
    },
    "clarabel": {
        "tol_gap_abs": 1e-14,
        "tol_gap_rel": 1e-14,
        "tol_feas": 1e-12,
    },
    "highs": {"qp_regularization_value": 0.0},
    "scs": {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iters": 100_000},
}


class QPSolversBackEnd:
    """One solver behind ``qpsolvers.solve_qp``, set up again at every call."""

    def __init__(self, name: str) -> None:
        if name not in qpsolvers.available_solvers:
            raise UnknownNameError(
                "qpsolvers solver", name, qpsolvers.available_solvers
            )
        self._name = name
        self.settings = TIGHT.get(name, {})
        self._matrix = np.asarray
        if name not in qpsolvers.dense_solvers:
            self._matrix = csc_matrix

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z, or NaN if the solver finds none; its warnings are suppressed."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return self._solve(problem)

    def _solve(self, problem: ScaledProblem) -> Array:
        n, rows = len(problem.target), len(problem.offsets)
        z = qpsolvers.solve_qp(
            self._matrix(np.eye(n)),
            -problem.target,
            self._matrix(-problem.normals) if rows else None,
            -problem.offsets if rows else None,
            lb=problem.lower,
            ub=problem.upper,
            solver=self._name,
            **self.settings,
        )
        return np.full(n, math.nan) if z is None else np.asarray(z)


BACK_END = QPSolversBackEnd
