"""The live page in a browser: it drives as Python does, and does what hands want."""

import itertools
import json
import math
import os
import shutil
import time
import tomllib
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from qpavoid.cli import main
from qpavoid.errors import MissingExtraError, QPAvoidError, UnknownNameError
from qpavoid.export.build import zig
from qpavoid.lab.play import program as programs
from qpavoid.lab.play.page import METHODS, as_json, play_page, scene
from qpavoid.lab.play.program import Program, program
from qpavoid.lab.scenario.scenario import load_scenario, make_scenario
from qpavoid.lab.simulation.run import run

without_program = pytest.mark.skipif(
    not (zig() or programs.BUILT.is_dir()),
    reason="no zig to make WebAssembly with: pip install 'qpavoid[wasm]'",
)


def needs_program(test):
    """The first of these compiles for half a minute."""
    return pytest.mark.long(without_program(test))


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

CART = """
[[obstacles]]
kind = "polygon"
vertices_m = [[-2.2, -0.3], [-1.6, -0.3], [-1.6, 0.3], [-2.2, 0.3]]
turn_rate_radps = 0.2
velocity_mps = [-0.1, 0.0]
"""

COLUMNS = {
    "x": "x_m", "y": "y_m", "heading": "heading_rad",
    "vd": "v_desired_mps", "wd": "omega_desired_radps",
    "v": "v_mps", "w": "omega_radps", "clearance": "clearance_m",
}  # fmt: skip

DRIVE = """([methods, steps]) => {
  for (const name of methods) if (!play.methods().includes(name)) play.toggle(name);
  play.restart(); play.run(false);
  const told = Object.fromEntries(methods.map((name) => [name, []]));
  for (let i = 0; i < steps; i++) {
    play.advance(1);
    for (const name of methods) told[name].push(play.last(name));
  }
  return told;
}"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as found:
        yield found


@pytest.fixture
def config(tmp_path):
    file = tmp_path / "parked.toml"
    file.write_text(PARKED + CART)
    return file


@contextmanager
def played(browser, config, tmp_path):
    """The page of a scenario, which stands still at first."""
    page = tmp_path / "play.html"
    page.write_text(play_page(program(), str(config), ["qp", "qp-ahead"]))
    with opened(browser, page.as_uri() + "#paused") as found:
        until(found, "play.frames() > 0")
        yield found


def until(page, condition):
    """Wait for what the page says."""
    deadline = time.monotonic() + 8.0
    while not page.evaluate(condition):
        assert time.monotonic() < deadline, condition
        page.wait_for_timeout(20)


def saved(page, file):
    """Save from the page, and read what was saved."""
    with page.expect_download() as download:
        page.click("#save")
    download.value.save_as(file)
    return tomllib.loads(file.read_text())


def drag(page, start, end, seconds):
    """Drag with the mouse from a place of the scene to another."""
    start, end = (page.evaluate("at => play.onPage(...at)", at) for at in (start, end))
    page.mouse.move(*start)
    page.mouse.down()
    for place in np.linspace(start, end, max(2, round(seconds / 0.03))):
        page.mouse.move(*place)
        page.wait_for_timeout(30)
    page.mouse.up()


def assert_same(frames, log, alike=1e-9):
    """Assert that a page drove as a log says; return how long to the last bit."""
    differ = []
    for name, column in COLUMNS.items():
        shown = np.array([math.inf if f[name] is None else f[name] for f in frames])
        known = log[column][: len(shown)]
        np.testing.assert_allclose(shown, known, rtol=0.0, atol=alike, err_msg=name)
        differ.append(np.flatnonzero(shown != known))
    known = log["status"][: len(frames)].astype(int).tolist()
    assert [
        known[i] if f["blocked"] else f["code"] for i, f in enumerate(frames)
    ] == known
    return min((int(d[0]) for d in differ if len(d)), default=len(frames))


@needs_program
@pytest.mark.parametrize("name", ["paper/test_case_1", "parked"])
def test_it_drives_as_run_does(browser, config, tmp_path, name):
    """To the last bit, until a sine of the browser's libm has another one."""
    config = config if name == "parked" else name
    methods = list(METHODS)
    with played(browser, config, tmp_path) as page:
        told = page.evaluate(DRIVE, [methods, 400])
    for method in methods:
        same = assert_same(told[method], run(load_scenario(config), method))
        assert same >= (10 if name == "parked" else 100), (method, same)


WALKER = """
[[obstacles]]
kind = "waypoints"
times_s = [0.0, 14.0]
positions_m = [[4.0, 0.2], [-4.4, 0.2]]
radius_m = 0.25
[[obstacles]]
kind = "polygon"
vertices_m = [[-6.0, -3.5], [-5.5, -3.5], [-5.5, 3.5], [-6.0, 3.5]]
[[obstacles]]
kind = "wall"
start_m = [4.5, -4.0]
end_m = [4.5, 4.0]
"""
PASSED = PARKED.split("[[obstacles]]")[0] + WALKER  # at 0.6 m/s, past the parked robot

LIDARS = {
    "": 125,
    "field_of_view_rad = 4.71\nmount_x_m = 0.3\nlatency_s = 0.05": 125,
    "perception = false": 400,
}
"""Steps, of which the last 30 or more are driven."""


@needs_program
@pytest.mark.parametrize(("lidar", "steps"), LIDARS.items())
def test_by_lidar_it_drives_as_run_does(browser, config, tmp_path, lidar, steps):
    """Until a last bit decides which side the robot takes."""
    config.write_text(f"{PASSED}\n[lidar]\nnoise_m = 0.0\n{lidar}")
    with played(browser, config, tmp_path) as page:
        assert page.input_value("#sees") == "lidar"
        told = page.evaluate(DRIVE, [["qp-ahead"], steps])["qp-ahead"]
    log = run(load_scenario(config), "qp-ahead")
    assert assert_same(told, log) >= 80
    assert np.count_nonzero(log["v_mps"][:steps]) > 30


@needs_program
def test_the_page_has_a_lidar_whose_view_is_set_and_saved(browser, config, tmp_path):
    config.write_text(PASSED)
    file = tmp_path / "lidar.toml"
    with played(browser, config, tmp_path) as page:
        assert not page.is_visible("#view")
        page.select_option("#sees", "lidar")
        page.evaluate("play.restart()")
        page.locator("#view").fill("270")
        page.evaluate("play.advance(1)")
        (frame,) = page.evaluate("play.kept('qp-ahead')")
        ends = np.array(page.evaluate("play.known().scan")) - frame["xr"]
        told = saved(page, file)
    bearings = np.degrees(np.arctan2(*ends.T[::-1]) - frame["heading"])
    assert len(ends) == 360 and np.ptp((bearings + 180.0) % 360.0) < 271.0
    assert told["lidar"] == {"field_of_view_rad": pytest.approx(1.5 * math.pi)}
    assert load_scenario(file).lidar.perception


@needs_program
def test_a_drag_is_recorded_and_run_again(browser, config, tmp_path):
    with played(browser, config, tmp_path) as page:
        page.press("body", "c")
        until(page, "play.time() > 0.3")
        drag(page, BESIDE, (0.6, 0.1), 1.2)
        page.wait_for_timeout(300)
        page.press("body", "c")
        assert not page.evaluate("play.running()")
        frames = page.evaluate("play.kept('qp-ahead')")
        document = saved(page, tmp_path / "drag.toml")
    kinds = [one["kind"] for one in document["obstacles"]]
    assert kinds == ["waypoints", "wall", "polygon"]
    scenario = load_scenario(tmp_path / "drag.toml")
    for frame, at in zip(frames, scenario.times.tolist(), strict=False):
        assert scenario.world.at(at).discs.tolist() == frame["discs"]
    log = run(scenario, "qp-ahead")
    assert len(log) == len(frames) > 60
    assert np.hypot(log["x_m"], log["y_m"]).max() > 0.1
    # A last bit decides whether an iteration goes on: 1e-3 m/s, and later the side.
    assert assert_same(frames[:50], log, alike=2e-3) >= 10


@needs_program
def test_a_pushed_cart_is_recorded(browser, config, tmp_path):
    with played(browser, config, tmp_path) as page:
        page.press("body", "c")
        until(page, "play.time() > 0.2")
        drag(page, (-1.9, 0.0), (-1.0, 0.2), 0.8)
        page.click("#record")
        frames = page.evaluate("play.kept('qp')")
        document = saved(page, tmp_path / "cart.toml")
    (cart,) = [one for one in document["obstacles"] if one["kind"] == "polygon"]
    assert len(cart["times_s"]) > 10 and cart["shifts_m"][-1][0] > 0.3
    scenario = load_scenario(tmp_path / "cart.toml")
    assert len(scenario.world.at(1.0).polygons) == 1
    log = run(scenario, "qp")
    assert abs(log["clearance_m"][-1] - frames[-1]["clearance"]) < 1e-6


@needs_program
def test_all_of_it_by_keys(browser, config, tmp_path):
    with played(browser, config, tmp_path) as page:
        page.press("body", "]")  # the first disc; arrows move it, in an edit at time 0
        for _ in range(3):
            page.press("#top", "ArrowLeft")
        assert page.evaluate("play.things()[0].x") == pytest.approx(2.2)
        page.press("#top", "Escape")
        page.press("#top", "w")
        page.press("#top", "Enter")
        for _ in range(4):
            page.press("#top", "Shift+ArrowDown")
        page.press("#top", "Enter")
        wall = page.evaluate("play.things().at(-1)")
        assert wall["kind"] == "wall" and wall["y1"] - wall["y2"] == pytest.approx(2.0)
        page.press("#top", "Delete")
        assert page.evaluate("play.things().length") == 3
        page.press("body", "1")
        assert page.evaluate("play.methods().join()") == "eq5,qp,qp-ahead"
        page.press("body", ".")
        assert page.evaluate("play.time()") == pytest.approx(0.02)
        page.press("body", " ")
        until(page, "play.time() > 0.1")
        page.press("body", " ")
        page.press("body", "r")
        assert page.evaluate("[play.time(), play.running()]") == [0, False]
        page.press("body", "?")
        assert page.is_visible("#keys")
        page.keyboard.press("Escape")
        page.press("body", "p")
        assert "Drive on" in page.inner_text("#drive")


TOGETHER = {
    "radius.r_min_slow_m": (0.1, 0.2), "radius.r_min_fast_m": (0.1, 0.2),
    "radius.speed_low_mps": (0.1, 0.5), "radius.speed_high_mps": (0.1, 0.5),
    "ahead.tick_s": (0.0029, 0.05, 3.5), "ahead.horizon_s": (2.9, 3.0, 4.0),
    "ahead.horizon_still_s": (1.0, 3.0, 3.5), "filter.gamma_per_s": (2.0, 50.0, 50.1),
    "actuation.delay_s": (0.0, 0.16, 0.17), "filter.braking_room": (True, False),
    "filter.passive": (False, True), "guide.stall_time_s": (1.0, 2.0),
    "guide.blocked_time_s": (2.0, 3.0),
}  # fmt: skip
"""Dependent settings: values of which some combinations are valid, and some are not."""


def fits(values):
    """Whether a scenario file may have these settings."""
    tables = {"title": "t", "duration_s": 1.0, "dt_s": 0.02}
    tables["reference"] = {"kind": "station", "pose": {"x_m": 0.0, "y_m": 0.0}}
    for key, value in values.items():
        section, name = key.split(".")
        tables.setdefault(section, {})[name] = value
    try:
        make_scenario(tables, "t", Path("t.toml"))
    except QPAvoidError:
        return False
    return True


@needs_program
def test_what_does_not_fit_together_is_what_python_refuses(browser, config, tmp_path):
    usual = {key: values[0] for key, values in TOGETHER.items()}
    usual |= {"ahead.tick_s": 0.05, "radius.r_min_fast_m": 0.2}
    usual |= {"radius.speed_high_mps": 0.5, "guide.blocked_time_s": 3.0}
    every = [usual]
    for keys in itertools.combinations(TOGETHER, 2):  # all values of two
        for pair in itertools.product(*(TOGETHER[key] for key in keys)):
            every.append(usual | dict(zip(keys, pair, strict=True)))
    with played(browser, config, tmp_path) as page:
        said = page.evaluate("every => every.map((one) => play.misfit(one))", every)
    assert [not text for text in said] == [fits(values) for values in every]
    assert len({*said}) == 10, "each of the nine rules was broken, and none"


def test_what_is_not_played_is_said(config):
    config.write_text("sight_m = 9.0\n" + PARKED)
    assert scene(str(config))["left_out"] == ["sight_m"]
    config.write_text(PARKED + "[lidar]\nfade = 0.1\n")
    assert scene(str(config))["left_out"] == ["fade"]
    config.write_text(PARKED + "[guide]\nyielding = true\n")
    assert scene(str(config))["left_out"] == ["yielding"]


def test_data_cannot_leave_its_place_in_the_page():
    hostile = '</script><script>boom()</script> <b>disc</b> & "quotes"'
    text = as_json({"a": hostile, "b": [math.nan, math.inf, 1.5], "c": "\u2028"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": hostile, "b": [None, None, 1.5], "c": "\u2028"}


def test_a_page_holds_its_program_and_no_html_of_a_title(config):
    config.write_text(PARKED.replace("Parked beside", "</script><b>Parked"))
    text = play_page(Program(b"\0asm", "export const TABLE = 1;"), str(config), ["qp"])
    assert "</script><b>" not in text and "export const" not in text
    assert "default-src 'none'" in text
    with pytest.raises(UnknownNameError, match="eq6"):
        play_page(Program(b"", ""), str(config), ["eq6"])


def test_a_program_is_kept_and_without_zig_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setattr(programs, "BUILT", tmp_path / "none")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("qpavoid.export.build.zig", list)
    steps = []
    with pytest.raises(MissingExtraError, match=r"qpavoid\[wasm\]"):
        program(steps.append)
    assert [step[:6] for step in steps] == ["1 of 2", "2 of 2"]
    assert "1 to 3 minutes" in steps[1]
    for name in programs.FILES:
        (tmp_path / name).write_bytes(b"kept")
    programs.keep(tmp_path, programs.cached())
    assert program() == Program(b"kept", "kept")


@needs_program
def test_the_command_writes_a_page(config, tmp_path, capsys):
    page = tmp_path / "a" / "page.html"
    assert main(["play", str(config), "--out", str(page), "--no-open"]) == 0
    assert capsys.readouterr().out.strip() == str(page)
    assert 200_000 < page.stat().st_size < 1_000_000


@contextmanager
def chromium():
    """A headless Chromium; the test is skipped where there is none."""
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="no playwright: pip install 'qpavoid[test]'"
    )
    names = "chromium", "chromium-browser", "google-chrome"
    path = os.environ.get("QPAVOID_CHROMIUM") or next(
        filter(None, map(shutil.which, names)), None
    )
    if path is None:
        pytest.skip(f"no Chromium: none of {', '.join(names)}; set QPAVOID_CHROMIUM")
    flags = "--no-sandbox", "--disable-gpu", "--disable-background-networking"
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=flags)
        yield browser
        browser.close()


@contextmanager
def opened(browser, url):
    """A page at a URL; it reports no error and requests nothing from elsewhere."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page, errors, outside = context.new_page(), [], []

    def said(message):
        if message.type in ("error", "warning"):
            errors.append(message.text)

    def asked(request):
        inline = request.url.startswith(("data:", "blob:", "about:"))
        if not inline and request.url != url.partition("#")[0]:
            outside.append(request.url)

    page.on("console", said)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("request", asked)
    page.goto(url)
    yield page
    context.close()
    assert errors == outside == []
