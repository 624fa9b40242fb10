"""Scenario files that several tests run."""

import numpy as np
import pytest

from qpavoid.errors import ConfigError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.worlds.crowd import Pedestrian

CROSSING = """
title = "A disc crosses the way"
duration_s = 4.0
dt_s = 0.05
frames_s = [0.0, 1.5, 3.0]
[reference]
kind = "cubic"
start = { x_m = 0.0, y_m = 0.0 }
goal = { x_m = 2.0, y_m = 0.5 }
k_m = 2.0
duration_s = 4.0
"""

SLOW = """
[[obstacles]]
kind = "disc"
position_m = [1.3, 0.7]
velocity_mps = [0.0, -0.08]
"""


def walker(number, begin, start, end, seconds=8.0):
    times = begin + np.arange(0.0, seconds + 0.2, 0.4)
    part = ((times - begin) / seconds)[:, None]
    return Pedestrian(
        number, times, np.array(start) * (1 - part) + np.array(end) * part
    )


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
