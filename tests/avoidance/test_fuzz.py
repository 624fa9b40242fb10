"""No call whatever makes the filter fail: in Python, bounds checked, and in C."""

import os
import subprocess
import sys

import numpy as np
import pytest

from export_problems import CAPACITY
from fuzz import FILTERS, fuzzed, in_c
from in_c import COMPILER, STRICT
from places import SUPPORT
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
from timing.exported import compile_replay

SANE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", FILTERS)
def test_no_call_breaks_the_exported_filter(name, tmp_path):
    robot, settings, ahead = FILTERS[name]
    export_c(tmp_path, robot, settings, CAPACITY, ahead)
    try:
        program = compile_replay(tmp_path, [*STRICT, *SANE])
    except QPAvoidError as why:
        assert "sanit" in str(why) or "asan" in str(why), why
        pytest.skip("no sanitizers")
    seen = set()
    for seed in range(3):
        problems = fuzzed([seed, len(name)], 5_000, robot)
        answers, bad, last = in_c(program, robot, problems)
        assert len(answers) == len(problems)
        assert not bad.any(), (answers[bad][:3], last[bad][:3])
        seen |= set(answers["status"].tolist())
    assert seen >= {-1, 1, 2}


@pytest.mark.slow
def test_no_call_breaks_the_filter_with_its_bounds_checked(tmp_path):
    folder = SUPPORT
    checked = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, str(folder / "fuzz.py"), str(100_000 // len(FILTERS))],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **checked},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    assert done.stdout.count(" 0 wrong") == len(FILTERS)
    answered = [int(line.split()[1]) for line in done.stdout.splitlines()]
    assert np.min(answered) > 1000
