"""A Jackal drives at a wall over a wet floor, and brakes too late or in time.

The floor has a friction of 0.1: from 1.5 m/s the robot cannot stop within 1.15 m. A
filter without limits of acceleration hits the wall; with 80 % of the floor's limit it
does not. With ``ramps`` it relies on braking alone; without, it plans a turn that wet
wheels cannot drive, unless the angular acceleration is limited to 2 rad/s², too.

Run: python comparisons/examples/slippery_floor.py [slippery_floor.png]
"""

import sys
from dataclasses import replace
from pathlib import Path

import qpavoid as qp
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.sensing.physics import Patch, Physics
from qpavoid.lab.study.plots import distance

FRICTION, GRAVITY = 0.1, 9.81
SCENE = {
    **{"title": "A wet floor", "duration_s": 6.0, "dt_s": 0.02},
    "radius": {"r_min_slow_m": 0.1, "r_min_fast_m": 0.1},
    "robot": {"preset": "jackal", "v_max_mps": 1.5},
    "reference": {
        **{"kind": "spline", "points_m": [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0]]},
        **{"speed_mps": 1.5, "acceleration_mps2": 0.6},
    },
    "obstacles": [{"kind": "wall", "start_m": [6.0, -3.0], "end_m": [6.0, 3.0]}],
}
WET = Patch((4.5, 0.0), (4.0, 6.0), friction=FRICTION)


def drive(settings):
    """Return the log of a run with some settings of robot and actuators."""
    scenario = make_scenario(SCENE | settings, "wet", Path("wet.toml"))
    plant = Physics("skid-steer", delay=0.02, lag=0.05, patches=(WET,))
    return qp.run(replace(scenario, plant=plant), "qp-ahead")


def least_clearance(settings):
    """Return the least clearance of the wall, m."""
    return float(drive(settings)["least_clearance_m"].min())


LIMITED = {
    "robot": SCENE["robot"] | {"acceleration_mps2": 0.8 * FRICTION * GRAVITY},
    "actuation": {"delay_s": 0.08, "ramps": True},
}

if __name__ == "__main__":
    try:
        logs = {"given nothing": drive({}), "given the floor": drive(LIMITED)}
    except qp.MissingExtraError as error:
        sys.exit(str(error))
    for what, log in logs.items():
        print(f"{what}: least clearance {log['least_clearance_m'].min():.3f} m")
    name = sys.argv[1] if sys.argv[1:] else "slippery_floor.png"
    distance([logs["given nothing"]]).savefig(name, dpi=120)
