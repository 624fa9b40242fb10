"""All solvers of the timing study by name: the package's back ends, and their peers."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from qpavoid.qp.backend_casadi import CasadiBackEnd
from qpavoid.qp.backend_osqp import SETTINGS, OSQPBackEnd
from qpavoid.qp.backend_qpsolvers import TIGHT
from qpavoid.qp.problem import ScaledProblem
from qpavoid.qp.solve import BACK_ENDS, BackEnd, BackEndEntry
from qpavoid.types import Array
from timing.peers import (
    CBFPY,
    Cbfpy,
    Clarabel,
    Cvxpy,
    Daqp,
    Piqp,
    Proxqp,
    Quadprog,
)

CAPPED = {"max_iter": 300, "max_iter_in": 100}
"""ProxQP's iterations; with its defaults one infeasible problem takes minutes."""

QUIET: dict[str, Mapping[str, Any]] = {
    "qpoases": {"printLevel": "none"},
    "proxqp": {"proxqp": {"eps_abs": 1e-12, "max_iter": 300}},
}
"""Options of CasADi's other plug-ins; highs is left out: its stats() crash."""


class Afresh:
    """A back end that is loaded and set up at every call."""

    def __init__(self, load: Callable[[], Any]) -> None:
        self._load = load
        self.settings = load().settings

    def __call__(self, problem: ScaledProblem) -> Array:
        """Return z, or NaN."""
        z: Array = self._load()(problem)
        return z


def _entry(kind: Callable[..., BackEnd], module: str, *settings: Any) -> BackEndEntry:
    extra = "quadprog" if module == "quadprog" else "bench"
    return BackEndEntry(partial(kind, *settings), module, extra)


def _osqp(eps: float) -> dict[str, Any]:
    return {**SETTINGS, "eps_abs": eps, "eps_rel": eps}


_PROXQP = {k: v for k, v in TIGHT["proxqp"].items() if k != "mu_in"} | CAPPED
_CLARABEL: dict[str, Any] = {"verbose": False, "presolve_enable": False}
_CVXPY_OSQP = {k: SETTINGS[k] for k in ("eps_abs", "eps_rel", "max_iter")}

CONTENDERS: dict[str, BackEndEntry] = {
    "exact": BACK_ENDS["exact"],
    "daqp": _entry(Daqp, "daqp", TIGHT["daqp"]),
    "daqp default": _entry(Daqp, "daqp", {}),
    "daqp afresh": _entry(Afresh, "daqp", partial(Daqp, TIGHT["daqp"])),
    "osqp": BACK_ENDS["osqp"],
    "osqp 1e-8": _entry(OSQPBackEnd, "osqp", _osqp(1e-8)),
    "osqp 1e-6": _entry(OSQPBackEnd, "osqp", _osqp(1e-6)),
    "osqp default": _entry(OSQPBackEnd, "osqp", {"verbose": False}),
    "osqp afresh": _entry(Afresh, "osqp", OSQPBackEnd),
    "piqp": _entry(Piqp, "piqp", TIGHT["piqp"]),
    "piqp default": _entry(Piqp, "piqp", {}),
    "proxqp": _entry(Proxqp, "proxsuite", _PROXQP | {"default_mu_in": 1e-2}),
    "proxqp default": _entry(Proxqp, "proxsuite", CAPPED),
    "clarabel": _entry(Clarabel, "clarabel", {**TIGHT["clarabel"], **_CLARABEL}),
    "clarabel default": _entry(Clarabel, "clarabel", _CLARABEL),
    "quadprog": _entry(Quadprog, "quadprog", {}),
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("casadi:")},
    **{
        f"casadi:{plugin}": _entry(CasadiBackEnd, "casadi", plugin, options)
        for plugin, options in QUIET.items()
    },
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("qpsolv")},
    "cvxpy:osqp": _entry(Cvxpy, "cvxpy", {"solver": "OSQP", **_CVXPY_OSQP}),
    "cvxpy:clarabel": _entry(Cvxpy, "cvxpy", {"solver": "CLARABEL"}),
    "cbfpy:elastiqp": _entry(Cbfpy, "cbfpy", CBFPY),
    "cbfpy:qpax": _entry(Cbfpy, "cbfpy", {**CBFPY, "backend": "qpax"}),
}
"""All solvers of the study by name: those of the package, and the peers."""
