"""All solvers of the timing study by name: the package's back ends, and their peers."""

from collections.abc import Callable
from functools import partial
from typing import Any

from qpavoid.qp.backend_osqp import SETTINGS, OSQPBackEnd
from qpavoid.qp.backend_qpsolvers import TIGHT
from qpavoid.qp.solve import BACK_ENDS, BackEnd, BackEndEntry
from timing.peers import CBFPY, Cbfpy, Daqp, Piqp, Quadprog


def _entry(kind: Callable[..., BackEnd], module: str, *settings: Any) -> BackEndEntry:
    extra = "quadprog" if module == "quadprog" else "bench"
    return BackEndEntry(partial(kind, *settings), module, extra)


LOOSE: dict[str, Any] = {**SETTINGS, "eps_abs": 1e-6, "eps_rel": 1e-6}
"""OSQP's settings with a tolerance of 1e-6."""

CONTENDERS: dict[str, BackEndEntry] = {
    "exact": BACK_ENDS["exact"],
    "daqp": _entry(Daqp, "daqp", TIGHT["daqp"]),
    "daqp default": _entry(Daqp, "daqp", {}),
    "osqp": BACK_ENDS["osqp"],
    "osqp 1e-6": _entry(OSQPBackEnd, "osqp", LOOSE),
    "osqp default": _entry(OSQPBackEnd, "osqp", {"verbose": False}),
    "piqp": _entry(Piqp, "piqp", TIGHT["piqp"]),
    "piqp default": _entry(Piqp, "piqp", {}),
    "quadprog": _entry(Quadprog, "quadprog", {}),
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("casadi:")},
    **{name: entry for name, entry in BACK_ENDS.items() if name.startswith("qpsolv")},
    "cbfpy:elastiqp": _entry(Cbfpy, "cbfpy", CBFPY),
}
"""All solvers of the study by name: those of the package, and the peers."""
