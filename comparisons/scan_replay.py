"""A recorded drive replayed: would a filter have touched what a real robot drove?

Not a closed loop. At every scan of the log the desired twist is that of the arc to the
next scan's pose, and the obstacles are the scan's returns as points; the answer goes
nowhere. The log is Freiburg-079, or any of CARMEN; ``--message`` says what its scans
are called. The robot is that of its own PARAM lines: 0.47 × 0.41 m about the axle, its
laser 0.04 m behind that (the sideways motion of the recorded poses agrees); of another
log, ``--robot`` and ``--laser`` say. Twists beyond |v| ≤ 1.6 m/s, |ω| ≤ 2.6 rad/s are
cut to that and counted: recorded poses and times are not exact; where more than half
are, the log is of another robot or unit. A twist is held for the median time between
scans, 0.5 s at most, or ``--dt``. A scan that is not later than all before is left
out. One step of a method drives through the whole log; r_min is the same for slow and
fast.

``successes`` are scans whose twist was left alone, ``contacts`` scans with a return
inside the footprint (of the data, not of the method), ``metric`` is the share left
alone where there is none. ``nearer`` are scans with a return nearer than r_min already,
``changed_nearer`` those of them that were not left alone. ``relaxed`` to ``stopped``
count statuses. Times are of the processor, so that a busy machine does not count. The
log is replayed three times: ``us_worst`` is the slowest step of all, ``us_worst_again``
the slowest that was so slow every time, in scan ``worst_scan`` with ``worst_points``
returns within 1 m. A method that raises, or answers with no twist, has ``failed``
scans and no other number; the exit status is 1 then.

    python comparisons/scan_replay.py --data PATH --out out/scan_replay
    python comparisons/scan_replay.py --log my.log --robot 0.6,0.4 --laser 0.2 --dt 0.1
"""

import base64
import html
import math
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from pathlib import Path
from time import thread_time_ns
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings, SafetyRadius
from qpavoid.errors import DataError, QPAvoidError
from qpavoid.lab.simulation.loop import differs
from qpavoid.lab.simulation.methods import check_methods, make_controller
from qpavoid.lab.study.replay import PIONEER, robot_of
from qpavoid.lab.study.style import BLUE, NAMED, RED
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.carmen import (
    LONGEST_ROBOT,
    MESSAGES,
    Scan,
    hold_time,
    in_order,
    read_scans,
    twist_between,
)
from qpavoid.lab.worlds.source import find_file
from qpavoid.model.contacts import Contacts
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from qpavoid.types import Array, Pose
from studies import Row, count, main_of, make_parser

LOG, FOLDERS = "freiburg-079-corrected.log.gz", ("carmen", "")
METHODS = "qp,qp-ahead,eq5,eq7"
RADII = (0.05, 0.1, 0.17)
LASER = -0.04
"""m; how far the robot's laser is ahead of its axle."""

DT_MIN, DT_MAX, PASSES = 1e-3, 0.5, 3
"""s that a twist may be held; times that the log is replayed."""

STILL, NEAR, MOST_TURNS = 1e-3, 10.0, 3.0
"""m/s or rad/s of who does not move; m within which a room has something; turns of a
heading: of what is beyond, the unit is another."""

STATUSES = ("relaxed", "braking", "holding", "stopped")


class Moment(NamedTuple):
    """One scan as a step sees it.

    Attributes:
        pose: Of the axle, world frame.
        v: Desired, m/s.
        omega: Desired, rad/s.
        cut: Whether the recorded twist was beyond the limits.
        seen: The returns, robot frame.
        touched: Whether one lies in the footprint.
    """

    pose: Pose
    v: float
    omega: float
    cut: bool
    seen: Obstacles
    touched: bool


def make_moments(
    scans: Sequence[Scan], robot: Robot = PIONEER, laser: float = LASER
) -> list[Moment]:
    """Return all scans but the last, each with the motion to the next.

    Args:
        scans: Each later than the one before.
        robot: Whose limits cut the motion.
        laser: How far ahead of the axle it is, m.
    """
    limits, footprint = robot.limits, robot.footprint
    axles = [
        (*to_world(np.array([[-laser, 0.0]]), scan.pose)[0].tolist(), scan.pose[2])
        for scan in scans
    ]
    moments = []
    for k, scan in enumerate(scans[:-1]):
        time = scans[k + 1].time - scan.time
        v, omega = twist_between(axles[k], axles[k + 1], time)
        bounded = (
            float(np.clip(v, limits.v_min, limits.v_max)),
            float(np.clip(omega, limits.omega_min, limits.omega_max)),
        )
        seen = Obstacles(scan.points() + np.array([laser, 0.0]))
        touched = bool((Contacts.of(footprint, seen).distance < 0.0).any())
        cut = bounded != (v, omega)
        moments.append(Moment(axles[k], *bounded, cut, seen, touched))
    return moments


def controller(name: str, radius: float, dt: float, robot: Robot) -> Any:
    """Return a method whose r_min (m) is the same for slow and fast."""
    radii = SafetyRadius(r_min_slow=radius, r_min_fast=radius)
    return make_controller(name, robot, AvoidanceSettings(radius=radii, dt=dt))


def copy_of(seen: Obstacles) -> Obstacles:
    """Return what a scan shows for one step: a method may change what it is given."""
    return Obstacles(seen.points.copy())


def replay(
    name: str,
    radius: float,
    moments: Sequence[Moment],
    dt: float,
    robot: Robot = PIONEER,
) -> tuple[list[Row], Array]:
    """Return a row a scan, and every step's time in each pass, (PASSES, n) µs.

    Args:
        name: Of the method.
        radius: r_min, m.
        moments: What it sees and is asked for.
        dt: For how long a twist is held, s.
        robot: Footprint and limits.
    """
    method = controller(name, radius, dt, robot)
    times = np.empty((PASSES, len(moments)))
    rows: list[Row] = []
    method.start()(0.0, 0.0, copy_of(moments[0].seen))  # compiles
    for k in range(PASSES):
        step, rows = method.start(), []
        for i, (pose, v, omega, cut, seen, touched) in enumerate(moments):
            mine = copy_of(seen)
            started = thread_time_ns()
            decision = step(v, omega, mine)
            times[k, i] = 1e-3 * (thread_time_ns() - started)
            rows.append(
                {
                    "method": name,
                    "setting": f"r_min {radius:g} m",
                    "r_min_m": radius,
                    "scan": i,
                    "x_m": pose[0],
                    "y_m": pose[1],
                    "v_mps": v,
                    "omega_radps": omega,
                    "cut": cut,
                    "v_given_mps": decision.v,
                    "omega_given_radps": decision.omega,
                    "changed": differs((v, omega), (decision.v, decision.omega)),
                    "status": str(decision.status),
                    "clearance_m": decision.clearance,
                    "touched": touched,
                }
            )
    for row, us in zip(rows, times.min(axis=0), strict=True):
        row["us"] = round(us, 2)
    return rows, times


def table_row(rows: Sequence[Row], times: Array, moments: Sequence[Moment]) -> Row:
    """Return the line of one method and setting."""
    changed = np.array([row["changed"] for row in rows])
    clear = ~np.array([row["touched"] for row in rows])
    nearer = np.array([row["clearance_m"] < row["r_min_m"] for row in rows])
    again = times.min(axis=0)
    worst = int(again.argmax())
    near = np.hypot(*moments[worst].seen.points.T) < 1.0
    words = [row["status"] for row in rows]
    return {
        "method": rows[0]["method"],
        "runs": len(rows),
        "successes": int((~changed).sum()),
        "contacts": int((~clear).sum()),
        "contacts_standing": "",
        "timeouts": "",
        "failed": 0,
        "mean_time_s": "",
        "metric": round(float((~changed)[clear].mean()), 4),
        "setting": rows[0]["setting"],
        "nearer": int(nearer.sum()),
        "changed_nearer": int((changed & nearer).sum()),
        **{word: words.count(word) for word in STATUSES},
        "us_median": round(float(np.median(times)), 1),
        "us_p99": round(float(np.percentile(times, 99)), 1),
        "us_worst": round(float(times.max()), 1),
        "us_worst_again": round(float(again.max()), 1),
        "worst_scan": worst,
        "worst_status": words[worst],
        "worst_points": int(near.sum()),
    }


def failed_row(name: str, radius: float, scans: int, error: BaseException) -> Row:
    """Return the line of a method that broke off."""
    told = f"{type(error).__name__}: {error}"
    line = {"method": name, "runs": scans, "failed": scans, "error": told}
    return line | {"setting": f"r_min {radius:g} m"}


def draw(runs: Sequence[Row], moments: Sequence[Moment], path: Path) -> None:
    """Draw where along the map each method intervened, at the middle r_min."""
    setting = f"r_min {sorted(RADII)[len(RADII) // 2]:g} m"
    names = list(dict.fromkeys(row["method"] for row in runs))
    if not names:
        return
    cloud = np.vstack([to_world(m.seen.points, m.pose) for m in moments[::20]])
    way = np.array([moment.pose[:2] for moment in moments])
    low, high = way.min(axis=0) - 2.5, way.max(axis=0) + 2.5
    cloud = cloud[((cloud > low) & (cloud < high)).all(axis=1)]
    figure, axes = plt.subplots(
        len(names), 1, figsize=(9, 3.7 * len(names)), sharex=True, squeeze=False,
        layout="constrained",
    )  # fmt: skip
    for axis, name in zip(axes[:, 0], names, strict=True):
        mine = [r for r in runs if (r["method"], r["setting"]) == (name, setting)]
        changed = np.array([row["changed"] for row in mine], dtype=bool)
        touched = np.array([row["touched"] for row in mine], dtype=bool)
        axis.plot(*cloud.T, ",", color="0.75", zorder=0)
        axis.plot(*way.T, color="0.4", lw=0.7, label="driven")
        axis.plot(*way[changed].T, ".", ms=4, color=RED, label="changed")
        axis.plot(*way[touched].T, "x", ms=4, color=BLUE, label="return inside")
        label = NAMED[name].label if name in NAMED else name
        axis.set_title(
            f"{label}, {setting}: {changed.sum():,} of {len(mine):,} changed"
        )
        axis.set_aspect("equal")
        axis.set_xlim(low[0], high[0])
        axis.set_ylim(low[1], high[1])
        axis.set_ylabel("y (m)")
    axes[-1, 0].set_xlabel("x (m)")
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3
    )
    figure.savefig(path, dpi=150)
    plt.close(figure)


def write_page(table: Sequence[Row], picture: Path, path: Path, title: str) -> None:
    """Write table and picture as one HTML file."""
    every = dict.fromkeys(key for row in table for key in row)
    keys = [key for key in every if any(row.get(key, "") != "" for row in table)]
    lines = [keys, *([row.get(key, "") for key in keys] for row in table)]
    cells = "\n".join(
        "<tr>" + "".join(f"<td>{html.escape(str(x))}</td>" for x in line) + "</tr>"
        for line in lines
    )
    image = base64.b64encode(picture.read_bytes()).decode() if picture.exists() else ""
    path.write_text(
        f'<!doctype html><meta charset="utf-8"><title>{title}</title><h1>{title}</h1>'
        "<style>td {white-space: nowrap; font: 12px sans-serif}</style>"
        f"<pre>{html.escape(__doc__ or '')}</pre><table border>{cells}</table>"
        f'<img width="900" src="data:image/png;base64,{image}">',
        encoding="utf-8",
    )


def make_robot(text: str) -> Robot:
    try:
        return robot_of(text)
    except QPAvoidError as error:
        raise ArgumentTypeError(str(error)) from None


def drive_of(log: Path, options: Namespace) -> tuple[list[Moment], float]:
    """Return what a log asks for, and how long a twist is held, s.

    Raises:
        DataError: The log is damaged, or of another robot, laser or unit.
    """
    view = None if options.view is None else math.radians(options.view)
    every = list(read_scans(log, options.message, view))
    scans = in_order(every, f"{log}: ")
    if len(scans) < len(every):
        print(f"{len(every) - len(scans)} scans are not later than all before")
    times = [scan.time for scan in scans]
    without = f"{log}: without --dt, "
    dt = options.dt or max(DT_MIN, min(hold_time(times, without), DT_MAX))
    moments = make_moments(scans, options.robot, options.laser)[:: options.every]
    print(f"{len(moments)} scans, {sum(m.cut for m in moments)} twists cut")
    check_drive(f"{log}: ", moments)
    return moments, dt


def check_makes(name: str, robot: Robot) -> None:
    """Raise QPAvoidError if there is no such method for a robot.

    What one's own raises else is its failed row.
    """
    try:
        controller(name, RADII[0], DT_MAX, robot)
    except QPAvoidError:
        raise
    except (Exception, SystemExit) as error:
        print(f"{name}: {type(error).__name__}: {error}")


def check_drive(where: str, moments: Sequence[Moment]) -> None:
    """Raise DataError if a drive says nothing of a method, or is in other units."""
    moving = [m for m in moments if math.hypot(m.v, m.omega) > STILL]
    cut = sum(moment.cut for moment in moving)
    near = any((np.hypot(*m.seen.points.T) < NEAR).any() for m in moments)
    turns = max(abs(moment.pose[2]) for moment in moments) / math.tau
    wrong = {
        "it never moves: are its poses in m?": not moving,
        f"{cut} of {len(moving)} twists are faster than the robot: --robot, or poses "
        "that are not in m?": cut > 0.5 * len(moving),
        f"a heading is {turns:.0f} turns: is it in rad?": turns > MOST_TURNS,
        f"no scan has a return within {NEAR:g} m: are its ranges in m?": not near,
        "every scan has a return in the footprint: --robot, --laser?": all(
            moment.touched for moment in moments
        ),
    }
    for told, is_so in wrong.items():
        if is_so:
            raise DataError(where + told)


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/scan_replay")
    parser.add_argument("--every", type=count, default=1, metavar="N", help="thin out")
    parser.add_argument("--log", type=Path, metavar="FILE", help="of CARMEN")
    parser.add_argument("--message", choices=MESSAGES, default="FLASER")
    parser.add_argument("--dt", type=float, metavar="S", help="a twist is held")
    parser.add_argument(
        "--robot", type=make_robot, default=PIONEER, metavar="NAME|LENGTH,WIDTH"
    )
    parser.add_argument(
        "--laser", type=float, default=LASER, metavar="M", help="ahead of the axle"
    )
    parser.add_argument(
        "--view", type=float, metavar="DEG", help="from FLASER's first beam to its last"
    )
    options = parser.parse_args()
    if options.dt is not None and not DT_MIN <= options.dt <= DT_MAX:
        parser.error(f"--dt wants {DT_MIN:g} to {DT_MAX:g} s")
    if not abs(options.laser) <= LONGEST_ROBOT:
        parser.error(f"--laser wants -{LONGEST_ROBOT:g} to {LONGEST_ROBOT:g} m")
    if options.view is not None and not 0.0 < options.view <= 360.0:
        parser.error("--view wants 0 to 360°")
    if options.view is not None and options.message != "FLASER":
        parser.error(f"--view is of FLASER: {options.message} says it itself")
    names = [*dict.fromkeys(options.methods.split(","))]

    def study() -> list[Row]:
        check_methods(names)
        for name in names:
            check_makes(name, options.robot)
        log = options.log or find_file("CARMEN logs", LOG, options.data, FOLDERS)
        moments, dt = drive_of(log, options)
        table, runs = [], []
        for name in names:
            for radius in RADII:
                try:
                    rows, times = replay(name, radius, moments, dt, options.robot)
                except (Exception, SystemExit) as error:  # of one's own method: any
                    table.append(failed_row(name, radius, len(moments), error))
                else:
                    table.append(table_row(rows, times, moments))
                    runs += rows
                print(*(f"{k}={v}" for k, v in table[-1].items() if v != ""))
        (options.out / "map.png").unlink(missing_ok=True)
        write_csv(options.out / "table.csv", table)
        write_csv(options.out / "runs.csv", runs)
        draw(runs, moments, options.out / "map.png")
        title = html.escape(f"{log.name} replayed")
        write_page(table, options.out / "map.png", options.out / "report.html", title)
        return [{"error": "", **row} for row in table]

    main_of(study, parser)


if __name__ == "__main__":
    main()
