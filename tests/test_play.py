"""The live page: the loop without a network, the protocol, the page in a browser."""

import asyncio
import contextlib
import importlib
import json
import math
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from browser import chromium, opened

from qpavoid.errors import InvalidInputError, MissingExtraError, UnknownNameError
from qpavoid.simulation.run import run
from qpavoid.simulation.scenario import load_scenario
from qpavoid.study.play.actions import act
from qpavoid.study.play.hand import HAND_SPEED, HOLD
from qpavoid.study.play.messages import read_message
from qpavoid.study.play.record import thin
from qpavoid.study.play.session import Session

pytest.importorskip("aiohttp")
from aiohttp import ClientSession, WSMsgType, web

from qpavoid.study.play.loop import Loop
from qpavoid.study.play.server import _serve, check_host, make_app

PARKED = """
title = "Parked beside a disc"
duration_s = 10.0
dt_s = 0.02
[reference]
kind = "station"
pose = { x_m = 0.0, y_m = 0.0 }
[robot]
acceleration_mps2 = 2.0
angular_acceleration_radps2 = 2.5
[tracking]
station_keeping = true
[margins]
error_m = 0.02
acceleration_mps2 = 1.0
[[obstacles]]
kind = "disc"
position_m = [2.5, 0.1]
radius_m = 0.25
[[obstacles]]
kind = "wall"
start_m = [-3.0, -4.0]
end_m = [3.0, -4.0]
"""
BESIDE = (2.5, 0.1)


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "parked.toml"
    file.write_text(PARKED)
    return str(file)


@pytest.fixture
def session(config):
    return Session(config)


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


# ---- the session ---------------------------------------------------------------------


@pytest.mark.parametrize("end", [(-2.5, 0.1), (0.0, 0.5), (-2.5, -0.6)])
def test_a_parked_robot_steps_aside_and_comes_back(session, end):
    frames = wait(session, 0.5) + sweep(session, BESIDE, end, 0.5)
    moved = max(math.hypot(frame["x"], frame["y"]) for frame in frames)
    frames += sweep(session, end, (-3.5, 2.5), 0.5) + wait(session, 15.0)
    last = frames[-1]
    assert moved > 0.2
    assert min(frame["clearance"] for frame in frames) > 0.15
    assert math.hypot(last["x"], last["y"]) < 0.01 and abs(last["heading"]) < 0.02


@pytest.mark.parametrize("controller", ["eq7", "qp-ahead"])
def test_untouched_it_is_the_run(controller):
    frames = wait(Session("demo/crowd", controller), 10.0)
    log = run(load_scenario("demo/crowd"), controller)
    for name, column in (("x", "x_m"), ("wd", "omega_desired_radps"), ("r", "r_m")):
        shown = [frame[name] for frame in frames]
        assert np.abs(shown - log[column][: len(frames)]).max() < 1e-9


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
    before = wait(session, 1.0)[-1]["discs"]
    say(session, "drag", disc=0, x_m=before[0][0], y_m=before[0][1])
    after = wait(session, 2.0)[-1]["discs"]
    assert math.dist(before[0], after[0]) < 0.1 < math.dist(before[1], after[1])
    say(session, "restart")
    assert session.step()["discs"][1] == (0.2, 6.0, 0.25) and session.time == 0.05


def test_a_recording_replays(session, tmp_path):
    say(session, "record", on=True)
    frames = wait(session, 0.4) + sweep(session, BESIDE, (-1.0, 0.1), 0.8)
    frames += wait(session, 2.0)
    say(session, "record", on=False)
    file = tmp_path / "recorded.toml"
    file.write_text(session.recording_toml())
    scenario = load_scenario(file)
    assert len(scenario.world.tracks[0].times) < 50 and len(scenario.world.walls) == 1
    log = run(scenario, "qp-ahead")
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
        ("radius", "low_m", -0.1, "radius.low_m: input should be greater"),
        ("radius", "low_m", "wide", "radius.low_m: input should be a valid number"),
        ("radius", "low_m", 0.5, "low <= high"),
        ("radius", "low", 0.2, "did you mean 'low_m'"),
        ("filter", "gamma_per_s", 51.0, "one step could pass r_min"),
        ("robot", "v_max_mps", 5.0, "cannot be set"),
    ):
        with pytest.raises(InvalidInputError, match=complaint):
            say(session, "set", section=section, key=key, value=value)
    with pytest.raises(UnknownNameError):
        say(session, "controller", name="eq6")
    assert session.scenario.settings.radius.low == 0.17
    assert session.controller == "qp-ahead"
    say(session, "set", section="radius", key="high_m", value=0.4)
    assert session.scenario.settings.radius.high == 0.4


def test_settings_and_controllers_change_under_way(session):
    frames = wait(session, 0.2) + sweep(session, BESIDE, (1.2, 0.1), 0.8)
    say(session, "controller", name="eq5")
    say(session, "set", section="radius", key="high_m", value=0.3)
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


# ---- the server ----------------------------------------------------------------------

MALFORMED = (
    "no JSON",
    "[1, 2]",
    "{}",
    '{"kind": "fly"}',
    '{"kind": "drag", "disc": 0, "x_m": NaN, "y_m": 0.0}',
    '{"kind": "drag", "disc": 0, "x_m": 1e999, "y_m": 0.0}',
    '{"kind": "drag", "disc": 0, "x_m": "1", "y_m": 0.0}',
    '{"kind": "drag", "disc": 0.5, "x_m": 1.0, "y_m": 0.0}',
    '{"kind": "drag", "disc": 7, "x_m": 1.0, "y_m": 0.0}',
    '{"kind": "run", "on": 1}',
    '{"kind": "restart", "more": 1}',
    "[" * 2000,
)


@contextlib.asynccontextmanager
async def served(config, **kwargs):
    """Serve a scenario on a free port; yield a client, its address, and the loop."""
    loop = Loop(Session(config))
    loop.start()
    runner = web.AppRunner(
        make_app(loop, **kwargs), access_log=None, shutdown_timeout=1.0
    )
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", 0).start()
    port = runner.addresses[0][1]
    try:
        async with ClientSession() as client:
            yield client, f"http://127.0.0.1:{port}", loop
    finally:
        await runner.cleanup()
        loop.stop()
        assert not any(thread.name == "loop" for thread in threading.enumerate())


async def next_of(socket, kind, seconds=2.0):
    async with asyncio.timeout(seconds):
        while True:
            message = json.loads(await socket.receive_str())
            if message["kind"] == kind:
                return message


def test_a_malformed_message_is_an_error_for_its_sender_only(config):
    async def check():
        async with served(config) as (client, url, _):
            bad = await client.ws_connect(f"{url}/live")
            good = await client.ws_connect(f"{url}/live")
            for text in MALFORMED:
                await bad.send_str(text)
                error = await next_of(bad, "error")
                assert error["message"] and "\n" not in error["message"]
            await bad.send_bytes(b"{}")
            assert "text" in (await next_of(bad, "error"))["message"]
            await bad.send_str(" " * 5000)
            while (last := await bad.receive()).type is WSMsgType.TEXT:
                pass
            assert last.data == 1009  # too big
            for _ in range(20):
                kind = json.loads(await good.receive_str())["kind"]
                assert kind in ("world", "frame")

    asyncio.run(check())


def test_two_clients_see_the_same_and_both_drag(config):
    async def check():
        async with served(config) as (client, url, _):
            one = await client.ws_connect(f"{url}/live")
            two = await client.ws_connect(f"{url}/live")
            await one.send_json({"kind": "add", "x_m": -2.0, "y_m": 2.0})
            for id, socket in ((0, one), (1, two)):
                drag = {"kind": "drag", "disc": id, "x_m": 2.0, "y_m": 2.0}
                await socket.send_json(drag)
            frames = []
            for socket in (one, two):
                frame = await next_of(socket, "frame")
                while frame["held"] != [0, 1]:
                    frame = await next_of(socket, "frame")
                frames.append(frame)
            assert frames[0]["ids"] == frames[1]["ids"] == [0, 1]
            await one.send_json(
                {"kind": "set", "section": "radius", "key": "low_m", "value": 0.9}
            )
            assert (await next_of(one, "error"))["about"] == "radius.low_m"

    asyncio.run(check())


def test_a_lost_client_lets_go(config):
    async def check():
        async with served(config) as (client, url, loop):
            lost = await client.ws_connect(f"{url}/live")
            await lost.send_json({"kind": "drag", "disc": 0, "x_m": 2.5, "y_m": 900.0})
            while not (await next_of(lost, "frame"))["held"]:
                pass
            await lost.close()
            await asyncio.sleep(0.1)
            assert json.loads(loop.frame[1])["held"] == []

    asyncio.run(check())


def test_a_client_that_never_reads_stops_nothing(config):
    upgrade = (
        "GET /live HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )

    async def check():
        async with served(config) as (client, url, _):
            port = int(url.rsplit(":", 1)[1])
            with socket.create_connection(("127.0.0.1", port)) as slow:
                slow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
                slow.sendall(upgrade.format(port).encode())
                reader = await client.ws_connect(f"{url}/live")
                first = await next_of(reader, "frame")
                frames, started = 0, time.monotonic()
                while time.monotonic() - started < 3.0:
                    last = await next_of(reader, "frame")
                    frames += 1
                assert frames > 3 * 30
                assert last["t"] - first["t"] == pytest.approx(3.0, abs=0.3)

    asyncio.run(check())


def test_only_its_own_page_is_served(config):
    async def status(client, url, **headers):
        async with client.get(url, headers=headers) as response:
            return response.status

    async def check():
        async with served(config) as (client, url, _):
            for page in ("/", "/play.js", "/panels.js", "/style.css"):
                assert await status(client, url + page) == 200
            assert await status(client, f"{url}/recording.toml") == 404
            assert await status(client, f"{url}/../session.py") == 404
            own, port = url.removeprefix("http://"), url.rsplit(":", 1)[1]
            assert await status(client, url, Origin=f"http://{own}") == 200
            assert await status(client, url, Host=f"localhost:{port}") == 200
            for headers in (
                {"Host": f"evil.example:{port}"},
                {"Host": "["},
                {"Origin": "http://evil.example"},
                {"Origin": "null"},
                {"Origin": "http://127.0.0.1:1"},
            ):
                for page in ("/", "/live"):
                    assert await status(client, url + page, **headers) in (400, 403)

    asyncio.run(check())


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.2", "example.org", ""])
def test_it_binds_to_loopback_only(host):
    with pytest.raises(InvalidInputError, match="allow-remote"):
        check_host(host, allow_remote=False)
    check_host(host, allow_remote=True)


def test_without_aiohttp_the_extra_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "qpavoid.study.play.server")
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    with pytest.raises(MissingExtraError, match=r"qpavoid\[play\]"):
        importlib.import_module("qpavoid.study.play.server")


def test_a_port_that_is_taken_is_said(config):
    loop = Loop(Session(config))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InvalidInputError, match=f"port {port} .*in use.*--port"):
            asyncio.run(_serve(loop, "127.0.0.1", port, False))


@contextlib.contextmanager
def child(config):
    """Serve in a process of its own; yield its address; end it with Ctrl-C."""
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from qpavoid.study.play.server import serve\n"
        f"serve({config!r}, port=0)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-W", "error", "-c", code], stdout=-1, stderr=-1, text=True
    ) as process:
        try:
            yield process.stdout.readline().split()[0]
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(10)
        said = [
            x for x in process.stderr.read().splitlines() if "compiling for" not in x
        ]
        assert (code, said) == (0, [])


def test_ctrl_c_ends_it(config):
    with child(config) as address:
        assert address.startswith("http://127.0.0.1:")


# ---- the page ------------------------------------------------------------------------


ON_PAGE = "place => play.onPage(...place)"


def until(page, condition):
    """Wait for what the page says; its policy forbids playwright's own way."""
    deadline = time.monotonic() + 5.0
    while not page.evaluate(condition):
        assert time.monotonic() < deadline, condition
        page.wait_for_timeout(20)


def test_a_scripted_drag_in_a_browser(config, tmp_path):
    with (
        chromium() as browser,
        child(config) as address,
        opened(browser, address) as page,
    ):
        until(page, "play.frames() > 0")
        page.click("#record")
        before = page.evaluate("play.frames()")
        page.wait_for_timeout(3000)
        assert page.evaluate("play.frames()") - before > 3 * 30
        start, end = (page.evaluate(ON_PAGE, place) for place in (BESIDE, (0.5, 0.1)))
        page.mouse.move(*start)
        page.mouse.down()
        for place in np.linspace(start, end, 60):
            page.mouse.move(*place)
            page.wait_for_timeout(30)
        until(page, "Math.hypot(play.frame().x, play.frame().y) > 0.1")
        page.screenshot(path=tmp_path / "drag.png")
        page.wait_for_timeout(1500)
        page.mouse.up()
        page.click("#record")
        with page.expect_download() as saved:
            page.click("#save")
        saved.value.save_as(tmp_path / "drag.toml")
        page.fill("[name='radius.low_m']", "0.9")
        page.press("[name='radius.low_m']", "Enter")
        page.wait_for_selector(".wrong:not(:empty)")
        assert "low <= high" in page.inner_text(".wrong:not(:empty)")
        page.select_option("#controller", "eq5")
        until(page, "play.about().controller === 'eq5'")
    log = run(load_scenario(tmp_path / "drag.toml"), "qp-ahead")
    assert np.hypot(log["x_m"], log["y_m"]).max() > 0.1
    assert log["least_clearance_m"].min() > 0.05
