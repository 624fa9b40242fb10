"""cbfpy, a filter of control barrier functions in jax: on our rows, and by itself."""

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.qp.problem import ScaledProblem
from qpavoid.types import Array
from timing.peers import Workspace
from timing.recorded import Scan

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
