"""A failure: a standing person steps in front of the passing robot.

The filter assumes that static obstacles stay. A person who starts walking when the
robot passes is touched. A greater r_min of 0.8 m avoids that, but would not pass a
door.

Run: python comparisons/examples/sudden_step.py [sudden_step.png]
"""

import sys
from pathlib import Path

import qpavoid as qp
from qpavoid.lab.scenario.config import changed
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.study.plots import distance

SETS_OFF = 3.9  # s; the robot's tip is beside that person then
SCENE = {
    "title": "A sudden step",
    "duration_s": 12.0,
    "dt_s": 0.02,
    "robot": {"acceleration_mps2": 1.0, "angular_acceleration_radps2": 2.0},
    "reference": {
        "kind": "spline",
        "points_m": [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]],
        "speed_mps": 1.0,
        "begin_mps": 1.0,
    },
    "obstacles": [
        {
            "kind": "waypoints",
            "times_s": [0.0, SETS_OFF, SETS_OFF + 1.5],
            "positions_m": [[4.6, 0.95], [4.6, 0.95], [4.6, -1.0]],
            "radius_m": 0.25,
        }
    ],
}
ROOM = {"radius.r_min_slow_m": 0.8, "radius.r_min_fast_m": 0.8}


def drive(changes):
    """Return the log with these settings."""
    scene = changed(SCENE, changes)
    scenario = make_scenario(scene, "step", Path("step.toml"))
    return qp.run(scenario, "qp-ahead")


if __name__ == "__main__":
    logs = [drive(changes) for changes in ({}, ROOM)]
    for name, log in zip(("r_min 0.17 m", "r_min 0.8 m"), logs, strict=True):
        found = qp.metrics(log)
        print(f"{name}: {found['outcome']}, {found['min_clearance_m']:.3f} m")
    distance(logs[:1]).savefig(
        sys.argv[1] if sys.argv[1:] else "sudden_step.png", dpi=120
    )
