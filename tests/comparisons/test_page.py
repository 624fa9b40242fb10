"""The page of all comparisons: its numbers, and that it is what its tables give."""

import csv
import re
import tomllib
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from scipy import stats

from places import ROOT
from qpavoid.lab.study.statistics import wilson

FOLDER = ROOT / "comparisons"
page = pytest.importorskip("page", reason="needs qpavoid[study]")
page_runs = pytest.importorskip("page_runs")
rerun = pytest.importorskip("rerun")
page_numbers = pytest.importorskip("page_numbers")
page_losses = pytest.importorskip("page_losses")
page_overview = pytest.importorskip("page_overview")
page_scenes = pytest.importorskip("page_scenes")
page_parts = pytest.importorskip("page_parts")
page_rivals = pytest.importorskip("page_rivals")
page_records = pytest.importorskip("page_records")
page_cells = pytest.importorskip("page_cells")
page_differences = pytest.importorskip("page_differences")
page_ranking = pytest.importorskip("page_ranking")
page_statistics = pytest.importorskip("page_statistics")
page_figures = pytest.importorskip("page_figures")

TEXTS = tomllib.loads((FOLDER / "page.toml").read_text())
COLUMNS = (
    "method,setting,scenario,seed,outcome,success,contact,arrived_s,"
    "start_clearance_m,contacts_moving,min_room_m,jerk_mps3,solve_us,metric\n"
)


def test_the_page_is_what_its_tables_give():
    studies = page.read_studies(FOLDER / "results", TEXTS)
    made = page.make_page(studies, FOLDER / "results", TEXTS)
    kept = (FOLDER / "README.md").read_text()
    assert kept == page.thin(made) and len(kept.encode()) < 500 * 1024
    readme = (ROOT / "README.md").read_text()
    assert page.with_overview(readme, studies) == readme
    for figure in ("success", "differences"):
        assert (FOLDER / "figures" / f"comparisons-{figure}.png").is_file()


def test_the_tables_are_small_enough_to_commit():
    sizes = [path.stat().st_size for path in (FOLDER / "results").rglob("*.*")]
    assert 0 < sum(sizes) <= 2_000_000


def alone(scenes):
    return {scene: k for k, scene in enumerate(scenes)}


def test_pairs_are_counted_by_scene():
    ours = {"a": 10.0, "b": 12.0, "c": None, "d": 9.0, "e": None, "f": 3.0}
    theirs = {"a": 8.0, "b": None, "c": 5.0, "d": 10.0, "e": None, "f": None, "g": 1.0}
    pair = page_statistics.compare(ours, theirs, alone("abcdefg"))
    assert pair[:4] == (6, 2, 1, 2) and pair.g == pytest.approx(1 / 6)
    assert pair.differences["success"].value[0] == pytest.approx(1 / 6)
    assert "time" not in pair.differences
    assert page_statistics.compare({"a": 1.0}, {"b": 1.0}, alone("ab")) is None
    back = page_statistics.compare(theirs, ours, alone("abcdefg"))
    assert back[1:3] == (1, 2) and back.g == pytest.approx(-1 / 6)


def sign_flips(sums):
    """How often random signs sum up to as much: all of them, one by one."""
    flips = [
        sum(s * x for s, x in zip(signs, sums, strict=True))
        for signs in product((-1, 1), repeat=len(sums))
    ]
    return sum(abs(total) >= abs(sum(sums)) for total in flips) / len(flips)


@pytest.mark.parametrize(
    "sums", [[0], [1] * 3, [1, 1, -1, 0], [-3, 1, 2, 3, 3, 0, 1], [5] * 5, [3, -3]]
)
def test_p_is_that_of_all_signs_of_clusters(sums):
    assert page_statistics.exact_p(np.array(sums)) == pytest.approx(sign_flips(sums))
    for size in (1.0, 1e-3, 0.1):  # of whole numbers and of thousandths no tie is lost
        p = page_statistics.exact_p(page_statistics.on_grid(size * np.array(sums)))
        assert p == pytest.approx(sign_flips(sums))


@given(st.lists(st.floats(-3.0, 3.0, allow_subnormal=False), min_size=1, max_size=11))
def test_p_of_any_numbers_is_that_of_all_signs_but_for_the_rounding(sums):
    """No farther off than signs whose sum is within rounding of the one seen."""
    seen, sizes = abs(sum(sums)), np.abs(sums).sum()
    signs = np.array([*product((-1.0, 1.0), repeat=len(sums))])
    reached, off = np.abs(signs @ np.array(sums)), 1.1 * len(sums) * sizes / 40_000
    p = page_statistics.exact_p(page_statistics.on_grid(np.array(sums)))
    least, most = ((reached >= seen + x).mean() for x in (off, -off))
    assert least - 1e-9 <= p <= most + 1e-9


def test_p_of_single_scenes_is_mcnemars():
    sums = np.array([1] * 9 + [-1] * 2)
    p = page_statistics.exact_p(sums)
    assert p == pytest.approx(stats.binomtest(2, 11).pvalue)


@pytest.mark.parametrize("clusters", [8, 60, 500])
def test_intervals_are_those_of_scipy_s_bootstrap(clusters):
    """Of clusters: their sums and counts are drawn together."""
    rng = np.random.default_rng(clusters)
    counts = rng.integers(1, 4, clusters).astype(float)
    sums = counts * rng.normal(0.1, 1.0, clusters)
    told = stats.bootstrap(
        (sums, counts),
        lambda a, b, axis=-1: a.sum(axis) / b.sum(axis),
        paired=True,
        vectorized=True,
        n_resamples=page_statistics.RESAMPLES,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    found = page_statistics.mean(sums, counts)
    assert found == pytest.approx((sums.sum() / counts.sum(), *told), abs=1e-5)


def test_copies_of_a_scene_add_nothing():
    """Each scene at five levels: as sure as at one, not more."""
    once = {k: 1.0 if k < 4 else None for k in range(12)}
    never = dict.fromkeys(once)
    often = {(k, level): time for k, time in once.items() for level in range(5)}
    levels = {key: key[0] for key in often}
    one = page_statistics.compare(once, never, alone(once)).differences["success"]
    many = page_statistics.compare(often, dict.fromkeys(often), levels)
    many = many.differences["success"]
    assert many.value == pytest.approx(one.value) and many.p == one.p
    apart = page_statistics.compare(often, dict.fromkeys(often), alone(often))
    assert apart.differences["success"].p < 0.01 * one.p
    hits = np.array([time is not None for time in once.values()], float)
    share = page_statistics.share(hits, np.arange(12))
    fivefold = page_statistics.share(np.repeat(hits, 5), np.repeat(np.arange(12), 5))
    assert fivefold == pytest.approx(share, abs=0.04)  # t of 11 degrees for 59
    assert fivefold[2] - fivefold[1] > share[2] - share[1]


def test_the_interval_of_a_share_is_wilsons_where_scenes_are_single():
    for hits in (0, 3, 10):
        values = np.repeat([1.0, 0.0], [hits, 10 - hits])
        found = page_statistics.share(values, np.arange(10))
        assert found == pytest.approx(wilson(hits, 10), abs=1e-12)
    alike = page_statistics.share(np.ones(30), np.arange(30) // 3)
    assert alike == pytest.approx(wilson(10, 10), abs=1e-12)


def test_holm_is_the_textbooks():
    """Four p, worked by hand: times 4, 3, 2, 1, never less than the one before."""
    found = page_statistics.holm([0.01, 0.04, 0.03, 0.005])
    assert found == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert page_statistics.holm([0.6, 0.9]) == [1.0, 1.0]


def test_p_is_corrected_for_all_of_a_study(results):
    (part,) = page.read_studies(results, TEXTS)[0].parts
    found, gain = (part.pairs[x].differences for x in ("vfh", "stop"))
    assert gain["success"].single == found["time"].single == 2.0**-18
    assert gain["success"].p == pytest.approx(7 * 2.0**-18)  # of seven comparisons
    assert found["time"].p == 2.0**-18  # a loss, and all of its kind that is of times
    assert found["success"].p == 1.0


def test_a_variant_of_ours_makes_no_loss_less_clear(results):
    """Corrected apart, but where a study stands aside."""
    (part,) = page.read_studies(results, TEXTS)[0].parts
    rows = [row for some in part.runs.values() for row in some]
    rows += [{**row, "method": "qp"} for row in part.runs["qp-ahead"]]

    def p_of(text):
        (with_it,) = page_parts.make_parts(rows, text, 3)
        return with_it.pairs["vfh"].differences["time"].p

    assert p_of({}) == part.pairs["vfh"].differences["time"].p
    assert p_of({"aside": True}) == 2.0**-17


def test_texts_are_told_the_numbers_of_a_ranking(results):
    studies = page.read_studies(results, TEXTS)
    study, (part,) = studies[0], studies[0].parts
    fill = page_numbers.Numbers(studies).fill
    text = "{vfh won} of {scenes}, ours {ours won}, {ours moving} + {stop standing}"
    said = "20 of 20, ours 19, 1 + 0"
    assert fill(text, study, part) == fill(text, study) == said
    assert fill(
        f"v_{{k+1}}, {{#{study.name}|vfh won}} of {{#{study.name}|scenes}}"
    ) == ("v_{k+1}, 20 of 20")
    text = "{vfh times}, {vfh median} s, {ours below} by {ours nearer} cm, {stop late}"
    assert fill(text, study) == "1.31, 16.0 s, 1 by 30 cm, 0"
    runs = {**part.runs, "stop": part.runs["stop"][:5]}
    some = part._replace(runs=runs)
    text = "{vfh won where stop ran} of {stop ran}, {vfh stalled where nobody ran}"
    assert fill(text, study, some) == "5 of 5, 0"
    for wrong in "{nobody won}", "{nowhere|vfh won}", "{#nowhere|vfh won}":
        assert fill(wrong, study) == "–"
    assert fill("{vfh won}") == "–"


def test_of_a_setting_within_a_ranking_its_own_runs_are_counted():
    studies = {x.name: x for x in page.read_studies(FOLDER / "results", TEXTS)}
    study, level = studies["sensing"], "strangers as points: latency (s) 0.4"
    part = page_numbers.part_of(study, level)
    assert {row["setting"] for some in part.runs.values() for row in some} == {level}
    told = page_numbers.Numbers([study]).fill(f"{{{level}|ours won}}", study)
    rows = [x for x in study.rows if (x["setting"], x["method"]) == (level, part.ours)]
    assert told == str(sum(row["success"] for row in rows)) and len(rows) == 60


def test_who_is_quick_but_seldom_there_is_told(results):
    study, (part,) = (x := page.read_studies(results, TEXTS)[0]), x.parts
    assert page_losses.seldom(study, part, "time") == ""
    runs = {**part.runs, "vfh": [*part.runs["vfh"]]}
    runs["vfh"][:8] = [row | {"success": False} for row in runs["vfh"][:8]]
    told = page_losses.seldom(study, part._replace(runs=runs), "time")
    assert told.endswith("`vfh` (12 of 20; ours takes 1.31 times as long)")


def test_who_would_be_better_in_a_ranking_by_itself_is_told(results):
    """Six successes more, p 0.031: clear as the only one, not as one of three."""
    study = page.read_studies(results, TEXTS)[0]
    rows = [
        {
            **row,
            "method": name,
            "setting": setting,
            "success": name != "qp-ahead" or k > 5,
        }
        for setting in "abc"
        for name in ("qp-ahead", "vfh")
        for k, row in enumerate(study.parts[0].runs["vfh"])
    ]
    parts = page_parts.make_parts(rows, {}, 3)
    told = [page_losses.thinned(study, part) for part in parts]
    assert [len(x) for x in told] == [1, 1, 1]
    assert told[0][0].endswith(", a: `vfh` in success")


def test_the_interval_covers_a_known_mean():
    """Of 200 samples about 95 % of the intervals hold the true difference of 1 s."""
    held = 0
    for late in np.random.default_rng(4).normal(1.0, 2.0, (200, 40)):
        _, low, high = page_statistics.mean(late, np.ones(40))
        held += low <= 1.0 <= high
    assert 0.88 <= held / 200 <= 0.99


def write_runs(folder, lines):
    folder.mkdir(parents=True)
    (folder / "runs.csv").write_text(COLUMNS + "\n".join(lines) + "\n")


def run(method, seed, became, time="", setting="", scenario="s"):
    words = {
        "success": "arrived,True,False,{},0.3,0.0,0.1,1.5,7.0,0.5",
        "contact": "touched,False,True,,0.3,2.0,-0.3,1.5,7.0,0.0",
        "contact_standing": "touched,False,True,,0.3,0.0,-0.3,1.5,7.0,0.0",
        "stalled": "stalled,False,False,,0.3,0.0,0.1,1.5,7.0,0.0",
        "late": "off goal,False,False,,0.3,0.0,0.1,1.5,7.0,0.0",
        "failed": "died,False,False,,,,,,,",
        "began": "touched,False,True,,-0.1,1.0,-0.3,1.5,7.0,0.0",
    }
    return f"{method},{setting},{scenario},{seed}," + words[became].format(time)


def test_a_run_becomes_a_short_row(tmp_path):
    kinds = [*page_runs.OUTCOMES, page_runs.BEGAN]
    lines = [run("qp", seed, kind, 12.3456) for seed, kind in enumerate(kinds)]
    write_runs(tmp_path / "few", lines)
    path = page_runs.condense(tmp_path / "few", tmp_path)
    with path.open() as file:
        rows = list(csv.DictReader(file, restval=""))
    assert [row["outcome"] for row in rows] == kinds
    assert [row["scene"] for row in rows] == list("0123456")
    assert [row["method"] for row in rows] == ["qp"] + [""] * 6
    assert {run["method"] for run in page_runs.read_runs(path)} == {"qp"}
    assert (rows[0]["arrived_s"], rows[1]["arrived_s"]) == ("12.35", "")
    assert page_runs.condense(tmp_path / "none", tmp_path) is None


@given(st.floats(-1e4, 1e4), st.sampled_from([(), (".2f",), (".4f", ".3g")]))
def test_a_number_is_kept_without_its_leading_zero(number, how):
    text = page_runs.as_kept(str(number), *how)
    assert float(text) == float(page_runs.rounded(str(number), *how))
    assert not text.startswith(("0.", "-0."))


def test_what_is_shown_as_a_mean_is_kept_as_one(tmp_path):
    """What decides something is kept run by run; a mean is of the runs that it has."""
    begun = [run("qp", k, "success", 9.0).rpartition(",")[0] for k in range(4)]
    begun += [run("qp", 4, "contact").rpartition(",")[0]]
    told = ["1,1.5", "0,1.0", "0,1.0", "0,1.0", "0,"]
    lines = [COLUMNS.strip() + ",metric_time"]
    lines += [f"{line},{metrics}" for line, metrics in zip(begun, told, strict=True)]
    folder = tmp_path / "crowd"
    folder.mkdir()
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    path = page_runs.condense(folder, tmp_path)
    rows = page_runs.read_csv(path)
    assert [row["metric_time"] for row in rows] == ["1.125", "", "", "", ""]
    again = page_runs.read_runs(path)
    assert [row["metric"] for row in again] == [1.0, 0.0, 0.0, 0.0, 0.0]
    assert [row["metric_time"] for row in again] == [*[1.125] * 4, None]


def test_methods_that_did_not_run_again_stay(tmp_path):
    lines = [run(name, k, "late") for name in ("qp", "eq5") for k in range(3)]
    write_runs(tmp_path / "few", lines)
    page_runs.condense(tmp_path / "few", tmp_path)
    again = tmp_path / "again" / "few"
    write_runs(again, [run("qp", k, "success", 9.0) for k in range(3)])
    path = page_runs.condense(again, tmp_path, beside=True)
    became = [(row["method"], row["outcome"]) for row in page_runs.read_runs(path)]
    assert became == [("eq5", "late")] * 3 + [("qp", "success")] * 3
    rain = tmp_path / "rain" / "few"
    write_runs(rain, [run("qp", 0, "late", setting="rain")])
    path = page_runs.condense(rain, tmp_path, beside=True)
    settings = [(row["method"], row["setting"]) for row in page_runs.read_runs(path)]
    assert settings == [("eq5", "")] * 3 + [("qp", "")] * 3 + [("qp", "rain")]
    path = page_runs.condense(again, tmp_path)
    assert {row["method"] for row in page_runs.read_runs(path)} == {"qp"}


def test_lines_of_a_table_that_did_not_run_again_stay(tmp_path):
    for folder, methods in (("fleet", ["qp", "eq5"]), ("again/fleet", ["qp", "orca"])):
        (tmp_path / folder).mkdir(parents=True)
        lines = [f"{name},door,{folder}" for name in methods]
        text = "\n".join(["method,setting,of", *lines])
        (tmp_path / folder / "table.csv").write_text(text)
        path = page_runs.condense(tmp_path / folder, tmp_path, beside=True)
    found = {row["method"]: row["of"] for row in page_runs.read_csv(path)}
    assert found == {"eq5": "fleet", "qp": "again/fleet", "orca": "again/fleet"}


@given(
    blocks=st.lists(
        st.tuples(
            st.sampled_from(["", "rain"]),
            st.lists(st.sampled_from("abc"), min_size=1, max_size=4),
            st.lists(st.sampled_from(["", "3", "5", "40"]), min_size=1, max_size=4),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_what_is_left_empty_is_read_again(tmp_path_factory, blocks):
    lines = [
        {
            **{"method": f"m{k}", "setting": setting, "scene": scene},
            **{"outcome": "late", "solve_us": solve, "jerk_mps3": solve},
        }
        for k, (setting, scenes, solves) in enumerate(blocks)
        for scene, solve in zip(scenes, solves, strict=False)
    ]
    told = sorted((x["method"], x["setting"], x["scene"]) for x in lines)
    path = tmp_path_factory.mktemp("kept") / "table.csv"
    page_runs.write_table(path, [*lines])
    again = page_runs.whole(page_runs.read_csv(path))
    assert sorted((x["method"], x["setting"], x["scene"]) for x in again) == told
    for k, (_, scenes, solves) in enumerate(blocks):
        known = [float(x) for x, _ in zip(solves, scenes, strict=False) if x]
        (solve,) = {x["solve_us"] for x in again if x["method"] == f"m{k}"}
        middle = float(format(np.median(known), ".2g")) if known else None
        assert (float(solve) if solve else None) == middle
        (jerk,) = {x["jerk_mps3"] for x in again if x["method"] == f"m{k}"}
        mean = float(format(np.mean(known), ".3g")) if known else None
        assert (float(jerk) if jerk else None) == mean


def test_the_day_of_rows_is_noted_and_said(tmp_path):
    path = tmp_path / "made.toml"
    page_records.note_day(path, "forest", ["vfh", "dwa"], "2026-01-02")
    page_records.note_day(path, "forest", ["dwa", "qp"], "2026-01-03")
    page_records.note_day(path, "maps", ["qp"], "2026-01-04")
    days = page_records.days_of(path)["forest"]
    said = page_records.day_words(days, ["qp", "vfh", "dwa", "stop"])
    assert said == (
        "Rows made on 2026-01-02: `vfh`; on 2026-01-03: `qp`, `dwa`; "
        "all others before that."
    )
    assert page_records.day_words(days, ["vfh"]) == "Rows made on 2026-01-02: `vfh`."
    assert page_records.day_words(days, ["stop"]) == ""
    assert page_records.days_of(tmp_path / "none.toml") == {}


def test_a_search_is_said_with_its_budget(tmp_path):
    file = tmp_path / "tuned.toml"
    file.write_text(
        "[dwa]\ntried = 3\nforests.count = 2\nstrangers.count = 4\n"
        "loss.before = 1.0\nloss.best = 0.5\n"
        "[ours.all_kinds]\ntried = 2\nruns = 80\n"
        "before.loss = 0.3\nafter.loss = 0.2\n"
    )
    found = page_records.tuned_words(file)
    told = "forests and strangers: 3 settings, 18 runs, loss 1.000 → 0.500"
    assert found["dwa"] == told
    told = "all kinds: 2 settings, 80 runs, loss 0.300 → 0.200"
    assert found["ours"] == told
    file.write_text(file.read_text().replace("[ours.", "[dwa."))
    assert page_records.tuned_words(file)["dwa"].endswith(f"0.500; then {told}")
    assert page_records.check_words(file) == ""
    asked = "[{}.all_kinds.check]\nbefore.loss = 2.0\nafter.loss = {}\n"
    file.write_text(file.read_text() + asked.format("dwa", 2.0))
    assert page_records.tuned_words(file)["dwa"].endswith(" (held out 2.000 → 2.000)")
    last = "tried = 1\nruns = 9\nbefore.loss = 1.0\nafter.loss = 1.0\n"
    more = "[vfh.all_kinds]\n" + last + asked.format("vfh", 1.5)
    file.write_text(file.read_text() + more)
    said = page_records.check_words(file)
    assert "Of 2 methods" in said and "for 1: `vfh`; and not for 1: `dwa`." in said


def test_a_row_that_differs_is_told(tmp_path):
    file = tmp_path / "rows.csv"
    file.write_text(
        "seed,study,method,setting,scene,what\n3,barn,qp,,7,\n3,barn,dwa,a,8,x: 1\n"
    )
    text, wrong = page_records.rerun_words(file)
    assert "Of 2 random rows" in text and "--seed 3` (2 of `barn`), **1 agree**" in text
    assert wrong == "- `barn`, `dwa`, a 8: x: 1"
    assert page_records.rerun_words(tmp_path / "none.csv") == []
    (other,) = page_records.other_words(file)
    assert "`--without-avx512`), 1 of 2 such rows agree; " in other
    assert page_records.other_words(tmp_path / "none.csv") == []


@pytest.mark.parametrize(
    ("scenarios", "scenes"),
    [
        (("s", "s"), ["3", "3"]),
        (("s", "t"), ["s 3", "t 3"]),
        (("w", "w, noise 1"), ["3", "noise 1 3"]),
        (("w, a", "w, b"), ["a 3", "b 3"]),
        (("wide", "win"), ["wide 3", "win 3"]),
    ],
)
def test_a_scene_is_told_without_what_all_of_its_setting_begin_with(
    tmp_path, scenarios, scenes
):
    lines = [run("qp", 3, "stalled", "", "one", f'"{name}"') for name in scenarios]
    lines.append(run("qp", 3, "stalled", "", "two", "another"))
    write_runs(tmp_path / "few", lines)
    runs = page_runs.read_runs(page_runs.condense(tmp_path / "few", tmp_path))
    assert [row["scene"] for row in runs] == [*scenes, "3"]
    found = rerun.found_in(tmp_path / "few" / "runs.csv")
    assert all(("qp", row["setting"], row["scene"]) in found for row in runs)


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
    assert [*part.runs] == ["vfh", "qp-ahead", "stop"]
    said = page_differences.not_best(part, scored=True)
    assert "more successes: `vfh` by 5.0 (0.0 to 15.0) points, level" in said
    assert "fewer contacts than our 1: `vfh` (0), `stop` (0)" in said
    assert "quicker where both succeed: `vfh` (ours takes 1.31 (1.31 to" in said
    assert page_rivals.quickest(part) == "vfh"
    success = page_differences.standing(part, "success")
    assert success == "**level**: 19 of 20 / 20 of 20, `vfh` (p 1.000 by itself)"
    assert page_differences.standing(part, "time").startswith("**worse**: 1.31 (")
    assert page_differences.standing(part, "metric") == "–"


def test_what_begins_in_contact_is_left_out_and_listed(tmp_path):
    lines = [run(name, k, "late") for name in ("qp", "eq5") for k in range(3)]
    lines[4] = run("eq5", 1, "began")
    write_runs(tmp_path / "few", lines)
    page_runs.condense(tmp_path / "few", tmp_path)
    studies = page.read_studies(tmp_path, TEXTS)
    assert studies[0].parts[0].scenes == 2
    text = page.make_page(studies, tmp_path, TEXTS)
    assert "Left out, for they begin in contact: 1 (1)." in text
    assert "| `qp` | 0 of 2 |" in text


def test_a_column_that_rows_have_is_shown(results):
    text = page.make_page(page.read_studies(results, TEXTS), results, TEXTS)
    assert "| least room m | jerk m/s³ | solve µs |" in text
    assert "| −0.30 | 1.5 | 7 |" in text


def test_a_method_of_ones_own_is_not_loaded_for_the_page(tmp_path):
    lines = [
        run(name, k, "success", 9.0) for name in ("qp", "no_such:thing") for k in "12"
    ]
    write_runs(tmp_path / "few", lines)
    page_runs.condense(tmp_path / "few", tmp_path)
    text = page.make_page(page.read_studies(tmp_path, TEXTS), tmp_path, TEXTS)
    assert "| `no_such:thing` | a method of one's own | polygon | nothing |" in text


def test_what_failed_touched_nothing_and_kept_nothing(tmp_path):
    lines = [run("qp", k, how, 9.0) for k, how in enumerate(["success", "failed"])]
    write_runs(tmp_path / "few", lines)
    page_runs.condense(tmp_path / "few", tmp_path)
    (part,) = page.read_studies(tmp_path, TEXTS)[0].parts
    assert "| `qp` | 1 of 2 | 50.0 (9.5 to 90.5) | 1 | 1 | 1 |" in page_ranking.ranking(
        part, apart=True
    ).replace("**", "")


def test_a_thin_table_is_the_same_table():
    text = "a | b\n\n| x | y |\n| --- | ---: |\n| `p` | 1 \\| 2 |\n"
    thin = "a | b\n\n|x|y|\n|---|---:|\n|`p`|1 \\|2|\n"
    assert page.thin(text) == thin


def test_room_is_shown_as_it_is_kept():
    for room, shown in ((-0.032, "−0.032"), (0.38, "0.38"), (6.3, "6.3"), (None, "–")):
        assert page_cells.room_of([{"room": room}], "room") == shown


def test_clusters_are_as_the_page_says():
    cluster = page_parts.cluster_of
    assert cluster(("x", "7"), "") == ("x", "7") and cluster(("x", "7"), 3) == ("x", 2)
    rule = TEXTS["study"]["sensing"]["cluster"]
    assert cluster(("strangers as points: UWB", "4"), rule) == ("strangers", "4")
    with pytest.raises(ValueError, match="no cluster"):
        cluster(("x", "y"), rule)


@pytest.mark.parametrize(
    ("scenes", "said"),
    [
        ({"a": [0, 2, 4], "b": [0, 2]}, "one in 2 (5)"),
        ({"a": [0, 1], "b": [0, 1]}, "the first 2 of each setting"),
        ({"a": [0, 1], "b": []}, "2"),
        ({"a": [0, 1], "b": [1, 2]}, "4"),
        ({"a": [0, 2], "b": [0, 1]}, "4"),
        ({"a": [0, 1], "b": [0, 1, 2]}, "5"),
        ({"a": [0], "b": [0]}, "the first 1 of each setting"),
    ],
)
def test_which_scenes_a_method_ran_is_said(scenes, said):
    most = [{"setting": name, "scene": f"{k}"} for name in "ab" for k in range(6)]
    some = [row for row in most if int(row["scene"]) in scenes[row["setting"]]]
    assert page_ranking.which(some, most) == said
    if not scenes["b"]:
        assert page_ranking.which(some, most[:6]) == "the first 2"


def test_a_method_that_stands_still_is_shown_as_one(results):
    text = page.make_page(page.read_studies(results, TEXTS), results, TEXTS)
    (line,) = (line for line in text.splitlines() if line.startswith("| `stop` | 0 of"))
    cells = [cell.strip() for cell in line.split("|")[2:9]]
    assert cells == ["0 of 20", "0.0 (0.0 to 16.1)", "0", "0", "20", "0", "0"]


def test_many_settings_are_ranked_together_and_shown_apart(results):
    text = page.make_page(page.read_studies(results, TEXTS), results, TEXTS)
    assert "### " not in text.split("## Methods")[0] and "16 of 16" in text
    assert "| a (4 scenes) | 4 | 4 |" in text
    line = "| `alone` | 0 | 0 | 0, nowhere different | 1.000 | – | 0 / 0 | 1.000"
    assert line in text


def test_a_study_with_a_table_only_shows_it(results):
    text = page.make_page(page.read_studies(results, TEXTS), results, TEXTS)
    assert "| family | method | n |\n| --- | --- | ---: |\n| x | qp | 3 |" in text


def test_the_figures(results, tmp_path):
    page_figures.draw(page.panels(page.read_studies(results, TEXTS)), tmp_path)
    for name in ("success", "differences"):
        content = (tmp_path / f"comparisons-{name}.png").read_bytes()
        assert content.startswith(b"\x89PNG") and len(content) > 5_000


def test_the_panels_of_a_figure_can_be_compared(results, tmp_path, monkeypatch):
    """They have one axis, which holds every interval."""
    drawn = []
    monkeypatch.setattr(
        Figure, "savefig", lambda figure, *_, **how: drawn.append(figure)
    )
    panels = page.panels(page.read_studies(results, TEXTS))
    page_figures.draw(panels, tmp_path)
    for figure in drawn:
        shown = [axes for axes in figure.axes if axes.get_visible()]
        ((low, high),) = {axes.get_xlim() for axes in shown}
        for line in (line for axes in shown for line in axes.lines):
            assert low < min(line.get_xdata()) <= max(line.get_xdata()) < high
    assert len(drawn) == 2 and len(panels) > 1


def test_a_scene_that_was_run_twice_is_no_pair():
    rows = [{"method": "qp", "setting": "", "scene": "1", "success": False}] * 2
    with pytest.raises(ValueError, match="qp: a scene was run twice"):
        page_parts.times_of(rows)


def test_long_names_of_a_figure_keep_off_borders_and_neighbours(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(page_figures.plt, "close", kept.append)
    values = {"astar+qp-ahead+detour": wilson(9, 10), "eq5": wilson(1, 10)}
    panels = [page_figures.Panel(title, values, {}) for title in "abc"]
    page_figures.plot(panels, "x", (0.0, 100.0), tmp_path / "a.png")
    (figure,) = kept
    edges = [0.0, *(axes.get_window_extent().x1 for axes in figure.axes)]
    for edge, axes in zip(edges, figure.axes, strict=False):
        starts = [text.get_window_extent().x0 for text in axes.get_yticklabels()]
        assert min(starts) - edge > 0.1 * figure.dpi


def test_who_hardly_fails_cannot_be_shown_to_be_worse():
    """p of never failing is 2^(1 − n) where n clusters are lost, times the tests."""
    lines = [("qp-ahead", k, k >= 6) for k in range(12)]
    lines += [("eq5", k, True) for k in range(12)]
    rows = [
        {"method": name, "setting": "", "scene": str(k), "success": won}
        | {"outcome": "success" if won else "late", "contact": False}
        | {"arrived_s": 9.0 if won else None, "min_room_m": 0.1}
        for name, k, won in lines
    ]
    part = page_parts.make_part("", rows, {})
    assert part.ours == "qp-ahead" and 2.0**-5 < 0.05 < 2 * 2.0**-5
    assert not page_rivals.at_the_top(part, [1.0])
    assert page_rivals.at_the_top(part, [0.9, 1.0])
    assert not page_rivals.at_the_top(part, [0.001, 1.0])  # Holm's, not Bonferroni's
    assert page_rivals.at_the_top(part._replace(runs={"qp-ahead": rows[6:12]}), [1.0])


def test_what_speaks_for_ours_is_corrected_over_all_and_against_it_over_a_kind():
    def pair(p, better):
        found = page_statistics.Difference((0.0, 0.0, 0.0), p, better)
        return page_statistics.Pair(9, 0, 0, 0, {"success": found})

    plain = [pair(0.02, 1), pair(0.02, -1), pair(0.9, 1)]
    led = [pair(0.03, 1), pair(0.03, -1)]
    page_statistics.adjust(plain, led)
    told = [x.differences["success"].p for x in (*plain, *led)]
    assert told == pytest.approx([0.1, 0.06, 0.9, 0.1, 0.06])
    assert plain[0].differences["success"].single == 0.02


def test_of_equals_one_that_ran_in_most_scenes_is_named():
    names = {"qp-ahead": 9, "apf": 4, "vfh": 9, "astar+vfh": 9}
    rows = [
        {"method": name, "setting": "", "scene": str(k), "success": True}
        | {"outcome": "success", "contact": False, "arrived_s": 9.0, "min_room_m": 0.1}
        for name, count in names.items()
        for k in range(count)
    ]
    part = page_parts.make_part("", rows, {})
    assert (
        page_rivals.rival(part, "success") == page_rivals.rival(part, "time") == "vfh"
    )
    families = [page_parts.family(part, name) for name in part.pairs]
    assert sorted(families) == ["others", "others", "others, planned otherwise"]
    assert "astar+vfh" not in page.shown(part).runs | page.shown(part).pairs


def test_a_day_is_of_all_settings(tmp_path, monkeypatch):
    """A method that ran in one of two settings keeps the day of before."""
    monkeypatch.setattr(page, "RESULTS", tmp_path)
    both = [
        run(name, 0, "late", setting=x) for name in ("qp", "eq5") for x in ("a", "b")
    ]
    write_runs(tmp_path / "few", both)
    page.refresh([tmp_path / "few"], {"study": {}}, None, beside=False)
    page_records.note_day(tmp_path / "made.toml", "few", ["qp", "eq5"], "2026-01-02")
    again = tmp_path / "again" / "few"
    write_runs(again, [run("qp", 0, "success", 9.0, setting="a"), *both[2:]])
    page.refresh([again], {"study": {}}, None, beside=True)
    days = page_records.days_of(tmp_path / "made.toml")["few"]
    assert days["qp"] == "2026-01-02" and days["eq5"] > "2026-01-02"


def test_a_cluster_that_was_not_run_is_no_cluster():
    sums, counts = np.r_[np.ones(9), np.zeros(51)], np.r_[np.ones(20), np.zeros(40)]
    of_some = page_statistics.mean(sums[:20], counts[:20])
    assert page_statistics.mean(sums, counts) == of_some


def test_how_wide_intervals_are_is_said_of_methods_by_themselves():
    """Behind A* a method ran fewer scenes; on maps, where ours is so, it is meant."""
    studies = page.read_studies(FOLDER / "results", TEXTS)
    studies = [x for x in studies if x.name in ("dynabarn", "encounters", "maps")]
    told = page_scenes.wide(studies).splitlines()
    halves = {}
    for line in (line for line in told if line.startswith("- ")):
        name = re.match(r"- `?(\w+)", line)[1]
        for title, half in re.findall(r"(\[[^;]*?): ± ([\d.]+) \(", line):
            halves[name, title] = float(half)
    for study, part in page_overview.ranked(studies):
        led = "astar+" * part.ours.startswith("astar+")
        for name in "nmpc", "mppi", "Ours":
            named = part.ours if name == "Ours" else led + name
            _, low, high = part.most(named).success(named)
            half = halves.get((name, page_overview.linked(study, part)))
            assert (half is None) == (50.0 * (high - low) <= 5.0), (study.name, name)
            assert half is None or half == round(50.0 * (high - low), 1)


def test_an_interval_is_that_of_all_scenes_that_were_run():
    """A study may name another that has more of its scenes."""

    def lines(method, count, of="qp-ahead"):
        return [
            {"method": name, "setting": "s", "scene": str(k), "outcome": "success",
             "success": k % 2 == 0, "contact": False, "arrived_s": 9.0 + k}
            for name in (of, method) for k in range(count)
        ]  # fmt: skip

    many = page.Study("many", {"aside": True}, lines("mppi", 900), True)
    few = page.Study("few", {"more": "many"}, lines("mppi", 40), True, many)
    alone = page.Study("few", {"more": "many"}, lines("mppi", 40), True)
    others = page.Study("others", {"all_there": "all"}, lines("mppi", 40), True)
    told = page_scenes.wide([few, others, many])
    assert "; with all scenes of [many](#many):" in told
    assert "- `mppi`: [others](#others), s: ± 14.8 (40 runs, 350 wanted, all)." in told
    assert "[few]" not in told.split("`mppi`")[1]
    assert "[few](#few), s: ± 14.8" in page_scenes.wide([alone, others])


def ran(name, count, fails):
    """Return runs of which the first are late."""
    return [
        {"method": name, "setting": "", "scene": str(k), "success": k >= fails,
         "outcome": "success" if k >= fails else "late", "contact": False,
         "arrived_s": 9.0 if k >= fails else None}
        for k in range(count)
    ]  # fmt: skip


def test_ours_is_judged_where_a_method_ran_most_scenes():
    """Five failures of 40 are not clear beside ten of another, 50 of 400 are."""
    few = [*ran("qp-ahead", 40, 0), *ran("mppi", 40, 5), *ran("nmpc", 40, 6)]
    rows = [*ran("qp-ahead", 400, 0), *ran("mppi", 400, 50)]
    more = page.Study("more", {}, rows, True)
    (alone,) = page.Study("few", {}, few, True).parts
    (both,) = page.Study("few", {"more": "more"}, few, True, more).parts
    (many,) = more.parts
    found = [x.versus("mppi")["success"] for x in (alone, both, many)]
    assert [x.clear for x in found] == [0, 1, 1]
    assert found[1].value == found[2].value
    assert found[1].p > found[2].p  # Holm's over as many comparisons as without them
    words = [page_differences.standing(x, "success") for x in (alone, both)]
    assert words[0].startswith("**level**: 40 of 40 / 35 of 40, `mppi`")
    assert words[1].startswith("**better**: 400 of 400 / 350 of 400, `mppi`")
    assert both.pairs == alone.pairs
    own = alone.pairs["nmpc"].differences["success"]
    assert both.versus("nmpc")["success"].value == own.value


def test_the_best_other_ran_half_as_many_scenes_as_ours_or_as_any():
    """Short rows behind A* had pulled the median of all down to theirs."""
    short = [*ran("astar+vfh", 20, 0), *ran("astar+dwa", 20, 0), *ran("astar", 20, 0)]
    rows = [*ran("qp-ahead", 100, 0), *ran("mppi", 100, 9), *ran("vfh", 50, 5), *short]
    assert page_rivals.many(page_parts.make_part("", rows, {})) == ["mppi", "vfh"]
    rows = [*ran("qp-ahead", 100, 0), *ran("vfh", 9, 5), *short]
    told = page_rivals.many(page_parts.make_part("", rows, {}))
    assert {*told} == {"astar", "astar+vfh", "astar+dwa"}
