"""Environments: the interfaces' own tests, the simulation, the shield."""

from dataclasses import dataclass

import numpy as np
import pytest

from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.errors import InvalidInputError, UnknownNameError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot
from scenario_files import CROSSING, SLOW
from sweep_sources import Harmless

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env

import qpavoid.gym as qgym
from examples import random_policy

PHYSICAL = "ignore:.*symmetric and normalized space"
"""Twists are in m/s and rad/s; ``RescaleAction`` makes others of them."""

WALL = """
[[obstacles]]
kind = "wall"
start_m = [1.5, -2.0]
end_m = [1.5, 2.0]
"""
TURNING_BACK = """
[[obstacles]]
kind = "waypoints"
times_s = [0.0, 1.0, 4.0]
positions_m = [[3.0, 0.0], [2.0, 0.0], [3.0, 1.0]]
radius_m = 0.2
"""


@pytest.fixture
def place(tmp_path):
    def write(*texts):
        file = tmp_path / "scene.toml"
        file.write_text("".join(texts))
        return file

    return write


@pytest.mark.filterwarnings(PHYSICAL)
@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
def test_gymnasium_accepts_them():
    env = qgym.ScenarioEnv("demo/strangers", seeds=range(3))
    check_env(env, skip_render_check=True)
    check_env(qgym.ShieldedEnv(env), skip_render_check=True)
    made = gymnasium.make("qpavoid/Scenario-v0", source="paper/test_case_1")
    observed, info = made.reset(seed=1)
    assert made.observation_space.contains(observed) and info == {"scene": None}


class Recorded:
    """A method that drives what it was given."""

    def __init__(self, twists):
        self.twists = twists

    def start(self, v, omega):
        left = iter(self.twists)
        return lambda *_: next(left)


@pytest.mark.parametrize("obstacles", [SLOW, WALL, TURNING_BACK])
def test_it_drives_as_a_run_does(place, obstacles):
    file = place(CROSSING, obstacles)
    asked = np.random.default_rng(3).uniform((0.0, -1.0), (1.0, 1.0), (80, 2))
    log = run(load_scenario(file), Recorded(asked))
    noted = outcome_of(log)
    env = qgym.ScenarioEnv(file)
    env.reset()
    least, poses = np.inf, []
    for action in asked:
        *_, over, late, info = env.step(action)
        poses.append(env._simulation.pose)
        least = min(least, info["clearance"])
        if over:
            break
    k = len(poses)
    assert over == (noted["min_clearance_m"] < 0.0) and (over or late)
    assert info["touched"] == over
    x, y = log["x_m"], log["y_m"]
    n = min(k, len(x) - 1)
    np.testing.assert_array_equal(np.array(poses)[: n - 1, 0], x[1:n])
    np.testing.assert_array_equal(np.array(poses)[: n - 1, 1], y[1:n])
    assert least == log["least_clearance_m"][:k].min()


def test_what_is_observed_and_rewarded(place):
    env = qgym.ScenarioEnv(place("ends_at_goal = true", CROSSING, WALL), beams=4)
    observed, _ = env.reset()
    # beams at −135°, −45°, 45°, 135°: the wall is 1.5 m ahead
    ahead = 1.5 * np.sqrt(2.0)
    expected = [2.0, 0.5, 1.0, 0.0, 0.0, 0.0, 10.0, ahead, ahead, 10.0]
    np.testing.assert_allclose(observed, expected, atol=1e-6)
    observed, reward, *_, info = env.step((1.0, 0.0))
    assert reward == pytest.approx(np.hypot(2.0, 0.5) - np.hypot(1.95, 0.5))
    assert observed[4] == 1.0 and info["clearance"] == pytest.approx(
        1.45 - 0.688, abs=1e-3
    )
    over = False
    while not over:
        _, reward, over, late, info = env.step((1.0, 0.0))
    assert info["touched"] and not info["arrived"] and not late
    assert reward == pytest.approx(-10.0, abs=0.06)


def test_an_episode_ends_at_the_goal_or_in_time(place):
    goal = place("ends_at_goal = true\narrival_m = 0.6\narrival_rad = 3.2", CROSSING)
    env = qgym.ScenarioEnv(goal)
    env.reset()
    over = False
    while not over:
        _, reward, over, late, info = env.step((1.0, 0.2))
    assert info["arrived"] and reward > 10.0 and not late
    env = qgym.ScenarioEnv(place("arrival_m = 5.0\narrival_rad = 3.2", CROSSING))
    env.reset()
    ends = [env.step((0.0, 0.0))[2:4] for _ in range(80)]
    assert ends == [(False, False)] * 79 + [(False, True)]


def test_the_shield_keeps_off_and_says_what_it_costs(place):
    env = qgym.ShieldedEnv(qgym.ScenarioEnv(place(CROSSING, WALL)))
    env.reset()
    *_, info = env.step((0.1, 0.0))
    assert info["cost"] == 0.0 and info["status"] == "tracking"
    costs = []
    for _ in range(79):
        _, _, over, late, info = env.step((1.0, 0.0))
        costs.append(info["cost"])
        assert not over
    assert max(costs) > 0.01 and info["clearance"] > 0.1 and late


class Other(gymnasium.Env):
    """Somebody else's: a robot on a line, a wall 2 m ahead."""

    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,))
    observation_space = gymnasium.spaces.Box(-9.0, 9.0, (1,))

    def reset(self, *, seed=None, options=None):
        self.x = 0.0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.x += 0.05 * action[0]
        return np.array([self.x], np.float32), 0.0, False, False, {}


def test_the_shield_fits_other_environments():
    other = Other()
    safety = SafetyFilter(Robot.mir100())
    env = qgym.ShieldedEnv(
        other,
        lambda: Obstacles(walls=[(2.0 - other.x, -1.0, 2.0 - other.x, 1.0)]),
        safety,
    )
    env.reset()
    for _ in range(100):
        env.step((1.0, 0.0))
    assert 0.8 < other.x < 2.0 - 0.688


@dataclass(frozen=True)
class Changing(Harmless):
    """Another robot in every other scene; three scenes."""

    def sample(self, seed=None):
        if seed > 2:
            raise IndexError
        preset = "jackal" if seed % 2 else "mir100"
        return super().sample(seed) | {"robot": {"preset": preset}}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: qgym.ScenarioEnv("fleet/swap"), "several robots"),
        (lambda: qgym.ScenarioEnv(Harmless(), []), "no seeds"),
        (lambda: qgym.ScenarioEnv(Changing(), [0, 1]), "differ from scene to scene"),
        (lambda: qgym.ScenarioEnv(Changing(), [2, 4]), "no scene 4"),
        (lambda: qgym.ScenarioEnv(Harmless(), [0], beams=0), "beams"),
        (
            lambda: made(Harmless()).reset(options={"scene": 9}),
            "9 is none of the seeds",
        ),
        (lambda: made(Harmless()).step((np.nan, 0.0)), "finite twist"),
        (lambda: made(Harmless()).step((0.0, 0.0, 0.0)), "finite twist"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises(InvalidInputError, match=message):
        make()


def made(source):
    env = qgym.ScenarioEnv(source, range(2))
    env.reset()
    return env


@pytest.mark.parametrize(
    "action", [(0.0,), (0.0, 0.0, 0.0), 1.0, None, "fast", [[0.0, 0.0]], (0.0, np.inf)]
)
def test_the_shield_refuses_what_is_no_twist(action):
    env = qgym.ShieldedEnv(made(Harmless()))
    env.reset(seed=1)
    with pytest.raises(InvalidInputError, match="finite twist"):
        env.step(action)
    assert np.isfinite(env.step((0.1, 0.0))[4]["cost"]), "nothing is lost"


def test_what_has_not_been_reset_says_so():
    env = qgym.ScenarioEnv(Harmless())
    for one in (env, qgym.ShieldedEnv(env)):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset first"):
            one.step((0.1, 0.0))


def test_what_is_not_simulated_is_refused(place):
    with pytest.raises(InvalidInputError, match=r"no \[localisation\]"):
        kind = '[localisation]\nkind = "motion_capture"\n'
        qgym.ScenarioEnv(place(CROSSING, kind))
    with pytest.raises(UnknownNameError, match="demo/strangers"):
        qgym.ScenarioEnv("demo/stranger")


def test_the_example_runs():
    env = qgym.ScenarioEnv("demo/strangers", seeds=range(2))
    touched, cost = random_policy.contacts(qgym.ShieldedEnv(env), 2)
    assert touched == 0 and cost > 0.0
