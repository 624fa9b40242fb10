"""The live page's server: its protocol, its clients, the page in a browser."""

import asyncio
import contextlib
import importlib
import json
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from browser import chromium, opened
from parked import BESIDE, PARKED
from qpavoid.errors import InvalidInputError, MissingExtraError
from qpavoid.lab.play.session import Session
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario

pytest.importorskip("aiohttp")
from aiohttp import ClientSession, WSMsgType, web

from qpavoid.lab.play.loop import Loop
from qpavoid.lab.play.server import _serve, check_host, make_app

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


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "parked.toml"
    file.write_text(PARKED)
    return str(file)


@contextlib.asynccontextmanager
async def served(config, **kwargs):
    """Serve a scenario on a free port; yield a client, its address, and the loop."""
    loop = Loop(Session(config))
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


FRAMES = 100
"""More than wait for a client that reads nothing."""


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
                {
                    "kind": "set",
                    "section": "radius",
                    "key": "r_min_slow_m",
                    "value": 0.9,
                }
            )
            assert (await next_of(one, "error"))["about"] == "radius.r_min_slow_m"

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
                for _ in range(FRAMES):
                    last = await next_of(reader, "frame")
                assert last["t"] > first["t"]

    asyncio.run(check())


def test_the_clock_waits_for_the_first_client(config):
    async def check():
        async with served(config) as (client, url, loop):
            async with client.get(url) as response:
                assert response.status == 200
            await asyncio.sleep(0.2)
            assert loop.frame == (0, "") and loop.world[0] == 1
            live = await client.ws_connect(f"{url}/live")
            assert (await next_of(live, "world"))["running"]
            assert 0.0 < (await next_of(live, "frame"))["t"] < 1.0

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
    monkeypatch.delitem(sys.modules, "qpavoid.lab.play.server")
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    with pytest.raises(MissingExtraError, match=r"qpavoid\[play\]"):
        importlib.import_module("qpavoid.lab.play.server")


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
        "from qpavoid.lab.play.server import serve\n"
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
        until(page, f"play.frames() > {before + 60}")
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
        page.fill("[name='radius.r_min_slow_m']", "0.9")
        page.press("[name='radius.r_min_slow_m']", "Enter")
        page.wait_for_selector(".wrong:not(:empty)")
        assert "r_min_slow <= r_min_fast" in page.inner_text(".wrong:not(:empty)")
        page.select_option("#controller", "eq5")
        until(page, "play.about().controller === 'eq5'")
    log = run(load_scenario(tmp_path / "drag.toml"), "qp-ahead")
    assert np.hypot(log["x_m"], log["y_m"]).max() > 0.1
    assert log["least_clearance_m"].min() > 0.05
