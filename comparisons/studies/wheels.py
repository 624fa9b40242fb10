"""The plant of rigid bodies: speed, comparison with the unicycle, identification.

Speed: seconds simulated per second of processor time in a BARN world, known and seen by
the LiDAR, with wheels and with the unicycle. Cross-check: distance from the unicycle's
arc after 5 s at a constant twist. Identified: result of ``qpavoid identify`` on a
minute of random commands. ``wheels.csv`` has a row per number.

    python comparisons/studies/wheels.py --data PATH --world 228 --out out/wheels
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any, Literal, TypeAlias

import numpy as np

from qpavoid.lab.sensing.physics import Physics, PhysicsRun
from qpavoid.lab.simulation.config import changed
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.study.identify import Base, Response, identify, rows_of
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.barn import BarnWorlds
from qpavoid.model.kinematics import arc, wrap_angle
from qpavoid.types import Twist

LIDAR = {
    "lidar.field_of_view_rad": 4.712388980384690,
    "lidar.beams": 720,
    "lidar.rate_hz": 30.0,
    "lidar.noise_m": 0.01,
}
"""Of the studies of BARN."""

MUJOCO: dict[str, dict[str, Any]] = {
    base: {"plant.kind": "mujoco", "plant.base": base}
    for base in ("differential", "skid-steer")
}
"""Settings by dotted key, by base."""

DT, WARM, SECONDS = 0.02, 1.0, 5.0
"""Control step, run-up of the cross-check, and its duration, s."""

Row: TypeAlias = dict[str, Any]
Wheels: TypeAlias = Literal["differential", "skid-steer"]

SLOW: dict[Wheels, tuple[tuple[float, float], ...]] = {
    "differential": ((0.2, 0.0), (0.2, 0.2), (0.0, 0.3), (-0.2, 0.1)),
    "skid-steer": ((0.2, 0.0), (0.2, 0.1), (0.0, 0.3), (1.0, 0.5), (2.0, 0.5)),
}
"""Twists of the cross-check, m/s and rad/s."""

FAST: dict[Wheels, tuple[tuple[float, float], ...]] = {
    "differential": ((1.0, 1.5),),
    "skid-steer": ((0.5, 1.57), (2.0, 1.57)),
}
"""Greatest v and ω of random commands."""


def speed(world: int, data: Path | None, methods: list[str]) -> Iterator[Row]:
    """Yield seconds simulated per second, with obstacles known and seen."""
    for seen, lidar in (("known", {}), ("LiDAR", LIDAR)):
        for plant, wheels in (("unicycle", {}), ("mujoco", MUJOCO["skid-steer"])):
            document = changed(BarnWorlds(2.0).sample(world), lidar | wheels)
            scenario = make_scenario(document, "barn", Path("barn.toml"), data)
            many = len(scenario.world.at(0.0))
            for method in methods:
                run(replace(scenario, duration=0.5), method)  # compiles
                started = process_time()
                log = run(scenario, method)
                took = process_time() - started
                what = f"{method}, {plant}, {many} obstacles, {seen}"
                yield row("speed", what, DT * len(log) / took, "× real time")


def beside_the_arc(base: Wheels) -> Iterator[Row]:
    """Yield the distance of a base from the arc at the end, mm and mrad."""
    for v, omega in SLOW[base]:
        plant = PhysicsRun(Physics(base, delay=0.0, lag=0.0), (0.0, 0.0, 0.0))
        for _ in range(round(WARM / DT)):
            plant.step(v, omega, DT)
        begin = plant.pose
        for _ in range(round(SECONDS / DT)):
            plant.step(v, omega, DT)
        x, y, heading = arc(*begin, v, omega, SECONDS)
        off = math.dist(plant.pose[:2], (x, y))
        turned = wrap_angle(plant.pose[2] - heading)
        what = f"{base}, {v:g} m/s, {omega:g} rad/s"
        yield row("cross-check", what, 1e3 * off, "mm")
        yield row("cross-check", what, 1e3 * turned, "mrad")


def driven_at_random(
    base: Wheels, most: tuple[float, float], seconds: float
) -> Response:
    """Return a drive with commands that change about twice a second."""
    rng = np.random.default_rng(0)
    plant = PhysicsRun(Physics(base), (0.0, 0.0, 0.0))
    asked: list[Twist] = []
    driven: list[Twist] = []
    while len(asked) * DT < seconds:
        v, omega = rng.uniform([-0.3 * most[0], -most[1]], most).tolist()
        for _ in range(rng.integers(10, 60)):
            asked.append((v, omega))
            driven.append(plant.step(v, omega, DT).ground)
    return Response(DT, np.array(asked), np.array(driven))


def identified(base: str, most: tuple[float, float], found: Base) -> Iterator[Row]:
    """Yield the identified parameters of a base."""
    for name, value, interval, unit in rows_of(found):
        low, high = interval.split(" … ")
        what = f"{base}, up to {most[0]:g} m/s: {name}"
        yield row("identified", what, float(value), unit) | {"low": low, "high": high}


def row(part: str, what: str, value: float, unit: str) -> Row:
    """Return a line of the table."""
    line = {"part": part, "what": what, "value": float(f"{value:.4g}")}
    return line | {"low": "", "high": "", "unit": unit}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH", help="published data sets")
    parser.add_argument("--world", type=int, default=228, metavar="N")
    names = "--methods", "--controllers"
    parser.add_argument(*names, default="qp-ahead,qp-ahead+guide", metavar="A,B,…")
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S")
    parser.add_argument("--out", type=Path, default=Path("out/wheels"), metavar="DIR")
    options = parser.parse_args()

    rows = list(speed(options.world, options.data, options.methods.split(",")))
    for base in SLOW:
        rows += beside_the_arc(base)
    for base, fast in FAST.items():
        for most in fast:
            found = identify(driven_at_random(base, most, options.seconds))
            rows += identified(base, most, found)
    for line in rows:
        print(*filter(str, line.values()), sep=", ")
    write_csv(options.out / "wheels.csv", rows)


if __name__ == "__main__":
    main()
