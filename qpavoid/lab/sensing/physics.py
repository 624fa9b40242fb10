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

Bases are models of primitives:

- ``differential``: MiR100. Masses, sizes, places of wheels and casters, torque and the
  driver's limits as in DFKI-NI/mir_robot (BSD-3), ``mir_v1.urdf.xacro``,
  ``mir_100.gazebo.xacro``, ``diffdrive_controller.yaml``. The springs of its casters
  are ours: half of the weight is on the driven wheels.
- ``skid-steer``: Clearpath Jackal. Masses, inertia, wheels, wheel separation multiplier
  and the driver's limits as in jackal/jackal (BSD-3), ``jackal.urdf.xacro``,
  ``control.yaml``.

Wheels are ellipsoids of the published radius: a cylinder on its edge hardly turns.
Friction is set per wheel; the ground has none of its own, since MuJoCo uses the
greater one.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from qpavoid.errors import MissingExtraError
from qpavoid.lab.sensing.plant import Drive, wheel_speeds, wheel_twist
from qpavoid.model.kinematics import STRAIGHT, wrap_angle
from qpavoid.settings import FINITE, NOT_NEGATIVE, POSITIVE, Range, check, want
from qpavoid.types import Pose, Twist

DT = 0.005
"""s; step of the simulation."""

ROTOR, SERVO, RESET = 0.1, 20.0, 5.0
"""kg m² of a motor's rotor behind its gear, N m s/rad and 1/s of its PI speed servo.
The contact solver ignores the servo: without the rotor's inertia a wheel would run
freely, and a skid-steered base would turn a third of what it should."""

SPRING, DAMPER = 5e3, 500.0
"""N/m and N s/m of a caster."""

WHEEL, GROUND = 1, 2
"""Collision groups: wheels touch the ground, and nothing else."""


class BaseModel(NamedTuple):
    """A base; robot frame, the origin on the ground below the middle of its axle.

    Attributes:
        mass: Of the body without wheels, kg.
        inertia: Its principal moments, kg m².
        centre: Its centre of mass, m.
        radius: Of a wheel, m.
        width: Of a wheel, m.
        wheel_mass: kg
        wheel_inertia: About its axle and across, kg m².
        wheels: x, y of the driven ones, m; left and right by turns.
        casters: x, y of the swivels of casters, m; their wheels are like the others.
        trail: From swivel back to its wheel, m.
        track: Between left and right, m.
        multiplier: Of the track, by which the driver turns a yaw rate into speeds of
            wheels.
        torque: Greatest of a wheel, N m.
        acceleration: The driver's limits, m/s² and rad/s².
    """

    mass: float
    inertia: tuple[float, float, float]
    centre: tuple[float, float, float]
    radius: float
    width: float
    wheel_mass: float
    wheel_inertia: Twist
    wheels: tuple[Twist, ...]
    casters: tuple[Twist, ...]
    trail: float
    track: float
    multiplier: float
    torque: float
    acceleration: Twist


MIR100 = BaseModel(
    mass=77.0,
    inertia=(2.736, 5.775, 7.356),
    centre=(0.037646, 0.0, 0.20),
    radius=0.0625,
    width=0.032,
    wheel_mass=1.0,
    wheel_inertia=(0.00195, 0.00106),
    wheels=((0.0, 0.222604), (0.0, -0.222604)),
    casters=(
        *((0.341346, 0.203), (0.341346, -0.203)),
        *((-0.270154, 0.203), (-0.270154, -0.203)),
    ),
    trail=0.0382,
    track=0.445208,
    multiplier=1.0,
    torque=10.0,
    acceleration=(2.0, 2.5),
)

JACKAL = BaseModel(
    mass=16.523,
    inertia=(0.3136, 0.3922, 0.4485),
    centre=(0.012, 0.002, 0.1305),
    radius=0.098,
    width=0.040,
    wheel_mass=0.477,
    wheel_inertia=(0.0024, 0.0013),
    wheels=(
        *((0.131, 0.187795), (0.131, -0.187795)),
        *((-0.131, 0.187795), (-0.131, -0.187795)),
    ),
    casters=(),
    trail=0.0,
    track=0.37559,
    multiplier=1.5,
    torque=10.0,
    acceleration=(20.0, 25.0),
)

BASES = {"differential": MIR100, "skid-steer": JACKAL}


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


def model_text(base: BaseModel, friction: float) -> str:
    """Return base and ground in MuJoCo's XML.

    Wheels are called ``wheel0`` …; friction is theirs only.
    """
    return f"""<mujoco>
    <option timestep="{DT}" integrator="implicitfast" cone="elliptic" impratio="10"/>
    <default>
      <geom contype="{GROUND}" conaffinity="{WHEEL}" friction="0 0 0"/>
      <default class="wheel">
        <geom type="ellipsoid" condim="3" contype="{WHEEL}" conaffinity="{GROUND}"
              size="{base.radius} {base.width / 2} {base.radius}"
              friction="{friction} 0 0"/>
      </default>
    </default>
    <worldbody>
      <geom type="plane" size="0 0 1"/>
      <body name="base">
        <freejoint/>
        <inertial pos="{_text(*base.centre)}" mass="{base.mass}"
                  diaginertia="{_text(*base.inertia)}"/>
        {"".join(_wheel(base, k) for k in range(len(base.wheels)))}
        {"".join(_caster(base, x, y) for x, y in base.casters)}
      </body>
    </worldbody>
    <actuator>{"".join(_motor(base, k) for k in range(len(base.wheels)))}</actuator>
    </mujoco>"""


def _text(*numbers: float) -> str:
    return " ".join(map(repr, numbers))


def _inertial(base: BaseModel) -> str:
    along, across = base.wheel_inertia
    return (
        f'<inertial pos="0 0 0" mass="{base.wheel_mass}" '
        f'diaginertia="{_text(across, along, across)}"/>'
    )


def _wheel(base: BaseModel, number: int) -> str:
    x, y = base.wheels[number]
    return f"""<body pos="{_text(x, y, base.radius)}">
      <joint name="wheel{number}" axis="0 1 0" armature="{ROTOR}"/>
      {_inertial(base)}
      <geom name="wheel{number}" class="wheel"/></body>"""


def _motor(base: BaseModel, number: int) -> str:
    return (
        f'<velocity joint="wheel{number}" kv="{SERVO}" '
        f'forcerange="{-base.torque} {base.torque}"/>'
    )


def _caster(base: BaseModel, x: float, y: float) -> str:
    """Return a swivel on a spring with a wheel behind it, as in forward motion."""
    parts = len(base.casters) * base.wheel_mass + len(base.wheels) * base.wheel_mass
    load = 0.5 * 9.81 * (base.mass + parts) / len(base.casters)
    return f"""<body pos="{_text(x, y, base.radius)}">
      <inertial pos="0 0 0" mass="0.31" diaginertia="0.0006 0.0006 0.0002"/>
      <joint type="slide" axis="0 0 1" stiffness="{SPRING}" damping="{DAMPER}"
             springref="{-load / SPRING}"/>
      <joint axis="0 0 1" damping="0.01"/>
      <body pos="{-base.trail} 0 0"><joint axis="0 1 0"/>
        {_inertial(base)}<geom class="wheel"/></body></body>"""


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

    @property
    def published(self) -> BaseModel:
        """The base within the configured limits."""
        known = BASES[self.base]
        (v, omega), (most_v, most_omega) = self.acceleration, known.acceleration
        return known._replace(
            acceleration=(min(v, most_v), min(omega, most_omega)),
            multiplier=self.separation_multiplier or known.multiplier,
        )

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
    """

    def __init__(self, settings: Physics, pose: Pose) -> None:
        try:
            import mujoco
        except ImportError:
            raise MissingExtraError("MuJoCo", "mujoco") from None
        self._settings, self._base = settings, settings.published
        text = model_text(self._base, settings.friction)
        self._model: Any = mujoco.MjModel.from_xml_string(text)
        self.data: Any = mujoco.MjData(self._model)
        self._advance = partial(mujoco.mj_step, self._model, self.data)
        self._rolling = np.flatnonzero(self._model.geom_contype == WHEEL)
        names = [f"wheel{k}" for k in range(len(self._base.wheels))]
        self._angles = [int(self._model.joint(n).qposadr[0]) for n in names]
        self._coming: deque[tuple[float, Twist]] = deque()
        self._asked = (0.0, 0.0)
        self._told, self._turning = [0.0, 0.0], [0.0, 0.0]
        self._missing = np.zeros(len(names))
        self._place(pose)
        self.data.time = 0.0

    def _place(self, pose: Pose) -> None:
        """Let the base come to rest on its wheels."""
        half, qpos = 0.5 * pose[2], self.data.qpos
        qpos[:2], qpos[3], qpos[6] = pose[:2], math.cos(half), math.sin(half)
        for _ in range(round(SETTLING / DT)):
            self._advance()

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
        self._check()
        turned = (self.data.qpos[self._angles] - angles).tolist()
        return self._mean(before, turned, dt)

    def _check(self) -> None:
        """Raise InvalidInputError unless the base is upright and simulated."""
        i, j = self.data.qpos[4:6].tolist()
        upright = 1.0 - 2.0 * (i * i + j * j) > UPRIGHT
        want(
            upright and not self.data.warning.number.any(),
            "the base in MuJoCo has tipped over: its ground is too rough",
        )

    def _drive(self, h: float) -> None:
        """Set the speeds of the motors for the next h s."""
        while self._coming and self._coming[0][0] <= self.data.time + STEP_ROUNDING:
            _, self._asked = self._coming.popleft()
        base, lag = self._base, self._settings.lag
        for i, most in enumerate(base.acceleration):
            change = self._asked[i] - self._told[i]
            self._told[i] += min(max(change, -most * h), most * h)
        share = 1.0 - math.exp(-h / lag) if lag else 1.0
        v, omega = self._told
        sides = wheel_speeds(v, omega, base.track * base.multiplier)
        for i, speed in enumerate(sides):
            self._turning[i] += share * (speed / base.radius - self._turning[i])
        wanted = np.array(self._turning * (len(base.wheels) // 2))
        most, behind = base.torque / SERVO, wanted - self.data.actuator_velocity
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

    def _mean(self, before: Pose, turned: list[float], dt: float) -> Drive:
        """Return the mean twists of a motion of the base."""
        (x, y, heading), (x_0, y_0, heading_0) = self.pose, before
        angle = wrap_angle(heading - heading_0)
        half = 0.5 * angle
        sinc = math.sin(half) / half if abs(half) > STRAIGHT else 1.0 - half**2 / 6.0
        cos, sin = math.cos(heading_0 + half), math.sin(heading_0 + half)
        ahead = (cos * (x - x_0) + sin * (y - y_0)) / (sinc * dt)
        lateral = (cos * (y - y_0) - sin * (x - x_0)) / (sinc * dt)
        base, sides = self._base, len(turned) // 2
        left, right = (
            base.radius * sum(turned[side::2]) / (sides * dt) for side in (0, 1)
        )
        wheels = wheel_twist(left, right, base.track * base.multiplier)
        return Drive(wheels, (ahead, angle / dt), lateral)
