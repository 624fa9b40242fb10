"""Dynamic window [Fox1997], with the polygonal footprint and exact arcs."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from qpavoid.avoidance.bodies import Setup
from qpavoid.avoidance.controllers import StepContext
from qpavoid.compiled import compiled_once, entry
from qpavoid.lab.baselines.drive import Baseline, Command, reference_ahead
from qpavoid.lab.baselines.stopping import free_time
from qpavoid.model.kinematics import TINY, arc, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist, limits_of, stopping_time, twist_box
from qpavoid.types import Arrays, Twist

SPEEDS_TRIED, RATES_TRIED = 9, 25
"""Numbers of forward speeds and yaw rates that are tried."""

FASTEST = 10.0
"""rad/s; greatest yaw rate that is tried for a robot without limits."""

LONGEST_FOLLOWED = 20.0
"""s; horizon for slow twists."""


class Window(NamedTuple):
    """Context of the score of a twist.

    Attributes:
        setup: Footprint, limits and settings.
        obstacles: Robot frame.
        weights: Of heading, clearance and velocity.
        look: s after which the heading counts.
        reach: m; free length of full score.
        margin: Required distance on the arc, m.
        target: x, y, robot frame, m.
        driven: Twist driven last.
        pace: Greatest forward speed that is tried, m/s.
    """

    setup: Setup
    obstacles: Arrays
    weights: tuple[float, float, float]
    look: float
    reach: float
    margin: float
    target: tuple[float, float]
    driven: Twist
    pace: float


@compiled_once
def judge(window: Window, twist: Twist, least: float) -> float:
    """Return the objective of a twist; −inf if it is not admissible.

    A weighted sum of 1 − |θ|/π, of the free length of the arc over ``reach``, and of
    v/v_max; θ is the bearing of the target from the pose ``look`` s on. Admissible
    twists can stop before any obstacle, braking along their arc. Also −inf if the
    objective cannot exceed ``least``.
    """
    (_, robot, settings), (v, omega), reach = window.setup, twist, window.reach
    heading, clearance, velocity = window.weights
    x, y, course = arc(0.0, 0.0, 0.0, v, omega, window.look)
    bearing = math.atan2(window.target[1] - y, window.target[0] - x)
    off, v_max = wrap_angle(bearing - course), max(limits_of(robot).v_max, TINY)
    score = heading * (1.0 - abs(off) / math.pi) + velocity * v / v_max
    # The free length adds its weight at most, and takes most of the time.
    if score + clearance <= least:
        return -math.inf
    rest = stopping_time(robot, v, omega, settings[0].dt)
    turn = 2.0 * math.pi / max(abs(omega), TINY)
    horizon = min(reach / max(abs(v), TINY), turn)
    horizon = max(min(horizon, LONGEST_FOLLOWED), rest)
    free = free_time(window.setup, window.obstacles, window.margin, twist, horizon)
    if free < rest:
        return -math.inf
    way = reach if v != 0.0 and free >= horizon else abs(v) * free
    return float(score + clearance * min(1.0, way / reach))


@entry
@compiled_once
def best_twist(window: Window) -> tuple[float, float, float]:
    """Return the best objective in the dynamic window, and its v and ω.

    −inf if no twist is admissible. Forward speeds up to the pace only, if the window
    has any.
    """
    (_, robot, settings), driven = window.setup, window.driven
    v_low, v_high, omega_low, omega_high = twist_box(
        robot, driven[0], driven[1], settings[0].dt
    )
    omega_low = min(max(omega_low, -FASTEST), omega_high)
    omega_high = max(min(omega_high, FASTEST), omega_low)
    v_low = min(max(v_low, 0.0), v_high)
    v_high = min(max(window.pace, v_low), v_high)
    best, best_v, best_omega = -math.inf, 0.0, 0.0
    for i in range(SPEEDS_TRIED):
        for j in range(RATES_TRIED):
            v = v_high - (v_high - v_low) * i / (SPEEDS_TRIED - 1)
            omega = omega_low + (omega_high - omega_low) * j / (RATES_TRIED - 1)
            # The window is a box; the wheels' limit excludes a part of it.
            v, omega = limit_twist(robot, (v, omega), driven, settings[0].dt)
            score = judge(window, (v, omega), best)
            if score > best:
                best, best_v, best_omega = score, v, omega
    return best, best_v, best_omega


@dataclass(frozen=True)
class WindowController(Baseline):
    """The best of the reachable twists that allow a stop.

    If the desired twist itself is free for ``preview`` s it is driven. Else the target
    is the position of the reference by then, and the pace the speed that reaches it in
    that time. Obstacles are taken as static, as by Fox; the margin replaces his
    smoothing of the objective. Static obstacles are never touched.

    Attributes:
        heading: Weight of the heading towards the target.
        clearance: Weight of the free length of the arc.
        velocity: Weight of the forward speed.
        look: s after which the heading counts.
        reach: m; free length of full score.
        margin: Required distance on the arc, in r_min of static obstacles.
        preview: s.
    """

    heading: float = 1.0
    clearance: float = 1.0
    velocity: float = 0.1
    look: float = 1.2
    reach: float = 2.0
    margin: float = 1.0
    preview: float = 2.0

    def plan(
        self, desired: Twist, obstacles: Obstacles, context: StepContext
    ) -> Command | None:
        """Return the best twist of the window; None: the desired twist."""
        setup, arrays = self.setup, obstacles.arrays
        wanted = self.limited(desired, context)
        margin = self.margin * self.settings.radius.r_min()
        rest = stopping_time(setup.robot, *wanted, self.settings.dt)
        time = max(self.preview, rest)
        if free_time(setup, arrays, margin, wanted, time) >= time:
            return None
        x, y, _ = reference_ahead(context, self.robot, 1, self.preview)[0].tolist()
        window = Window(
            setup,
            arrays,
            weights=(self.heading, self.clearance, self.velocity),
            look=self.look,
            reach=self.reach,
            margin=margin,
            target=(x, y),
            driven=context.driven,
            pace=math.hypot(x, y) / self.preview,
        )
        score, v, omega = best_twist(window)
        return self.brake(context) if score == -math.inf else Command((v, omega))
