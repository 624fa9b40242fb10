"""A scene on the terminal: where that is asked, to scale, and said in words."""

import numpy as np

from qpavoid.cli import main
from qpavoid.cli.picture import TALLEST, Canvas, picture

BLANK = chr(0x2800)


def test_dots_stand_where_points_are():
    canvas = Canvas((0.0, 10.0, 0.0, 4.0), 10)
    canvas.draw(np.array([[0.1, 3.9], [9.9, 0.1]]), "red")
    lines = canvas.text().plain.splitlines()
    assert lines[0][0] == chr(0x2801) and lines[-1][-1] == chr(0x2880)
    assert len(lines) == 2 and set("".join(lines)[1:-1]) == {BLANK}


def test_a_scene_fits_and_names_its_methods(logs):
    text = picture(logs, 60).plain
    *drawn, names = text.splitlines()
    assert len(drawn) <= TALLEST and max(map(len, drawn)) <= 60
    assert "Eq. 5" in names and any(set(line) != {BLANK} for line in drawn)


def test_only_where_it_is_asked(tmp_path, capsys):
    command = ["run", "paper/figure_2b", "--controller", "eq5", "--out", str(tmp_path)]
    assert main(command) == 0
    assert BLANK not in capsys.readouterr().out
    assert main([*command, "--picture", "--figures", "svg"]) == 0
    assert BLANK in capsys.readouterr().out and list(tmp_path.glob("*-poses.svg"))
