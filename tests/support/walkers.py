"""People who walk straight on, for tests of crowds."""

import numpy as np

from qpavoid.lab.worlds.crowd import Pedestrian


def walker(number, begin, start, end, seconds=8.0):
    times = begin + np.arange(0.0, seconds + 0.2, 0.4)
    part = ((times - begin) / seconds)[:, None]
    return Pedestrian(
        number, times, np.array(start) * (1 - part) + np.array(end) * part
    )
