"""Artificial potential field [Khatib1986]."""

from dataclasses import dataclass

from qpavoid.avoidance.controllers import StepContext
from qpavoid.compiled import compiled, compiled_once, entry
from qpavoid.lab.baselines.drive import Baseline, Command
from qpavoid.model.contacts import CONTACT, CONTACT_SIZE, contact_table, empty_contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Twist, Vector

LEAST_DISTANCE = 0.02
"""m; distance below which the force is constant: the potential diverges at contact."""


@compiled
def force(distance: float, strength: float, reach: float) -> float:
    """Return −dU/dd = η(1/d − 1/d_0)/d² of U = ½η(1/d − 1/d_0)², d < d_0, else 0.

    Args:
        distance: d, m; not below :data:`LEAST_DISTANCE`.
        strength: η.
        reach: d_0, m.
    """
    if distance >= reach:
        return 0.0
    d = max(distance, LEAST_DISTANCE)
    return strength * (1.0 / d - 1.0 / reach) / (d * d)


@entry
@compiled_once
def whole_force(memory: Vector, strength: float, reach: float) -> tuple[float, float]:
    """Return Σ F = −∇U over shifts of the robot, one nearest contact per obstacle.

    Contacts of one obstacle are successive rows of the table.
    """
    contacts, f_x, f_y, i = memory.view(CONTACT), 0.0, 0.0, 0
    count = contacts.shape[0]
    while i < count:
        nearest, obstacle = i, contacts[i].obstacle
        while i < count and contacts[i].obstacle == obstacle:
            if contacts[i].distance < contacts[nearest].distance:
                nearest = i
            i += 1
        size = force(contacts[nearest].distance, strength, reach)
        f_x -= size * contacts[nearest].n_x
        f_y -= size * contacts[nearest].n_y
    return f_x, f_y


@dataclass(frozen=True)
class PotentialController(Baseline):
    """The desired twist plus the forces of all obstacles on a point ahead of the axle.

    Every obstacle nearer to the footprint than ``reach`` repels. The point ``lever``
    ahead of the axle can move in any direction, with (v, ω·lever); the sum of the
    forces is added to its velocity: ``strength`` includes the mobility. The tracking
    law replaces the attractive potential. The obstacles' velocities are not used.

    Attributes:
        strength: η times the mobility, m⁴/s.
        lever: m.
        reach: d_0, m.
    """

    strength: float = 0.03
    lever: float = 0.3
    reach: float = 0.8

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the desired twist and the forces; None: the desired twist."""
        edges, arrays = self.robot.footprint.edges, obstacles.arrays
        contacts = empty_contacts(edges, arrays)
        radius = self.robot.footprint.circumradius
        count, _ = contact_table(edges, radius, arrays, self.reach, contacts)
        within = contacts[: count * CONTACT_SIZE]
        f_x, f_y = whole_force(within, self.strength, self.reach)
        if f_x == 0.0 == f_y:
            return None
        return Command((desired[0] + f_x, desired[1] + f_y / self.lever))
