"""The filter in C: the same answers as in Python, warning-free, without allocation."""

import ctypes
import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from hostile_filters import CAPACITY, FILTERS, LOOPS, in_python, problems_of
from in_c import COMPILER, STRICT
from qpavoid import Footprint, Robot
from qpavoid.avoidance.decision import BRAKING, HOLDING, PLANNED
from qpavoid.cli import main
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
from shapes import ELL, FORKS
from timing.exported import compile_replay, replay

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

MOST = sorted(set(FILTERS) - {"ahead-limited"})
FEW = [
    name
    if name in ("ahead-limited", "ahead-parts", "limited", "repulsion")
    else pytest.param(name, marks=pytest.mark.long)
    for name in FILTERS
]

SEEN = {
    "ahead": {PLANNED, HOLDING},
    "ahead-limited": {PLANNED, BRAKING, HOLDING},
    "limited": {BRAKING},
}
"""Statuses that come up beside the common ones."""


class Programs(dict):
    """Every filter, exported and compiled without a warning when it is asked for."""

    def __init__(self, factory):
        super().__init__()
        self.factory = factory

    def __missing__(self, name):
        robot, settings, ahead, _ = FILTERS[name]
        folder = self.factory.mktemp(name)
        export_c(folder, robot, settings, CAPACITY, ahead)
        self[name] = compile_replay(folder, STRICT)
        return self[name]


@pytest.fixture(scope="module")
def filters(tmp_path_factory):
    return Programs(tmp_path_factory)


@pytest.mark.parametrize("name", FEW)
def test_same_answers_as_python(filters, name):
    robot, settings, ahead, _ = FILTERS[name]
    problems = problems_of(name)
    wanted = in_python(robot, settings, ahead, problems)
    given = replay(filters[name], problems)
    assert (given["status"] == wanted["status"]).all()
    assert (given["active"] == wanted["active"]).all()
    for field in ("v", "omega", "clearance", "slack", "shortfall"):
        np.testing.assert_array_equal(given[field], wanted[field])
    assert np.isfinite([given["v"], given["omega"]]).all()
    seen = set(given["status"])
    assert seen >= {-1, 0, 1, 2, *SEEN.get(name, ())}, seen


@pytest.mark.parametrize(
    "name", ["ahead-limited", *(pytest.param(n, marks=pytest.mark.slow) for n in MOST)]
)
def test_no_undefined_behaviour(filters, name, tmp_path):
    for file in ("qpavoid_filter.h", "qpavoid_filter.c"):
        shutil.copy(filters[name].with_name(file), tmp_path)
    flags = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
    try:
        program = compile_replay(tmp_path, flags)
    except QPAvoidError:
        pytest.skip("no sanitizers")
    problems = problems_of(name)[LOOPS - 100 : LOOPS + 700]
    assert len(replay(program, problems)) == len(problems)


class Machine:
    """An exported filter, called through ctypes."""

    room = np.dtype(
        [
            ("n_parts", np.int32),
            ("n_corners", np.int32, 6),
            ("corners", np.float64, (24, 2)),
        ],
        align=True,
    )

    def __init__(self, folder, robot, settings):
        parts, edges = (self.room[k].shape[0] for k in ("n_corners", "corners"))
        capacity = replace(CAPACITY, parts=parts, edges=edges)
        export_c(folder, robot, settings, capacity)
        flags = ["-std=c99", "-O2", "-ffp-contract=off", *STRICT, "-shared", "-fPIC"]
        files = ["qpavoid_filter.c", "-lm", "-o", "filter.so"]
        subprocess.run([COMPILER, *flags, *files], cwd=folder, check=True)
        self.c, self.own = ctypes.CDLL(str(folder / "filter.so")), bytearray(1 << 20)
        self.filter = (ctypes.c_char * len(self.own)).from_buffer(self.own)
        self.c.qpavoid_init(self.filter)

    def set(self, *parts):
        """Set convex parts; return the code."""
        given = np.zeros((), self.room)
        given["n_parts"] = len(parts)
        sizes, corners = [len(x) for x in parts], np.vstack([(0, 0), *parts])[1:]
        given["n_corners"][: len(sizes)] = sizes[:6]
        given["corners"][: len(corners)] = corners[:24]
        return self.c.qpavoid_set_footprint(self.filter, at(given))

    def step(self, p, out):
        """Write the answer (1,) of one problem (1,)."""
        names = "last_v", "last_omega", "v", "omega"
        *last, v, omega = (ctypes.c_double(p[name][0]) for name in names)
        if p["anew"][0]:
            self.c.qpavoid_reset(self.filter, *last)
        self.c.qpavoid_step(self.filter, v, omega, at(p["obstacles"]), at(out))


def at(array):
    return ctypes.c_void_p(array.ctypes.data)


def test_a_footprint_is_changed_as_in_python(tmp_path):
    (robot, settings, _, _), problems = FILTERS["ahead-parts"], problems_of("ahead")
    machine, pentagon = Machine(tmp_path, robot, settings), Robot.mir100().footprint
    shapes = FORKS, pentagon, Footprint.union([*FORKS.parts, pentagon]), ELL
    changes = {i: shapes[i // 31 % len(shapes)] for i in range(31, 1200, 31)}
    wanted = in_python(robot, settings, True, problems, changes)
    given = np.zeros_like(wanted)
    for i in range(len(problems)):
        if i in changes:
            assert machine.set(*changes[i].parts) == 0
        machine.step(problems[i : i + 1], given[i : i + 1])
    for name in set(wanted.dtype.names) - {"residual", "nanoseconds"}:
        np.testing.assert_array_equal(given[name], wanted[name])
    assert set(given["status"]) >= {-1, 0, 1, 2, PLANNED}


def test_a_footprint_that_cannot_be_is_refused_and_changes_nothing(tmp_path):
    machine = Machine(tmp_path, *FILTERS["ahead-parts"][:2])
    box, before = Footprint.rectangle(1.0, 0.5).vertices, bytes(machine.own)
    nan = np.where(box > 0.3, np.nan, box)
    angles = 0.8 * math.pi * np.arange(5)
    pentagram = np.column_stack([np.cos(angles), np.sin(angles)])
    assert machine.set() == machine.set(box, box[:2]) == -1
    assert machine.set(*7 * [box]) == machine.set(*4 * [box], *2 * [pentagram]) == -1
    for wrong in (box[::-1], nan, pentagram, box[[0, 1, 1, 2]]):
        assert machine.set(box, wrong, wrong) == 2
    assert machine.own == before
    assert machine.set(*6 * [box]) == 0 and machine.own != before


@pytest.mark.parametrize("name", ["ahead-limited", "repulsion"])
def test_nothing_is_needed_beyond_libm(filters, name, tmp_path):
    source = filters[name].with_name("qpavoid_filter.c")
    command = [COMPILER, "-std=c99", *STRICT, "-O0", "-c", source, "-o", "filter.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    listed = subprocess.run(
        ["nm", "filter.o"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    libm = "sqrt hypot sin cos atan2 copysign ceil floor fmod rint".split()
    assert set(re.findall(r" U (\w+)", listed)) <= {*libm, "memcpy", "memset"}
    assert not re.search(r" [BbDd] ", listed), "memory of its own"


def test_the_example_and_the_command_line(tmp_path, capsys):
    folder = tmp_path / "filter"
    known = ["--robot", "demo/crowd", "--obstacles", "3", "--edges=9"]
    assert main(["export-c", *known, str(folder)]) == 0
    names = ["qpavoid_filter.h", "qpavoid_filter.c", "main.c"]
    assert capsys.readouterr().out.split() == [str(folder / name) for name in names]
    command = [COMPILER, "-std=c99", *STRICT, "-O2", *names[1:], "-lm", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run(["./main"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 and "0.20 m from the goal" in done.stdout
    header = (folder / names[0]).read_text()
    assert re.findall(r"#define QPAVOID_(?:PARTS|EDGES) (\d+)", header) == ["3", "9"]
    assert main(["export-c", "--robot", "mir10", str(folder)]) == 2
    assert main(["export-c", "--obstacles", "0", str(folder)]) == 2
