"""A mobile manipulator: limits of the base's footprint for pink and mink, G Δq ≤ h.

The base's twist has no lateral part, so the unknowns are u = (v, ω, q̇). A frame is
``("tool",)`` with pink, ``("tool", "body")`` with mink. Nothing is relaxed.

Run: python comparisons/examples/mobile_manipulator.py
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.avoidance.cbf_rows import constraint_rows, row_reach, wheel_rows
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.model.capsules import in_robot_frame, like
from qpavoid.model.contacts import CONTACT, contact_table, empty_contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, twist_box
from qpavoid.model.validation import finite_rows
from qpavoid.qp.exact import A_OMEGA, A_V, ROW_WIDTH, B
from qpavoid.types import Array

Frame: TypeAlias = tuple[str, ...]
ENDS = np.vstack([np.eye(3), -np.eye(3)])  # of v, ω and the lateral speed


class Rows(NamedTuple):
    """G (m, n_v) and h (m,) of G Δq ≤ h; there may be none."""

    G: Array
    h: Array
    inactive: bool = False  # mink asks


class FootprintLimit:
    """Rows d̂ᵀ J_0 (v, ω) ≥ −γ(d − r_min) + d̂ᵀ v_o of the base, and its limits.

    Attributes:
        obstacles: World frame; update them as they move.
        driven: (v, ω) last driven, m/s and rad/s: accelerations count from there.
    """

    def __init__(self, robot: Robot, frame: Frame, settings: AvoidanceSettings) -> None:
        self.obstacles, self.driven = Obstacles(), (0.0, 0.0)
        self._edges, self._frame, self._dt = robot.footprint.edges, frame, settings.dt
        self._known = robot.limit_vector, settings.record()

    def compute_qp_inequalities(self, configuration: Any, dt: float) -> Rows:
        """Return the rows at a configuration; dt must be that of the settings, s."""
        if not np.isclose(dt, self._dt):
            raise InvalidInputError(f"dt is {dt} s, but {self._dt} s in the settings")
        place, J = _frame(configuration, self._frame)
        pose = place[0, 3], place[1, 3], np.arctan2(place[1, 0], place[0, 0])
        robot, arrays = self._known[0], like(self.obstacles.arrays)
        in_robot_frame(pose, 0.0, self.obstacles.arrays, arrays)
        contacts = empty_contacts(self._edges, arrays)
        reach = row_reach(*self._known, arrays[1], 0.0)
        box = twist_box(robot, *finite_rows([(*self.driven, dt)], 3, "driven")[0])
        n, _ = contact_table(self._edges, robot[-1], arrays, reach, contacts)
        rows = np.zeros((n + 4, ROW_WIDTH))
        seen = contacts.view(CONTACT)[:n]
        m = constraint_rows(seen, *self._known, box, 0.0, False, rows)
        m += wheel_rows(robot, rows[m:])
        G, h = np.zeros((m + 6, 3)), np.zeros(m + 6)
        G[:m, :2], h[:m] = -rows[:m, A_V : A_OMEGA + 1], -rows[:m, B]
        G[m:], h[m:] = ENDS, (box[1], box[3], 0.0, -box[0], -box[2], 0.0)
        return Rows((G @ J[[0, 5, 1]])[h < np.inf], dt * h[h < np.inf])


def _frame(configuration: Any, frame: Frame) -> tuple[Array, Array]:
    """Return where a frame is (4, 4), and its Jacobian (6, n_v) in its own axes."""
    place = configuration.get_transform_frame_to_world(*frame)
    matrix = place.homogeneous if hasattr(place, "homogeneous") else place.as_matrix()
    return finite_rows(matrix, 4, "a frame"), configuration.get_frame_jacobian(*frame)
