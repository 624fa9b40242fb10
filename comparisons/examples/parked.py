"""A person passes a parked robot: one-step laws are touched, the look-ahead is not.

The one-step laws react too late to a point beside the axle, or not at all. The
look-ahead filter drives away in time, and the station law brings it back.

Run: python comparisons/examples/parked.py [parked.png]
"""

import sys
from pathlib import Path

import qpavoid as qp
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.study.plots import paths

SCENE = {
    "title": "Parked",
    "duration_s": 14.0,
    "dt_s": 0.02,
    "reference": {"kind": "station", "pose": {"x_m": 0.0, "y_m": 0.0}},
    "tracking": {"station_keeping": True},
    "obstacles": [
        {
            "kind": "disc",
            "position_m": [0.1, 2.6],
            "radius_m": 0.25,
            "velocity_mps": [0.0, -0.6],
        }
    ],
}


def drive(names):
    """Return the log of each method."""
    scenario = make_scenario(SCENE, "parked", Path("parked.toml"))
    return [qp.run(scenario, name) for name in names]


if __name__ == "__main__":
    logs = drive(["eq5", "qp", "qp-ahead"])
    for log in logs:
        found = qp.metrics(log)
        print(
            f"{found['controller']:10} {found['outcome']:10} least distance "
            f"{found['min_clearance_m']:.3f} m, ends {found['final_error_m']:.3f} m off"
        )
    paths(logs).savefig(sys.argv[1] if sys.argv[1:] else "parked.png", dpi=120)
