"""Peers of the timing study: solvers through their own interfaces, cvxpy and cbfpy.

Each is a back end like those of :mod:`qpavoid.qp.solve`, for any number of unknowns: it
is handed a :class:`ScaledProblem` and returns z, or NaN where it claims no answer.
"""

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.qp.backend_casadi import CasadiBackEnd, Program
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array
from timing.recorded import Scan


class Workspace(ABC):
    """A solver whose workspace is set up once and then updated.

    It has as many rows as the first problem; later ones may have fewer, the rest is
    0 ≥ −1. With more rows it is set up again, for at least twice as many.

    Args:
        settings: Of the solver; what is not named is its default.
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

    @abstractmethod
    def _set_up(self, problem: ScaledProblem) -> None: ...

    @abstractmethod
    def _solve(self, problem: ScaledProblem) -> Array | None: ...


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


class Proxqp(Workspace):
    """ProxQP by its dense interface and update, warm-started."""

    module = "proxsuite"

    def _set_up(self, problem: ScaledProblem) -> None:
        m, n = problem.normals.shape
        self._high = np.full(m, 1e20)
        self._proxqp = self._package.proxqp
        self._qp = self._proxqp.dense.QP(n, 0, m, True)
        for name, value in self.settings.items():
            setattr(self._qp.settings, name, value)
        rows = None, None, problem.normals, problem.offsets, self._high
        self._qp.init(np.eye(n), -problem.target, *rows, problem.lower, problem.upper)
        guess = self._proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._qp.settings.initial_guess = guess

    def _solve(self, problem: ScaledProblem) -> Array | None:
        self._qp.update(
            g=-problem.target,
            C=problem.normals,
            l=problem.offsets,
            u=self._high,
            l_box=problem.lower,
            u_box=problem.upper,
        )
        self._qp.solve()
        solved = self._proxqp.QPSolverOutput.PROXQP_SOLVED
        results = self._qp.results
        return results.x if results.info.status == solved else None


class Clarabel(Workspace):
    """Clarabel by update; without presolve, which forbids it."""

    module = "clarabel"

    def _set_up(self, problem: ScaledProblem) -> None:
        m, n = problem.normals.shape
        size = m + 2 * n
        self._columns = np.hstack([-problem.normals.T, np.eye(n), -np.eye(n)])
        self._high = np.empty(size)
        settings = self._package.DefaultSettings()
        for name, value in self.settings.items():
            setattr(settings, name, value)
        entries = np.ones(n * size), np.tile(np.arange(size), n)
        matrix = csc_matrix((*entries, np.arange(n + 1) * size), (size, n))
        cones = [self._package.NonnegativeConeT(size)]
        data = csc_matrix(np.eye(n)), -problem.target, matrix, np.ones(size), cones
        self._solver = self._package.DefaultSolver(*data, settings)

    def _solve(self, problem: ScaledProblem) -> Array | None:
        m, n = problem.normals.shape
        np.negative(problem.normals.T, out=self._columns[:, :m])
        np.negative(problem.offsets, out=self._high[:m])
        self._high[m : m + n] = problem.upper
        np.negative(problem.lower, out=self._high[m + n :])
        self._solver.update(q=-problem.target, A=self._columns.ravel(), b=self._high)
        found = self._solver.solve()
        return found.x if found.status == self._package.SolverStatus.Solved else None


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


class Cvxpy(Workspace):
    """cvxpy, with all data as parameters (DPP)."""

    module = "cvxpy"

    def _set_up(self, problem: ScaledProblem) -> None:
        cp = self._package
        names = "target", "normals", "offsets", "lower", "upper"
        self._data = {n: cp.Parameter(getattr(problem, n).shape) for n in names}
        target, normals, offsets, lower, upper = self._data.values()
        self._z = cp.Variable(target.shape)
        cost = 0.5 * cp.sum_squares(self._z - target)
        rows = [normals @ self._z >= offsets, self._z >= lower, self._z <= upper]
        self._problem = cp.Problem(cp.Minimize(cost), rows)

    def _solve(self, problem: ScaledProblem) -> Array | None:
        for name, parameter in self._data.items():
            parameter.value = getattr(problem, name)
        self._problem.solve(warm_start=True, **self.settings)
        solved = self._problem.status == "optimal"
        return self._z.value if solved else None


class DMProgram(Program):
    """A program called the usual way, with numpy arrays that become DM."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.buffer, self._evaluate = self._function, self._call

    def _call(self) -> None:
        low, high = self._bounds
        arguments = {"x0": self._start, "p": self._p, "lbg": low, "ubg": high}
        found = self._function(lbx=self._lower, ubx=self._upper, **arguments)
        self._z[:] = found["x"].full().ravel()


class ThroughDM(CasadiBackEnd):
    """A CasADi plug-in without its FunctionBuffer."""

    made = DMProgram


CBFPY: Mapping[str, Any] = {"backend": "elastiqp", "solver_tol": 1e-8}
"""Settings of its faster back end."""


ADVICE = {
    "JAX_ENABLE_X64": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
    "OPENBLAS_NUM_THREADS": "1",
}
"""What cbfpy asks for at its import, for speed and precision on a processor."""


def prepare(solver: str) -> None:
    """Import cbfpy and its solver with the settings that cbfpy advises."""
    os.environ.update(ADVICE)
    import_module("jax").config.update("jax_enable_x64", True)
    import_module("cbfpy")
    import_module(solver)


class Cbfpy(Workspace):
    """cbfpy's own safety filter on the same rows.

    Equivalent: state z = 0 with ż = u, barriers h(z) = normals z − offsets and α(h) = h
    give exactly the rows normals u ≥ offsets; the limits are barriers too; same cost.
    Not equivalent: each row may be broken at a cost of 1000 a unit, so that it answers
    infeasible problems as well, and it has no status: every finite answer is a claim.
    """

    module = "cbfpy"

    def __init__(self, settings: Mapping[str, Any]) -> None:
        prepare(settings["backend"])
        super().__init__(settings)

    def _set_up(self, problem: ScaledProblem) -> None:
        jnp, n = import_module("jax.numpy"), len(problem.target)
        self._z = np.zeros(n)
        self._filter = cbfpy_filter(
            lambda z, *data: jnp.eye(n),
            lambda z, normals, offsets: jnp.concatenate([normals @ z, z, -z]) - offsets,
            np.ones(n),
            n,
            (problem.normals, self._offsets(problem)),
            self.settings,
        )

    def _solve(self, problem: ScaledProblem) -> Array:
        data = problem.normals, self._offsets(problem)
        return np.asarray(self._filter(self._z, problem.target, *data))

    def _offsets(self, problem: ScaledProblem) -> Array:
        return np.concatenate([problem.offsets, problem.lower, -problem.upper])


def cbfpy_filter(
    g: Callable[..., Any],
    h: Callable[..., Any],
    weights: Array,
    n: int,
    seed: tuple[Array, ...],
    settings: Mapping[str, Any],
    gamma: float = 1.0,
) -> Callable[..., Any]:
    """Return cbfpy's filter, from (z, u_f, *data) to u.

    min (u − u_f)ᵀ W (u − u_f) subject to ḣ(z, u) ≥ −γ h(z), with ż = g(z) u.

    Args:
        g: (z, *data) → (n, m).
        h: (z, *data) → barriers.
        weights: (m,) diagonal of W.
        n: Number of states.
        seed: Data of the shapes to come.
        settings: Of cbfpy's configuration.
        gamma: γ, 1/s.
    """
    jnp = import_module("jax.numpy")
    m = len(weights)

    class Rows(import_module("cbfpy.config.cbf_config").CBFConfig):  # type: ignore[misc]
        def f(self, z: Any, *data: Any) -> Any:
            return jnp.zeros(n)

        def g(self, z: Any, *data: Any) -> Any:
            return g(z, *data)

        def h_1(self, z: Any, *data: Any) -> Any:
            return h(z, *data)

        def alpha(self, h: Any, *data: Any) -> Any:
            return gamma * h

        def P(self, z: Any, u_des: Any, *data: Any) -> Any:
            return 2.0 * jnp.diag(weights)

        def q(self, z: Any, u_des: Any, *data: Any) -> Any:
            return -2.0 * weights * u_des

    config = Rows(n, m, init_args=seed, **settings)
    cbf = import_module("cbfpy.cbfs.cbf").CBF.from_config(config)
    run: Callable[..., Any] = cbf.safety_filter
    return run


class CbfpyStep:
    """cbfpy's filter for a unicycle at the origin, with one barrier d − r_min a point.

    It differentiates the distance from the polygon by itself. Equivalent: rows, limits,
    cost. Not equivalent: see :class:`Cbfpy`.
    """

    def __init__(self, safety: SafetyFilter, points: int) -> None:
        prepare(CBFPY["backend"])
        limits, edges = safety.problem(0.0, 0.0), safety.robot.footprint.edges
        jnp = import_module("jax.numpy")
        r_min = safety.settings.radius.r_min()

        def g(pose: Any, points: Any) -> Any:
            c, s = jnp.cos(pose[2]), jnp.sin(pose[2])
            return jnp.array([[c, 0.0], [s, 0.0], [0.0, 1.0]])

        def h(pose: Any, points: Any) -> Any:
            c, s = jnp.cos(pose[2]), jnp.sin(pose[2])
            seen = (points - pose[:2]) @ jnp.array([[c, -s], [s, c]])
            offset = seen[:, None] - edges[:, :2]
            tangent = edges[:, 3:1:-1] * np.array([-1.0, 1.0])
            along = jnp.clip((offset * tangent).sum(axis=2), 0.0, edges[:, 4])
            gap = offset - along[:, :, None] * tangent
            return jnp.sqrt((gap**2).sum(axis=2).min(axis=1)) - r_min

        limited = {**CBFPY, "u_min": limits.lower, "u_max": limits.upper}
        weights = np.array(safety.settings.weights)
        seed = (np.ones((points, 2)) * (2.0, 0.1),)
        gamma = safety.settings.gamma
        self._filter = cbfpy_filter(g, h, weights, 3, seed, limited, gamma)
        self._pose = np.zeros(3)

    def __call__(self, scan: Scan) -> Array:
        """Return (v, ω)."""
        u = self._filter(self._pose, np.array([scan.v, scan.omega]), scan.points)
        return np.asarray(u)
