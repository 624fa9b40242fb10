"""Eq. 5 and Eq. 7 with settings of their own: which, and that no scenario has a say."""

from dataclasses import replace

import numpy as np
import pytest

from guided import SETTINGS
from qpavoid.avoidance.settings import Repulsion
from qpavoid.lab.baselines.repulsion import TunedEq5, TunedEq7
from qpavoid.lab.simulation.methods import make_controller
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.model.obstacles import Obstacles
from shapes import ROBOT, scene


@pytest.mark.parametrize("law", ["eq5", "eq7"])
@pytest.mark.parametrize("case", ["paper/test_case_1", "paper/test_case_2"])
def test_the_papers_are_those_of_its_test_cases(law, case):
    scenario = load_scenario(case)
    as_stated, named = run(scenario, law), run(scenario, f"{law}-paper")
    for key in ("x_m", "y_m", "v_mps", "omega_radps"):
        assert (as_stated[key] == named[key]).all()


@pytest.mark.parametrize("name", ["eq5-paper", "eq7-paper", "eq5-tuned", "eq7-tuned"])
def test_the_repulsion_of_a_scenario_is_nothing_to_them(name):
    weak = replace(SETTINGS, repulsion=Repulsion(0.5, "step", 0.3))
    far = replace(SETTINGS, radius=replace(SETTINGS.radius, r_min_slow=0.2))
    rng, moved = np.random.default_rng(3), 0
    for _ in range(40):
        near = Obstacles(**scene(rng))
        one, other, wider = (
            make_controller(name, ROBOT, settings).start(0.5)(0.5, 0.1, near)[:3]
            for settings in (SETTINGS, weak, far)
        )
        assert one == other
        moved += one != wider
    assert moved, "r_min is the scenario's"


@pytest.mark.parametrize(("law", "made"), [("eq5", TunedEq5), ("eq7", TunedEq7)])
def test_what_was_searched_is_what_is_driven(law, made):
    """By the law's own settings in a scenario."""
    own = made(ROBOT, SETTINGS, 2.0, "smooth", 0.1, 2.5)
    settings = replace(
        SETTINGS,
        repulsion=Repulsion(2.0, "smooth", 0.1),
        radius=replace(SETTINGS.radius, zone_ratio=2.5),
    )
    rng, changed = np.random.default_rng(8), 0
    for _ in range(40):
        near = Obstacles(**scene(rng))
        expected = make_controller(law, ROBOT, settings).start(0.5)(0.5, 0.1, near)
        assert own.start(0.5)(0.5, 0.1, near)[:3] == expected[:3]
        changed += expected[:2] != (0.5, 0.1)
    assert changed > 5
