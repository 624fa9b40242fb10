"""Measures of runs and of the footprint for the paper's statements.

Run: python comparisons/paper/calibrations.py
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.lab.baselines.drive import body_discs
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.metrics import metrics
from qpavoid.types import Array

Runs: TypeAlias = Mapping[str, Log]
"""Logs of one scenario by law."""

LENGTH, WIDTH = 0.89, 0.58
"""Of the paper's robot, m."""


numbers_of = lru_cache(maxsize=16)(metrics)
"""Metrics of a run."""


def values(of: Callable[[Log], float], unit: str) -> Callable[[Runs], str]:
    """Return a function from runs to a number of both laws in words."""
    return lambda runs: ", ".join(
        f"{name} {of(runs[law]):.3g} {unit}"
        for name, law in (("Eq. 5", "eq5"), ("Eq. 7", "eq7"))
    )


def metric(key: str) -> Callable[[Log], float]:
    """Return a function from a run to one of its metrics."""
    return lambda log: float(numbers_of(log)[key] or 0.0)


least_clearance, left = metric("min_clearance_m"), metric("zone_exit_s")
entered, final = metric("zone_entry_s"), metric("final_error_m")
rms, roughness = metric("rms_error_m"), metric("roughness_omega_radps2")


def off(log: Log) -> Array:
    """Return the distance of the robot from its plan at each step, m."""
    return np.hypot(log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"])


def turned(log: Log) -> Array:
    """Return the heading error at each step, °."""
    less = log["heading_rad"] - log["heading_ref_rad"]
    return np.degrees(np.arctan2(np.sin(less), np.cos(less)))


def rms_turned(log: Log) -> float:
    """Return the root mean square of the heading error, °."""
    return float(np.sqrt(np.mean(turned(log) ** 2)))


def inside(log: Log) -> npt.NDArray[np.bool_]:
    """Return whether the obstacle is in the zone at each step."""
    return np.asarray(log["clearance_m"] < log["r_m"])


def before_zone(log: Log) -> slice:
    """Return the steps before the zone is entered."""
    return slice(int(inside(log).argmax()) if inside(log).any() else None)


def astray(log: Log, degrees: float = math.inf) -> tuple[float, float]:
    """Return the first and the last time, s, at which the pose is off its plan.

    By more than 5 cm, or by more than some degrees; 0 where it never is.
    """
    late = np.flatnonzero((off(log) > 0.05) | (np.abs(turned(log)) > degrees))
    first, last = (late[0], late[-1]) if len(late) else (0, 0)
    return float(log["t_s"][first]), float(log["t_s"][last])


def recovered(log: Log) -> float:
    """Return the last time at which it is more than 5 cm off its plan, s."""
    return astray(log)[1]


def restored(log: Log) -> float:
    """Return the last time at which it is more than 5 cm or 5° off its plan, s."""
    return astray(log, 5.0)[1]


def roughness_after(log: Log) -> float:
    """Return the mean |Δω/dt| after the zone was last left, rad/s²."""
    last = np.flatnonzero(inside(log))[-1]
    return float(np.abs(np.diff(log["omega_radps"][last:])).mean() / log.meta["dt_s"])


def nearest_at(log: Log) -> float:
    """Return the time of the least clearance, s."""
    return float(log["t_s"][np.argmin(log["clearance_m"])])


def fastest_turn(log: Log) -> float:
    """Return the greatest |ω|, rad/s."""
    return float(np.abs(log["omega_radps"]).max())


def slowest(log: Log) -> float:
    """Return the least v, m/s, in the zone."""
    return float(log["v_mps"][inside(log)].min())


def backwards(log: Log) -> float:
    """Return the share of the steps in the zone in which it drives backwards."""
    return float((log["v_mps"][inside(log)] < 0.0).mean())


def retreat(log: Log) -> float:
    """Return the greatest retreat along x, the direction of the plan, m."""
    return float((np.maximum.accumulate(log["x_m"]) - log["x_m"]).max())


def held_back(log: Log) -> float:
    """Return the greatest deficit of v to the tracking command, m/s.

    The command is limited to the greatest v of the run.
    """
    wanted = np.minimum(log["v_desired_mps"], log["v_mps"].max())
    return float((wanted - log["v_mps"]).max())


def share_of_both(log: Log) -> float:
    """Return the share of the steps in the zone that change both v and ω."""
    v = np.abs(log["v_mps"] - log["v_desired_mps"]) > 1e-6
    omega = np.abs(log["omega_radps"] - log["omega_desired_radps"]) > 1e-6
    return float((v & omega)[inside(log)].mean())


def both(test: Callable[[Log], bool]) -> Callable[[Runs], bool]:
    """Return a function from runs to whether a test holds for both laws."""
    return lambda runs: test(runs["eq5"]) and test(runs["eq7"])


def throughout(runs: Runs) -> float:
    """Return the greatest advantage of Eq. 7 while both are in the zone, m."""
    near = inside(runs["eq5"]) & inside(runs["eq7"])
    more = runs["eq7"]["clearance_m"] - runs["eq5"]["clearance_m"]
    return float(more[near].max()) if near.any() else -math.inf


def fluctuation(runs: Runs) -> float:
    """Return the ratio of the mean |Δω/dt| of Eq. 7 to that of Eq. 5."""
    return roughness(runs["eq7"]) / max(roughness(runs["eq5"]), 1e-9)


def recovery_after_exit(log: Log) -> float:
    """Return the time from leaving the zone to 5 cm and 5° of the plan, s."""
    return max(restored(log) - left(log), 0.0)


def turns_by_tip(angle: float) -> tuple[float, float, float]:
    """Return ω of Eq. 5, the greatest divisor of Eq. 7, and the length of a tip.

    ω at the middle of the left edge for 1 m/s of repulsion, rad/s; the divisor
    p_y cos α − p_x sin α, m, which must be negative all along the edge; length, m.
    """
    corner = np.array([0.5 * LENGTH, 0.5 * WIDTH])
    length = 0.5 * WIDTH * math.tan(angle)
    apex = np.array([0.5 * LENGTH + length, 0.0])
    x, y = np.linspace(corner, apex, 101).T
    worst = float((y * math.cos(angle) - x * math.sin(angle)).max())
    return math.sin(angle) / float(0.5 * (corner + apex)[0]), worst, length


def by_angle(pick: int) -> list[float]:
    """Return one number of :func:`turns_by_tip` for tips of 30, 40 and 50°."""
    return [turns_by_tip(math.radians(angle))[pick] for angle in (30.0, 40.0, 50.0)]


def by_tip(values: list[float], unit: str) -> str:
    """Return three numbers in words."""
    return ", ".join(f"{x:.3g}" for x in values) + f" {unit} at 30, 40, 50°"


def greatest_change(log: Log) -> float:
    """Return the greatest |Δω/dt|, rad/s²."""
    return float(np.abs(np.diff(log["omega_radps"])).max() / log.meta["dt_s"])


def sign_changes(log: Log) -> int:
    """Return the number of sign changes of v in the zone."""
    return int(np.count_nonzero(np.diff(np.sign(log["v_mps"][inside(log)]))))


def circle_about() -> tuple[float, float]:
    """Return radius (m) and relative area of the least circle about the footprint.

    The area is relative to that of the rectangle and its tip at 40°.
    """
    ((_, radius),) = body_discs(load_scenario("paper/test_case_1").robot, 1)
    area = WIDTH * (LENGTH + 0.5 * by_angle(2)[1])
    return radius, math.pi * radius**2 / area


STRENGTHS = 5.0, 10.0, 20.0, 40.0
"""Repulsive velocities, m/s, from half the paper's on: at a quarter Eq. 5 touches."""


@lru_cache
def by_strength(law: str) -> tuple[list[float], list[float]]:
    """Return least and rms distances, m, of test case 1 by the repulsive velocity.

    The least distance is that to the obstacle, the other to the plan.
    """
    base = load_scenario("paper/test_case_1")
    logs = []
    for speed in STRENGTHS:
        repulsion = replace(base.settings.repulsion, speed=speed)
        settings = replace(base.settings, repulsion=repulsion)
        logs.append(run(replace(base, settings=settings), law))
    return [least_clearance(log) for log in logs], [rms(log) for log in logs]


def rises(values: list[float]) -> bool:
    """Return whether numbers never fall and rise at least once."""
    return values == sorted(values) and values[0] < values[-1]
