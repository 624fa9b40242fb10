"""Computing time and errors of QP solvers on problems recorded from closed loops.

Every installed back end and peer solves the same problems of two unknowns, in turns.
Time: from numpy arrays (normalised rows) to a numpy answer, with all that the interface
needs; scaling, relaxation and certificate are excluded. Wrong: a claimed answer that is
farther than 1e-5 m/s or rad/s from the certified one. False ok: wrong, or an answer to
an infeasible problem. False infeasible: no answer to a feasible problem.

``solvers.csv`` has a row per solver and number of rows; ``provenance.json`` has the
machine, versions and settings. The wall times belong to one machine: compare ratios.
Peers come with ``pip install qpavoid[bench]``.

    python comparisons/timing/solvers.py --out out/timing
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.errors import MissingExtraError, QPAvoidError, UnknownNameError
from qpavoid.qp.backends import BackEnd, BackEndEntry, find_back_end
from timing.peers import CONTENDERS
from timing.recorded import record_problems
from timing.tables import pivot, write_tables
from timing.trials import FULL, QUICK, Case, Plan, Row, of_back_end, race

ROWS = (5, 20, 100, 1000)


def contender(name: str) -> BackEndEntry:
    """Return a contender, or a back end of that name."""
    return CONTENDERS[name] if name in CONTENDERS else find_back_end(name)


def installed(names: Sequence[str]) -> dict[str, BackEnd]:
    """Return solvers by name, loaded; without names all that are installed.

    Raises:
        UnknownNameError: No such solver.
        MissingExtraError: The package of a named solver is absent.
    """
    found = {}
    for name in names or CONTENDERS:
        entry = contender(name)
        try:
            found[name] = entry.load()
        except (ImportError, UnknownNameError):  # qpsolvers knows what is installed
            if names:
                raise MissingExtraError(name, entry.extra) from None
            print(f"not installed: {name}")
    return found


def bench(out: Path, plan: Plan, names: Sequence[str] = ()) -> str:
    """Time solvers, write the tables, and return the short one; :func:`installed`."""
    table = list[Row]()
    for rows in ROWS:
        back_ends = installed(names)
        print(f"{rows} rows: {len(back_ends)} solvers", flush=True)
        problems = record_problems(rows, plan.problems)
        cases = [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]
        contenders = {name: of_back_end(one) for name, one in back_ends.items()}
        for name, row in race(contenders, cases, plan).items():
            table.append({"solver": name, "rows": rows, **row})
        settings = {name: dict(contender(name).settings) for name in back_ends}
        write_tables(out, {"solvers": table}, plan, settings=settings)
    return pivot(table, "solver", "rows", "daqp")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/timing"), metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="fewer problems")
    parser.add_argument("--solvers", default="", metavar="A,B,…", help="default: all")
    options = parser.parse_args()
    names = [name for name in options.solvers.split(",") if name]
    try:
        print(bench(options.out, QUICK if options.quick else FULL, names))
    except QPAvoidError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
