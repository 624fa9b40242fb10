"""Plant of rigid bodies in MuJoCo: wheels that slip, motors that lag.

A twist goes through the driver: a delay, limits of acceleration, and for every wheel
v ∓ ω b m/2 (b: track, m: wheel separation multiplier), which its motor follows as a
system of first order within its torque. The contact of wheels and ground is
simulated.

Obstacles are not part of it. Clearances are computed along the arc of every control
step as with every other plant, so a contact is recorded but stops nothing, and
obstacles cost no more than without physics. Sensors use the base's position and heading
in the plane, regardless of its pitch; the lateral velocity of a method (``omni``) is
added to that of the wheels.

The bases are MJCF files beside this one, ``differential`` (MiR100) and ``skid-steer``
(Clearpath Jackal): masses, sizes, wheels, torque and the driver's limits as published.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from qpavoid.errors import MissingExtraError
from qpavoid.lab.sensing.plant import Drive, twist_between, wheel_speeds, wheel_twist
from qpavoid.settings import FINITE, NOT_NEGATIVE, POSITIVE, Range, check, want
from qpavoid.types import Pose, Twist

DT = 0.005
"""s; greatest step of the simulation."""

RESET = 5.0
"""1/s; integral gain of a motor's PI speed servo."""

WHEEL = 1
"""Collision group of wheels."""


@dataclass(frozen=True)
class Patch:
    """A rectangle of another friction; of several under a wheel the last one counts.

    Attributes:
        place: Its middle, m, world frame.
        size: Length along ``heading`` and width across it, m.
        heading: rad
        friction: Of wheels on it.
    """

    place: Annotated[Twist, FINITE, ("x_m", "y_m")]
    size: Annotated[Twist, POSITIVE, ("length_m", "width_m")]
    heading: Annotated[float, "rad", FINITE] = 0.0
    friction: Annotated[float, NOT_NEGATIVE] = 0.1

    def __post_init__(self) -> None:
        check(self, "a patch needs")


STEP_ROUNDING = 1e-6
"""s, or of a step: tolerance for rounding."""

UPRIGHT = 0.5
"""Cosine of the greatest tilt of an upright base."""

SETTLING = 1.0
"""s for which a base settles on its wheels before it is driven."""


@dataclass(frozen=True)
class Physics:
    """A base of rigid bodies.

    Attributes:
        base: ``differential``, two driven wheels and four casters (MiR100), or
            ``skid-steer``, four driven wheels (Jackal).
        friction: Of every wheel.
        delay: s until a twist reaches the driver.
        lag: Time constant of a motor, s.
        acceleration: Greatest of the driver, m/s² and rad/s²; at most the published
            one.
        separation_multiplier: m; 0: the published one, 1 or 1.5.
        patches: Of the ground.
    """

    base: Literal["differential", "skid-steer"] = "differential"
    friction: Annotated[float, NOT_NEGATIVE] = 0.5
    delay: Annotated[float, "s", Range(ge=0.0, le=1.0)] = 0.02
    lag: Annotated[float, "s", NOT_NEGATIVE] = 0.05
    acceleration: Annotated[
        Twist, Range(gt=0.0), ("acceleration_mps2", "angular_acceleration_radps2")
    ] = (math.inf, math.inf)
    separation_multiplier: Annotated[float, NOT_NEGATIVE] = 0.0
    patches: tuple[Patch, ...] = ()

    def __post_init__(self) -> None:
        check(self, "a base in MuJoCo needs")

    def start(self, pose: Pose = (0.0, 0.0, 0.0)) -> Callable[..., Drive]:
        """Return the step of a base at rest at ``pose``.

        A function from v, ω and time dt (s) to the motion driven.

        Raises:
            MissingExtraError: MuJoCo is not installed.
        """
        return PhysicsRun(self, pose).step


class PhysicsRun:
    """State of a base.

    Attributes:
        data: MuJoCo's state; its first numbers are position and rotation of the base.
        acceleration: Limits of the driver, m/s² and rad/s².
    """

    def __init__(self, settings: Physics, pose: Pose) -> None:
        try:
            import mujoco
        except ImportError:
            raise MissingExtraError("MuJoCo", "mujoco") from None
        text = Path(__file__).with_name(f"{settings.base}.xml").read_text("utf-8")
        self._settings, model = settings, mujoco.MjModel.from_xml_string(text)
        self._model: Any = model
        self.data: Any = mujoco.MjData(model)
        self._advance = partial(mujoco.mj_step, model, self.data)
        self._rolling = np.flatnonzero(model.geom_contype == WHEEL)
        model.geom_friction[self._rolling, 0] = settings.friction
        published = model.numeric("acceleration").data.tolist()
        self.acceleration = [*map(min, settings.acceleration, published)]
        known = [float(model.numeric(x).data[0]) for x in ("track", "multiplier")]
        self._track = known[0] * (settings.separation_multiplier or known[1])
        self._radius = float(model.geom_size[self._rolling[0], 0])
        self._torque = model.actuator_forcerange[0, 1] / model.actuator_gainprm[0, 0]
        self._angles = model.jnt_qposadr[model.actuator_trnid[:, 0]]
        self._coming: deque[tuple[float, Twist]] = deque()
        self._asked = (0.0, 0.0)
        self._told, self._turning = [0.0, 0.0], [0.0, 0.0]
        self._missing = np.zeros(model.nu)
        half, qpos = 0.5 * pose[2], self.data.qpos
        qpos[:2], qpos[3], qpos[6] = pose[:2], math.cos(half), math.sin(half)
        for _ in range(round(SETTLING / DT)):  # it comes to rest on its wheels
            self._advance()
        self.data.time = 0.0

    @property
    def pose(self) -> Pose:
        """x, y (m), γ (rad) of the robot's frame."""
        x, y, _, w, i, j, k = self.data.qpos[:7].tolist()
        return x, y, math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))

    def step(self, v: float, omega: float, dt: float) -> Drive:
        """Drive a commanded twist for dt (s), and return the mean twists.

        Raises:
            InvalidInputError: The base has tipped over, or the solver has failed.
        """
        arrival = self.data.time + self._settings.delay
        self._coming.append((arrival, (v, omega)))
        before, angles = self.pose, self.data.qpos[self._angles]
        parts = math.ceil(dt / DT - STEP_ROUNDING)
        self._model.opt.timestep = h = dt / parts
        for _ in range(parts):
            self._drive(h)
            self._slip()
            self._advance()
        i, j = self.data.qpos[4:6].tolist()
        upright = 1.0 - 2.0 * (i * i + j * j) > UPRIGHT
        want(
            upright and not self.data.warning.number.any(),
            "the base in MuJoCo has tipped over: its ground is too rough",
        )
        turned = (self.data.qpos[self._angles] - angles).tolist()
        v, omega, lateral = twist_between(before, self.pose, dt)
        sides = len(turned) // 2
        left, right = (
            self._radius * sum(turned[side::2]) / (sides * dt) for side in (0, 1)
        )
        return Drive(wheel_twist(left, right, self._track), (v, omega), lateral)

    def _drive(self, h: float) -> None:
        """Set the speeds of the motors for the next h s."""
        while self._coming and self._coming[0][0] <= self.data.time + STEP_ROUNDING:
            _, self._asked = self._coming.popleft()
        lag = self._settings.lag
        for i, most in enumerate(self.acceleration):
            change = self._asked[i] - self._told[i]
            self._told[i] += min(max(change, -most * h), most * h)
        share = 1.0 - math.exp(-h / lag) if lag else 1.0
        v, omega = self._told
        for i, speed in enumerate(wheel_speeds(v, omega, self._track)):
            self._turning[i] += share * (speed / self._radius - self._turning[i])
        wanted = np.array(self._turning * (len(self._angles) // 2))
        most, behind = self._torque, wanted - self.data.actuator_velocity
        self._missing = np.clip(self._missing + RESET * h * behind, -most, most)
        self.data.ctrl[:] = wanted + self._missing

    def _slip(self) -> None:
        """Set the friction of every wheel to that of the ground below it."""
        if not self._settings.patches:
            return
        places = self.data.geom_xpos[self._rolling, :2]
        friction = np.full(len(places), self._settings.friction)
        for patch in self._settings.patches:
            cos, sin = math.cos(patch.heading), math.sin(patch.heading)
            there = np.abs((places - patch.place) @ [[cos, -sin], [sin, cos]])
            friction[(there <= 0.5 * np.array(patch.size)).all(axis=1)] = patch.friction
        self._model.geom_friction[self._rolling, 0] = friction
