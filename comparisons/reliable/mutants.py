"""Mutants of the filter, and which of them the tests kill; resumes where it ended.

An operator changes one place in the body of one function: a comparison turns round, a
sum becomes a difference, a condition is always true, … . Each mutant gets a process of
its own, forked when the tests are collected: the function's code is put in place there,
and, of a compiled function, an extension module is made anew of all entries. numba is
off: what is no entry runs as Python. Then the tests run until one fails or hangs: those
that are named after the module, the answers on record, those that have killed most, the
quick ones.

    python comparisons/reliable/mutants.py --count 300 --seconds 500
"""

import argparse
import ast
import hashlib
import importlib.util
import linecache
import math
import os
import pickle
import random
import resource
import select
import signal
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, process_time
from types import CodeType, FunctionType
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before anything imports it
os.environ["HYPOTHESIS_PROFILE"] = "mutants"

import hypothesis
import numpy as np
import pytest

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.compiled import ENTRIES, Compiled, native_code, with_defaults
from qpavoid.export import build
from qpavoid.export.extension import extension_text
from qpavoid.guide.settings import GuideSettings
from reliable.data import add_row, rows_of

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("qp", "model", "guide", "avoidance")
MEMORY = 4 << 30
"""Bytes that a mutant may take."""
TEST, BUDGET, HANGS, SILENT = 1.0, 30.0, 20.0, 120.0
"""s of the processor that a test may take, all of a mutant, and one test of a mutant;
s without a word after which a mutant hangs."""

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
            yield f"if {value}", ast.copy_location(ast.Constant(value), node.test)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "not is dropped", ast.copy_location(deepcopy(node.operand), node)
    if isinstance(node, ast.AugAssign | ast.Expr | ast.Continue | ast.Break):
        if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            yield "statement is dropped", ast.copy_location(ast.Pass(), node)


def places(tree: ast.Module) -> Iterator[tuple[str, str, ast.AST]]:
    """Yield all changes within functions: function, word, node with its location."""

    def below(node: ast.AST, path: tuple[str, ...], inside: bool) -> Iterator[Any]:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            path = *path, node.name
            inside = inside or isinstance(node, ast.FunctionDef)
            for part in node.body:
                yield from below(part, path, inside)
        elif not isinstance(node, ast.AnnAssign | ast.arg | ast.JoinedStr | ast.Raise):
            if inside:
                yield from ((".".join(path), *made) for made in changes(node))
            for part in ast.iter_child_nodes(node):
                yield from below(part, path, inside)

    yield from below(tree, (), False)


def changed(text: str, node: Any) -> str:
    """Return a source in which a node stands at its location, on as many lines."""
    lines = text.encode().splitlines(keepends=True)
    start = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: node.end_lineno - 1])) + node.end_col_offset
    more = "\n" * (node.end_lineno - node.lineno)
    made = (
        f"({ast.unparse(node)}{more})" if isinstance(node, ast.expr) else f"pass{more}"
    )
    return (text.encode()[:start] + made.encode() + text.encode()[end:]).decode()


KEPT = "seed", "mutant", "line", "sources"
"""Columns of the table that say which it is: its name has file, function and change."""


def named(text: str) -> dict[str, tuple[str, str, Any]]:
    """Return the changes of a source by a name that no edit elsewhere shifts.

    That of the function, the change, and which of those of the function it is.
    """
    found, seen = {}, Counter[tuple[str, str]]()
    for function, word, node in places(ast.parse(text)):
        seen[function, word] += 1
        found[f"{function}, {word}, {seen[function, word]}"] = function, word, node
    return found


def mutants(seed: int) -> list[dict[str, Any]]:
    """Return all that there are, in the order of the sample of a seed."""
    found = []
    for folder in FOLDERS:
        for path in sorted((ROOT / "qpavoid" / folder).glob("*.py")):
            file, text = str(path.relative_to(ROOT)), path.read_text()
            sources = hashlib.sha256(text.encode()).hexdigest()[:8]
            for name, (function, word, node) in named(text).items():
                where = {"mutant": f"{file}, {name}", "file": file}
                where |= {"function": function, "line": node.lineno, "change": word}
                found.append({"seed": seed, **where, "sources": sources})
    random.Random(seed).shuffle(found)
    return found


def functions(module: Any, name: str) -> Any:
    """Return what a module has of a name, without what wraps it but the compiler."""
    *owners, last = name.split(".")
    found = module
    for owner in owners:
        found = getattr(found, owner)
    found = vars(found)[last]
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    while hasattr(found, "__wrapped__") and not isinstance(found, Compiled):
        found = found.__wrapped__
    return found


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
    """Put a mutant in place of the function, and of the machine code that has it."""
    path = ROOT / mutant["file"]
    module = importlib.import_module(mutant["file"][:-3].replace("/", "."))
    text = path.read_text()
    text = changed(text, named(text)[mutant["mutant"].split(", ", 1)[1]][2])
    name = outer(mutant["function"], module)
    found = functions(module, name)
    plain: FunctionType = found.py_func if isinstance(found, Compiled) else found
    plain.__code__ = code_of(compile(text, str(path), "exec"), name)
    linecache.cache[str(path)] = (
        len(text), None, text.splitlines(keepends=True), str(path)
    )  # fmt: skip
    if isinstance(found, Compiled):
        with TemporaryDirectory() as folder:
            put_native(Path(folder))


def put_native(folder: Path) -> None:
    """Let all entries run as machine code of the sources as they are now."""
    build.FLAGS = *build.FLAGS, "-O0"
    source, file = folder / "qpavoid.c", folder / "_native.so"
    source.write_text(extension_text(ENTRIES, {}), encoding="utf-8")
    build.compile_extension(source, file)
    spec = importlib.util.spec_from_file_location("qpavoid._native", file)
    assert spec is not None and spec.loader is not None
    native = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(native)
    for name, one in ENTRIES.items():
        plain = one.py_func  # type: ignore[attr-defined]
        vars(one)["call"] = with_defaults(getattr(native, name), plain)


class Plugin:
    """Runs mutants instead of tests, in a process of its own each."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, self.until = options, perf_counter() + options.seconds

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Measure the tests once, then run the mutants that are not in the table.

        They are measured with machine code that is put in place, but of no mutant.
        """
        entry = next(iter(ENTRIES.values()))
        if native_code(entry.py_func) is None:  # type: ignore[attr-defined]
            raise RuntimeError("the extension module is not that of these sources")
        with TemporaryDirectory() as folder:  # a test that this fails kills nobody
            put_native(Path(folder))
        costs = self.costs(session.items)
        items = [item for item in session.items if costs[item.nodeid] < TEST]
        items.sort(key=lambda item: costs[item.nodeid])
        print(len(items), "tests", sum(costs[item.nodeid] for item in items), "s")
        for mutant in mutants(self.options.seed)[: self.options.count]:
            rows = {row["mutant"]: row for row in rows_of("mutants")}
            if perf_counter() > self.until:
                break
            old = rows.get(mutant["mutant"])
            if old is None or (
                self.options.again and not old["killed by"] and not old["reason"]
            ):
                end = self.ended(mutant, self.ordered(items, mutant, rows))
                row = {key: mutant[key] for key in KEPT}
                row |= {"killed by": end, "reason": ""}
                add_row("mutants", "mutant", row)
                print(mutant["mutant"], mutant["change"], "|", end, flush=True)
        return True

    def ordered(
        self, items: list[pytest.Item], mutant: dict[str, Any], rows: dict[str, Any]
    ) -> list[pytest.Item]:
        """Return tests in the order in which they are to run."""
        path, kills = Path(mutant["file"]), Counter[str]()
        for row in rows.values():
            kills[row["killed by"]] += 1 + 10 * (row["mutant"].startswith(f"{path}, "))
        ranks = Counter[Path]()
        keys: dict[str, tuple[Any, ...]] = {}
        for item in items:  # of each file the quickest, then the second of each, …
            ranks[item.path] += 1
            keys[item.nodeid] = (
                path.stem not in item.path.stem,
                "recorded" not in item.path.stem,
                -kills[item.nodeid],
                item.path.parent.name != path.parent.name,
                ranks[item.path],
            )
        return sorted(items, key=lambda item: keys[item.nodeid])

    def costs(self, items: list[pytest.Item]) -> dict[str, float]:
        """Return what each test takes, s; kept in a file."""
        known = Path(self.options.known)
        costs = pickle.loads(known.read_bytes()) if known.exists() else {}
        for item in items:
            if item.nodeid not in costs:
                costs[item.nodeid] = self.measured(item)
                known.parent.mkdir(parents=True, exist_ok=True)
                known.write_bytes(pickle.dumps(costs))
        for item in items:
            item.session.testsfailed = 0  # of those that were measured
        return costs  # type: ignore[no-any-return]

    def measured(self, item: pytest.Item) -> float:
        """Return how long a test takes, s; for ever, if it fails or is too long."""
        failed = item.session.testsfailed

        def late(*_: Any) -> None:
            raise TimeoutError

        signal.signal(signal.SIGVTALRM, late)
        signal.setitimer(signal.ITIMER_VIRTUAL, 2.0 * TEST)
        started = process_time()
        with suppress(TimeoutError):
            item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        took = process_time() - started
        return math.inf if item.session.testsfailed > failed else took

    def ended(self, mutant: dict[str, Any], items: list[pytest.Item]) -> str:
        """Return which test kills a mutant; empty: none."""
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.setsid()
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            signal.signal(signal.SIGVTALRM, signal.SIG_DFL)
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            with suppress(BaseException):
                self.run(mutant, items, writing)
            os._exit(1)
        os.close(writing)
        last = ""
        while select.select([reading], [], [], SILENT)[0]:
            told = os.read(reading, 1 << 16).decode()
            if not told:
                break
            last = told.rstrip("\n").split("\n")[-1]
        with suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)
        os.close(reading)
        return last if os.waitpid(child, 0)[1] else ""

    def run(self, mutant: dict[str, Any], items: list[pytest.Item], told: int) -> None:
        """Run the tests of a mutant; leave with 0 if it lives."""
        os.write(told, b"does not compile\n")
        put(mutant)
        began = process_time()
        for item in items:
            signal.setitimer(signal.ITIMER_VIRTUAL, HANGS)
            os.write(told, f"{item.nodeid}\n".encode())
            item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
            if item.session.testsfailed:
                os._exit(1)
            if process_time() > began + BUDGET:
                break
        os._exit(0)


def without_compiler() -> None:
    """Make records of settings readable by name in Python, too."""
    for one in (AvoidanceSettings, GuideSettings):
        made: Any = one.record

        def record(*given: Any, made: Any = made) -> Any:
            return made(*given).view(np.recarray)

        one.record = record  # type: ignore[method-assign]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300, help="mutants")
    parser.add_argument("--seed", type=int, default=3, help="of the sample")
    parser.add_argument("--seconds", type=float, default=500.0, help="then end")
    parser.add_argument("--again", action="store_true", help="those that survived")
    parser.add_argument("--known", default="out/mutants.pickle", help="times of tests")
    options = parser.parse_args()
    without_compiler()
    phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
    quick: dict[str, Any] = {"phases": phases, "derandomize": True, "database": None}
    checks = [hypothesis.HealthCheck.too_slow]
    hypothesis.settings.register_profile(
        "mutants", deadline=None, max_examples=40, suppress_health_check=checks, **quick
    )
    folders = [str(ROOT / "tests" / name) for name in FOLDERS]
    quiet = ["-q", "--tb=no", "-p", "no:cacheprovider", "-W", "ignore", "-r", ""]
    pytest.main([*quiet, *folders, f"--rootdir={ROOT}"], [Plugin(options)])


if __name__ == "__main__":
    main()
