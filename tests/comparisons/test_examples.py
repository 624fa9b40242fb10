"""Examples run, are short, draw, show what they say; scripts name lacking extras."""

import re
import runpy
import subprocess
import sys

import pytest

from places import COMPARISONS

EXAMPLES = COMPARISONS / "examples"

SHOWN = {
    "parked": "eq5 +arrived.*\nqp +touched.*\nqp-ahead +arrived",
    "velocity_plane": r"driven \[ ?0\.[78]\d* -1\.2",
    "dead_end": r"qp-ahead +stalled .*\nqp-ahead\+guide +arrived",
    "sudden_step": r"0\.17 m: touched.*\nr_min 0\.8 m: off goal, 0\.1",
    "fork_lift": r"x = 3\.4 m.* 0\.1.*\n.*x = 10\.0 m, clearance (-0\.00\d), least \1",
    "slippery_floor": r"nothing: least clearance -0.*\n.*floor: least clearance 0\.",
}
"""Expected output of each example, as a pattern."""


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_shows_what_it_says(name, tmp_path, monkeypatch, capsys):
    if name == "slippery_floor":
        pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")
    picture = tmp_path / f"{name}.png"
    monkeypatch.setattr(sys, "argv", [f"{name}.py", str(picture)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert re.search(SHOWN[name], capsys.readouterr().out)
    assert picture.read_bytes().startswith(b"\x89PNG")


EXTRAS = """pyarrow pyrvo tcod mujoco rosbags gymnasium piqp proxsuite clarabel highspy
pink mink pinocchio IPython"""

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


@pytest.mark.parametrize("name", WANTING)
def test_an_example_without_extras_says_in_a_line_which_it_lacks(name, tmp_path):
    done = run_without_extras(COMPARISONS / "examples" / name, folder=tmp_path)
    assert done.returncode == 1 and done.stderr.count("\n") == 1
    assert done.stderr.endswith(f"pip install 'qpavoid[{WANTING[name]}]'\n")


SCRIPTS = "crowdnav/crowdnav.py", "timing/solvers.py", "timing/steps.py", "rows.py"
SCRIPTS += "paper/calibrations.py", "encounters/station.py"


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_script_without_extras_helps_or_says_which_it_lacks(name):
    path = COMPARISONS / name
    done = run_without_extras(path, "--help", folder=path.parent)
    if done.returncode:
        assert done.returncode == 1
        assert "Install it with: pip install 'qpavoid[" in done.stderr
    else:
        assert "usage:" in done.stdout
