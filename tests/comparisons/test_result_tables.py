"""The numbers of README and page, computed again from the committed rows."""

import csv
import re
from collections import defaultdict
from functools import lru_cache
from statistics import median

import pytest
from scipy import stats

from places import COMPARISONS, RESULTS, ROOT
from qpavoid.lab.study.sweep.job import run_job
from qpavoid.lab.study.sweep.study import read_study

rows, tables = map(pytest.importorskip, ("rows", "tables"))  # need qpavoid[study]

PAGE, README = ((x / "README.md").read_text("utf-8") for x in (COMPARISONS, ROOT))
CROWDS = (COMPARISONS / "crowdnav/README.md").read_text("utf-8")
ALL = rows.RANKINGS + rows.REACTING
OURS = "qp-ahead+guide"
LABELS = {"ours": OURS} | {x: x.lower() for x in "MPPI NMPC TEB MPC-CBF ORCA".split()}


@lru_cache
def runs(study, settings=""):
    """Cells by method and scene, of methods that ran in all settings."""
    found, seen, setting = defaultdict(dict), defaultdict(set), ""
    with (RESULTS / f"{study}.csv").open(newline="") as file:
        names, *lines = csv.reader(file)
    for line in lines:
        setting = line[0] or setting
        if not re.search(settings, setting):
            continue
        for name, cell in zip(names[2:], line[2:], strict=False):
            if cell and not cell.startswith("b"):
                found[name][setting, line[1]] = cell
                seen[name].add(setting)
    whole = set.union(*seen.values())
    return {x: some for x, some in found.items() if seen[x] == whole}


def time(cell):
    return None if cell[0].isalpha() else float(cell.partition("/")[0])


def won(some):
    return sum(time(cell) is not None for cell in some.values())


def hit(some, letters="ct"):
    return sum(any(x in cell for x in letters) for cell in some.values())


def ratio(some, other):
    both = [(time(some[k]), time(other[k])) for k in some if k in other]
    ratios = [a / b for a, b in both if a and b]
    return f"{median(ratios):.2f}" if len(ratios) >= 8 else "–"


def rate(some):
    return f"{100 * (won(some) / len(some)):.1f}"


def both(some):
    return f"{rate(some)} % and {hit(some)}"


def lines_of(text, name):
    """Headings and rows of a table, without bold."""
    body = text.split(f"<!-- table: {name} -->\n")[1].split("\n<!-- end -->")[0]
    lines = [x.strip("|").split("|") for x in body.replace("**", "").splitlines()]
    heads, _, *rest = [[x.strip() for x in line] for line in lines]
    return heads, rest


@pytest.mark.parametrize("name", sorted({x.table for x in ALL}))
def test_a_table_has_the_numbers_of_its_rows(name):
    rankings = [x for x in ALL if x.table == name]
    page = CROWDS if name == "reacting" else PAGE
    (heads, lines), place, seen = lines_of(page, name), rankings[0], []
    for line in lines:
        if heads[0] == "scenes":
            (place,) = [x for x in rankings if x.title == line[0]] or [place]
            line = line[1:]
        found, label = runs(place.study, place.settings), line[0]
        known = place.before + LABELS.get(label, "")
        some = found[known if label in LABELS else label.strip("`")]
        share, interval = line[2].split()
        assert (line[1], share) == (str(len(some)), rate(some))
        assert [line[k] for k in (3, 4, 6)] == [
            str(hit(some, x)) for x in ("c", "ct", "/")
        ]
        assert line[5] == ratio(some, found[place.before + "mppi"])
        if not place.world:
            test = stats.binomtest(won(some), len(some))
            low, high = test.proportion_ci(0.95, method="wilson")
            assert interval == f"({100 * low:.0f}–{100 * high:.0f})"
        seen.append((place.title, label))
    for place in rankings:
        ran = runs(place.study, place.settings)
        named = [x for x in LABELS if place.before + LABELS[x] in ran]
        assert all((place.title, x) in seen for x in named)


@pytest.mark.parametrize("text", [README, PAGE])
def test_the_first_table(text):
    heads, lines = lines_of(text, "first")
    assert len(lines) <= 8 and [*LABELS] == heads[2:]
    for line in lines:
        (place,) = [x for x in rows.RANKINGS if x.title == line[0]]
        found = runs(place.study, place.settings)
        for label, cell in zip(heads[2:], line[2:], strict=True):
            some = found.get(place.before + LABELS[label], {})
            shares = [
                f"{100 * x / len(some):.0f}" for x in (won(some), hit(some)) if some
            ]
            assert cell == (" / ".join(shares) or "–")


def test_what_is_bold_by_mcnemar_and_holm():
    found = {k: x for k, x in runs("discs").items() if 2 * len(x) >= 150}
    names = [x for x in found if not re.search(r"qp-ahead|\+guide|^omni$", x)] + [OURS]
    best = max(names, key=lambda x: (won(found[x]) / len(found[x]), -hit(found[x])))
    p = {}
    for name in {*names} - {best}:
        pairs = [(time(found[best][k]), time(x)) for k, x in found[name].items()]
        split = [(not b) for a, b in pairs if bool(a) != bool(b)]
        p[name] = stats.binomtest(sum(split), len(split)).pvalue if split else 1.0
    expected, least = {best}, 0.0
    for k, name in enumerate(sorted(p, key=p.get)):
        least = max(least, p[name] * (len(p) - k))
        expected |= {name} if least >= 0.05 else set()
    assert tables.compare(rows.RANKINGS[1]).best["success"] == expected


def test_the_sentences_have_the_numbers_of_the_rows():
    points, every = (runs("sensing", f"^str.* points: {x}") for x in ("(?!t)", "tog"))
    free, crowd = runs("discs"), runs("crowd", "(eth|hotel|zara01)$")
    dyna = runs("dynabarn", "reverse.* 1 m/s")
    end, tasks = runs("dynabarn", "end"), runs("maps")
    fast = runs("barn", "2 m/s: known")
    wood, mine = runs("sensing", "^forest as points: (?!tog)"), "astar+" + OURS
    view = hit(runs("sensing", "^forest.*view")[OURS])
    moving = [hit(dyna[x], "c") for x in (OURS, "nmpc", "mpc-cbf")]
    scans = runs("crowd", "LiDAR")
    most = [f(crowd[x]) for x in ("astar+mppi", OURS) for f in (won, hit)]
    quick = [ratio(fast[x], fast["mppi"]) for x in ("dijkstra", OURS)]
    disc = [ratio(free[x], free["mppi"]) for x in ("teb", OURS)]
    times = [ratio(tasks[x], tasks["astar+mppi"]) for x in ("astar+nmpc", mine)]
    for text in (
        f"in {rate(points[OURS])} % of 660 runs with {hit(points[OURS])} contacts",
        f"{both(points['eq5-tuned'])} contacts, MPC-CBF {both(points['mpc-cbf'])}",
        f"ORCA {both(points['orca'])}. Use",
        f"{both(every[OURS])} contacts of 60. ORCA has {both(every['orca'])} contacts",
        "TEB needs {} of MPPI's time among moving discs, ours {}".format(*disc),
        f"{hit(free['teb'], '/')} of 150 runs there, ours in {hit(free[OURS], '/')}.",
        f"each, ours {hit(dyna[OURS])}.",
        "begins {} contacts while it moves, NMPC {} and MPC-CBF {}".format(*moving),
        *(f"have {hit(dyna[x])} contacts each, ours" for x in ("nmpc", "mpc-cbf")),
        *(f"succeed in {rate(end[x])} %, ours in" for x in ("nmpc", "mpc-cbf")),
        f"{rate(end[OURS])} %. The test",
        f"{len(tasks[mine])} tasks ours begins {hit(tasks[mine], 'c')} contact",
        "NMPC needs {} of MPPI's time, ours {}".format(*times),
        "{} of 166 with {} contacts, ours in {} with {}".format(*most),
        f"a LiDAR MPPI succeeds in {won(scans['mppi'])}, ours in {won(scans[OURS])}",
        "path takes {} of MPPI's time, ours {}".format(*quick),
        f"{both(wood['vfh'])} contacts, ours {both(wood[OURS])}. {view} of",
    ):
        assert text in PAGE, text


def test_the_sentences_of_the_readme():
    text, best, pairs = " ".join(README.split()), defaultdict(int), []
    for place in rows.RANKINGS:
        found = runs(place.study, place.settings)
        pairs.append([found[place.before + x] for x in (OURS, "mppi")])
        for name in LABELS.values():
            best[name] += place.before + name in tables.compare(place).best["success"]
    ours, mppi = (sum(hit(x, "/") for x in y) for y in zip(*pairs, strict=True))
    assert f"in {ours} of 4,212 runs, MPPI in {mppi:,} of the same" in text
    ten = [hit(runs("crowdnav", "^10")[x]) for x in (OURS, "mppi")]
    assert f"contact in {ten[0]} of 500 runs, MPPI in {ten[1]}" in text
    assert sum(len(x) for x, _ in pairs) == 4212 and len(pairs) == 25
    assert f"In all {best[OURS]} sets of scenes" in text
    many = [best[x] for x in ("mpc-cbf", "mppi", "nmpc")]
    assert "MPC-CBF in {}, of MPPI in {} and of NMPC in {}.".format(*many) in text


def test_pages_are_as_written_and_short():
    pages = PAGE, README, CROWDS
    assert tuple(tables.filled(x, tables.tables()) for x in pages) == pages
    assert len(README.splitlines()) <= 150 and len(PAGE.splitlines()) <= 400
    assert len(PAGE.encode()) <= 40_000
    assert sum(path.stat().st_size for path in RESULTS.rglob("*.*")) <= 1_000_000


FILES = sorted((COMPARISONS / "studies").rglob("*.toml"))
DATA = {"barn", "barn_lidar", "barn_wheels", "crowd", "crowd_lidar", "dynabarn", "maps"}
METRICS = "astar", "qp-ahead+guide"
METHOD = {"maps": "astar", "noise": "vfh", "latency_tracks": "vfh"}
"""Whose first run is compared, if not ``alone``; other levels ran no such method."""


def told(path):
    """Study and level to which the head of a file adds its runs."""
    add = re.search(r'rows\.py \S+ (\w+)(?: --level "?([^"\n]+))?', path.read_text())
    return add[1], f": {add[2]}" if add[2] else ""


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_study_file_has_the_scenes_of_the_rows(path, request, monkeypatch):
    data = None
    if path.stem in DATA:
        data = str(request.getfixturevalue("data_folder"))
        monkeypatch.setenv("QPAVOID_DATA", data)
    study, (name, level) = read_study(path, data), told(path)
    kept = [place for place, _ in rows.read_cells(name)]
    mine = [(source, seed) for source, seeds in study.sources for seed in seeds]
    places = {(x.name + level, "" if k is None else str(k)) for x, k in mine}
    settings = {setting for setting, _ in places}
    assert places == {place for place in kept if place[0] in settings}
    assert str(path.relative_to(ROOT)) in path.read_text()


@pytest.mark.parametrize("name", ["discs", "discs_wheels", "fleet", "base", "noise"])
def test_its_first_run_is_that_of_the_rows(name):
    (path,) = (x for x in FILES if x.stem == name)
    if name == "discs_wheels":
        pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")
    study, level = told(path)
    method = METHOD.get(name, "alone")
    job = next(job for job in read_study(path).jobs() if job.controller == method)
    kept = dict(rows.read_cells(study))[job.source.name + level, str(job.seed)]
    row, _ = run_job(job)
    end = rows.cell_of(row).partition("/")[0]
    assert end == dict(kept)[method].partition("/")[0]


def test_the_runs_of_a_script_are_added(tmp_path, monkeypatch):
    monkeypatch.setattr(rows, "RESULTS", tmp_path / "results")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "costs.csv").write_text("study,setting,method,solve_us\n")
    rows.read_costs.cache_clear()
    columns = "method,setting,seed,outcome,success,contact," + ",".join(rows.NUMBERS)
    (tmp_path / "runs.csv").write_text(
        f"{columns}\nqp,5 people,0,arrived,True,False,9.50,0.2,0.3,0,8,12\n"
        "qp,5 people,1,touched,False,True,,-0.0123,0.3,1,10,14\n"
        "eq5,5 people,1,off goal,False,False,,,0.3,0,,\n"
    )
    rows.add(tmp_path, "people", "far")
    text = (tmp_path / "results" / "people.csv").read_text()
    assert text == "setting,scene,qp,eq5\n5 people: far,0,9.5\n,1,c/13,l\n"
    costs = (tmp_path / "results" / "costs.csv").read_text().splitlines()
    assert costs[1] == "people,5 people: far,qp,9,13"
    rows.read_costs.cache_clear()


def test_other_numbers_of_the_page_are_those_of_the_rows():
    page = (COMPARISONS / "README.md").read_text(encoding="utf-8")
    costs = rows.read_costs()
    metric = [costs["barn", "BARN, v <= 0.5 m/s: known", x][2] for x in METRICS]
    assert "metric of {:.3f}, ours {:.3f};".format(*metric) in page
    people = rows.chosen(next(x for x in rows.RANKINGS if "10 people" in x.title))
    ran = [len(people[x]) for x in ("nmpc", "teb", "mpc-cbf")]
    assert "NMPC ran {} of the 500 scenes, TEB and MPC-CBF {}.".format(*ran) in page
    discs = rows.read_runs("discs")
    won = {k for some in discs.values() for k, run in some.items() if not run.end}
    assert len({k for some in discs.values() for k in some} - won) == 2
    short = rows.chosen(next(x for x in rows.RANKINGS if "short" in x.title))
    ends = {k for some in short.values() for k in some}
    won = {k for some in short.values() for k, run in some.items() if not run.end}
    said = f"in {len(ends - won)} of its {len(ends)} episodes no method succeeds"
    assert said in page
    ours = [tables.costs(x, x.before + METRICS[1])[1] for x in rows.RANKINGS]
    assert f"{min(ours):.2f} to {max(ours):.0f} ms" in page
    assert max(x[1] for k, x in costs.items() if k[2] == "eq5" and x[1] == x[1]) < 40
