"""Methods of a user: driven and reported like all others."""

import math
import sys

import numpy as np
import pytest

import qpavoid as qp
from qpavoid.avoidance.decision import STATUSES, Status
from qpavoid.errors import ConfigError, InvalidInputError, UnknownNameError
from qpavoid.lab.scenario.methods import find_entry, own_file
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.simulation.run import run

MODULE = """
def wild(v, omega, obstacles, context):
    return 1e9, -1e9

NUMBER = 3
"""
DOCUMENT = {
    "title": "Past a disc",
    "duration_s": 4.0,
    "dt_s": 0.05,
    "reference": {
        "kind": "cubic",
        "start": {"x_m": 0.0, "y_m": 0.0},
        "goal": {"x_m": 2.0, "y_m": 0.0},
        "k_m": 2.0,
        "duration_s": 4.0,
    },
    "obstacles": [{"kind": "disc", "position_m": [3.0, 0.2], "radius_m": 0.2}],
}


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """A working folder with a module of the user's."""
    name = f"things_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    find_entry.cache_clear()
    own_file.cache_clear()
    yield name
    sys.modules.pop(name, None)


def scene(tmp_path):
    return make_scenario(DOCUMENT, "past", tmp_path / "past.toml")


def test_a_function_drives_from_python(tmp_path):
    asked = []

    def gentle(v, omega, obstacles, context):
        asked.append((v, omega, obstacles, context))
        return 0.5 * v, 0.5 * omega

    scenario = scene(tmp_path)
    log = qp.run(scenario, gentle)
    assert log.meta["controller"] == "gentle" and log.meta["solver"] == "its own"
    v, wanted = log["v_mps"], log["v_desired_mps"]
    np.testing.assert_allclose(v, 0.5 * wanted, atol=1e-12)
    statuses = {STATUSES[int(number)] for number in log["status"]}
    assert statuses <= {Status.STEERED, Status.TRACKING}
    _, _, obstacles, context = asked[-1]
    robot = log.final  # one step on
    goal = (2.0 - robot[0], 0.0 - robot[1])
    assert math.hypot(*context.goal[:2]) == pytest.approx(math.hypot(*goal), abs=0.05)
    disc = obstacles.discs[0, :2]
    far = math.dist(robot[:2], (3.0, 0.2))
    assert math.hypot(*disc) == pytest.approx(far, abs=0.05)


def test_what_it_wants_is_cut_to_the_limits(tmp_path, mine):
    scenario = scene(tmp_path)
    log, limits = run(scenario, f"{mine}:wild"), scenario.robot.limits
    assert (log["v_mps"] == limits.v_max).all()
    assert (log["omega_radps"] == limits.omega_min).all()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("{}:wyld", "did you mean 'wild'"),
        ("{}:NUMBER.nothing", "has no 'nothing'"),
        ("no_such_module:f", "No module named 'no_such_module'"),
        (":f", "[Ee]mpty module name"),
    ],
)
def test_what_cannot_be_loaded_is_said(tmp_path, mine, name, message):
    with pytest.raises(ConfigError, match=message):
        run(scene(tmp_path), name.format(mine))


def test_what_cannot_drive_is_said(tmp_path, mine):
    with pytest.raises(InvalidInputError, match="cannot be called"):
        run(scene(tmp_path), f"{mine}:NUMBER")

    def lost(v, omega, obstacles, context):
        return math.nan, 0.0

    with pytest.raises(InvalidInputError, match=r"lost returned \(nan, 0.0\)"):
        run(scene(tmp_path), lost)
    for found in (None, 1.0, (1.0,), "ab", (1.0, 2.0, 3.0)):
        with pytest.raises(InvalidInputError, match="finite twist"):
            run(scene(tmp_path), lambda *_, found=found: found)
    with pytest.raises(UnknownNameError, match="dwa"):
        run(scene(tmp_path), "dwaa")


class Bare:
    def start(self, v, omega):
        return lambda v, omega, obstacles, context: (v, omega)


class Forgetful(Bare):
    def __init__(self, robot, settings):
        pass

    def start(self):
        return None


class Blank(Forgetful):
    def start(self, v, omega):
        return None


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (lambda v, omega: (v, omega), r"\(v, omega, obstacles, context\): too many"),
        (lambda v, omega, o, c, more: 0, "context.: missing a required .*'more'"),
        (Bare, r"Bare is called with \(robot, settings\): .*arguments?"),
        (Forgetful, r"Forgetful.start is called with \(v, omega\): too many"),
        (Blank, "what Blank.start returns is called with .*None is not a callable"),
    ],
)
def test_what_takes_other_arguments_is_said(tmp_path, method, message):
    with pytest.raises(InvalidInputError, match=message):
        run(scene(tmp_path), method)
    assert run(scene(tmp_path), Bare()).meta["controller"] == "Bare"
