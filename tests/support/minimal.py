"""The smallest scenario file, and what is wrong with others."""

import pytest

from qpavoid.errors import ConfigError
from qpavoid.lab.scenario.scenario import load_scenario

MINIMAL = """
title = "t"
duration_s = 1.0
[reference]
kind = "station"
pose = { x_m = 0.0, y_m = 0.0 }
"""


def write(folder, text, name="s.toml"):
    path = folder / name
    path.write_text(text)
    return path


def problems(folder, text):
    with pytest.raises(ConfigError) as caught:
        load_scenario(write(folder, text))
    for line in caught.value.problems:
        assert line.startswith(str(folder / "s.toml"))
    return caught.value.problems
