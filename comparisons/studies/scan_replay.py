"""A recorded drive replayed: which commands does a method change?

No closed loop. At every scan of Freiburg-079 the desired twist is that of the arc to
the next pose, and the obstacles are the returns of the scan as points. The robot is
that of the log's PARAM lines: 0.47 × 0.41 m about the axle, the laser 0.04 m behind it.
Twists beyond |v| ≤ 1.6 m/s, |ω| ≤ 2.6 rad/s are limited. r_min is the same for slow and
fast.

``successes`` are scans with an unchanged twist, ``contacts`` scans with a return inside
the footprint (of the data, not of the method). ``metric`` is the share unchanged of the
others. ``nearer``: scans with a return nearer than r_min; ``changed_nearer``: those
with a changed twist. ``relaxed`` to ``stopped`` count statuses.

    python comparisons/studies/scan_replay.py --data PATH --out out/scan_replay
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.errors import QPAvoidError
from qpavoid.lab.scenario.methods import check_methods, make_controller
from qpavoid.lab.sensing.plant import twist_between
from qpavoid.lab.simulation.outcome import differs
from qpavoid.lab.study.replay import PIONEER
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.carmen import (
    Scan,
    hold_time,
    in_order,
    read_scans,
)
from qpavoid.lab.worlds.source import find_file
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Pose

Row: TypeAlias = dict[str, Any]

LOG, FOLDERS = "freiburg-079-corrected.log.gz", ("carmen", "")
METHODS = "qp,qp-ahead,eq5,eq7,vfh,dwa"
RADII = (0.05, 0.1, 0.17)
LASER = -0.04
"""Position of the laser ahead of the axle, m."""

STATUSES = ("relaxed", "braking", "holding", "stopped")


class Moment(NamedTuple):
    """A scan and the desired twist."""

    pose: Pose  # of the axle, world frame
    v: float  # desired, m/s
    omega: float  # desired, rad/s
    cut: bool  # whether the recorded twist was beyond the limits
    seen: Obstacles  # returns of the scan, robot frame
    touched: bool  # whether one lies in the footprint


def make_moments(scans: Sequence[Scan]) -> list[Moment]:
    """Return all scans but the last, each with the motion to the next."""
    limits, footprint = PIONEER.limits, PIONEER.footprint
    axles = [
        (*to_world(np.array([[-LASER, 0.0]]), scan.pose)[0].tolist(), scan.pose[2])
        for scan in scans
    ]
    moments = []
    for k, scan in enumerate(scans[:-1]):
        time = scans[k + 1].time - scan.time
        v, omega, _ = twist_between(axles[k], axles[k + 1], time)
        bounded = (
            float(np.clip(v, limits.v_min, limits.v_max)),
            float(np.clip(omega, limits.omega_min, limits.omega_max)),
        )
        seen = Obstacles(scan.points() + np.array([LASER, 0.0]))
        touched = bool((Contacts.of(footprint, seen).distance < 0.0).any())
        cut = bounded != (v, omega)
        moments.append(Moment(axles[k], *bounded, cut, seen, touched))
    return moments


def replay(name: str, radius: float, moments: Sequence[Moment], dt: float) -> Row:
    """Return the line of a method and of an r_min, m, with control steps of dt, s."""
    settings = AvoidanceSettings(radius=SafetyRadius(radius, radius), dt=dt)
    step = make_controller(name, PIONEER, settings).start()
    decisions = [step(one.v, one.omega, one.seen) for one in moments]
    both = list(zip(moments, decisions, strict=True))
    changed = np.array([differs((x.v, x.omega), (y.v, y.omega)) for x, y in both])
    clear = ~np.array([one.touched for one in moments])
    nearer = np.array([one.clearance < radius for one in decisions])
    words = [str(one.status) for one in decisions]
    return {
        "method": name,
        "runs": len(moments),
        "successes": int((~changed).sum()),
        "contacts": int((~clear).sum()),
        "metric": round(float((~changed)[clear].mean()), 4),
        "setting": f"r_min {radius:g} m",
        "nearer": int(nearer.sum()),
        "changed_nearer": int((changed & nearer).sum()),
        **{word: words.count(word) for word in STATUSES},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH", help="published data sets")
    parser.add_argument("--methods", default=METHODS, metavar="A,B,…")
    parser.add_argument("--out", type=Path, default=Path("out/scan_replay"))
    options = parser.parse_args()
    names, table = options.methods.split(","), []
    try:
        check_methods(names)
        log = find_file("CARMEN logs", LOG, options.data, FOLDERS)
        scans = in_order(list(read_scans(log)), f"{log}: ")
    except QPAvoidError as error:
        parser.error(str(error))
    moments = make_moments(scans)
    dt = hold_time([scan.time for scan in scans], f"{log}: ")
    print(f"{len(moments)} scans, {sum(m.cut for m in moments)} twists limited")
    for name in names:
        for radius in RADII:
            table.append(replay(name, radius, moments, dt))
            print(*(f"{k}={v}" for k, v in table[-1].items()))
    write_csv(options.out / "scan_replay.csv", table)


if __name__ == "__main__":
    main()
