"""Two wheeled bases and their ground as MuJoCo models of primitives.

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

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from qpavoid.settings import FINITE, NOT_NEGATIVE, POSITIVE, check
from qpavoid.types import Twist

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
