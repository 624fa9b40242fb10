"""Solver timing: every installed solver on problems recorded from closed loops.

Two unknowns, three (with a penalised slack), and whole steps of the filter. Writes CSV
files, figures and a report with versions, settings and limits to a folder, and prints
the tables. ``qpavoid bench`` does the same; peers come with ``pip install
qpavoid[bench]``, and what is absent is listed.

    python comparisons/solver_timing.py --out out/timing --cold-start
"""

import argparse
from pathlib import Path

from qpavoid.errors import QPAvoidError
from timing import bench


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/timing"), metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="fewer problems, < 20 s")
    parser.add_argument(
        "--backends", metavar="A,B,…", help="default: all installed; quick: no peers"
    )
    parser.add_argument(
        "--cold-start", action="store_true", help="time fresh processes too"
    )
    options = parser.parse_args()
    names = options.backends.split(",") if options.backends else None
    try:
        bench(options.out, options.quick, names, options.cold_start)
    except QPAvoidError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
