"""Solvers of the timing study: the package's back ends, and DAQP by its interface.

Each is a back end like those of :mod:`qpavoid.qp.backends`: a function from a
:class:`ScaledProblem` to z, or NaN where it claims no answer.

Run: python comparisons/timing/solvers.py
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from qpavoid.qp.backends import BACK_ENDS, BackEndEntry
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array


class Daqp:
    """DAQP by Model.update; it starts from its last active set.

    It has as many rows as the first problem; later ones may have fewer, the rest is
    0 ≥ −1. With more rows it is set up again, for at least twice as many.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.settings, self._package = settings, import_module("daqp")
        self._rows = 0

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z, or NaN if the solver does not call it solved."""
        m, n = problem.normals.shape
        if m > self._rows:
            self._rows = max(m, 2 * self._rows)
            self._set_up(self._filled(problem))
        problem = self._filled(problem)
        self._low[:n], self._low[n:] = problem.lower, problem.offsets
        self._high[:n] = problem.upper
        self._model.update(
            f=-problem.target, A=problem.normals, bupper=self._high, blower=self._low
        )
        z, _, flag, _ = self._model.solve()
        return np.asarray(z, dtype=np.float64) if flag > 0 else np.full(n, math.nan)

    def _set_up(self, problem: ScaledProblem) -> None:
        m, n = problem.normals.shape
        self._low, self._high = np.empty(n + m), np.full(n + m, np.inf)
        self._low[:n], self._low[n:] = problem.lower, problem.offsets
        self._high[:n] = problem.upper
        self._model = self._package.Model()
        self._model.settings = dict(self.settings)
        data = np.eye(n), -problem.target, problem.normals, self._high, self._low
        self._model.setup(*data)

    def _filled(self, problem: ScaledProblem) -> ScaledProblem:
        m, n = problem.normals.shape
        if m == self._rows:
            return problem
        normals, offsets = np.zeros((self._rows, n)), np.full(self._rows, -1.0)
        normals[:m], offsets[:m] = problem.normals, problem.offsets
        return replace(problem, normals=normals, offsets=offsets)


LOOSE: dict[str, Any] = {**BACK_ENDS["osqp"].settings, "eps_abs": 1e-6, "eps_rel": 1e-6}
"""OSQP's settings with a tolerance of 1e-6."""

DAQP = BackEndEntry(Daqp, "daqp", "bench", BACK_ENDS["qpsolvers:daqp"].settings)

CONTENDERS: dict[str, BackEndEntry] = {
    "exact": BACK_ENDS["exact"],
    "daqp": DAQP,
    "daqp default": DAQP._replace(settings={}),
    "osqp": BACK_ENDS["osqp"],
    "osqp 1e-6": BACK_ENDS["osqp"]._replace(settings=LOOSE),
    "osqp default": BACK_ENDS["osqp"]._replace(settings={"verbose": False}),
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("casadi:")},
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("qpsolv")},
}
"""Solvers of the study by name; ``--solvers qpsolvers:NAME`` runs any other."""
