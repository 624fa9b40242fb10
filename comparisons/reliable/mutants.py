"""Mutants of the filter, and which of them the tests kill; resumes where it ended.

An operator changes one place in the body of one function: a comparison turns round, a
sum becomes a difference, a condition is always true, … . The function's code is put in
place in a forked process without a compiler, which then runs, quickest first, the tests
that call this function, until one fails or hangs.

    python comparisons/reliable/mutants.py --count 300 --seconds 500
"""

import argparse
import ast
import importlib
import math
import os
import pickle
import random
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from time import perf_counter, process_time
from types import CodeType, FrameType, FunctionType
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports it

import numpy as np
import pytest

from reliable.data import add_row, rows_of

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("qp", "model", "guide", "avoidance")
SEED, TEST, BUDGET = 19, 0.7, 15.0
"""Of the sample; s of the processor that a test may take, and all of a mutant."""
LATE: tuple[float, set[Any]] = math.inf, set()
"""What a test that fails without a mutant takes: it is never run."""

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Add: ast.Sub, ast.Sub: ast.Add,
    ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
    ast.UAdd: ast.USub, ast.USub: ast.UAdd,
}  # fmt: skip
NAMES = {"min": "max", "max": "min", "sin": "cos", "cos": "sin", "floor": "ceil"}
NAMES |= {"ceil": "floor", "True": "False", "False": "True", "any": "all", "all": "any"}


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield what a node may become: a word for it, and the node that is there then."""
    new: Any = deepcopy(node)
    for field in ("op", "ops"):
        old = getattr(node, field, None)
        first = old[0] if isinstance(old, list) else old
        if type(first) in SWAPS:
            made = SWAPS[type(first)]()
            setattr(new, field, [made, *old[1:]] if isinstance(old, list) else made)
            yield f"{type(first).__name__} to {type(made).__name__}", new
    if isinstance(node, ast.Constant) and type(node.value) in (int, float, bool):
        value = not node.value if type(node.value) is bool else 2 * node.value + 1
        yield f"{node.value} to {value}", ast.copy_location(ast.Constant(value), node)
    if isinstance(node, ast.Name | ast.Attribute):
        name = "id" if isinstance(node, ast.Name) else "attr"
        if getattr(node, name) in NAMES:
            setattr(new, name, NAMES[getattr(node, name)])
            yield f"{getattr(node, name)} to {getattr(new, name)}", new
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        for value in (True, False)[isinstance(node, ast.While) :]:
            forced = deepcopy(new)
            forced.test = ast.copy_location(ast.Constant(value), node.test)
            yield f"if {value}", forced
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "not is dropped", node.operand
    if isinstance(node, ast.AugAssign | ast.Expr | ast.Continue | ast.Break):
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            yield "statement is dropped", ast.copy_location(ast.Pass(), node)


class Place(ast.NodeTransformer):
    """Counts all changes within functions; makes the one of a number."""

    def __init__(self, wanted: int = -1) -> None:
        self.wanted, self.found, self.path = wanted, list[dict[str, Any]](), []

    def visit(self, node: ast.AST) -> Any:
        """Count what can be changed below a node; change the one that is wanted."""
        named = isinstance(node, ast.FunctionDef | ast.ClassDef)
        inside = any(isinstance(p, ast.FunctionDef) for p in self.path)
        made = None
        if inside and not named:
            for word, new in changes(node):
                if len(self.found) == self.wanted:
                    made = new
                name = ".".join(p.name for p in self.path)
                where = {"function": name, "line": node.lineno, "change": word}
                self.found.append(where)
        if named:
            self.path.append(node)
            node.body = [self.visit(part) for part in node.body]
            self.path.pop()
        elif not isinstance(node, ast.AnnAssign | ast.arg):
            self.generic_visit(node)
        return node if made is None else made


def mutants() -> list[dict[str, Any]]:
    """Return all that there are, in the order of the sample."""
    found = []
    for folder in FOLDERS:
        for path in sorted((ROOT / "qpavoid" / folder).glob("*.py")):
            place = Place()
            place.visit(ast.parse(path.read_text()))
            file = str(path.relative_to(ROOT))
            for i, where in enumerate(place.found):
                found.append(
                    {"mutant": f"{file} {i}", "file": file, "number": i, **where}
                )
    random.Random(SEED).shuffle(found)
    return found


def functions(module: Any, name: str) -> FunctionType:
    """Return the function of a name in a module, without what wraps it."""
    *owners, last = name.split(".")
    found = module
    for owner in owners:
        found = getattr(found, owner)
    found = vars(found)[last]
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    while hasattr(found, "__wrapped__"):
        found = found.__wrapped__
    return found  # type: ignore[no-any-return]


def code_of(code: CodeType, name: str) -> CodeType:
    """Return the code of a function within that of its module."""
    for part in name.split("."):
        code = next(c for c in code.co_consts if getattr(c, "co_name", "") == part)
    return code


def outer(name: str, module: Any) -> str:
    """Return the name of the outermost function: what is in it is part of its code."""
    parts = name.split(".")
    return ".".join(parts[: 1 + isinstance(getattr(module, parts[0]), type)])


def put(mutant: dict[str, Any]) -> None:
    """Put a mutant in place of the function."""
    path = ROOT / mutant["file"]
    module = importlib.import_module(mutant["file"][:-3].replace("/", "."))
    tree = Place(mutant["number"]).visit(ast.parse(path.read_text()))
    code = compile(ast.fix_missing_locations(tree), str(path), "exec")
    name = outer(mutant["function"], module)
    functions(module, name).__code__ = code_of(code, name)


class Plugin:
    """Runs mutants instead of tests, in a process of its own each."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, self.measure = options, perf_counter() + options.measure
        self.until = self.measure + options.seconds

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Measure the tests once, then run the mutants that are not in the table."""
        costs = self.costs(session.items)
        items = [
            item for item in session.items if costs.get(item.nodeid, LATE)[0] < TEST
        ]
        items.sort(key=lambda item: costs[item.nodeid][0])
        done = len(rows_of("mutants"))
        for mutant in mutants()[done : self.options.count]:
            if perf_counter() > self.until:
                break
            module = importlib.import_module(mutant["file"][:-3].replace("/", "."))
            code = functions(module, outer(mutant["function"], module)).__code__
            key = mutant["file"], code.co_firstlineno
            chosen = [item for item in items if key in costs[item.nodeid][1]]
            end = self.ended(mutant, chosen)
            add_row(
                "mutants", "mutant", {**mutant, "tests": len(chosen), "killed by": end}
            )
        return True

    def costs(self, items: list[pytest.Item]) -> dict[str, tuple[float, set[Any]]]:
        """Return what each test takes, and which functions it calls; kept in a file."""
        known = Path(self.options.known)
        costs = pickle.loads(known.read_bytes()) if known.exists() else {}
        for item in items:
            if item.nodeid not in costs and perf_counter() < self.measure:
                costs[item.nodeid] = self.measured(item)
                known.write_bytes(pickle.dumps(costs))
        return costs

    def measured(self, item: pytest.Item) -> tuple[float, set[Any]]:
        """Return how long a test takes, and what it calls; never, if it fails."""
        called, failed = set(), item.session.testsfailed

        def seen(frame: FrameType, event: str, _: Any) -> None:
            if event == "call" and "/qpavoid/" in frame.f_code.co_filename:
                file = frame.f_code.co_filename.removeprefix(f"{ROOT}/")
                called.add((file, frame.f_code.co_firstlineno))

        def late(*_: Any) -> None:
            raise TimeoutError

        signal.signal(signal.SIGVTALRM, late)
        signal.setitimer(signal.ITIMER_VIRTUAL, TEST)
        started = process_time()
        sys.setprofile(seen)
        with suppress(TimeoutError):
            item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
        sys.setprofile(None)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        took = process_time() - started
        return (LATE[0] if item.session.testsfailed > failed else took), called

    def ended(self, mutant: dict[str, Any], items: list[pytest.Item]) -> str:
        """Return which test kills a mutant; empty: none."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            signal.signal(signal.SIGVTALRM, signal.SIG_DFL)
            put(mutant)
            for item in items[:1]:
                item.session.testsfailed = 0  # of those that were measured
            began = process_time()
            for item in items:
                signal.setitimer(signal.ITIMER_VIRTUAL, 10.0)
                os.write(writing, f"{item.nodeid}\n".encode())
                item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
                if item.session.testsfailed:
                    os._exit(1)
                if process_time() > began + BUDGET:
                    break
            os._exit(0)
        os.close(writing)
        with os.fdopen(reading) as told:
            last = (told.read().splitlines() or [""])[-1]
        return last if os.waitpid(child, 0)[1] else ""


def without_compiler() -> None:
    """Make records of settings readable by name in Python, too."""
    from qpavoid.avoidance import settings, workspace

    record = settings.AvoidanceSettings.record
    view = property(lambda self: record(self).view(np.recarray))
    settings.AvoidanceSettings.record = lambda self: view.fget(self)
    workspace.carve.py_func = workspace.carve


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300, help="mutants")
    parser.add_argument("--seconds", type=float, default=500.0, help="then end")
    parser.add_argument("--measure", type=float, default=200.0, help="s for tests")
    parser.add_argument("--known", default="/tmp/mutants.pickle", help="times of tests")
    options = parser.parse_args()
    without_compiler()
    folders = [str(ROOT / "tests" / name) for name in FOLDERS]
    quiet = ["-q", "--tb=no", "-p", "no:cacheprovider", "-W", "ignore"]
    pytest.main([*quiet, *folders, f"--rootdir={ROOT}"], [Plugin(options)])


if __name__ == "__main__":
    main()
