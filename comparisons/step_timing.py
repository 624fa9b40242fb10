"""Step timing: whole control steps against the number of points, ours and peers'.

Writes a table, a figure with the machine's own limits, and a report to a folder, and
prints the table: median, tail and faults of every way to make a step; steps of a guide
in four worlds; then a million calls of the one-step filter: the slowest of them, the
bound on its operations, and the growth of memory.

    python comparisons/step_timing.py --out out/steps
"""

import argparse
from dataclasses import asdict
from pathlib import Path

from timing.calls import time_guide
from timing.figure import save_steps
from timing.report import (
    STEP_COLUMNS,
    machine_line,
    origins,
    pivot,
    table_lines,
    write_tables,
)
from timing.steps import (
    POINT_BYTES,
    POINT_OPERATIONS,
    POINTS,
    STEPS,
    endure,
    machine_limits,
    time_exported,
    time_steps,
)
from timing.trials import FULL, QUICK

ENDURANCE = {
    "points": "points",
    "rows": "rows ≤",
    "row_evaluations": "row evaluations ≤",
    "calls": "calls",
    "median_us": "median µs",
    "p99_us": "p99",
    "p999_us": "p99.9",
    "p9999_us": "p99.99",
    "max_us": "max",
    "switches": "processor taken away",
    "growth_mb": "growth of memory, MB",
}
GUIDE = {
    "world": "world of a guide",
    "steps": "steps",
    "median_us": "median µs",
    "p99_us": "p99",
    "max_us": "max",
}
LIMITS = {
    "gflops": "multiply and add, Gflop/s",
    "gb_per_s": "cache, GB/s",
    "memory_gb_per_s": "memory, GB/s",
    "call_us": "call into compiled code, µs",
}
NOTES = (
    f"Floors in the figure: {POINT_OPERATIONS} operations and {POINT_BYTES} bytes for "
    "every point, as if none were passed over by its range; one core.",
    "A step goes from numpy points to the twist. qpavoid: limits, status, certificate, "
    "room to brake; '+ osqp': the same with another solver and its answer certified by "
    "the exact one. numpy: the same rows in vectors, then a warm solver, nothing else. "
    "cbfpy: one barrier a point for a unicycle, derivatives by jax, elastiqp; each row "
    "may be broken at a cost of 1000 a unit.",
    "wrong: farther than 1e-5 from qpavoid's twist; scans that need no relaxation. The "
    "look-ahead filter answers another question and is not judged.",
    "A guide: reference, candidates or the search of a way, and the filter; dead "
    "end and points want the search.",
    "Row evaluations: of one exact solve, see qpavoid.qp.exact; up to three solves "
    "a step where the room to brake bites. Memory: growth of the process's peak.",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/steps"), metavar="DIR")
    parser.add_argument(
        "--quick", action="store_true", help="few calls, no peers in jax"
    )
    parser.add_argument("--calls", type=int, default=1_000_000, help="of the long run")
    parser.add_argument("--points", type=int, default=100, help="of the long run")
    options = parser.parse_args()
    plan = QUICK if options.quick else FULL
    steps = {k: v for k, v in STEPS.items() if not (options.quick and k == "cbfpy")}
    limits = machine_limits()
    rows = time_steps(POINTS, steps, plan, progress=print)
    rows += time_exported(POINTS, rows[0], plan)
    calls = min(options.calls, 10_000) if options.quick else options.calls
    guide = time_guide(*((2.0, 1) if options.quick else (30.0, 3)))
    long_run = [endure(options.points, calls)]
    origin = origins(asdict(plan))
    tables = {"steps": rows, "machine": [limits], "endurance": long_run}
    tables["guide"] = guide
    write_tables(options.out, tables, origin)
    machine = machine_line(origin)
    save_steps(rows, limits, machine, options.out / "step_timing.png")
    short = pivot("whole step", rows, "step", "points")
    lines = [*short, *table_lines(GUIDE, guide), *table_lines(LIMITS, [limits])]
    lines += table_lines(ENDURANCE, long_run)
    notes = [machine, "", *(f"- {note}" for note in NOTES), ""]
    whole = ["# Step timing", "", *lines, *table_lines(STEP_COLUMNS, rows), *notes]
    (options.out / "report.md").write_text("\n".join(whole), encoding="utf-8")
    print("\n".join(lines), f"Report, tables and figure are in {options.out}", sep="\n")


if __name__ == "__main__":
    main()
