"""CasADi [Andersson2019]: the problem written symbolically, solved by its plug-ins."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from qpavoid.qp.accuracy import DAQP, OSQP, PIQP
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array

OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "qrqp": {"print_iter": False, "print_header": False, "print_info": False},
    "osqp": {"osqp": {"verbose": False, **OSQP}},
    "daqp": {"daqp": dict(DAQP)},
    "piqp": {"piqp": dict(PIQP)},
}


class CasadiBackEnd:
    """A CasADi QP of up to ``capacity`` rows, called through its FunctionBuffer.

    The arrays of arguments and of the answer are handed to CasADi once, as memory; a
    call then writes into them and evaluates. Rows that are not used are 0 ≥ −1.

    Args:
        plugin: CasADi's name of the solver.
        settings: Its options, if not those of :data:`OPTIONS`.
    """

    def __init__(self, plugin: str, settings: Mapping[str, Any] | None = None) -> None:
        self._plugin = plugin
        self.settings = OPTIONS.get(plugin, {}) if settings is None else settings
        self._capacity = 0

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z as the plug-in leaves it; its own word is not to be trusted."""
        n, rows = problem.normals.shape[1], len(problem.offsets)
        if rows > self._capacity or not self._capacity:
            self._set_up(max(4, 1 << rows.bit_length()), n)
        size = self._capacity
        self._p[:] = 0.0
        self._p[:n] = problem.target
        self._p[n : n + n * rows] = problem.normals.ravel()
        self._p[n + n * size :] = -1.0
        self._p[n + n * size : n + n * size + rows] = problem.offsets
        self._lower[:], self._upper[:] = problem.lower, problem.upper
        self._start[:] = np.clip(problem.target, problem.lower, problem.upper)
        self._z[:] = np.nan
        self._evaluate()
        return self._z.copy()

    def _set_up(self, capacity: int, n: int) -> None:
        """Write the problem for so many rows and n unknowns, and bind its memory."""
        z = ca.SX.sym("z", n)
        target = ca.SX.sym("target", n)
        normals = ca.SX.sym("normals", n, capacity)
        offsets = ca.SX.sym("offsets", capacity)
        problem = {
            "x": z,
            "p": ca.vertcat(target, ca.vec(normals), offsets),
            "f": 0.5 * ca.sumsqr(z - target),
            "g": normals.T @ z - offsets,
        }
        options = {
            "error_on_fail": False,
            "print_time": False,
            **self.settings,
        }
        function = ca.qpsol("projection", self._plugin, problem, options)
        self._capacity = capacity
        self._p = np.zeros(n + (n + 1) * capacity)
        self._lower, self._upper, self._start = np.zeros((3, n))
        self._z = np.zeros(n)
        self._bounds = np.zeros(capacity), np.full(capacity, np.inf)
        self._function = function
        self._buffer, self._evaluate = function.buffer()
        arguments = {
            "x0": self._start,
            "p": self._p,
            "lbx": self._lower,
            "ubx": self._upper,
            "lbg": self._bounds[0],
            "ubg": self._bounds[1],
        }
        for name, array in arguments.items():
            self._buffer.set_arg(function.index_in(name), memoryview(array.data))
        self._buffer.set_res(function.index_out("x"), memoryview(self._z.data))
