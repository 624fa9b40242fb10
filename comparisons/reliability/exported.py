"""Hostile calls of the exported C under sanitizers; its stack, loops and warnings.

python comparisons/reliability/exported.py --filter plain --sanitizer thread
"""

import argparse
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from collections.abc import Sequence
from graphlib import TopologicalSorter
from pathlib import Path
from tempfile import TemporaryDirectory

from qpavoid.export.write import Capacity, export_c

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.calls import FILTERS
from reliability.page import add_row

CAPACITY = Capacity(discs=8, points=64, walls=4, polygons=3, corners=14)
SANITIZERS = {
    "address, undefined": "-fsanitize=address,undefined",
    "thread": "-fsanitize=thread",
    "none": "-O2",
}
WARNINGS = """
    -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wsign-conversion -Wcast-qual
    -Wcast-align -Wundef -Wvla -Wstrict-prototypes -Wmissing-prototypes
    -Wredundant-decls -Wpointer-arith -Wwrite-strings -Wswitch-default
    -Wunreachable-code -Wimplicit-fallthrough
""".split()
"""Of gcc and clang; as MISRA asks, no implicit conversion or shadowing."""

CLANG = sys.executable, "-m", "ziglang", "cc", "-target"
TARGETS = "native", "arm-linux-gnueabihf"
"""Of clang."""

NODE = re.compile(r'node: \{ title: "([^"]+)" label: "[^"]*?\\n(\d+) bytes \(([^)]*)\)')
EDGE = re.compile(r'edge: \{ sourcename: "([^"]+)" targetname: "([^"]+)"')
LOOP = re.compile(r"^ *(for|while|do)\b", re.M)
COUNTED = re.compile(
    r"^ *for \(int (\w+) = [^;]+; \1 [<>]=? [^;]+; \1(\+\+|--)\)", re.M
)


def export(folder: str | Path, name: str, capacity: Capacity = CAPACITY) -> Path:
    """Export one of :data:`reliability.calls.FILTERS`; return its source."""
    robot, settings, how = FILTERS[name]
    export_c(folder, robot, settings, capacity, how.get("ahead", True))
    return Path(folder) / "qpavoid_filter.c"


def fuzz(
    name: str, sanitizer: str, count: int, seed: int = 0, threads: int = 1
) -> dict[str, object]:
    """Return the row of a filter and a sanitizer; RuntimeError: it found something.

    The threads, each with a filter and a seed of its own, share the calls.
    """
    fuzzer = Path(__file__).with_name("fuzz.c")
    with TemporaryDirectory() as folder:
        source = export(folder, name)
        program = str(Path(folder) / "fuzz")
        flags = ["-std=c99", "-O2", "-g", "-pthread", SANITIZERS[sanitizer]]
        flags += ["-fno-sanitize-recover=all"] * (sanitizer != "none")
        build = ["gcc", *flags, f"-I{folder}", str(fuzzer), str(source), "-o", program]
        subprocess.run([*build, "-lm"], check=True)
        limits = [str(float(x)) for x in FILTERS[name][0].limit_vector[:8]]
        asked = [program, str(count), str(seed), str(threads), *limits]
        done = subprocess.run(asked, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr[-4000:])
    rows = [[int(x) for x in line.split()] for line in done.stdout.splitlines()]
    names = "calls", "invalid", "not finite", "beyond limits"
    worst = max(rows, key=lambda row: row[4])
    near = zip(worst[5:], ("points", "discs", "walls", "polygons"), strict=True)
    return {
        "part": f"{name}, {sanitizer}, {seed}",
        "threads": threads,
        **{one: sum(row[k] for row in rows) for k, one in enumerate(names)},
        "worst ms": round(1e-6 * worst[4], 3),
        "worst call": ", ".join(f"{n} {what}" for n, what in near if n > 0),
    }


def stack_of(source: Path, root: str, *flags: str) -> int:
    """Return the deepest path of gcc's call graph from a function, bytes of stack.

    Functions of the C library count as nothing.

    Raises:
        ValueError: A function calls itself, or its frame has no bound.
    """
    command = ["gcc", "-std=c99", "-O2", *flags, "-fcallgraph-info=su,da", "-c"]
    folder = source.parent
    subprocess.run([*command, source.name, "-o", "stack.o"], cwd=folder, check=True)
    text = next(folder.glob("*.ci")).read_text()
    frames, called = dict[str, int](), defaultdict[str, set[str]](set)
    for name, size, kind in NODE.findall(text):
        if kind not in ("static", "dynamic,bounded"):
            raise ValueError(f"{name}: {kind}")
        frames[name] = int(size)
    for name, other in EDGE.findall(text):
        called[name].add(other)
    deepest = dict[str, int]()
    for name in TopologicalSorter(called).static_order():  # those that are called first
        below = [deepest[other] for other in called[name]] if name in called else []
        deepest[name] = frames.get(name, 0) + max(below, default=0)
    return next(deepest[name] for name in deepest if name.split(":")[-1] == root)


def warnings_of(compiler: Sequence[str], source: Path, *flags: str) -> list[str]:
    """Return the warnings of a compiler."""
    command = [*compiler, "-std=c99", "-O2", *flags, "-c", str(source), "-o"]
    target = source.with_suffix(".o")
    done = subprocess.run([*command, str(target)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return [line for line in done.stderr.splitlines() if "warning:" in line]


def describe(name: str) -> dict[str, object]:
    """Return the row of a filter's source: lines, stack, loops, warnings; needs zig."""
    with TemporaryDirectory() as folder:
        source = export(folder, name)
        text = source.read_text()
        loops = len(LOOP.findall(text))
        return {
            "filter": name,
            "lines": len(text.splitlines()),
            "stack bytes": stack_of(source, "qpavoid_step"),
            "loops": loops,
            "counted": len(COUNTED.findall(text)),
            "warnings of gcc": len(warnings_of(["gcc"], source, *WARNINGS)),
            "warnings of clang": sum(
                len(warnings_of([*CLANG, target], source, *WARNINGS))
                for target in TARGETS
            ),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--filter", default="plain", choices=FILTERS)
    parser.add_argument("--sanitizer", default="none", choices=SANITIZERS)
    parser.add_argument("--count", type=int, default=10_000, help="calls; 0: describe")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    if shutil.which("gcc") is None:
        parser.error("there is no gcc")
    if options.count:
        given = options.filter, options.sanitizer, options.count, options.seed
        row = fuzz(*given, options.threads)
        add_row("exported", row)
    else:
        row = describe(options.filter)
        add_row("source", row)
    print(row)


if __name__ == "__main__":
    main()
