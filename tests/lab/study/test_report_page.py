"""The report page and its replay in a real browser."""

import json
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from browser import chromium, opened, wait_until
from packed import HOSTILE, row, unpacked
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.compare import save_run
from qpavoid.lab.study.report import write_report
from qpavoid.lab.study.report.payload import pack_run
from scenario_files import CROSSING, SLOW


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    file = tmp_path_factory.mktemp("driven") / "slow.toml"
    title = json.dumps(HOSTILE)
    text = re.sub("title = .*", f"title = {title}".replace("\\", "\\\\"), CROSSING)
    file.write_text(text + SLOW)
    scenario = load_scenario(file)
    return [run(scenario, name) for name in ("eq7", "qp", "qp-ahead")]


@pytest.fixture(scope="module")
def compared(driven, tmp_path_factory):
    """A folder as ``qpavoid compare`` leaves it."""
    folder = tmp_path_factory.mktemp("compared")
    for log in driven:
        save_run(log, folder)
    return folder


@pytest.fixture(scope="module")
def report(compared):
    return write_report(compared, compared / "report.html")


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


def stub_sweep(monkeypatch, rows):
    """Put hand-made rows where a sweep's are read."""
    store = SimpleNamespace(
        read_rows=lambda folder: rows,
        read_provenance=lambda folder: {"versions": {"qpavoid": "0"}},
    )
    for name in ("qpavoid.lab.study.sweep", "qpavoid.lab.study.sweep.store"):
        monkeypatch.setitem(sys.modules, name, store)


def test_a_sweep_of_many_runs_makes_a_small_page(tmp_path, monkeypatch, browser):
    (tmp_path / "runs").mkdir()
    rows = [
        row(
            name,
            success=(seed * gamma) % 7 > 1,
            contact=False,
            scenario=scenario,
            seed=seed,
            run=f"{scenario}{name}{gamma}{seed}",
            min_room_m=0.01 * (seed % 5) - 0.02,
            error=HOSTILE,
            **{"filter.gamma_per_s": float(gamma)},
        )
        for name in ("eq5", "qp", "qp-ahead")
        for scenario in ("forest", HOSTILE)
        for gamma in (1, 2, 3)
        for seed in range(300)
    ]
    stub_sweep(monkeypatch, rows)
    page_file = write_report(tmp_path, tmp_path / "out" / "report.html")
    assert page_file.stat().st_size < 7e6
    with opened(browser, page_file.as_uri()) as page:
        assert "5,400 runs, 9 methods, 2 scenarios, 300 seeds" in page.inner_text(
            "#facts"
        )
        assert page.locator("#ranking tbody tr").count() == 9
        failed = page.locator("#failures tbody tr")
        assert failed.count() == 50
        page.get_by_role("button", name="Show all 300 rows").click()
        assert failed.count() == 300
        assert not page.get_by_role("button", name="Show all").count()
        assert 'trajectories = "all"' in page.inner_text("#replay")
        heads = page.locator("#ranking th[scope=col], #failures th[scope=col]")
        titles = [head.get_attribute("title") for head in heads.all()]
        assert len(titles) > 10 and all(titles)
        page.locator("#choice select").select_option("1")
        assert page.inner_text("#ranking caption") == HOSTILE


def test_a_packed_log_keeps_every_step(driven):
    log = driven[1]
    packed = pack_run(log)
    found = unpacked(packed)
    assert packed["every"] == 1 and len(found["t"]) == len(log)
    np.testing.assert_allclose(found["x"], log["x_m"], rtol=1e-6)
    assert found["status"].dtype == np.int8


def test_the_report_stands_alone(report):
    text = report.read_text()
    assert report.stat().st_size < 10e6
    assert not re.search(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=\"http", text)
    assert "boom()</script>" not in text


def test_only_the_scripts_of_a_page_run(report, browser, tmp_path):
    """The policy refuses injected scripts, in elements and in attributes."""
    text = report.read_text()
    assert "script-src 'sha256-" in text
    hostile = (
        "<script>window.broken = 1</script><img src='data:,' onerror='broken = 2'>"
    )
    page = tmp_path / "hostile.html"
    page.write_text(text.replace("</body>", f"{hostile}</body>"))
    with opened(browser, page.as_uri(), errors_allowed=True) as shown:
        shown.wait_for_selector("#ranking table")
        assert shown.evaluate("typeof window.broken") == "undefined"
    page.write_text(re.sub("<meta http-equiv.*?>", "", page.read_text(), count=1))
    with opened(browser, page.as_uri(), errors_allowed=True) as shown:
        shown.wait_for_selector("#ranking table")
        assert shown.evaluate("typeof window.broken") == "number"


# ---- in the browser ---------------------------------------------------------------


def time_line(page):
    return page.locator(".timeline input")


def test_the_replay_goes_to_its_last_step(report, driven, browser, tmp_path):
    with opened(browser, report.as_uri()) as page:
        page.wait_for_selector(".card canvas")
        assert page.locator(".card").count() == 3
        page.locator(".stage").focus()
        steps = len(driven[0])
        for key, step in (
            ("ArrowRight", 1),
            ("Shift+ArrowRight", 11),
            ("ArrowLeft", 10),
            ("End", steps - 1),
            ("Home", 0),
        ):
            page.keyboard.press(key)
            assert int(time_line(page).input_value()) == step
        page.get_by_label("Speed").select_option("8")
        page.locator(".stage").focus()
        page.keyboard.press("Space")
        wait_until(
            page, f"document.querySelector('.timeline input').value == {steps - 1}"
        )
        wait_until(page, "document.querySelector('.play').textContent == 'Play'")
        assert f"step {steps} of {steps}" in page.inner_text(".clock")
        assert "from above" in page.locator("canvas.top").first.get_attribute(
            "aria-label"
        )
        box = page.locator("canvas.strip").first.bounding_box()
        page.mouse.click(box["x"] + box["width"] / 2, box["y"] + 50)
        assert abs(int(time_line(page).input_value()) - steps / 2) < 0.15 * steps
        assert page.screenshot(path=tmp_path / "page.png")


def test_the_replay_shows_what_the_log_holds(report, driven, browser):
    with opened(browser, report.as_uri()) as page:
        page.wait_for_selector(".card canvas")
        frames = page.evaluate(
            """async () => {
                const text = document.getElementById("data").textContent;
                const { replay } = JSON.parse(text);
                const runs = await Promise.all(replay.groups[0].runs.map(Unpack.run));
                return runs.map((run) => Array.from({ length: run.n }, (_, k) => {
                    const frame = run.frame(k);
                    frame.words = Panels.words(frame, run.world);
                    return frame;
                }));
            }"""
        )
    for log, shown in zip(driven, frames, strict=True):
        assert len(shown) == len(log)
        for name, column in (("x", "x_m"), ("v", "v_mps"), ("r", "r_m")):
            found = [frame[name] for frame in shown]
            np.testing.assert_allclose(found, log[column], rtol=1e-5, atol=1e-7)
        assert all(frame["words"] for frame in shown)


def test_tables_sort_filter_and_lead_to_the_replay(report, browser):
    with opened(browser, report.as_uri()) as page:
        page.wait_for_selector(".card canvas")
        methods = page.locator("#ranking tbody th")
        assert methods.count() == 3
        page.get_by_role("button", name="method", exact=True).first.click()
        assert methods.all_inner_texts() == ["eq7", "qp", "qp-ahead"]
        page.get_by_role("button", name="method", exact=True).first.click()
        assert methods.all_inner_texts() == ["qp-ahead", "qp", "eq7"]
        assert page.locator("th[aria-sort=descending]").count() == 1
        for replay in page.get_by_role("button", name="Replay", exact=True).all():
            replay.click()
        assert HOSTILE in page.inner_text(".replay")
        box = page.get_by_label("eq7", exact=True)
        box.uncheck()
        assert page.locator(".card").count() == 2
