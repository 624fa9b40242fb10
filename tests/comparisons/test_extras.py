"""Every script says which extra it lacks, even for --help: no traceback."""

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
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


WANTING = {
    "slippery_floor.py": "mujoco",
    "random_policy.py": "gym",
    "mobile_manipulator.py": "wholebody",
}
"""Examples that want an extra, and which."""


def run_without_extras(path, *arguments, folder=COMPARISONS):
    code = RUN.format(extras=set(EXTRAS.split()))
    command = [sys.executable, "-c", code, str(path), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, cwd=folder)
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.mark.parametrize(
    "path",
    [
        path if path.name in WANTING else pytest.param(path, marks=pytest.mark.slow)
        for path in sorted((COMPARISONS / "examples").glob("*.py"))
    ],
    ids=lambda path: path.stem,
)
def test_an_example_without_extras_says_in_a_line_what_it_wants(path, tmp_path):
    done = run_without_extras(path, folder=tmp_path)
    if path.name in WANTING:
        assert done.returncode == 1
        assert done.stderr.count("\n") == 1
        assert done.stderr.endswith(f"pip install 'qpavoid[{WANTING[path.name]}]'\n")
    else:
        assert done.returncode == 0, done.stderr


def scripts():
    """Scripts with options, but for the examples."""
    for path in sorted([*COMPARISONS.glob("*.py"), *COMPARISONS.glob("[!e]*/*.py")]):
        if "ArgumentParser" in path.read_text():
            yield str(path.relative_to(COMPARISONS))


QUICK = ("crowdnav/crowdnav.py", "timing/solvers.py")
"""All others are slow."""


@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK else pytest.param(name, marks=pytest.mark.slow)
        for name in scripts()
    ],
)
def test_a_script_without_extras_says_which_it_lacks(name):
    path = COMPARISONS / name
    done = run_without_extras(path, "--help", folder=path.parent)
    if done.returncode:
        assert done.returncode == 1
        assert "Install it with: pip install 'qpavoid[" in done.stderr
    else:
        assert "usage:" in done.stdout
