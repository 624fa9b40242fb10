"""The filter that looks ahead: on which side it passes, and mirror images."""

import numpy as np
import pytest

from passing import RADIUS, along_x, drive, moving
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead
from shapes import ROBOT


# ------------------------------------------------------------------- which side
@pytest.mark.parametrize("speed", [0.0, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("offset", [0.0, 0.02, -0.02])
def test_a_disc_head_on_is_passed_on_one_side(speed, offset):
    world = moving([3.0, offset], [-speed, 0.0], 0.2)
    least, poses, decisions = drive(SafetyFilter(ROBOT), world, 7.0, along_x)
    assert least >= RADIUS.r_min(speed) - 1e-3
    assert poses[-1, 0] > 3.5
    aside = poses[np.abs(poses[:, 1]) > 0.02, 1]
    assert (np.sign(aside) == np.sign(aside[0])).all()
    assert np.abs(aside).max() > 0.4
    turning = [np.sign(d.omega) for d in decisions if d.active and abs(d.omega) > 0.1]
    assert len(turning) > 50
    assert np.count_nonzero(np.diff(turning)) <= 12


@pytest.mark.parametrize(("hysteresis", "kept"), [(0.2, True), (0.0, False)])
def test_a_side_is_kept_although_the_other_becomes_a_little_cheaper(hysteresis, kept):
    """A disc that wanders 2 cm over to the side on which it is passed."""
    settings = AvoidanceSettings(ahead=LookAhead(hysteresis=hysteresis))
    for side in (1.0, -1.0):
        safety, turned = SafetyFilter(ROBOT, settings), []
        for offset in (-0.2, -0.15, -0.1, -0.05, 0.0, *[0.02] * 30):
            disc = [[1.6, side * offset, 0.2]]
            decision = safety.filter(0.6, 0.0, discs=disc, disc_velocities=[[-0.3, 0]])
            turned.append(side * decision.omega)
        assert turned[0] > 0.1
        assert (turned[-1] > 0.1) if kept else (turned[-1] < -0.1)


# -------------------------------------------------------------------- symmetry
