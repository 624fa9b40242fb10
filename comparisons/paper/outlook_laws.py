"""Laws of the paper's outlook: a radius by closing speed, and variable coefficients.

v_c = −ḋ is the closing speed at P_r (m/s) of the obstacle and the twist driven last;
S(q) = 3q² − 2q³ with q cut to [0, 1].

* ``closing-radius``: r_min(v_c) = 0.17 m + (r_high − 0.17 m)·(v_c − 0.1)/(v_high − 0.1)
  with v_c cut to [0.1 m/s, v_high], in place of the paper's by |v_o|; r = 4/3 r_min.
* ``variable-coefficients``: ẋ_0·(s + (1 − s)·S(v_c / 0.5 m/s)), gentler where nothing
  closes in; and all that tracking adds to the planned twist, for Eq. 6 a common factor
  of k_x, k_y and k_γ, times 1 − κ·S((r − d)/(r − r_min)): recovery yields to repulsion.
"""

import math
from typing import Any

from qpavoid.avoidance.controllers import StepContext
from qpavoid.avoidance.decision import STATUSES, Decision
from qpavoid.avoidance.repulsion import repulsive_twist
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius, activation
from qpavoid.model.contact import approach_row
from qpavoid.model.contacts import (
    ObstacleContact,
    contact_at,
    contact_table,
    empty_contacts,
)
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.tracking.kanayama import kanayama
from qpavoid.types import Twist

V_REF = SafetyRadius.speed_high
"""m/s; from which on the paper calls an obstacle fast."""

SMOOTH = 2
"""S, as an activation."""

NAMES = {"closing-radius": "ClosingRadius", "variable-coefficients": "Coefficients"}
"""Arms that are laws of one's own; the others are settings of Eq. 5 and Eq. 7."""

CHOSEN: dict[int, dict[str, tuple[float, ...]]] = {
    5: {
        "closing-radius": (0.35, 1.0),
        "closing-time": (0.4,),
        "fixed-radius": (0.3,),
        "variable-coefficients": (0.1, 0.8),
        "fixed-coefficients": (0.3, 0.0),
    },
    7: {
        "closing-radius": (0.8, 0.5),
        "closing-time": (0.6,),
        "fixed-radius": (0.8,),
        "variable-coefficients": (0.1, 0.0),
        "fixed-coefficients": (0.1, 0.4),
    },
}
"""By law and arm, what ``outlook.py --tune`` found best: r_high (m), v_high (m/s); T
(s); r_min (m); s, κ; s, κ."""


class Law:
    """Eq. 5 or 7 of the package, with what varies set anew at every step.

    Attributes:
        law: 5 or 7.
        radius: r_min by closing speed; none: the scenario's, by the obstacle's.
        s: Share of ẋ_0 that acts where nothing closes in.
        kappa: Share of the recovery that is lost at r_min.
    """

    law = 5
    radius: SafetyRadius | None = None
    s, kappa = 1.0, 0.0

    def __init__(self, robot: Robot, settings: AvoidanceSettings) -> None:
        self.footprint, self.limit_vector = robot.footprint, robot.limit_vector
        self.record, self.usual = settings.record(), settings.radius

    def __call__(
        self, v: float, omega: float, obstacles: Obstacles, context: StepContext
    ) -> Decision | Twist:
        """Return the twist before the robot's limits."""
        contact = self._nearest(obstacles)
        if contact is None:
            return v, omega
        closing, record = closing_speed(contact, context.driven), self.record.copy()
        r_min = self.usual.r_min(math.hypot(contact.v_x, contact.v_y))
        if self.radius is not None:
            r_min = self.radius.r_min(max(closing, 0.0))
            record["r_min_slow"] = record["r_min_fast"] = r_min
        record["speed"] *= self.push(closing)
        setup = Setup(self.footprint.edges, self.limit_vector, record)
        request = Request(obstacles.arrays, 0.0, False, (v, omega))
        code, push_v, push_omega = repulsive_twist(self.law, setup, contact, request)
        plan = kanayama(context.target, context.reference, (0.0, 0.0, 0.0))
        lost = self.kappa * near(contact.distance, r_min, self.usual.zone_ratio * r_min)
        twist = (
            v - lost * (v - plan[0]) + push_v,
            omega - lost * (omega - plan[1]) + push_omega,
        )
        return Decision(*twist, STATUSES[code], contact.distance, 0.0, 0.0, (), 0.0)

    def push(self, closing: float) -> float:
        """Return the share of ẋ_0 at a closing speed, m/s."""
        return self.s + (1.0 - self.s) * near(-closing, -V_REF, 0.0)

    def _nearest(self, obstacles: Obstacles) -> ObstacleContact | None:
        edges, arrays = self.footprint.edges, obstacles.arrays
        contacts = empty_contacts(edges, arrays)
        radius = self.footprint.circumradius
        _, nearest = contact_table(edges, radius, arrays, 0.0, contacts)
        return contact_at(contacts, nearest) if nearest >= 0 else None


def near(distance: float, low: float, high: float) -> float:
    """Return S of where a value is from ``high`` (0) to ``low`` (1)."""
    return float(activation(SMOOTH, distance, low, high))


def closing_speed(contact: ObstacleContact, driven: Twist) -> float:
    """Return v_c = −ḋ at P_r, m/s, of a robot that drives (v, ω)."""
    c = contact
    a_v, a_omega = approach_row(c.x, c.y, c.n_x, c.n_y)
    away = a_v * driven[0] + a_omega * driven[1] + c.n_x * c.v_x + c.n_y * c.v_y
    return -float(away)


def law_of(law: int, arm: str, constants: tuple[float, ...]) -> type[Law] | None:
    """Return the law of an arm; none where settings say it."""
    what: dict[str, Any] = {"law": law}
    if arm == "closing-radius":
        high, speed = constants
        what["radius"] = SafetyRadius(r_min_fast=high, speed_high=speed)
    elif arm == "variable-coefficients":
        what["s"], what["kappa"] = constants
    else:
        return None
    return type(f"Eq{law}", (Law,), what)


def method_of(law: int, arm: str) -> str:
    """Return what a sweep knows the arm of a law by."""
    return f"outlook_laws:Eq{law}{NAMES[arm]}" if arm in NAMES else f"eq{law}"


for one, arms in CHOSEN.items():
    for name in NAMES:
        globals()[f"Eq{one}{NAMES[name]}"] = law_of(one, name, arms[name])
