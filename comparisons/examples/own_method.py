"""A user's method of fifteen lines beside ours: slow down near obstacles.

Run: python comparisons/examples/own_method.py [own_method.png]
"""

import sys

import qpavoid as qp
from qpavoid.lab.study.plots import paths

SLOW, STOP = 1.5, 0.25  # m


class Careful:
    """Speed proportional to the distance of the nearest obstacle; 0 below 0.25 m."""

    def __init__(self, robot, settings):
        self.robot = robot

    def start(self, v, omega):
        """Return the step of a new run."""
        return self.step

    def step(self, v, omega, obstacles, context):
        """Return the desired twist, slowed down."""
        contacts = qp.Contacts.of(self.robot.footprint, obstacles)
        nearest = min([SLOW, *contacts.distance])
        share = max(0.0, (nearest - STOP) / (SLOW - STOP))
        return share * v, share * omega


def drive(methods):
    """Return the log of each method among strangers."""
    scenario = qp.load_scenario("demo/strangers")
    return [qp.run(scenario, method) for method in methods]


if __name__ == "__main__":
    logs = drive([Careful, "qp-ahead+guide"])
    for log in logs:
        found = qp.metrics(log)
        print(
            f"{found['controller']}: {found['outcome']}, "
            f"least distance {found['min_clearance_m']:.3f} m"
        )
    paths(logs).savefig(sys.argv[1] if sys.argv[1:] else "own_method.png", dpi=120)
