"""Tolerances of the QP solvers, as tight as each one allows, by their own names."""

from collections.abc import Mapping
from typing import Any

OSQP: Mapping[str, Any] = {
    "eps_abs": 1e-10,
    "eps_rel": 1e-10,
    "max_iter": 20_000,
    "adaptive_rho_interval": 50,  # fixed, or it follows the wall clock
}

PIQP: Mapping[str, Any] = {
    "eps_abs": 1e-8,
    "eps_rel": 1e-8,
    "eps_duality_gap_abs": 1e-13,  # the gap is quadratic in the error of z
    "eps_duality_gap_rel": 1e-13,
}

DAQP: Mapping[str, Any] = {"primal_tol": 1e-9}
