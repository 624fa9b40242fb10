"""What is measured of runs for the paper's statements, and of its footprint."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from qpavoid.lab.baselines.drive import body_discs
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.metrics import Metrics, metrics
from qpavoid.types import Array

Runs: TypeAlias = Mapping[str, Log]
"""Logs of one scenario by law."""

LENGTH, WIDTH = 0.89, 0.58
"""Of the paper's robot, m."""


@lru_cache(maxsize=16)
def numbers_of(log: Log) -> Metrics:
    """Return the metrics of a run; the last ones are remembered."""
    return metrics(log)


def told(of: Callable[[Log], float], unit: str) -> Callable[[Runs], str]:
    """Return what says a number of both runs."""
    return lambda runs: ", ".join(
        f"{name} {of(runs[law]):.3g} {unit}"
        for name, law in (("Eq. 5", "eq5"), ("Eq. 7", "eq7"))
    )


def metric(key: str) -> Callable[[Log], float]:
    """Return what reads a metric of a run."""
    return lambda log: float(numbers_of(log)[key] or 0.0)


room, left = metric("min_clearance_m"), metric("zone_exit_s")
entered, final = metric("zone_entry_s"), metric("final_error_m")
rms, lively = metric("rms_error_m"), metric("roughness_omega_radps2")


def off(log: Log) -> Array:
    """Return how far from its plan the robot is, step by step, m."""
    found: Array = np.hypot(
        log["x_m"] - log["x_ref_m"], log["y_m"] - log["y_ref_m"], dtype=np.float64
    )
    return found


def turned(log: Log) -> Array:
    """Return by how much the heading is off its plan, step by step, °."""
    less = log["heading_rad"] - log["heading_ref_rad"]
    return np.degrees(np.arctan2(np.sin(less), np.cos(less)))


def rms_turned(log: Log) -> float:
    """Return the root mean square of that, °."""
    return float(np.sqrt(np.mean(turned(log) ** 2)))


def inside(log: Log) -> npt.NDArray[np.bool_]:
    """Return in which steps the obstacle is in the zone."""
    return np.asarray(log["clearance_m"] < log["r_m"])


def outset(log: Log) -> slice:
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
    """Return from when on it is within 5 cm of its plan, s."""
    return astray(log)[1]


def restored(log: Log) -> float:
    """Return from when on it is within 5 cm and 5° of its plan, s."""
    return astray(log, 5.0)[1]


def restlessness(log: Log) -> float:
    """Return the mean size of Δω/dt, rad/s², from when the zone was last left."""
    last = np.flatnonzero(inside(log))[-1]
    return float(np.abs(np.diff(log["omega_radps"][last:])).mean() / log.meta["dt_s"])


def nearest_at(log: Log) -> float:
    """Return when the robot is nearest to the obstacle, s."""
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
    """Return by how much x, its plan's direction, becomes less again at most, m."""
    return float((np.maximum.accumulate(log["x_m"]) - log["x_m"]).max())


def held_back(log: Log) -> float:
    """Return by how much v is below the tracking command's at most, m/s.

    As far as a limit does not say so: that is the greatest v of the run.
    """
    wanted = np.minimum(log["v_desired_mps"], log["v_mps"].max())
    return float((wanted - log["v_mps"]).max())


def together(log: Log) -> float:
    """Return in which share of the steps in the zone v and ω are both changed."""
    v = np.abs(log["v_mps"] - log["v_desired_mps"]) > 1e-6
    omega = np.abs(log["omega_radps"] - log["omega_desired_radps"]) > 1e-6
    return float((v & omega)[inside(log)].mean())


def both(test: Callable[[Log], bool]) -> Callable[[Runs], bool]:
    """Return what says whether something holds of both runs."""
    return lambda runs: test(runs["eq5"]) and test(runs["eq7"])


def less(of: Callable[[Log], float], few: str, many: str) -> Callable[[Runs], bool]:
    """Return what says whether a number of a law is less than that of the other."""
    return lambda runs: of(runs[few]) < of(runs[many])


def within(most: float, log: Log) -> bool:
    """Return whether a run ends so near its plan's end, m."""
    return final(log) < most


def throughout(runs: Runs) -> float:
    """Return by how much Eq. 5 is nearer at most while it has the obstacle near, m."""
    near = inside(runs["eq5"]) & inside(runs["eq7"])
    more = runs["eq7"]["clearance_m"] - runs["eq5"]["clearance_m"]
    return float(more[near].max()) if near.any() else -math.inf


def fluctuation(runs: Runs) -> float:
    """Return by how much more Eq. 7 changes ω than Eq. 5 does."""
    return lively(runs["eq7"]) / max(lively(runs["eq5"]), 1e-9)


def afterwards(log: Log) -> float:
    """Return how long after it has left the zone it is within 5 cm and 5° again, s."""
    return max(restored(log) - left(log), 0.0)


def turns_by_tip(angle: float) -> tuple[float, float, float]:
    """Return ω of Eq. 5 on a tip's edge, Eq. 7's worst divisor there, and its length.

    ω at the middle of the left edge for 1 m/s of repulsion, rad/s; the divisor
    p_y cos α − p_x sin α is to be negative all along it; how far it sticks out, m.
    """
    corner = np.array([0.5 * LENGTH, 0.5 * WIDTH])
    length = 0.5 * WIDTH * math.tan(angle)
    apex = np.array([0.5 * LENGTH + length, 0.0])
    x, y = np.linspace(corner, apex, 101).T
    worst = float((y * math.cos(angle) - x * math.sin(angle)).max())
    return math.sin(angle) / float(0.5 * (corner + apex)[0]), worst, length


def by_angle(pick: int) -> list[float]:
    """Return one of these numbers for tips of 30, 40 and 50°."""
    return [turns_by_tip(math.radians(angle))[pick] for angle in (30.0, 40.0, 50.0)]


def numbered(values: list[float], unit: str) -> str:
    """Return three numbers in words."""
    return ", ".join(f"{x:.3g}" for x in values) + f" {unit} at 30, 40, 50°"


def sudden(log: Log) -> float:
    """Return the greatest |Δω/dt|, rad/s²."""
    return float(np.abs(np.diff(log["omega_radps"])).max() / log.meta["dt_s"])


def turned_back(log: Log) -> int:
    """Return how often v changes its sign while the obstacle is in the zone."""
    return int(np.count_nonzero(np.diff(np.sign(log["v_mps"][inside(log)]))))


def circle_about() -> tuple[float, float]:
    """Return radius (m) and area of the least circle about the footprint.

    The area over that of the rectangle and its tip at 40°.
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
    return [room(log) for log in logs], [rms(log) for log in logs]


def rises(values: list[float]) -> bool:
    """Return whether numbers become greater, and nowhere less."""
    return values == sorted(values) and values[0] < values[-1]
