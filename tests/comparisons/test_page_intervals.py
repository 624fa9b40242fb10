"""The page's intervals, solve times and further columns, recomputed from the rows.

Bootstrap with other draws, the design effect and Wilson's bounds by other formulas.
"""

import csv
import re
from functools import cache
from itertools import chain

import numpy as np
import pytest
from scipy.stats import t as student

from page_rows import (
    COMPARISONS,
    LISTED,
    PAGE,
    RANKED,
    REPEATED,
    SENTENCES,
    by_cluster,
    judged,
    ours_of,
    ratios,
    runs,
    scored,
    sections,
    study_of,
    tables,
    tables_of,
    time_of,
    won,
)

DRAWS = 4_000
AROUND = ((0.015, 0.037), (0.963, 0.985))  # of 2.5 and 97.5 %, for two sets of draws


@cache
def drawn(clusters):
    rng = np.random.default_rng(20261128)
    return rng.multinomial(clusters, np.full(clusters, 1.0 / clusters), DRAWS)


def bounds(study, values):
    """Between which numbers each bound of the mean of values by scene has to lie."""
    each = np.array(by_cluster(study, values))
    many = np.array(by_cluster(study, dict.fromkeys(values, 1.0)))
    often = drawn(len(each))
    means = (often @ each) / (often @ many)
    return [tuple(np.quantile(means, pair)) for pair in AROUND]


def numbers_in(cell):
    return [float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", cell.replace(",", ""))]


def fits(shown, between, digits):
    """Whether both bounds of a cell lie where they have to."""
    _, *told = numbers_in(shown)
    for bound, (low, high) in zip(told, between, strict=True):
        assert low - digits <= bound <= high + digits, (shown, between)


@pytest.mark.parametrize("study", RANKED)
def test_intervals_of_differences(study):
    for title, methods in runs(study).items():
        own = methods.get(ours_of(study, title), {})
        for line in tables_of(study, title)[0]:
            name = line["ours less"]
            both = [x for x in own if x in methods[name]]
            head = "success, points (95 %)"
            if line[head] != "0, nowhere different":
                less = {x: won(own[x]) - won(methods[name][x]) for x in both}
                less = {x: 100.0 * value for x, value in less.items()}
                fits(line[head], bounds(study, less), 0.051)
            head = "time, ours / theirs (95 %)"
            if line[head] != "–":
                found = bounds(study, ratios(own, methods[name]))
                fits(line[head], [np.exp(pair) for pair in found], 0.0051)
            head = "metric (95 %)"
            if line.get(head, "–") != "–":
                less = scored(own, methods[name])
                fits(line[head], bounds(study, less), 0.00051)


def shares(study, some):
    """The bounds of a share: Wilson's, with n over the design effect."""
    hits = {x: float(won(run)) for x, run in some.items()}
    n, p = len(hits), sum(hits.values()) / len(hits)
    k = len(by_cluster(study, hits))
    n_eff = k
    if 0.0 < p < 1.0 and k > 1:
        off = by_cluster(study, {x: hit - p for x, hit in hits.items()})
        variance = k / (k - 1) * sum(x * x for x in off) / n**2
        effect = max(1.0, variance * (n - 1) / (p * (1.0 - p)))
        wider = student.ppf(0.975, k - 1) / student.ppf(0.975, n - 1)
        n_eff = n / effect / wider**2
    z2 = 1.959963984540054**2 / n_eff  # |p - x| = z sqrt(x (1 - x) / n) at both ends x
    return [float(x.real) for x in sorted(np.roots([1 + z2, -2 * p - z2, p * p]))]


@pytest.mark.parametrize("study", sorted(REPEATED & {*LISTED}))
def test_intervals_of_shares_where_scenes_repeat(study):
    for title, methods in runs(study).items():
        for row in tables_of(study, title)[1]:
            _, *told = numbers_in(row["% (95 %)"])
            ends = [100.0 * x for x in shares(study, methods[row["method"]])]
            assert told == pytest.approx(ends, abs=0.051), (title, row["method"])


def test_where_intervals_are_wide_is_said():
    """Of NMPC, MPPI and ours, in the ranking with most of their scenes."""
    lines = PAGE.split('<a id="more-scenes"></a>')[1].split("\n- ")[1:4]
    rows = [*chain(*tables(PAGE, "study"))]
    for line, name in zip(lines, ("nmpc", "mppi", ""), strict=True):
        told, found = {}, {}
        line = line.partition(" Behind A*")[0].partition("It did not run")[0]
        for title, *numbers in re.findall(
            r"(\[[^;]*?): ± ([\d.]+) \((\d+) runs, (\d+) wanted", line
        ):
            told[title] = numbers
        for row in rows:
            study, title = study_of(row), row["study"].partition("), ")[2]
            mine = "astar+" * row["ours"].startswith("astar+") + name
            mine = mine if name else row["ours"]
            if mine in runs(study)[title]:
                place = judged(study, title, mine)
                some = runs(place)[title][mine]
                low, high = shares(place, some)
                if high - low > 0.1:
                    half = 50.0 * (high - low)
                    found[row["study"]] = half, len(some), len(some) * (half / 5.0) ** 2
        assert told.keys() == found.keys()
        for title, (half, ran, wanted) in found.items():
            shown = [float(x) for x in told[title]]
            assert shown == pytest.approx([half, ran, wanted], abs=0.51), title


def of_blocks(mine, key):
    """A column of which a method's setting has one value, or each run its own."""
    each = [(x[0], float(run[key])) for x, run in mine.items() if run.get(key)]
    blocks = dict(each)
    if len(each) > len(blocks):
        return [value for _, value in each]
    return [blocks[setting] for setting, _ in mine if setting in blocks]


@pytest.mark.parametrize("study", LISTED)
def test_solve_times_metrics_and_ratios(study):
    for title, methods in runs(study).items():
        for row in tables_of(study, title)[1]:
            mine = methods[row["method"]]
            if row.get("solve µs", "–") != "–":
                keys = "solve_us", "solve_p99_us"
                told = [float(x) for x in row["solve µs"].split(" / ")]
                known = [of_blocks(mine, key) for key in keys]
                found = [float(np.median(x)) for x in known if x]
                assert told == pytest.approx(found, rel=6e-3, abs=0.51)
            for head in row:
                if not head.startswith("metric ") or head == "metric possible":
                    continue
                known = of_blocks(mine, head.replace(" ", "_"))
                if row[head] != "–":  # how many of a block had none is not kept
                    assert float(row[head]) == pytest.approx(np.mean(known), abs=2e-3)
            head = next((x for x in row if x.startswith("time / ")), "")
            if "(" in row.get(head, "–"):
                yard = methods[head.split("`")[1]]
                found = bounds(study, ratios(mine, yard))
                fits(row[head], [np.exp(pair) for pair in found], 0.0051)


SINGLE = "paper", "outlook_paper"
ENDS = {"contact": "contact moving", "contact_standing": "contact standing"}
ENDS |= {"stalled": "stood still"}


@pytest.mark.parametrize("study", SINGLE)
def test_single_runs_are_as_they_were_left(study):
    for title, methods in runs(study).items():
        text = sections()[study].split(f"### {title}\n")[1].split("\n### ")[0]
        (rows,) = tables(text, "method")
        assert {row["method"] for row in rows} == methods.keys()
        for row in rows:
            (run,) = methods[row["method"]].values()
            end = run["outcome"]
            assert row["outcome"] == ENDS.get(end, end)
            if end == "success":
                assert float(row["time s"]) == pytest.approx(time_of(run), abs=0.0051)
            for head, key in (("least room m", "min_room_m"), ("metric", "metric")):
                if row.get(head, "–") != "–":
                    told = pytest.approx(float(run[key]), rel=0.01, abs=6e-4)
                    assert float(row[head]) == told


LEFT = {path.stem for path in (COMPARISONS / "results").glob("*.csv")}
LEFT = sorted(LEFT & sections().keys() - {*LISTED, *SINGLE})


@pytest.mark.parametrize("study", LEFT)
def test_tables_that_are_no_rankings_are_as_they_were_left(study):
    with (COMPARISONS / "results" / f"{study}.csv").open() as file:
        rows = list(csv.DictReader(file, restval=""))
    columns = SENTENCES["study"].get(study, {}).get("columns")
    columns = columns or {key: key for key in rows[0] if key != "study"}
    (shown,) = tables(sections()[study], next(iter(columns.values())))
    assert [[row[x] for x in columns.values()] for row in shown] == [
        [row[x].strip() or "–" for x in columns] for row in rows
    ]
