"""Mutation score of the core: which changes of one place do the tests notice?

    python tests/mutants.py COUNT SEED

Each mutant of qp, model, guide or avoidance is tried in a process of its own: the code
of a function is replaced, the machine code of all entries is built again, and the tests
of these folders that take less than a second run until one fails.
"""

import ast
import linecache
import math
import os
import random
import resource
import signal
import sys
from collections import Counter
from contextlib import suppress
from copy import deepcopy
from functools import partial
from importlib import import_module, util
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

if __name__ == "__main__":
    os.environ |= {"NUMBA_DISABLE_JIT": "1", "HYPOTHESIS_PROFILE": "repeatable"}

import pytest

from qpavoid.compiled import ENTRIES, Compiled, with_defaults
from qpavoid.export import build
from qpavoid.export.extension import extension_text

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = "qp", "model", "guide", "avoidance"
TEST, BUDGET, HANGS, WALL, MEMORY = 1.0, 30.0, 20.0, 600, 4 << 30
OPERATORS = "Lt GtE LtE Gt Eq NotEq Add Sub Mult Div And Or UAdd USub".split()
NAMES = "min max sin cos floor ceil any all".split()
SWAPS = {one: w[k ^ 1] for w in (OPERATORS, NAMES) for k, one in enumerate(w)}


def changes(node):
    """Yield what a node may become: a word for it, and the node that is there then."""
    new = deepcopy(node)
    for field in ("op", "ops", "id", "attr"):
        old = getattr(node, field, None)
        first = old[0] if isinstance(old, list) else old
        name = first if isinstance(first, str) else type(first).__name__
        if name in SWAPS:
            made = SWAPS[name] if first == name else getattr(ast, SWAPS[name])()
            setattr(new, field, [made, *old[1:]] if isinstance(old, list) else made)
            yield f"{name} to {SWAPS[name]}", new
    if isinstance(node, ast.Constant) and type(node.value) in (int, float, bool):
        value = not node.value if type(node.value) is bool else 2 * node.value + 1
        yield f"{node.value} to {value}", ast.copy_location(ast.Constant(value), node)
    if isinstance(node, ast.If | ast.IfExp | ast.While):
        for value in (True, False)[isinstance(node, ast.While) :]:
            yield f"if {value}", ast.copy_location(ast.Constant(value), node.test)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield "not is dropped", ast.copy_location(deepcopy(node.operand), node)
    text = isinstance(getattr(node, "value", None), ast.Constant)
    if isinstance(node, ast.AugAssign | ast.Continue | ast.Break) or (
        isinstance(node, ast.Expr) and not text
    ):
        yield "statement is dropped", ast.copy_location(ast.Pass(), node)


def places(node, path=(), inside=False):
    """Yield function, word and node of all changes within functions."""
    parts = ast.iter_child_nodes(node)
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        path, parts = (*path, node.name), node.body
        inside = inside or isinstance(node, ast.FunctionDef)
    elif isinstance(node, ast.AnnAssign | ast.arg | ast.JoinedStr | ast.Raise):
        return
    elif inside:
        yield from ((".".join(path), *made) for made in changes(node))
    for part in parts:
        yield from places(part, path, inside)


def named(text):
    """Return the changes of a source by function, change, and which of these it is."""
    found, seen = {}, Counter()
    for function, word, node in places(ast.parse(text)):
        seen[function, word] += 1
        found[f"{function}, {word}, {seen[function, word]}"] = function, node
    return found


def changed(text, node):
    """Return a source with a node in its place, on as many lines."""
    lines = text.encode().splitlines(keepends=True)
    start = len(b"".join(lines[: node.lineno - 1])) + node.col_offset
    end = len(b"".join(lines[: node.end_lineno - 1])) + node.end_col_offset
    made = ast.unparse(node) + "\n" * (node.end_lineno - node.lineno)
    made = f"({made})" if isinstance(node, ast.expr) else made
    return (text.encode()[:start] + made.encode() + text.encode()[end:]).decode()


def put(path, name):
    """Put a mutant in place of its function, and of the machine code that has it."""
    function, node = named(path.read_text())[name]
    text = changed(path.read_text(), node)
    found = import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
    code, parts = compile(text, str(path), "exec"), function.split(".")
    for part in parts[: 1 + isinstance(getattr(found, parts[0]), type)]:
        found = vars(found)[part]
        code = next(c for c in code.co_consts if getattr(c, "co_name", "") == part)
    found = getattr(found, "fget", None) or getattr(found, "__func__", found)
    while hasattr(found, "__wrapped__") and not isinstance(found, Compiled):
        found = found.__wrapped__
    getattr(found, "py_func", found).__code__ = code
    linecache.cache[str(path)] = len(text), None, text.splitlines(True), str(path)
    if isinstance(found, Compiled):
        put_native()


def put_native():
    """Let all entries run as machine code of the sources as they are now."""
    with TemporaryDirectory() as folder:
        source, file = Path(folder) / "qpavoid.c", Path(folder) / "_native.so"
        source.write_text(extension_text(ENTRIES, {}), encoding="utf-8")
        build.FLAGS = *build.FLAGS, "-O0"
        build.compile_extension(source, file)
        spec = util.spec_from_file_location("qpavoid._native", file)
        native = util.module_from_spec(spec)
        spec.loader.exec_module(native)
    for name, one in ENTRIES.items():
        vars(one)["call"] = with_defaults(getattr(native, name), one.py_func)


def pytest_runtestloop(session):
    """Try the mutants in place of running the tests; print those that survive."""
    put_native()
    costs = {item: spent([item], TEST) for item in session.items}
    quick = sorted((i for i in session.items if costs[i] < TEST), key=costs.get)
    paths = [p for x in FOLDERS for p in sorted((ROOT / "qpavoid" / x).glob("*.py"))]
    mutants = [(path, name) for path in paths for name in named(path.read_text())]
    random.Random(SEED).shuffle(mutants)
    survivors = stillborn = 0
    for path, name in mutants[:COUNT]:
        tests = sorted(quick, key=partial(order, path))
        time = spent(tests, HANGS, path, name)
        stillborn += math.isnan(time)
        if time < math.inf:
            survivors += 1
            print(f"{path.relative_to(ROOT)}, {name}", flush=True)
    tried = len(mutants[:COUNT]) - stillborn
    print(f"{len(quick)} tests; of {tried} mutants {survivors} survive; ", end="")
    print(f"{stillborn} cannot be built")
    return True


def order(path, item):
    """Return the key of a test: the mutant's module, recorded answers, its folder."""
    stem, folder = item.path.stem, item.path.parent.name
    return path.stem not in stem, "recorded" not in stem, folder != path.parent.name


def spent(items, most, *mutant):
    """Return the time of tests in a process of their own, s.

    Infinite if one fails; NaN if a mutant cannot be built.
    """
    if (child := os.fork()) == 0:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.alarm(WALL)
        code = 2
        with suppress(BaseException):
            if mutant:
                put(*mutant)
            code = 1
            began = process_time()
            while items and process_time() < began + BUDGET:
                signal.setitimer(signal.ITIMER_VIRTUAL, most)
                item = items.pop(0)
                item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
                assert not item.session.testsfailed
            os._exit(0)
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    ended = os.waitstatus_to_exitcode(status)
    return {0: used.ru_utime, 2: math.nan}.get(ended, math.inf)


if __name__ == "__main__":
    COUNT, SEED = map(int, sys.argv[1:])
    folders = [str(ROOT / "tests" / name) for name in FOLDERS]
    quiet = ["-q", "-s", "--tb=no", "-p", "no:cacheprovider", "-W", "ignore", "-r", ""]
    pytest.main([*quiet, *folders, f"--rootdir={ROOT}"], [sys.modules["__main__"]])
