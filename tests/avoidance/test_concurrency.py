"""Filters side by side in threads, processes and tasks; copies; pickles."""

import copy
import math
import multiprocessing
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from qpavoid import AvoidanceSettings, Robot, SafetyFilter
from qpavoid.avoidance.inputs import Freshness

STEPS = 60


def run(seed, safety=None, solver="exact", steps=STEPS):
    """Return the twists of a run among random points."""
    safety = safety or SafetyFilter(Robot.mir100(), solver=solver)
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (40, 2)) + [2.0, 0.0]
    twists = []
    for _ in range(steps):
        desired = rng.uniform([-0.4, -1.0], [1.0, 1.0]).tolist()
        twists.append(safety.filter(*desired, points)[:4])
        points = points - [0.02 * twists[-1][0], 0.0]
    return twists


def go_on(safety, seed):
    return run(seed, safety)


def test_many_threads_with_a_filter_each_answer_as_one():
    expected = [run(seed) for seed in range(12)]
    old = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(6) as pool:
            assert list(pool.map(run, range(12))) == expected
    finally:
        sys.setswitchinterval(old)


HANDED = """
import multiprocessing, sys
sys.path.insert(0, {path!r})
from test_concurrency import SafetyFilter, Robot, go_on, run
if __name__ == "__main__":
    safety = SafetyFilter(Robot.mir100())
    run(1, safety)
    with multiprocessing.get_context({method!r}).Pool(1) as pool:
        there = pool.apply_async(go_on, (safety, 2)).get(200)
    assert there == go_on(safety, 2)
"""


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_filter_handed_to_a_process_goes_on_there(method, tmp_path):
    """Memory and all: what it would have done here. The parent has no other threads."""
    if method not in multiprocessing.get_all_start_methods():
        pytest.skip("not here")
    script = tmp_path / "handed.py"
    script.write_text(HANDED.format(path=str(Path(__file__).parent), method=method))
    subprocess.run([sys.executable, script], check=True, timeout=300)


@pytest.mark.parametrize("solver", ["exact", "osqp", "casadi", "qpsolvers:daqp"])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_copy_goes_on_by_itself(solver, copied):
    settings, freshness = AvoidanceSettings(gamma=3.0), Freshness(good=0.1)
    safety = SafetyFilter(Robot.jackal(), settings, solver, freshness=freshness)
    run(1, safety, steps=5)
    safety.brake("to be remembered")
    other = copied(safety)
    other = pickle.loads(other) if isinstance(other, bytes) else other
    for name in ("solver", "ahead", "freshness", "settings", "faults", "plan"):
        assert getattr(other, name) == getattr(safety, name)
    assert other.robot.name == safety.robot.name
    first = [safety.step(0.5, 0.1, [[1.5, 0.2]])[:4] for _ in range(8)]
    second = [other.step(0.5, 0.1, [[1.5, 0.2]])[:4] for _ in range(8)]
    assert [x[:3] for x in first] == [x[:3] for x in second]
    assert math.isnan(first[0][3]) and first[-1][2] != "invalid"
