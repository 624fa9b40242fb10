"""The parked encounters as scenario files are those of the study."""

import pytest

pytest.importorskip("encounters", reason="needs qpavoid[study]")

import encounter_cases
from encounter_scenes import as_scenario, make_loops
from encounters import ROBOT, station_tracker
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.lab.simulation.batch import Batch
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import make_scenario


@pytest.mark.parametrize(
    ("family", "seed"), [("parked", 0), ("parked", 7), ("several", 2)]
)
def test_a_case_ends_as_the_encounter_does(family, seed, tmp_path):
    source = encounter_cases.Parked(family)
    settings = AvoidanceSettings(dt=encounter_cases.DT)
    batch = Batch(ROBOT, station_tracker(ROBOT), settings)
    (loop,) = make_loops([encounter_cases.drawn(family)[seed]], ROBOT)
    scene = make_scenario(source.sample(seed), "case", tmp_path)
    for method in ("qp-ahead", "eq5"):
        case, met = (
            outcome_of(run(x, method)) for x in (scene, as_scenario(batch, loop))
        )
        for key in ("clearance", "room", "arrived", "length"):
            assert case[key] == pytest.approx(met[key], abs=1e-9), key
    assert source.identity(None) == encounter_cases.Parked(family).identity(None)


def test_on_a_path_there_is_no_such_case():
    with pytest.raises(ValueError, match="several 1: the robot is on a path"):
        encounter_cases.Parked("several").sample(1)
    with pytest.raises(ValueError, match="'carts' is neither parked nor several"):
        encounter_cases.Parked("carts").sample(1)
