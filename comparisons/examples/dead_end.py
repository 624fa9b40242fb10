"""A failure of the filter alone: it stops in a dead end and stays there.

The nearest safe twist leads to no way out. Status (``filtered``) and r_min are in
order. The guide detects that it makes no progress and plans a path out.

Run: python comparisons/examples/dead_end.py [dead_end.png]
"""

import sys
from dataclasses import replace

import qpavoid as qp
from qpavoid.lab.study.plots import paths


def drive(names):
    """Return the log of each method in the trap that is shipped."""
    scenario = replace(qp.load_scenario("demo/trap"), guide=None)
    return [qp.run(scenario, name) for name in names]


if __name__ == "__main__":
    logs = drive(["qp-ahead", "qp-ahead+guide"])
    for log in logs:
        found = qp.metrics(log)
        print(
            f"{found['controller']:15} {found['outcome']:8} least distance "
            f"{found['min_clearance_m']:.3f} m, ends {found['final_error_m']:.2f} m off"
        )
    paths(logs).savefig(sys.argv[1] if sys.argv[1:] else "dead_end.png", dpi=120)
