"""The filter in C: the same answers as in Python, warning-free, without allocation."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from hostile_filters import (
    CAPACITY,
    FILTERS,
    LOOPS,
    in_python,
    problems_of,
)
from in_c import COMPILER, STRICT
from qpavoid.avoidance.decision import BRAKING, HOLDING, PLANNED
from qpavoid.cli import main
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
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


@pytest.mark.parametrize("name", ["ahead-limited", "repulsion"])
def test_nothing_is_needed_beyond_libm(filters, name, tmp_path):
    source = filters[name].with_name("qpavoid_filter.c")
    command = [COMPILER, "-std=c99", *STRICT, "-O0", "-c", source, "-o", "filter.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    listed = subprocess.run(
        ["nm", "filter.o"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    libm = "sqrt sin cos atan2 copysign ceil floor fmod rint".split()
    assert set(re.findall(r" U (\w+)", listed)) <= {*libm, "memcpy", "memset"}
    assert not re.search(r" [BbDd] ", listed), "memory of its own"


def test_the_example_and_the_command_line(tmp_path, capsys):
    folder = tmp_path / "filter"
    known = ["--robot", "demo/crowd", "--obstacles", "3"]
    assert main(["export-c", *known, str(folder)]) == 0
    names = ["qpavoid_filter.h", "qpavoid_filter.c", "main.c"]
    assert capsys.readouterr().out.split() == [str(folder / name) for name in names]
    command = [COMPILER, "-std=c99", *STRICT, "-O2", *names[1:], "-lm", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run(["./main"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 and "0.20 m from the goal" in done.stdout
    assert main(["export-c", "--robot", "mir10", str(folder)]) == 2
    assert main(["export-c", "--obstacles", "0", str(folder)]) == 2
