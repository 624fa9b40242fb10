"""CasADi [Andersson2019]: the problem written symbolically, solved by its plug-ins."""

from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from qpavoid.qp.accuracy import DAQP, OSQP, PIQP
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array

OPTIONS: Mapping[str, Mapping[str, Any]] = {
    "qrqp": {
        "print_iter": False,
        "print_header": False,
        "print_info": False,
        "max_iter": 100,
    },
    "osqp": {"osqp": {"verbose": False, **OSQP}},
    "daqp": {"daqp": dict(DAQP)},
    "piqp": {"piqp": dict(PIQP)},
}


class Program:
    """The problem for a fixed number of rows and n unknowns, and its bound memory.

    Unused rows are 0 ≥ −1. ``buffer.stats()`` is CasADi's status of the last answer.
    """

    def __init__(
        self, plugin: str, settings: Mapping[str, Any], rows: int, n: int
    ) -> None:
        z = ca.SX.sym("z", n)
        target = ca.SX.sym("target", n)
        normals = ca.SX.sym("normals", n, rows)
        offsets = ca.SX.sym("offsets", rows)
        problem = {
            "x": z,
            "p": ca.vertcat(target, ca.vec(normals), offsets),
            "f": 0.5 * ca.sumsqr(z - target),
            "g": normals.T @ z - offsets,
        }
        options = {"error_on_fail": False, "print_time": False, **settings}
        function = ca.qpsol("projection", plugin, problem, options)
        self._p, self._rows = np.zeros(n + (n + 1) * rows), rows
        self._lower, self._upper, self._start = np.zeros((3, n))
        self._z = np.zeros(n)
        self._bounds = np.zeros(rows), np.full(rows, np.inf)
        self._function = function
        self.buffer, self._evaluate = function.buffer()
        arguments = {
            "x0": self._start,
            "p": self._p,
            "lbx": self._lower,
            "ubx": self._upper,
            "lbg": self._bounds[0],
            "ubg": self._bounds[1],
        }
        for name, array in arguments.items():
            self.buffer.set_arg(function.index_in(name), memoryview(array.data))
        self.buffer.set_res(function.index_out("x"), memoryview(self._z.data))

    def solve(self, problem: ScaledProblem) -> Array:
        """Return z."""
        n, rows, size = len(self._z), len(problem.offsets), self._rows
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


class CasadiBackEnd:
    """A CasADi QP, called through its FunctionBuffer; one program for each size.

    CasADi gets the memory of arguments and answer once; a call writes into it and
    evaluates. There is a program for every power of two of rows, so that one large
    problem does not slow the small ones that follow.

    Args:
        plugin: CasADi's name of the solver.
        settings: Its options; default :data:`OPTIONS`.

    Attributes:
        last: The program used last.
    """

    made: type[Program] = Program
    last: Program

    def __init__(self, plugin: str, settings: Mapping[str, Any] | None = None) -> None:
        self._plugin = plugin
        self.settings = OPTIONS.get(plugin, {}) if settings is None else settings
        self._programs: dict[tuple[int, int], Program] = {}

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z as the plug-in gives it; certified by the caller."""
        rows, n = problem.normals.shape
        size = max(4, 1 << rows.bit_length()), n
        if size not in self._programs:
            self._programs[size] = self.made(self._plugin, self.settings, *size)
        self.last = self._programs[size]
        return self.last.solve(problem)


BACK_END = CasadiBackEnd
