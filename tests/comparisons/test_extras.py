"""Every script says which extra it lacks, even for --help: no traceback."""

import ast
import subprocess
import sys

import pytest

from places import COMPARISONS

EXTRAS = """joblib pyarrow plotly tomli_w optuna distributed pyrvo tcod mujoco rosbags
gymnasium pettingzoo aiohttp piqp proxsuite clarabel highspy cvxpy cbfpy elastiqp pink
mink pinocchio IPython"""

RUN = """
import runpy, sys
class Lacking:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {extras}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Lacking())
sys.argv = [sys.argv[1], "--help"]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def scripts():
    for path in sorted(COMPARISONS.glob("*.py")):
        text = path.read_text()
        if "ArgumentParser" in text or "make_parser" in text:
            if any(isinstance(node, ast.If) for node in ast.parse(text).body):
                yield path.name


QUICK = ("barn.py", "gym_timing.py", "tune_baselines.py")
"""One that goes through studies.py, and those that do not; all others are slow."""


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in scripts()
        if name != "studies.py"
    ],
)
def test_a_script_without_extras_says_what_it_wants(name):
    code = RUN.format(extras=set(EXTRAS.split()))
    command = [sys.executable, "-c", code, str(COMPARISONS / name)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=COMPARISONS)
    assert "Traceback" not in done.stderr
    if done.returncode:
        assert "Install it with: pip install 'qpavoid[" in done.stderr
    else:
        assert "usage:" in done.stdout


def test_all_scripts_are_asked():
    assert len(list(scripts())) > 20
