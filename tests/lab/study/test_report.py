"""The report: its rankings, its figures, and the page in a real browser."""

import base64
import json
import math
import re
import sys
from types import SimpleNamespace

import pytest

from browser import chromium, opened
from qpavoid.avoidance.decision import SENTENCES
from qpavoid.errors import DataError
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study import report as reports
from qpavoid.lab.study.compare import save_run
from qpavoid.lab.study.report import write_report
from qpavoid.lab.study.report.page import as_json, part
from qpavoid.lab.study.report.ranking import name_methods, rank, read_results
from report_rows import HOSTILE, row
from scenario_files import CROSSING, SLOW


def test_methods_are_named_after_all_that_makes_them():
    named = name_methods(
        [
            row(),
            row(solver="osqp"),
            row(**{"filter.gamma_per_s": 2.0, "path.gamma_per_s": 1.0}),
            row(**{"filter.dt_s": 0.05}),
        ]
    )
    assert [x["method"] for x in named] == [
        "qp",
        "qp (osqp)",
        "qp, filter.gamma_per_s 2, path.gamma_per_s 1",
        "qp, dt_s 0.05",
    ]


def test_ranking_is_by_success_then_contacts_then_time():
    rows = [
        *(row("slow", arrived_s=9.0, seed=i) for i in range(4)),
        *(row("fast", arrived_s=3.0, seed=i) for i in range(4)),
        *(row("rough", success=i > 0, contact=i < 1, seed=i) for i in range(4)),
        *(row("stuck", success=i > 0, seed=i) for i in range(4)),
        *(row("lost", success=False, min_clearance_m=None) for i in range(4)),
    ]
    records = rank(name_methods(rows))
    names = [record["method"] for record in records]
    assert names == ["fast", "slow", "stuck", "rough", "lost"]
    assert records[0]["time"] == 3.0
    assert records[-1]["time"] is records[-1]["clearance"] is None


def test_figures_begin_with_scenes_that_tell_methods_apart(logs, tmp_path, monkeypatch):
    logs[0].save(tmp_path / "log.npz")
    rows = [
        row(name, scenario=scenario, outcome=outcome, run=f"{scenario}{name}")
        for scenario, other in (("alike", "arrived"), ("apart", "stalled"))
        for name, outcome in (("a", "arrived"), ("b", other))
    ]
    kept = {x["run"]: tmp_path / "log.npz" for x in rows}
    figures, places = reports._figures(name_methods(rows), kept)
    assert [figure["title"] for figure in figures] == ["apart, seed 0", "alike, seed 0"]
    assert places == {"aparta": 0, "apartb": 0, "alikea": 1, "alikeb": 1}
    image = base64.b64decode(figures[0]["image"].partition(",")[2])
    assert image.startswith(b"\x89PNG")
    monkeypatch.setattr(reports, "MOST_FIGURES", 1)
    assert [*reports._figures(name_methods(rows), kept)[1]] == ["aparta", "apartb"]


def test_a_folder_without_runs_is_an_error(tmp_path):
    with pytest.raises(DataError, match="no results of qpavoid sweep"):
        read_results(tmp_path)
    for empty in ("[]", "{}"):
        (tmp_path / "summary.json").write_text(empty)
        with pytest.raises(DataError, match="no runs yet"):
            read_results(tmp_path)
    for wrong in ("{", "[1]", "[{}]"):
        (tmp_path / "summary.json").write_text(wrong)
        with pytest.raises(DataError, match=r"summary\.json"):
            read_results(tmp_path)


def test_data_cannot_leave_its_place_in_the_page():
    text = as_json({"a": HOSTILE, "b": [math.nan, math.inf, 1.5], "c": "\u2028"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": HOSTILE, "b": [None, None, 1.5], "c": "\u2028"}


def test_the_page_says_of_a_status_what_python_says():
    told = dict(re.findall(r'^    (\w+): "(.+)",$', part("panels.js"), re.MULTILINE))
    assert told == {str(status): text for status, text in SENTENCES.items()}


# ---- in the browser ---------------------------------------------------------------


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a folder as ``qpavoid compare`` leaves it."""
    folder = tmp_path_factory.mktemp("compared")
    title = json.dumps(HOSTILE)
    text = re.sub("title = .*", f"title = {title}".replace("\\", "\\\\"), CROSSING)
    (folder / "slow.toml").write_text(text + SLOW)
    for name in ("eq7", "qp", "qp-ahead"):
        save_run(run(load_scenario(folder / "slow.toml"), name), folder)
    return write_report(folder, folder / "report.html")


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


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
    store = SimpleNamespace(
        read_rows=lambda folder: rows,
        read_provenance=lambda folder: {"versions": {"qpavoid": "0"}},
    )
    for name in ("qpavoid.lab.study.sweep", "qpavoid.lab.study.sweep.store"):
        monkeypatch.setitem(sys.modules, name, store)
    page_file = write_report(tmp_path, tmp_path / "out" / "report.html")
    assert page_file.stat().st_size < 7e6
    with opened(browser, page_file.as_uri()) as page:
        said = page.inner_text("#facts")
        assert "5,400 runs, 9 methods, 2 scenarios, 300 seeds" in said
        assert page.locator("#ranking tbody tr").count() == 9
        failed = page.locator("#failures tbody tr")
        assert failed.count() == 50
        page.get_by_role("button", name="Show all 300 rows").click()
        assert failed.count() == 300
        assert not page.get_by_role("button", name="Show all").count()
        assert 'trajectories = "failures"' in page.inner_text("#figures")
        heads = page.locator("#ranking th[scope=col], #failures th[scope=col]")
        titles = [head.get_attribute("title") for head in heads.all()]
        assert len(titles) > 10 and all(titles)
        page.locator("#choice select").select_option("1")
        assert page.inner_text("#ranking caption") == HOSTILE


def test_only_the_scripts_of_a_page_run(report, browser, tmp_path):
    """The policy refuses injected scripts, in elements and in attributes."""
    text = report.read_text()
    assert not re.search(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=\"http", text)
    assert "boom()</script>" not in text and "script-src 'sha256-" in text
    hostile = (
        "<script>window.broken = 1</script><img src='data:,' onerror='broken = 2'>"
    )
    page = tmp_path / "hostile.html"
    page.write_text(text.replace("</body>", f"{hostile}</body>"))
    for found in ("undefined", "number"):
        with opened(browser, page.as_uri(), errors_allowed=True) as shown:
            shown.wait_for_selector("#ranking table")
            assert shown.evaluate("typeof window.broken") == found
        page.write_text(re.sub("<meta http-equiv.*?>", "", page.read_text(), count=1))


def test_tables_sort_and_lead_to_the_figures(report, browser):
    with opened(browser, report.as_uri()) as page:
        methods = page.locator("#ranking tbody th")
        assert methods.count() == 3
        page.get_by_role("button", name="method", exact=True).first.click()
        assert methods.all_inner_texts() == ["eq7", "qp", "qp-ahead"]
        page.get_by_role("button", name="method", exact=True).first.click()
        assert methods.all_inner_texts() == ["qp-ahead", "qp", "eq7"]
        assert page.locator("th[aria-sort=descending]").count() == 1
        image = page.locator("#figure-0 img")
        assert image.evaluate("one => one.naturalWidth") > 500
        for link in page.locator("#failures a").all():
            assert page.locator(link.get_attribute("href")).count() == 1
