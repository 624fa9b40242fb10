"""Robots of a fleet swap places; each sees the others as moving polygons.

Run: python comparisons/examples/swap.py [swap.png]
"""

import sys

import qpavoid as qp
from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.study.plots import paths


def drive(name):
    """Return the log of each robot."""
    return run_fleet(qp.load_scenario("fleet/swap"), name)


if __name__ == "__main__":
    logs = drive("qp-ahead+guide")
    for number, log in enumerate(logs):
        found = qp.metrics(log)
        print(
            f"robot {number}: {found['outcome']}, "
            f"least distance {found['min_clearance_m']:.3f} m"
        )
    paths(logs).savefig(sys.argv[1] if sys.argv[1:] else "swap.png", dpi=120)
