"""The examples run as they stand, are short, draw, and show what they say."""

import re
import runpy
import sys

import pytest

from places import COMPARISONS

EXAMPLES = COMPARISONS / "examples"
MOST_LINES = 60
"""Of the five that are shown; two more name the extra that they lack at once."""

SHOWN = {
    "parked": "eq5 +arrived.*\nqp +touched.*\nqp-ahead +arrived",
    "velocity_plane": r"driven \[ ?0\.[78]\d* -1\.2",
    "dead_end": r"qp-ahead +stalled .*\nqp-ahead\+guide +arrived",
    "sudden_step": r"0\.17 m: touched.*\nr_min 0\.8 m: off goal, 0\.1",
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


def test_examples_are_short_and_say_how_to_run_them():
    scripts = [path for path in EXAMPLES.glob("*.py") if path.stem != "wholebody"]
    assert len(scripts) >= 7
    for path in scripts:
        text = path.read_text()
        most = MOST_LINES if path.stem in SHOWN else MOST_LINES + 4
        assert len(text.splitlines()) <= most, path
        assert f"examples/{path.name}" in text or "figure.png" in text, path
