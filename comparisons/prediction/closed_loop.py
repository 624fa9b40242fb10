"""Closed loops among recorded people with each predictor, paired.

The filter with guide drives in the place of a pedestrian; nobody yields to it. All
moving obstacles are known exactly, with the velocity of the present. The learned
predictor is fitted without the scene that it drives in. Columns: success, contacts that
began while the robot moved and only while it stood, runs nearer than r_min, median of
the time relative to constant velocity; tasks that succeed with this predictor alone,
with constant velocity alone.

Run: python comparisons/prediction/closed_loop.py [--data FOLDER]
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from displacement import fit, moments
from predictors import constant_turn
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.scenario.scenario import Scenario, make_scenario
from qpavoid.lab.sensing.lidar import Sensor
from qpavoid.lab.simulation.outcome import Outcome, outcome_of, verdict
from qpavoid.lab.simulation.run import run
from qpavoid.lab.worlds.crowd import Crowd
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.prediction import Prediction, Predictor
from qpavoid.types import Pose

METHOD = "qp-ahead+guide"
NAMES = "constant velocity", "constant turn, stop", "learned"
STRIDES = {"eth": 4, "hotel": 4, "zara01": 4, "students03": 1}
"""Every so many tasks are driven, as in ``comparisons/studies/crowd.toml``."""


class Rated:
    """Sensor of a guide that predicts, and method: the filter of the measured discs."""

    def __init__(self, predict: Predictor, scenario: Scenario) -> None:
        self._predict, self._scenario, self._seen = predict, scenario, Obstacles()

    def start(self, v: float = 0.0, omega: float = 0.0) -> Callable[..., Any]:
        """Return the step of the method in a new run."""
        safety = SafetyFilter(self._scenario.robot, self._scenario.settings)
        safety.reset(v, omega)
        return lambda v, omega, obstacles, context: safety.filter(v, omega, self._seen)

    def sensor(self) -> Sensor:
        """Return the sensor of a new run."""
        prediction = Prediction(self._predict, self._scenario.dt)

        def see(time: float, obstacles: Obstacles, pose: Pose) -> Obstacles:
            self._seen = obstacles.seen_from(pose)
            return prediction.see(self._seen, pose, (0.0, 0.0))

        return see


def drive(scenario: Scenario, predict: Predictor | None) -> Outcome:
    """Return the outcome of a run."""
    method: Any = METHOD
    if predict is not None:
        method = Rated(predict, scenario)
        sensor = SimpleNamespace(start=method.sensor)
        scenario = replace(scenario, sensor=sensor, guide=GuideSettings())
    return outcome_of(run(scenario, method))


def line(runs: list[Outcome], usual: list[Outcome]) -> str:
    """Return the cells of a predictor beside those of the usual one."""
    won, one = (np.array([verdict(x) == "arrived" for x in y]) for y in (runs, usual))
    hits = [x["contacts_moving"] > 0 for x in runs if verdict(x) == "touched"]
    near = sum(x["min_room_m"] < -1e-3 for x in runs)
    times = np.array([[x["arrived_s"] for x in y] for y in (runs, usual)])[:, won & one]
    cells = (
        f"{won.sum()} / {len(runs)} | {sum(hits)} + {len(hits) - sum(hits)} | {near}"
    )
    cells += f" | {np.median(times[0] / times[1]):.2f}"
    return f"{cells} | {(won & ~one).sum()} / {(one & ~won).sum()}"


def main() -> None:
    """Drive all tasks and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", help="folder of the published sets")
    data = parser.parse_args().data
    for scene, stride in STRIDES.items():
        crowd = Crowd(scene, data)
        learned = fit([moments(x, data) for x in STRIDES if x != scene])
        ends = []
        for seed in range(0, len(crowd.tasks), stride):
            scenario = make_scenario(crowd.sample(seed), crowd.name, Path())
            runs = [drive(scenario, x) for x in (None, constant_turn, learned)]
            if runs[0]["start"] >= 0.0:  # else it began in contact
                ends.append(runs)
        for name, *each in zip(NAMES, *ends, strict=True):
            usual = [runs[0] for runs in ends]
            print(f"| {scene} | {name} | {line(each, usual)} |", flush=True)


if __name__ == "__main__":
    main()
