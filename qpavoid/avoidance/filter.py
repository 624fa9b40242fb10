"""The safety filter: the twist nearest to the desired one that respects the rows."""

import math
from time import perf_counter

import numpy as np
import numpy.typing as npt

from qpavoid.avoidance.decision import (
    FILTERED,
    INVALID,
    RELAXED,
    STATUSES,
    STOPPED,
    TRACKING,
    Decision,
)
from qpavoid.avoidance.rows import constraint_rows, row_reach
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.compiled import compiled
from qpavoid.errors import InvalidInputError
from qpavoid.model.contact import Names, contact_table
from qpavoid.model.footprint import Array
from qpavoid.model.obstacles import (
    NO_DISCS,
    NO_POINTS,
    NO_WALLS,
    check_obstacles,
    obstacle_arrays,
)
from qpavoid.model.robot import Robot
from qpavoid.qp.exact import certificate, relaxation, solve_exactly
from qpavoid.qp.problem import FilterProblem, SolveStatus
from qpavoid.qp.solve import TOLERANCE, load_back_end, solve

UNCHANGED = 1e-9
"""A twist that differs by less, in m/s and rad/s, counts as the desired one."""


@compiled
def filter_rows(
    edges: Array,
    circumradius: float,
    settings: npt.NDArray[np.void],
    lower: Array,
    upper: Array,
    points: Array,
    discs: Array,
    disc_velocities: Array,
    walls: Array,
) -> tuple[bool, Array, Array, Names, float]:
    """Return whether the data are valid, A, b, obstacles of the rows, and clearance."""
    reach = row_reach(circumradius, settings, disc_velocities, lower, upper)
    numbers, names, nearest = contact_table(
        edges, circumradius, points, discs, disc_velocities, walls, reach
    )
    if nearest == -2:
        return False, numbers, numbers[:, 0], names[:, 0], math.inf
    A, b, owner = constraint_rows(numbers, names, settings, lower, upper)
    clearance = numbers[nearest, 4] if nearest >= 0 else math.inf
    return True, A, b, owner, clearance


@compiled
def filter_step(
    edges: Array,
    circumradius: float,
    settings: npt.NDArray[np.void],
    weights: Array,
    lower: Array,
    upper: Array,
    points: Array,
    discs: Array,
    disc_velocities: Array,
    walls: Array,
    v: float,
    omega: float,
) -> tuple[int, float, float, float, float, float, int, int]:
    """Return code, v, ω, clearance, slack, residual, and the two active obstacles.

    Contacts, rows, exact answer and its certificate, in one compiled call.
    """
    if not (math.isfinite(v) and math.isfinite(omega)):
        return INVALID, 0.0, 0.0, math.inf, 0.0, 0.0, -1, -1
    valid, A, b, owner, clearance = filter_rows(
        edges,
        circumradius,
        settings,
        lower,
        upper,
        points,
        discs,
        disc_velocities,
        walls,
    )
    if not valid:
        return INVALID, 0.0, 0.0, math.inf, 0.0, 0.0, -1, -1
    tolerance = settings[0].slack_tolerance
    desired = np.array([v, omega])
    _, u_v, u_omega, slack, first, second = solve_exactly(
        A, b, lower, upper, desired, weights, tolerance
    )
    b -= relaxation(slack, tolerance)
    residual = max(certificate(A, b, lower, upper, desired, weights, u_v, u_omega))
    if not residual <= TOLERANCE:
        return STOPPED, 0.0, 0.0, clearance, slack, residual, -1, -1
    code = FILTERED
    if slack > 0.0:
        code = RELAXED
    elif abs(u_v - v) <= UNCHANGED and abs(u_omega - omega) <= UNCHANGED:
        code, u_v, u_omega = TRACKING, v, omega
    first = owner[first] if 0 <= first < owner.shape[0] else -1
    second = owner[second] if 0 <= second < owner.shape[0] else -1
    return code, u_v, u_omega, clearance, slack, residual, first, second


class SafetyFilter:
    """Gives the twist nearest to a desired one that keeps every obstacle away.

    It solves, at every call, min (u − u_f)ᵀ W (u − u_f) over u = (v, ω) within the
    robot's limits, subject to d̂_oᵀ J_0 u ≥ b for every contact in reach; see
    :class:`qpavoid.avoidance.settings.AvoidanceSettings` for b. It never passes a
    desired twist on that it could not check: without an answer it brakes.

    Args:
        robot: Footprint and limits.
        settings: Weights, bound and radii.
        solver: Back end by name: ``exact``, ``osqp``, ``qpsolvers:daqp``, ``casadi``, …

    Raises:
        UnknownNameError: No back end of that name.
        MissingExtraError: The back end's package is not installed.
    """

    def __init__(
        self,
        robot: Robot,
        settings: AvoidanceSettings | None = None,
        solver: str = "exact",
    ) -> None:
        self.robot = robot
        self.settings = settings if settings is not None else AvoidanceSettings()
        self.solver = solver
        self._back_end = None if solver == "exact" else load_back_end(solver)
        limits = robot.limits
        self._lower = np.array([limits.v_min, limits.omega_min])
        self._upper = np.array([limits.v_max, limits.omega_max])
        self._weights = np.array(self.settings.weights)
        self._record = self.settings.record()
        self._edges = robot.footprint.edges
        self._circumradius = robot.footprint.circumradius

    def filter(
        self,
        v: float,
        omega: float,
        points: npt.ArrayLike = NO_POINTS,
        discs: npt.ArrayLike = NO_DISCS,
        disc_velocities: npt.ArrayLike = NO_POINTS,
        walls: npt.ArrayLike = NO_WALLS,
    ) -> Decision:
        """Return the decision for a desired twist among obstacles, robot frame.

        Args:
            v: Desired forward speed, m/s.
            omega: Desired yaw rate, rad/s, counter-clockwise.
            points: (N, 2) sensed points, m; with an empty array there are none.
            discs: (M, 3) x, y, radius, m.
            disc_velocities: (M, 2) velocities over ground in robot axes, m/s; without
                them discs stand still.
            walls: (K, 4) segments x1, y1, x2, y2, m.

        Raises:
            InvalidInputError: A shape does not fit, a number is not finite, or a radius
                negative. Points inside the footprint are valid: their clearance is
                negative, and the answer moves away from them if any twist does.
        """
        started = perf_counter()
        v, omega = as_twist(v, omega)
        arrays = obstacle_arrays(points, discs, disc_velocities, walls)
        if self._back_end is not None:
            return self._filter_by_back_end(started, v, omega, arrays)
        code, v, omega, clearance, slack, residual, first, second = filter_step(
            self._edges,
            self._circumradius,
            self._record,
            self._weights,
            self._lower,
            self._upper,
            *arrays,
            v,
            omega,
        )
        if code == INVALID:
            raise _why_invalid(arrays)
        active = (first,) if second < 0 else (first, second)
        return Decision(
            v,
            omega,
            STATUSES[code],
            clearance,
            slack,
            residual,
            active if first >= 0 else active[1:],
            perf_counter() - started,
        )

    def problem(
        self,
        v: float,
        omega: float,
        points: npt.ArrayLike = NO_POINTS,
        discs: npt.ArrayLike = NO_DISCS,
        disc_velocities: npt.ArrayLike = NO_POINTS,
        walls: npt.ArrayLike = NO_WALLS,
    ) -> FilterProblem:
        """Return the QP that :meth:`filter` would solve; arguments and errors alike.

        An infeasible one is relaxed by :func:`qpavoid.qp.solve.solve` with its default
        ``slack_tolerance``; hand it that of the settings where they have another.
        """
        arrays = obstacle_arrays(points, discs, disc_velocities, walls)
        return self._problem(*as_twist(v, omega), arrays)[0]

    def _problem(
        self, v: float, omega: float, arrays: tuple[Array, Array, Array, Array]
    ) -> tuple[FilterProblem, float]:
        valid, A, b, owner, clearance = filter_rows(
            self._edges,
            self._circumradius,
            self._record,
            self._lower,
            self._upper,
            *arrays,
        )
        if not (valid and math.isfinite(v) and math.isfinite(omega)):
            raise _why_invalid(arrays)
        desired = np.array([v, omega])
        problem = FilterProblem(
            desired, self._weights, A, b, self._lower, self._upper, owner
        )
        return problem, clearance

    def _filter_by_back_end(
        self,
        started: float,
        v: float,
        omega: float,
        arrays: tuple[Array, Array, Array, Array],
    ) -> Decision:
        problem, clearance = self._problem(v, omega, arrays)
        assert self._back_end is not None
        solution = solve(problem, self._back_end, self.settings.slack_tolerance)
        u_v, u_omega = solution.u.tolist()
        if solution.status is SolveStatus.FAILED:
            code, u_v, u_omega = STOPPED, 0.0, 0.0
        elif solution.status is SolveStatus.RELAXED:
            code = RELAXED
        elif abs(u_v - v) <= TOLERANCE and abs(u_omega - omega) <= TOLERANCE:
            code, u_v, u_omega = TRACKING, v, omega
        else:
            code = FILTERED
        return Decision(
            u_v,
            u_omega,
            STATUSES[code],
            clearance,
            solution.slack,
            max(solution.violation, solution.suboptimality),
            tuple(problem.obstacle[list(solution.active)].tolist()),
            perf_counter() - started,
        )


def as_twist(v: float, omega: float) -> tuple[float, float]:
    """Return both as Python floats, whatever kind of number they are."""
    try:
        return float(v), float(omega)
    except (TypeError, ValueError):
        raise InvalidInputError(
            "the desired twist (v, omega) must be numbers"
        ) from None


def _why_invalid(arrays: tuple[Array, Array, Array, Array]) -> InvalidInputError:
    """Return the error that names what is wrong: an obstacle, else the twist."""
    try:
        check_obstacles(*arrays)
    except InvalidInputError as error:
        return error
    return InvalidInputError("the desired twist (v, omega) must be finite")
