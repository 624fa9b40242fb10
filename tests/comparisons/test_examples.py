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
    "fork_lift": r"x = 3\.4 m.* 0\.1.*\n.*x = 10\.0 m, clearance (-0\.0\d\d), least \1",
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

LACKING = {
    "examples/slippery_floor.py": "mujoco",
    "examples/random_policy.py": "gym",
    "examples/mobile_manipulator.py": "wholebody",
    "crowdnav/crowdnav.py": "",
    "paper/calibrations.py": "",
    "timing/solvers.py": "",
    "timing/steps.py": "",
    "encounters/station.py": "",
    "rows.py": "",
}
"""Scripts and the extra that each needs to start, if any."""


@pytest.mark.parametrize(("name", "extra"), LACKING.items())
def test_a_script_without_extras_helps_or_says_which_it_lacks(name, extra):
    path = COMPARISONS / name
    code = RUN.format(extras=set(EXTRAS.split()))
    command = [sys.executable, "-c", code, str(path), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=path.parent)
    if extra:
        assert done.returncode == 1 and done.stderr.count("\n") == 1
        assert done.stderr.endswith(f"pip install 'qpavoid[{extra}]'\n")
    else:
        assert done.returncode == 0 and "usage:" in done.stdout
