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
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.errors import MissingExtraError, QPAvoidError, UnknownNameError
from qpavoid.qp.solve import BackEnd, find_back_end
from timing.contenders import CONTENDERS
from timing.recorded import record_problems
from timing.tables import origins, pivot, write_tables
from timing.trials import FULL, QUICK, Case, Plan, Row, of_back_end, race

ROWS = (5, 20, 100, 1000)


def load(name: str) -> BackEnd:
    """Return a solver by name, loaded.

    Raises:
        UnknownNameError: No such solver.
        MissingExtraError: Its package, or one that it needs, is absent.
    """
    if name not in CONTENDERS:
        if not name.startswith("qpsolvers:"):
            raise UnknownNameError("back end", name, CONTENDERS)
        return find_back_end(name).load()
    try:
        return CONTENDERS[name].load()
    except (ImportError, UnknownNameError):  # qpsolvers knows what is installed alone
        raise MissingExtraError(f"solver {name!r}", CONTENDERS[name].extra) from None


def installed(names: Sequence[str]) -> dict[str, BackEnd]:
    """Return solvers by name; without names all that are installed."""
    found = {}
    for name in names or CONTENDERS:
        try:
            found[name] = load(name)
        except MissingExtraError:
            if names:
                raise
            print(f"not installed: {name}")
    return found


def time_solvers(names: Sequence[str], rows: int, plan: Plan) -> list[Row]:
    """Return a row per solver: size, and the columns of :func:`timing.trials.judge`.

    Args:
        names: Of the solvers.
        rows: Of each problem.
        plan: Number of problems and calls.
    """
    problems = record_problems(rows, plan.problems)
    cases = [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]
    contenders = {name: of_back_end(load(name)) for name in names}
    found = race(contenders, cases, plan)
    return [{"solver": name, "rows": rows, **row} for name, row in found.items()]


def bench(out: Path, plan: Plan, names: Sequence[str] = ()) -> str:
    """Time all solvers, write the tables, and return the short one.

    Raises:
        UnknownNameError: No such solver.
        MissingExtraError: The package of a named solver is absent.
    """
    back_ends = installed(names)
    settings = {name: getattr(x, "settings", {}) for name, x in back_ends.items()}
    origin, table = origins(asdict(plan)) | {"settings": settings}, list[Row]()
    for rows in ROWS:
        print(f"{rows} rows: {len(back_ends)} solvers", flush=True)
        table += time_solvers([*back_ends], rows, plan)
        write_tables(out, {"solvers": table}, origin)
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
