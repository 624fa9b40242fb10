"""Back ends: solvers of feasible scaled problems, in one table of lazy loaders.

A back end may keep a workspace between calls. Its answers need no trust: the caller
certifies them.
"""

import math
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.errors import MissingExtraError, UnknownNameError
from qpavoid.qp.exact import nearest_point
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array

BackEnd: TypeAlias = Callable[[ScaledProblem], npt.ArrayLike]
"""Function that returns z; anything, NaN too, if the solver failed."""

Settings: TypeAlias = Mapping[str, Any]

OSQP: Settings = {
    "eps_abs": 1e-10,
    "eps_rel": 1e-10,
    "max_iter": 20_000,
    "adaptive_rho_interval": 50,  # fixed, or it follows the wall clock
}
WORKSPACE: Settings = {
    **OSQP,
    "verbose": False,
    "warm_starting": True,
    "scaling": 0,  # rows come normalised
    "check_termination": 10,
}
PIQP: Settings = {
    "eps_abs": 1e-8,
    "eps_rel": 1e-8,
    "eps_duality_gap_abs": 1e-13,  # the gap is quadratic in the error of z
    "eps_duality_gap_rel": 1e-13,
}
DAQP: Settings = {"primal_tol": 1e-9}
QRQP: Settings = {
    "print_iter": False,
    "print_header": False,
    "print_info": False,
    "max_iter": 100,
}
PROXQP: Settings = {
    "eps_abs": 1e-12,
    "eps_rel": 0.0,
    "mu_in": 1e-2,
    "check_duality_gap": True,
    "eps_duality_gap_abs": 1e-9,
    "max_iter": 1_000,
}
CLARABEL: Settings = {"tol_gap_abs": 1e-14, "tol_gap_rel": 1e-14, "tol_feas": 1e-12}
HIGHS: Settings = {"qp_regularization_value": 0.0}
SCS: Settings = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iters": 100_000}
"""Settings of the solvers by their own names, as tight as each one allows."""


def capacity(problem: ScaledProblem) -> int:
    """Return the rows of a workspace for a problem: a power of two.

    Unused rows hold for all z. A large problem does not slow the small ones after it.
    """
    return max(4, 1 << len(problem.offsets).bit_length())


def exact(settings: Settings) -> BackEnd:
    """Return the exact solver of :mod:`qpavoid.qp.exact`; it has no settings."""

    def solve(problem: ScaledProblem) -> Array:
        target_1, target_2 = problem.target.tolist()
        p = nearest_point(problem.table, target_1, target_2, 0.0)
        return np.array([p.z_1, p.z_2] if p.found else [math.nan, math.nan])

    return solve


def osqp(settings: Settings) -> BackEnd:
    """Return OSQP [Stellato2020]: a workspace for each :func:`capacity`, warm-started.

    After a failure it is set up again.
    """
    import osqp
    from scipy.sparse import csc_matrix

    solvers: dict[int, Any] = {}

    def solve(problem: ScaledProblem) -> Array:
        n, capable = len(problem.target), capacity(problem)
        size, used = n + capable, n + len(problem.offsets)
        dense, (low, high) = np.zeros((size, n)), np.full((2, size), np.inf)
        low[n:] = -np.inf
        dense[:n], dense[n:used] = np.eye(n), problem.normals
        low[:n], low[n:used], high[:n] = problem.lower, problem.offsets, problem.upper
        entries, warm = dense.T.ravel(), capable in solvers
        if warm:
            solvers[capable].update(q=-problem.target, Ax=entries, l=low, u=high)
        else:
            # Every entry is stored, zeros too: the sparsity pattern stays.
            pattern = np.tile(np.arange(size), n), np.arange(n + 1) * size
            matrix, identity = csc_matrix((entries, *pattern), (size, n)), np.eye(n)
            solver = osqp.OSQP()
            solver.setup(
                csc_matrix(identity), -problem.target, matrix, low, high, **settings
            )
            solvers[capable] = solver
        result = solvers[capable].solve(raise_error=False)
        if result.info.status_val == osqp.SolverStatus.OSQP_SOLVED:
            return np.asarray(result.x, dtype=np.float64)
        del solvers[capable]
        return solve(problem) if warm else np.full(n, math.nan)

    return solve


class Casadi:
    """A plug-in of CasADi [Andersson2019], called through its FunctionBuffer.

    CasADi gets the memory of arguments and answer once for each size.

    Attributes:
        buffer: That of the last call; ``stats()`` is CasADi's own status.
    """

    buffer: Any = None

    def __init__(self, plugin: str, settings: Settings) -> None:
        self._plugin, self._settings = plugin, dict(settings)
        self._programs: dict[int, tuple[Any, ...]] = {}

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z as the plug-in gives it."""
        rows, n = problem.normals.shape
        size = capacity(problem)
        if size not in self._programs:
            self._programs[size] = self._program(size, n)
        memory, self.buffer, evaluate = self._programs[size]
        p, z = memory["p"], memory["x"]
        p[:], p[-size:] = 0.0, -1.0
        p[:n], p[n : n + n * rows] = problem.target, problem.normals.ravel()
        p[n + n * size :][:rows] = problem.offsets
        memory["lbx"][:], memory["ubx"][:] = problem.lower, problem.upper
        memory["x0"][:] = np.clip(problem.target, problem.lower, problem.upper)
        z[:] = np.nan
        evaluate()
        return np.array(z)

    def _program(self, rows: int, n: int) -> tuple[Any, ...]:
        """Return memory by name, buffer and call of the symbolic problem."""
        import casadi as ca

        z, target = ca.SX.sym("z", n), ca.SX.sym("target", n)
        normals, offsets = ca.SX.sym("normals", n, rows), ca.SX.sym("offsets", rows)
        problem = {
            "x": z,
            "p": ca.vertcat(target, ca.vec(normals), offsets),
            "f": 0.5 * ca.sumsqr(z - target),
            "g": normals.T @ z - offsets,
        }
        options = {"error_on_fail": False, "print_time": False, **self._settings}
        function = ca.qpsol("projection", self._plugin, problem, options)
        buffer, evaluate = function.buffer()
        sizes = {"x0": n, "p": n + (n + 1) * rows, "lbx": n, "ubx": n, "lbg": rows}
        memory = {name: np.zeros(size) for name, size in sizes.items()}
        memory["ubg"] = np.full(rows, np.inf)
        for name, array in memory.items():
            buffer.set_arg(function.index_in(name), memoryview(array.data))
        memory["x"] = np.zeros(n)
        buffer.set_res(function.index_out("x"), memoryview(memory["x"].data))
        return memory, buffer, evaluate


def qpsolvers(name: str, settings: Settings) -> BackEnd:
    """Return a solver of qpsolvers [Caron], set up again at every call.

    Raises:
        UnknownNameError: qpsolvers does not find it.
    """
    import qpsolvers
    from scipy.sparse import csc_matrix

    if name not in qpsolvers.available_solvers:
        known = qpsolvers.available_solvers
        raise UnknownNameError("qpsolvers solver", name, known)
    matrix = np.asarray if name in qpsolvers.dense_solvers else csc_matrix

    def solve(problem: ScaledProblem) -> Array:
        n, rows = len(problem.target), len(problem.offsets)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            z = qpsolvers.solve_qp(
                matrix(np.eye(n)),
                -problem.target,
                matrix(-problem.normals) if rows else None,
                -problem.offsets if rows else None,
                lb=problem.lower,
                ub=problem.upper,
                solver=name,
                **settings,
            )
        return np.full(n, math.nan) if z is None else np.asarray(z)

    return solve


class BackEndEntry(NamedTuple):
    """Row of the table of back ends.

    Attributes:
        make: Function from settings to a fresh back end.
        module: Package that it needs.
        extra: Extra that installs it, or empty.
        settings: Of the solver.
    """

    make: Callable[[Settings], BackEnd]
    module: str
    extra: str
    settings: Settings

    def load(self) -> BackEnd:
        """Return a fresh back end."""
        return self.make(self.settings)


def _casadi(plugin: str, settings: Settings) -> BackEndEntry:
    return BackEndEntry(partial(Casadi, plugin), "casadi", "", settings)


def _qpsolvers(
    name: str, settings: Settings, extra: str = "", module: str = ""
) -> BackEndEntry:
    return BackEndEntry(partial(qpsolvers, name), module or name, extra, settings)


BACK_ENDS = {
    "exact": BackEndEntry(exact, "numpy", "", {}),
    "osqp": BackEndEntry(osqp, "osqp", "", WORKSPACE),
    "casadi": _casadi("qrqp", QRQP),
    "casadi:qrqp": _casadi("qrqp", QRQP),
    "casadi:osqp": _casadi("osqp", {"osqp": {"verbose": False, **OSQP}}),
    "casadi:daqp": _casadi("daqp", {"daqp": dict(DAQP)}),
    "casadi:piqp": _casadi("piqp", {"piqp": dict(PIQP)}),
    "qpsolvers:daqp": _qpsolvers("daqp", {**DAQP, "dual_tol": 1e-12}),
    "qpsolvers:osqp": _qpsolvers("osqp", OSQP),
    "qpsolvers:piqp": _qpsolvers("piqp", PIQP, "piqp"),
    "qpsolvers:proxqp": _qpsolvers("proxqp", PROXQP, "proxqp", "proxsuite"),
    "qpsolvers:clarabel": _qpsolvers("clarabel", CLARABEL, "clarabel"),
    "qpsolvers:highs": _qpsolvers("highs", HIGHS, "highs", "highspy"),
    "qpsolvers:scs": _qpsolvers("scs", SCS, "scs"),
    "qpsolvers:quadprog": _qpsolvers("quadprog", {}, "quadprog"),
}
"""All back ends by name; the first is the default."""


def back_end_names() -> tuple[str, ...]:
    """Return the names of all back ends, installed or not; the first is the default.

    In addition ``qpsolvers:<name>`` is any other solver that qpsolvers finds.
    """
    return tuple(BACK_ENDS)


def is_installed(name: str) -> bool:
    """Return whether a back end's package is installed, without importing it."""
    return find_spec(BACK_ENDS[name].module) is not None


def find_back_end(name: str) -> BackEndEntry:
    """Return the entry of a known and installed back end.

    Raises:
        UnknownNameError: No such back end; the message lists them.
        MissingExtraError: Its package is absent; the message names the extra.
    """
    kind, _, solver = name.partition(":")
    if kind == "qpsolvers" and name not in BACK_ENDS:
        from qpsolvers import available_solvers

        if solver in available_solvers:
            return _qpsolvers(solver, {}, "", "qpsolvers")
    if name not in BACK_ENDS:
        raise UnknownNameError("back end", name, BACK_ENDS)
    if not is_installed(name):
        raise MissingExtraError(f"back end {name!r}", BACK_ENDS[name].extra)
    return BACK_ENDS[name]
