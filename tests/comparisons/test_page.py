"""The page of all comparisons: its numbers, and that it is what its tables give."""

import csv
import math
import tomllib
from itertools import product
from statistics import NormalDist

import numpy as np
import pytest

from places import ROOT
from qpavoid.lab.study.statistics import paired, wilson

FOLDER = ROOT / "comparisons"
page = pytest.importorskip("page", reason="needs qpavoid[study]")
page_runs = pytest.importorskip("page_runs")
page_text = pytest.importorskip("page_text")
page_figures = pytest.importorskip("page_figures")

TEXTS = tomllib.loads((FOLDER / "page.toml").read_text())
COLUMNS = (
    "method,setting,scenario,seed,outcome,success,contact,arrived_s,"
    "min_moving_clearance_m,min_room_m,metric\n"
)


def test_the_page_is_what_its_tables_give():
    made = page.make_page(FOLDER / "results", TEXTS)
    assert (FOLDER / "README.md").read_text() == made
    readme = (ROOT / "README.md").read_text()
    studies = page.read_studies(FOLDER / "results", TEXTS)
    assert page.with_overview(readme, studies) == readme
    for figure in ("success", "differences"):
        assert (FOLDER / "figures" / f"comparisons-{figure}.png").is_file()


def test_the_tables_are_small_enough_to_commit():
    sizes = [path.stat().st_size for path in (FOLDER / "results").glob("*.csv")]
    assert 0 < sum(sizes) <= 1_500_000


@pytest.mark.parametrize(("hits", "n"), [(0, 8), (3, 10), (39, 40), (7, 7)])
def test_wilson_solves_its_equation(hits, n):
    """Its bounds are the rates p that lie z standard errors of p from what was seen."""
    rate, low, high = wilson(hits, n)
    assert rate == hits / n
    for bound in {low, high} - {rate}:
        error = NormalDist().inv_cdf(0.975) * math.sqrt(bound * (1.0 - bound) / n)
        assert abs(rate - bound) == pytest.approx(error, abs=1e-12)


def test_pairs_are_counted_by_scene():
    ours = {"a": 10.0, "b": 12.0, "c": None, "d": 9.0, "e": None, "f": 3.0}
    theirs = {"a": 8.0, "b": None, "c": 5.0, "d": 10.0, "e": None, "f": None, "g": 1.0}
    pair = paired(ours, theirs)
    assert pair[:3] == (6, 2, 1)
    assert pair.success[0] == pytest.approx(1 / 6) and pair.both == 2
    assert pair.time == pytest.approx((0.5, -1.0, 2.0))
    assert paired({"a": 1.0}, {"b": 1.0}) is None
    back = paired(theirs, ours)
    assert back[1:3] == (1, 2) and back.time[0] == -0.5


def sign_flips(first, second):
    """How often a fair coin splits as unevenly: all outcomes, one by one."""
    n, seen = first + second, abs(first - second)
    flips = (sum(outcome) for outcome in product((-1, 1), repeat=n))
    return sum(abs(total) >= seen for total in flips) / 2**n


@pytest.mark.parametrize(("first", "second"), [(0, 0), (3, 0), (6, 0), (2, 9), (5, 5)])
def test_p_is_that_of_a_fair_coin(first, second):
    ours = {k: 1.0 if k < first else None for k in range(first + second)}
    theirs = {k: None if k < first else 1.0 for k in range(first + second)}
    pair = paired({**ours, "both": 1.0}, {**theirs, "both": 1.0})
    assert pair.p == pytest.approx(sign_flips(first, second))


def binomial_quantile(q, n, p):
    total = 0.0
    for k in range(n + 1):
        total += math.comb(n, k) * p**k * (1.0 - p) ** (n - k)
        if total >= q:
            return k
    return n


@pytest.mark.parametrize(("n", "wins"), [(40, 10), (100, 3), (60, 30)])
def test_the_interval_of_a_difference_is_that_of_all_resamples(n, wins):
    """Where only the first ever wins, its resampled wins are binomial."""
    ours = {k: 1.0 for k in range(n)}
    theirs = {k: None if k < wins else 1.0 for k in range(n)}
    pair = paired(ours, theirs)
    low, high = (binomial_quantile(q, n, wins / n) / n for q in (0.025, 0.975))
    assert pair.success == pytest.approx((wins / n, low, high), abs=1.5 / n)
    assert pair.time == (0.0, 0.0, 0.0)


def test_the_interval_covers_a_known_mean(rng_differences):
    """Of 200 samples about 95 % of the intervals hold the true difference of 1 s."""
    held = 0
    for late in rng_differences:
        ours = dict(enumerate(20.0 + late))
        _, low, high = paired(ours, dict.fromkeys(ours, 20.0)).time
        held += low <= 1.0 <= high
    assert 0.88 <= held / len(rng_differences) <= 0.99


@pytest.fixture
def rng_differences():
    return np.random.default_rng(4).normal(1.0, 2.0, (200, 40))


def write_runs(folder, lines):
    folder.mkdir(parents=True)
    (folder / "runs.csv").write_text(COLUMNS + "\n".join(lines) + "\n")


def run(method, seed, became, time="", setting="", scenario="s"):
    words = {
        "success": "arrived,True,False,{},0.3,0.1,0.5",
        "contact": "touched,False,True,,-0.1,-0.3,0.0",
        "contact_standing": "touched,False,True,,0.1,-0.3,0.0",
        "stalled": "stalled,False,False,,0.3,0.1,0.0",
        "late": "off goal,False,False,,0.3,0.1,0.0",
        "failed": "died,False,False,,,,",
    }
    return f"{method},{setting},{scenario},{seed}," + words[became].format(time)


def test_a_run_becomes_a_short_row(tmp_path):
    kinds = list(page_runs.OUTCOMES)
    lines = [run("qp", seed, kind, 12.3456) for seed, kind in enumerate(kinds)]
    write_runs(tmp_path / "few", lines)
    path = page_runs.condense(tmp_path / "few", tmp_path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert [row["outcome"] for row in rows] == kinds
    assert [row["scene"] for row in rows] == list("012345")
    assert [row["method"] for row in rows] == ["qp"] + [""] * 5
    assert {run["method"] for run in page_runs.read_runs(path)} == {"qp"}
    assert (rows[0]["arrived_s"], rows[1]["arrived_s"]) == ("12.35", "")
    assert page_runs.condense(tmp_path / "none", tmp_path) is None


def test_methods_that_did_not_run_again_stay(tmp_path):
    lines = [run(name, k, "late") for name in ("qp", "eq5") for k in range(3)]
    write_runs(tmp_path / "few", lines)
    page_runs.condense(tmp_path / "few", tmp_path)
    again = tmp_path / "again" / "few"
    write_runs(again, [run("qp", k, "success", 9.0) for k in range(3)])
    path = page_runs.condense(again, tmp_path, beside=True)
    became = [(row["method"], row["outcome"]) for row in page_runs.read_runs(path)]
    assert became == [("eq5", "late")] * 3 + [("qp", "success")] * 3
    path = page_runs.condense(again, tmp_path)
    assert {row["method"] for row in page_runs.read_runs(path)} == {"qp"}


@pytest.fixture
def results(tmp_path):
    """Ours loses to fast on time and scenes; one stands still; four settings; none."""
    lines = []
    for k in range(20):
        lines.append(run("qp-ahead", k, "success" if k else "contact", 20.0 + k % 3))
        lines.append(run("vfh", k, "success", 15.0 + k % 3))
        lines.append(run("stop", k, "stalled"))
    write_runs(tmp_path / "forest", lines)
    lines = [
        run(method, k, "success", 9.0, setting, scenario)
        for method in ("qp-ahead", "alone")
        for setting in "abcd"
        for scenario in ("s", "t")
        for k in range(2)
    ]
    write_runs(tmp_path / "many", lines)
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "table.csv").write_text("family,method,n\nx,qp,3\n")
    for name in ("forest", "many", "alone"):
        page_runs.condense(tmp_path / name, tmp_path)
    return tmp_path


def test_where_we_lose_is_computed(results):
    part = page.read_studies(results, TEXTS)[0].parts[0]
    assert [record["method"] for record in part.records] == ["vfh", "qp-ahead", "stop"]
    said = page_text.not_best(part, scored=True)
    assert "more successes: `vfh` by 5.0 (0.0 to 15.0) points, not told apart" in said
    assert "fewer contacts than our 1: `vfh` (0), `stop` (0)" in said
    assert "quicker where both succeed: `vfh` by 5.0 (5.0 to 5.0) s" in said
    assert "a higher metric than our 0.475: `vfh` (0.500)" in said
    assert page.standing(part) == ["`vfh`", "`qp-ahead`", "19 of 20", 1, 0, 1, 1]


def test_a_method_that_stands_still_is_shown_as_one(results):
    text = page.make_page(results, TEXTS)
    (line,) = (line for line in text.splitlines() if line.startswith("| `stop` | 0 of"))
    cells = [cell.strip() for cell in line.split("|")[2:9]]
    assert cells == ["0 of 20", "0.0 (0.0 to 16.1)", "0", "0", "20", "0", "0"]


def test_many_settings_are_ranked_together_and_shown_apart(results):
    text = page.make_page(results, TEXTS)
    assert "### " not in text.split("## Methods")[0] and "16 of 16" in text
    assert "| a (4 scenes) | 4 | 4 |" in text
    assert (
        "| `alone` | 0 | 0 | 0, nowhere different | 1.000 | 16 | 0.0 (0.0 to 0.0) |"
        in text
    )


def test_a_study_with_a_table_only_shows_it(results):
    text = page.make_page(results, TEXTS)
    assert "| family | method | n |\n| --- | ---: | ---: |\n| x | qp | 3 |" in text


def test_the_figures(results, tmp_path):
    page_figures.draw(page.panels(page.read_studies(results, TEXTS)), tmp_path)
    for name in ("success", "differences"):
        content = (tmp_path / f"comparisons-{name}.png").read_bytes()
        assert content.startswith(b"\x89PNG") and len(content) > 5_000


def test_a_scene_that_was_run_twice_is_no_pair():
    rows = [{"method": "qp", "setting": "", "scene": "1", "success": False}] * 2
    with pytest.raises(ValueError, match="qp: a scene was run twice"):
        page_text.times_of(rows)
