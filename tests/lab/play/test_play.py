"""The live page: the loop without a network."""

import json
import math
import time

import numpy as np
import pytest

from qpavoid.errors import InvalidInputError, UnknownNameError
from qpavoid.lab.play.actions import act
from qpavoid.lab.play.hand import HAND_SPEED, HOLD
from qpavoid.lab.play.messages import read_message
from qpavoid.lab.play.record import thin
from qpavoid.lab.play.session import Session
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario

pytest.importorskip("aiohttp")

from parked import BESIDE, PARKED
from qpavoid.lab.play.loop import Loop


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "parked.toml"
    file.write_text(PARKED)
    return str(file)


@pytest.fixture
def session(config):
    return Session(config)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"kind": "restart", "more": 1}', "more: unknown key. Known: kind."),
        ('{"kind": "run", "no": true}', "on: field required"),
        ('{"kind": "fly"}', "unknown kind 'fly'. Known: drag, release, add"),
        ('{"kind": "restrt"}', "unknown kind 'restrt'; did you mean 'restart'?"),
        ('{"on": true}', "kind: field required"),
        ('{"kind": "controller", "name": "%s"}' % ("x" * 3000), "at most 40"),
        ("{", "invalid JSON"),
        ("[]", "should be an object"),
    ],
)
def test_what_is_no_message_is_said_in_our_words(text, message):
    with pytest.raises(InvalidInputError) as caught:
        read_message(text)
    assert message in str(caught.value) and len(str(caught.value)) < 200


def say(session, kind, **content):
    return act(session, read_message(json.dumps({"kind": kind, **content})))


def sweep(session, start, end, speed):
    """Drag disc 0 along a straight line; return the frames."""
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    length, frames = math.hypot(dx, dy), []
    steps = math.ceil(length / speed / session.scenario.dt)
    for k in range(1, steps + 1):
        place = {"x_m": x + dx * k / steps, "y_m": y + dy * k / steps}
        say(session, "drag", disc=0, **place)
        frames.append(session.step())
    say(session, "release", disc=0)
    return frames


def wait(session, seconds):
    return [session.step() for _ in range(round(seconds / session.scenario.dt))]


@pytest.mark.parametrize("end", [(-2.5, 0.1), (0.0, 0.5), (-2.5, -0.6)])
def test_a_parked_robot_steps_aside_and_comes_back(session, end):
    frames = wait(session, 0.5) + sweep(session, BESIDE, end, 0.5)
    moved = max(math.hypot(frame["x"], frame["y"]) for frame in frames)
    frames += sweep(session, end, (-3.5, 2.5), 0.5) + wait(session, 15.0)
    last = frames[-1]
    assert moved > 0.2
    assert min(frame["clearance"] for frame in frames) > 0.15
    assert math.hypot(last["x"], last["y"]) < 0.01 and abs(last["heading"]) < 0.02


@pytest.mark.parametrize(("controller", "seconds"), [("eq7", 10.0), ("qp-ahead", 2.0)])
def test_untouched_it_is_the_run(controller, seconds):
    """As long as rounding does not decide between two plans."""
    frames = wait(Session("demo/crowd", controller), seconds)
    log = run(load_scenario("demo/crowd"), controller)
    for name, column in (("x", "x_m"), ("wd", "omega_desired_radps"), ("r", "r_m")):
        shown = [frame[name] for frame in frames]
        assert np.abs(shown - log[column][: len(frames)]).max() < 1e-6


def test_a_hand_is_no_faster_than_a_hand(session):
    say(session, "drag", disc=0, x_m=2.5, y_m=900.0)
    places = [frame["discs"][0][1] for frame in wait(session, HOLD)]
    assert np.diff(places).max() == pytest.approx(HAND_SPEED * 0.02)


def test_a_hand_that_is_lost_leaves_the_disc_where_it_is(session):
    say(session, "drag", disc=0, x_m=2.5, y_m=900.0)
    frames = wait(session, 1.0)
    assert frames[-1]["discs"][0][1] == pytest.approx(0.1 + HAND_SPEED * HOLD, abs=0.05)
    assert frames[-1]["discs"] == frames[-2]["discs"] and not frames[-1]["held"]


def test_a_track_ends_where_a_hand_takes_its_disc():
    session = Session("demo/crowd")
    begun = session.step()["discs"]
    before = wait(session, 1.0)[-1]["discs"]
    say(session, "drag", disc=0, x_m=before[0][0], y_m=before[0][1])
    after = wait(session, 2.0)[-1]["discs"]
    assert math.dist(before[0], after[0]) < 0.1 < math.dist(before[1], after[1])
    say(session, "restart")
    assert session.step()["discs"] == begun and session.time == 0.05


def test_a_restart_puts_dragged_discs_back(session):
    say(session, "add", x_m=-2.0, y_m=2.0)
    places = session.step()["discs"]
    for disc in (0, 1):
        say(session, "drag", disc=disc, x_m=3.0, y_m=3.0)
    assert wait(session, 0.2)[-1]["discs"] != places
    say(session, "restart")
    frame = session.step()
    assert frame["discs"] == places and not frame["held"]


def test_a_recording_replays(session, tmp_path):
    say(session, "controller", name="qp")
    say(session, "record", on=True)
    frames = wait(session, 0.4) + sweep(session, BESIDE, (-1.0, 0.1), 0.8)
    frames += wait(session, 2.0)
    say(session, "record", on=False)
    file = tmp_path / "recorded.toml"
    file.write_text(session.recording_toml())
    scenario = load_scenario(file)
    assert len(scenario.world.tracks[0].times) < 50 and len(scenario.world.walls) == 1
    log = run(scenario, "qp")
    x = [frame["x"] for frame in frames]
    clearance = min(frame["clearance"] for frame in frames)
    assert len(log) == len(frames) and min(x) < -0.2
    assert abs(log["clearance_m"].min() - clearance) < 1e-3
    assert np.abs(log["x_m"] - x).max() < 1e-2


def test_a_parked_recording_starts_where_the_robot_was_parked(tmp_path):
    session = Session("paper/test_case_1")
    wait(session, 3.0)
    say(session, "drive", on=False)
    say(session, "controller", name="eq7")
    say(session, "record", on=True)
    frames = wait(session, 1.0)
    say(session, "set", section="filter", key="gamma_per_s", value=3.0)
    say(session, "controller", name="qp")
    frames += wait(session, 1.0)
    for message in ({"kind": "drive", "on": True}, {"kind": "remove", "disc": 0}):
        with pytest.raises(InvalidInputError, match="when the recording is over"):
            say(session, **message)
    text = session.recording_toml()
    assert "# driven by eq7\n# 1.00 s: filter.gamma_per_s = 3.0\n# 1.00 s: cont" in text
    file = tmp_path / "recorded.toml"
    file.write_text(text)
    scenario = load_scenario(file)
    assert scenario.start == pytest.approx(
        [frames[0][key] for key in ("x", "y", "heading")]
    )
    assert scenario.settings.gamma == 3.0 and scenario.steps == len(frames)
    say(session, "record", on=False)
    say(session, "drive", on=True)
    assert wait(session, 6.0)[-1]["x"] > frames[-1]["x"] + 0.1


def test_a_bad_setting_changes_nothing(session):
    for section, key, value, complaint in (
        (
            "radius",
            "r_min_slow_m",
            -0.1,
            "radius.r_min_slow_m: input should be greater",
        ),
        (
            "radius",
            "r_min_slow_m",
            "wide",
            "radius.r_min_slow_m: input should be a valid number",
        ),
        ("radius", "r_min_slow_m", 0.5, "r_min_slow <= r_min_fast"),
        ("radius", "r_min_slow", 0.2, "did you mean 'r_min_slow_m'"),
        ("filter", "gamma_per_s", 51.0, "one step could pass r_min"),
        ("robot", "v_max_mps", 5.0, "cannot be set"),
    ):
        with pytest.raises(InvalidInputError, match=complaint):
            say(session, "set", section=section, key=key, value=value)
    with pytest.raises(UnknownNameError):
        say(session, "controller", name="eq6")
    assert session.scenario.settings.radius.r_min_slow == 0.17
    assert session.controller == "qp-ahead"
    say(session, "set", section="radius", key="r_min_fast_m", value=0.4)
    assert session.scenario.settings.radius.r_min_fast == 0.4


def test_settings_and_controllers_change_under_way(session):
    frames = wait(session, 0.2) + sweep(session, BESIDE, (1.2, 0.1), 0.8)
    say(session, "controller", name="eq5")
    say(session, "set", section="radius", key="r_min_fast_m", value=0.3)
    frames += wait(session, 0.2)
    ways = np.diff([(frame["x"], frame["y"]) for frame in frames], axis=0)
    assert np.hypot(*ways.T).max() < 0.021
    assert np.abs(np.diff([frame["v"] for frame in frames])).max() < 0.0401


def test_discs_come_and_go(session):
    with pytest.raises(InvalidInputError, match="onto the robot"):
        say(session, "add", x_m=0.1, y_m=0.0)
    for k in range(99):
        say(session, "add", x_m=5.0 + k, y_m=0.0)
    with pytest.raises(InvalidInputError, match="no more"):
        say(session, "add", x_m=-5.0, y_m=0.0)
    say(session, "remove", disc=0)
    with pytest.raises(InvalidInputError, match="no disc 0"):
        say(session, "drag", disc=0, x_m=0.0, y_m=0.0)
    frame = session.step()
    assert frame["ids"] == list(range(1, 100)) and len(frame["discs"]) == 99


def test_a_straight_line_needs_two_points():
    times = np.linspace(0.0, 5.0, 251)
    line = np.column_stack([times, -2 * times])
    assert thin(times, line) == [0, 250]
    line[100:] = line[100]
    assert thin(times, line) == [0, 100, 250]
    curve = np.column_stack([np.cos(times), np.sin(times)])
    rows = thin(times, curve, tolerance=1e-3)
    off = [np.interp(times, times[rows], column[rows]) - column for column in curve.T]
    assert len(rows) < 80 and np.hypot(*off).max() <= 1e-3


def test_a_step_that_fails_pauses_and_is_told(session):
    def fail():
        raise ZeroDivisionError("no more numbers")

    loop, session.step = Loop(session), fail
    loop.start()
    try:
        deadline = time.monotonic() + 5.0
        while not loop.frame[0]:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        assert json.loads(loop.world[1])["trouble"] == "Paused: no more numbers"
        assert not session.running and json.loads(loop.frame[1])["x"] == 0.0
    finally:
        loop.stop()
