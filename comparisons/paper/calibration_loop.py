"""One calibration of a case of the paper, driven by both laws in a compiled loop."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from qpavoid.avoidance.repulsion import repulsion_step
from qpavoid.avoidance.scene import Request, Setup
from qpavoid.avoidance.settings import Activation, AvoidanceSettings, Repulsion
from qpavoid.compiled import compiled_once
from qpavoid.lab.simulation.log import CLOSED_FORM, COLUMNS, Log
from qpavoid.lab.simulation.scenario import Scenario, load_scenario
from qpavoid.model.capsules import in_robot_frame
from qpavoid.model.contacts import empty_contacts
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from qpavoid.tracking.kanayama import Reference
from qpavoid.tracking.station import RESTING, track_step
from qpavoid.types import Array, Arrays
from statements import TWO


@lru_cache
def base_of(case: str) -> Scenario:
    """Return our scenario of a case."""
    return load_scenario(case)


@lru_cache
def plan_of(case: str) -> Array:
    """Return the (n + 1, 5) reference of our scenario of a case; it is not written."""
    base = base_of(case)
    return base.path.sample(base.times)


ZONE = base_of(TWO).settings.radius.r()
"""r, m; the obstacles are slow."""


@dataclass(frozen=True)
class Calibration:
    """What the paper leaves open: m, m/s, rad/s.

    Attributes:
        x: Of the obstacle at time 0.
        y: The same.
        v_x: Of the obstacle.
        v_y: The same.
        radius: Of the obstacle.
        v_max: The robot's limit, both ways.
        omega_max: The same.
        damping: λ of the laws.
        activation: Of the repulsive velocity.
    """

    x: float
    y: float
    v_x: float
    v_y: float
    radius: float
    v_max: float
    omega_max: float
    damping: float
    activation: Activation

    def settings(self, case: str) -> AvoidanceSettings:
        """Return the settings of the laws."""
        repulsion = Repulsion(10.0, self.activation, self.damping)
        return replace(base_of(case).settings, repulsion=repulsion)

    def robot(self, case: str) -> Robot:
        """Return the case's robot with these limits."""
        limits = Limits.symmetric(self.v_max, self.omega_max)
        return replace(base_of(case).robot, limits=limits)


@compiled_once
def drive(
    law: int,
    setup: Setup,
    gains: Array,
    plan: Array,
    world: Arrays,
    memory: Arrays,
    rows: Array,
) -> None:
    """Run a loop of a robot that starts where its plan does.

    Args:
        law: 5 or 7.
        setup: Footprint, limits and settings.
        gains: Of the tracking law.
        plan: (n + 1, 5) reference at each control step.
        world: The obstacle at time 0.
        memory: For the obstacle as the robot sees it.
        rows: (n + 1, 8) pose, v, ω, clearance, and the v, ω that tracking wants at each
            control step; of the last row the pose alone.
    """
    pose, mode, dt = (plan[0, 0], plan[0, 1], plan[0, 2]), RESTING, setup.settings[0].dt
    state, contacts = rows[-1, 3:5], memory[0]
    for k in range(rows.shape[0] - 1):
        in_robot_frame(pose, k * dt, world, (world[0], memory[1]))
        at = plan[k]
        goal = Reference(at[0], at[1], at[2], at[3], at[4])
        v, omega, mode = track_step(gains, setup.robot, pose, goal, mode)
        request = Request((world[0], memory[1]), 0.0, False, (v, omega))
        o = repulsion_step(law, setup, request, state, contacts)
        rows[k, 0], rows[k, 1], rows[k, 2] = pose
        rows[k, 3], rows[k, 4], rows[k, 5] = o.v, o.omega, o.clearance
        rows[k, 6], rows[k, 7] = v, omega
        pose = arc(pose[0], pose[1], pose[2], o.v, o.omega, dt)
    rows[-1, 0], rows[-1, 1], rows[-1, 2] = pose


def driven(found: Calibration, law: int, case: str = TWO) -> Array:
    """Return the rows of :func:`drive`."""
    base, robot = base_of(case), found.robot(case)
    edges = robot.footprint.edges
    setup = Setup(edges, robot.limit_vector, found.settings(case).record())
    disc = np.array([[found.x, found.y, found.radius]])
    velocity = np.array([[found.v_x, found.v_y]])
    world = Obstacles(discs=disc, disc_velocities=velocity).arrays
    memory = empty_contacts(edges, world), world[1].copy()
    rows = np.zeros((base.steps + 1, 8))
    drive(law, setup, base.tracker.array, plan_of(case), world, memory, rows)
    return rows


def log_of(found: Calibration, law: int, case: str = TWO) -> Log:
    """Return the log of a run, with what the statements look at."""
    base, rows = base_of(case), driven(found, law, case)
    names = (
        *("x_m", "y_m", "heading_rad", "v_mps", "omega_radps", "clearance_m"),
        *("v_desired_mps", "omega_desired_radps"),
    )
    plan = plan_of(case)
    wanted = "x_ref_m", "y_ref_m", "heading_ref_rad", "v_ref_mps", "omega_ref_radps"
    columns = dict.fromkeys(COLUMNS, np.zeros(base.steps))
    columns |= dict(zip(names, rows[:-1].T, strict=True))
    columns |= dict(zip(wanted, plan[:-1].T, strict=True))
    columns |= {
        "t_s": base.times[:-1],
        "least_clearance_m": columns["clearance_m"],
        "r_m": np.full(base.steps, ZONE),
        "r_min_m": np.full(base.steps, base.settings.radius.r_min_slow),
    }
    meta = {"dt_s": base.dt, "arrival": base.arrival, "solver": CLOSED_FORM}
    none, corners = np.empty((0, 4)), base.robot.footprint.vertices
    shapes = np.empty((base.steps, 0, 3)), none, none, corners, none
    return Log(meta, columns, rows[-1, :3], plan[-1], *shapes)
