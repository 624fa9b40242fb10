"""Solvers of the timing study: the package's back ends, and peers by their interfaces.

A peer is a back end like those of :mod:`qpavoid.qp.solve`: a function from a
:class:`ScaledProblem` to z, or NaN where it claims no answer.

Run: python comparisons/timing/solvers.py
"""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np

from qpavoid.qp.backends import BACK_ENDS, PIQP, BackEnd, BackEndEntry
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array


class Workspace:
    """A solver with a workspace: ``_set_up`` once, then ``_solve`` with an update.

    It has as many rows as the first problem; later ones may have fewer, the rest is
    0 ≥ −1. With more rows it is set up again, for at least twice as many.
    """

    module: str

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self.settings = settings
        self._package = import_module(self.module)
        self._rows = 0

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z, or NaN if the solver does not call it solved."""
        m, n = problem.normals.shape
        if m > self._rows:
            self._rows = max(m, 2 * self._rows)
            self._set_up(self._filled(problem))
        z = self._solve(self._filled(problem))
        return np.full(n, math.nan) if z is None else np.asarray(z, dtype=np.float64)

    def _filled(self, problem: ScaledProblem) -> ScaledProblem:
        m, n = problem.normals.shape
        if m == self._rows:
            return problem
        normals, offsets = np.zeros((self._rows, n)), np.full(self._rows, -1.0)
        normals[:m], offsets[:m] = problem.normals, problem.offsets
        return replace(problem, normals=normals, offsets=offsets)


class Daqp(Workspace):
    """DAQP by Model.update; it starts from its last active set."""

    module = "daqp"

    def _set_up(self, problem: ScaledProblem) -> None:
        m, n = problem.normals.shape
        self._low, self._high = np.empty(n + m), np.full(n + m, np.inf)
        self._low[:n], self._low[n:] = problem.lower, problem.offsets
        self._high[:n] = problem.upper
        self._model = self._package.Model()
        self._model.settings = dict(self.settings)
        data = np.eye(n), -problem.target, problem.normals, self._high, self._low
        self._model.setup(*data)

    def _solve(self, problem: ScaledProblem) -> Array | None:
        n = len(problem.target)
        self._low[:n], self._low[n:] = problem.lower, problem.offsets
        self._high[:n] = problem.upper
        self._model.update(
            f=-problem.target, A=problem.normals, bupper=self._high, blower=self._low
        )
        z, _, flag, _ = self._model.solve()
        return z if flag > 0 else None


class Piqp(Workspace):
    """PIQP by its dense interface and update."""

    module = "piqp"

    def _set_up(self, problem: ScaledProblem) -> None:
        self._solver = self._package.DenseSolver()
        for name, value in self.settings.items():
            setattr(self._solver.settings, name, value)
        rows = None, None, np.asfortranarray(problem.normals), problem.offsets, None
        box = problem.lower, problem.upper
        self._solver.setup(np.eye(len(box[0])), -problem.target, *rows, *box)

    def _solve(self, problem: ScaledProblem) -> Array | None:
        self._solver.update(
            c=-problem.target,
            G=np.asfortranarray(problem.normals),
            h_l=problem.offsets,
            x_l=problem.lower,
            x_u=problem.upper,
        )
        status = self._solver.solve()
        return self._solver.result.x if status == self._package.PIQP_SOLVED else None


class Quadprog(Workspace):
    """quadprog, a function without a workspace; GPL, hence optional."""

    module = "quadprog"

    def _set_up(self, problem: ScaledProblem) -> None:
        self._eye = np.eye(len(problem.target))

    def _solve(self, problem: ScaledProblem) -> Array | None:
        C = np.hstack([problem.normals.T, self._eye, -self._eye])
        b = np.concatenate([problem.offsets, problem.lower, -problem.upper])
        try:
            z: Array = self._package.solve_qp(self._eye, problem.target, C, b)[0]
        except ValueError:
            return None
        return z


class Cbfpy(Workspace):
    """Safety filter of cbfpy on the same rows.

    State z = 0 with ż = u, barriers h(z) = normals z − offsets and α(h) = h give the
    same rows normals u ≥ offsets. The limits are barriers too; the cost is the same.
    Difference: each row may be violated at a cost of 1000 a unit, so it also answers
    infeasible problems, and it has no status: every finite answer counts as a claim.
    """

    module = "cbfpy"

    def __init__(self, settings: Mapping[str, Any]) -> None:
        os.environ["JAX_ENABLE_X64"] = "1"  # as cbfpy advises
        os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false"
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        import_module("jax").config.update("jax_enable_x64", True)
        super().__init__(settings)
        import_module(settings["backend"])

    def _set_up(self, problem: ScaledProblem) -> None:
        jnp, n = import_module("jax.numpy"), len(problem.target)
        base: Any = import_module("cbfpy.config.cbf_config").CBFConfig

        class Rows(base):  # type: ignore[misc]
            def f(self, z: Any, *data: Any) -> Any:
                return jnp.zeros(n)

            def g(self, z: Any, *data: Any) -> Any:
                return jnp.eye(n)

            def h_1(self, z: Any, normals: Any, offsets: Any) -> Any:
                return jnp.concatenate([normals @ z, z, -z]) - offsets

            def alpha(self, h: Any, *data: Any) -> Any:
                return h

            def P(self, z: Any, u_des: Any, *data: Any) -> Any:
                return 2.0 * jnp.eye(n)

            def q(self, z: Any, u_des: Any, *data: Any) -> Any:
                return -2.0 * u_des

        seed = problem.normals, self._offsets(problem)
        config = Rows(n, n, init_args=seed, **self.settings)
        cbf = import_module("cbfpy.cbfs.cbf").CBF.from_config(config)
        self._z, self._filter = np.zeros(n), cbf.safety_filter

    def _solve(self, problem: ScaledProblem) -> Array:
        data = problem.normals, self._offsets(problem)
        return np.asarray(self._filter(self._z, problem.target, *data))

    def _offsets(self, problem: ScaledProblem) -> Array:
        return np.concatenate([problem.offsets, problem.lower, -problem.upper])


def _entry(kind: Callable[..., BackEnd], module: str, settings: Any) -> BackEndEntry:
    extra = "quadprog" if module == "quadprog" else "bench"
    return BackEndEntry(kind, module, extra, settings)


LOOSE: dict[str, Any] = {**BACK_ENDS["osqp"].settings, "eps_abs": 1e-6, "eps_rel": 1e-6}
"""OSQP's settings with a tolerance of 1e-6."""

CBFPY: Mapping[str, Any] = {"backend": "elastiqp", "solver_tol": 1e-8}
"""Settings of the faster of its two back ends."""

CONTENDERS: dict[str, BackEndEntry] = {
    "exact": BACK_ENDS["exact"],
    "daqp": _entry(Daqp, "daqp", BACK_ENDS["qpsolvers:daqp"].settings),
    "daqp default": _entry(Daqp, "daqp", {}),
    "osqp": BACK_ENDS["osqp"],
    "osqp 1e-6": BACK_ENDS["osqp"]._replace(settings=LOOSE),
    "osqp default": BACK_ENDS["osqp"]._replace(settings={"verbose": False}),
    "piqp": _entry(Piqp, "piqp", PIQP),
    "quadprog": _entry(Quadprog, "quadprog", {}),
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("casadi:")},
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("qpsolv")},
    "cbfpy:elastiqp": _entry(Cbfpy, "cbfpy", CBFPY),
}
"""All solvers of the study by name."""
