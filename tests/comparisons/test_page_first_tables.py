"""What the first tables, and what stands beside them, say; recomputed from the rows."""

import re
from collections import Counter, defaultdict
from itertools import chain

import numpy as np
import pytest

from page_rows import (
    CONTACTS,
    FEWER,
    PAGE,
    README,
    all_signs,
    by_cluster,
    family_of,
    first,
    gains,
    is_other,
    judged,
    judgement,
    ours_of,
    raised,
    runs,
    scenes_of,
    study_of,
    tables,
    widest,
    won,
)

PLANNERS = "mppi", "nmpc", "teb", "mpc-cbf"


def first_rows():
    """The rows of the first tables, each with its study and the ranking's title."""
    for row in chain(*tables(PAGE, "study")):
        study = re.search(r"\(#(\w+)\)", row["study"])[1]
        yield study, row["study"].partition("), ")[2], row


def test_the_first_tables_say_who_ran():
    for study, title, row in first_rows():
        others = [x for x in runs(study)[title] if is_other(x)]
        absent = {
            name
            for name in PLANNERS
            if others and not any(x.split("+")[-1] == name for x in others)
        }
        told = row["others"].replace("none of the four", " ".join(PLANNERS))
        count, led, *said = re.findall(
            r"[\w-]+", re.sub(r"^(\d+)\b(?! \+)", r"\1 + 0", told.replace("not", ""))
        )
        behind = [x for x in others if x.startswith(("astar", "dijkstra"))]
        counts = len(others) - len(behind), len(behind)
        assert ((int(count), int(led)), set(said)) == (counts, absent), study


def test_the_first_tables():
    """Their word is what p and sign say, and nobody in the column is better."""
    for study, title, row in first_rows():
        found = {k[1:]: v for k, v in judgement(study).items() if k[0] == title}
        for head, cell in row.items():
            quantity = head.partition(", ")[0]
            said = re.match(r"(\w+)\*\*: (.*?), `(.+?)(?:`(.*))?$", cell)
            if not said or quantity == "study":
                continue
            word, numbers, name, more = said.groups()
            more, *alike = (more or "").split("; level with ")
            assert not alike or word == "better"
            if word == "better":
                level = level_with(runs(study)[title], row["ours"], found, quantity)
                named = {x.strip("`") for some in alike for x in some.split(", ")}
                many = re.findall(r"^(\d+) others", "".join(alike))
                assert named == level if len(level) <= 4 else many == [f"{len(level)}"]
            some = (re.findall(r" in (\d+) scenes", more) or [None])[0]
            *equal, more = re.split(r" and (\d+) more", more)
            value, p = found[name, quantity]
            pool = standing_against(runs(study)[title], row["ours"], found, quantity)
            same = [found[m, quantity][0] for m in pool[word == "worse"]]
            ties = sum(abs(x - value) < 1e-9 for x in same) - 1
            assert [*map(int, equal[1:])] == [ties] * bool(ties), (study, title, head)
            sign = 1 if gains((title, name, quantity), widest(study)) else -1
            if not 0.045 < p < 0.055:
                assert word == {1: "better", -1: "worse"}[sign] if p < 0.05 else "level"
            names = row["ours"], name
            own, other = (runs(judged(study, title, name))[title][x] for x in names)
            both = own.keys() & other.keys()
            if quantity != "success":
                told = {len(both), *contacts_in(row, study, title)}
                elsewhere = told != {len(scenes_of(study, title))}
                assert some == (str(len(both)) if elsewhere else None)
            if quantity in FEWER:
                clear = beaten(runs(study)[title], found, quantity)
                assert word == "worse" or not clear
            if quantity == "time":
                assert first(numbers) == pytest.approx(value, abs=0.0051)
            elif quantity in CONTACTS:
                kinds = CONTACTS[quantity]
                hits = [
                    sum(x[k]["outcome"] in kinds for k in both) for x in (own, other)
                ]
                assert numbers == " / ".join(map(str, hits))
            elif quantity == "metric":
                for some, told in zip((own, other), numbers.split(" / "), strict=True):
                    known = [some[k]["metric"] for k in both if some[k]["metric"]]
                    mean = np.mean([float(x) for x in known])
                    assert float(told.split()[0]) == pytest.approx(mean, abs=6e-4)
            else:
                assert numbers == of_both(study, title, names)
                rest = [m for m in runs(study)[title] if is_other(m)]
                gained = {m: found[m, "success"] for m in rest}
                clear = [
                    m for m, (value, p) in gained.items() if value < 0 and p < 0.05
                ]
                level = in_many(runs(study)[title], row["ours"])
                assert gained[name][0] == min(gained[m][0] for m in clear or level)
                assert more == ahead(study, title, name)


def standing_against(methods, own, found, quantity):
    """Who may be named in a cell: of those in many scenes, and of whoever is clear."""
    some = [m for m in methods if is_other(m) and (m, quantity) in found]
    some = [m for m in some if quantity not in FEWER or often(methods, m)]
    many = in_many(methods, own)
    clear = [m for m in some if found[m, quantity][1] < 0.05]
    return [m for m in some if m in many], clear


def contacts_in(row, study, title):
    """Of how many scenes the contacts of a row are."""
    names = [re.search(r", `(.+?)`", x) for k, x in row.items() if k.startswith("cont")]
    for name in (x[1] for x in names if x):
        place = runs(judged(study, title, name))[title]
        yield len(place[name].keys() & place[row["ours"]].keys())


def in_many(methods, own):
    """The others that ran half as many scenes as ours, or as any of them."""
    ran = {m: len(some) for m, some in methods.items() if is_other(m)}
    return [m for m in ran if ran[m] >= min(len(methods[own]), max(ran.values())) / 2]


def level_with(methods, own, found, quantity):
    """With whom ours is level; of who succeeds as often, in contacts and time."""
    return {
        m
        for m in in_many(methods, own)
        if found.get((m, quantity), (0.0, 0.0))[1] >= 0.05
        if quantity not in FEWER or often(methods, m)
    }


def of_both(study, title, names):
    """Successes of two methods, of the scenes that both ran."""
    place = runs(judged(study, title, names[1]))[title]
    first, second = (place[name] for name in names)
    both = first.keys() & second.keys()
    return " / ".join(
        f"{sum(won(x[k]) for k in both)} of {len(both)}" for x in (first, second)
    )


def ahead(study, title, named):
    """What is said of who succeeds most often, where that is more and not clear."""
    rest = [m for m in runs(study)[title] if is_other(m)]
    gained = {m: widest(study)[title, m, "success"][0] for m in rest}
    most = min(rest, key=lambda m: (gained[m], m != named))
    value, p = widest(study)[title, most, "success"]
    if value >= 0 or judgement(study)[title, most, "success"][1] < 0.05:
        return ""
    told = of_both(study, title, (ours_of(study, title), most))
    who = f"; level: {told}, `{most}`" * (most != named)
    return f"{who} (p {'< 0.001' if p < 1e-3 else f'{p:.3f}'} by itself)"


def often(methods, name):
    """Whether a method succeeds about as often as the best."""
    rates = {m: np.mean([won(x) for x in some.values()]) for m, some in methods.items()}
    return rates[name] >= 0.8 * max(rates.values())


def beaten(methods, found, key):
    """By whom ours is clearly, of those that succeed about as often as the best."""
    return [
        name
        for (name, quantity), (value, p) in found.items()
        if quantity == key and value > (key == "time") and p < 0.045
        if is_other(name) and often(methods, name)
    ]


WORDS = "worse", "level", "better"


def word_of(row, quantity):
    """The place of a row's word among these; 3 where there is none."""
    (cell,) = (x for head, x in row.items() if head.partition(", ")[0] == quantity)
    return next((k for k, word in enumerate(WORDS) if cell.startswith(word)), 3)


def counted(row):
    """Whose runs a study repeats, with which it is counted."""
    return {"sensing_together": "sensing"}.get(study_of(row), study_of(row))


def behind(row):
    """By how many points less often ours succeeds than any other, below 0, or 0."""
    ranking = re.search(r"#(\w+)\)", row["study"])[1], row["study"].partition("), ")[2]
    gains = (
        x[0]
        for key, x in widest(ranking[0]).items()
        if key[0] == ranking[1]
        if key[2] == "success" and is_other(key[1])
    )
    return round(min(0.0, *gains), 6)


def test_the_readme_counts_what_the_tables_say():
    """Of a study the worst word of all its rankings, column by column."""
    text = README.split("<!-- comparisons -->")
    (shown,) = tables(text[1].split("<!-- end -->")[0], "study")
    rows = [*chain(*tables(PAGE, "study"))]
    names = {counted(row) for row in rows}
    assert [counted(row) for row in shown] == list(dict.fromkeys(map(counted, rows)))
    worst = {
        quantity: Counter(
            min(word_of(row, quantity) for row in rows if counted(row) == name)
            for name in names
        )
        for quantity in ("success", *CONTACTS, "time")
    }
    level = [x for x in shown if behind(x) and word_of(x, "success")]
    every = [x for x in rows if behind(x) and word_of(x, "success")]
    text = text[1].partition("\n\n")[2].partition("One at a time")[0]
    told = [int(word) for word in re.findall(r"\w+", text) if word.isdigit()]
    success, *rest = ([of[k] for k in (2, 1, 0)] for of in worst.values())
    head = next(head for head in shown[0] if head.startswith("success"))
    best = [x for x in shown if word_of(x, "success") == 2]
    alone = sum("level with" not in x[head] for x in best)
    assert told[:4] == [success[0], len(names), alone, success[1]]
    assert told[4:8] == [success[2], len(level), len(every), len(rows)]
    assert told[8] == sum(at_the_top(x) for x in shown)
    assert told[9:] == [*chain(*rest)]


def at_the_top(row):
    """Whether one who never fails would have no clear p, in ours' most scenes."""
    study, title = study_of(row), row["study"].partition("), ")[2]
    name = ours_of(study, title)
    place = judged(study, title, name)
    lost = {k: 1.0 for k, x in runs(place)[title][name].items() if not won(x)}
    sums = by_cluster(place, lost)
    tests = sorted(
        p
        for key, (_, p) in widest(study).items()
        if key[2] == "success" and family_of(study, *key[:2]) == (True, True)
    )
    tests[-1] = all_signs(sums) if len(sums) else 1.0
    mine = tests[-1]
    steps = [p * (len(tests) - k) for k, p in enumerate(sorted(tests)) if p <= mine]
    return max(steps) >= 0.05


def test_ours_against_one_other_method_at_a_time():
    """In every ranking of the first two tables, by sign and p recomputed."""
    counts, unsure = defaultdict(Counter), defaultdict(Counter)
    ran, sizes = Counter(), defaultdict(list)
    for row in chain(*tables(PAGE, "study")):
        study, title = study_of(row), row["study"].partition("), ")[2]
        if study == "encounters":
            continue
        before = "astar+" if row["ours"].startswith("astar+") else ""
        twice = study == "sensing_together" and title.endswith(": base")
        there = runs("sensing")[title.removesuffix(": base")] if twice else ()
        for name in filter(is_other, runs(study)[title]):
            if name in there:
                continue  # these scenes are among those of sensing
            if before and not name.startswith(("astar", "dijkstra")):
                continue
            other = name.removeprefix(before)
            ran[other] += 1
            of = runs(judged(study, title, name))[title]
            sizes[other].append(len(of[name].keys() & of[row["ours"]].keys()))
            for quantity in "success", "contacts", "time":
                key = title, name, quantity
                p = judgement(study).get(key, (0.0, 1.0))[1]
                if p < 0.055:
                    word = "better" if gains(key, widest(study)) else "worse"
                    counts[other][f"{quantity}: {word}"] += p < 0.05
                    unsure[other][f"{quantity}: {word}"] += p > 0.045
    (rows,) = tables(PAGE, "ours against")
    assert {row["ours against"] for row in rows} == {x for x in ran if ran[x] >= 3}
    for row in rows:
        name = row["ours against"]
        assert int(row["rankings"]) == ran[name]
        middle = float(np.median(sizes[name]))
        assert float(row["median scenes"]) == pytest.approx(middle, abs=0.51)
        for head in row.keys() - {"ours against", "rankings", "median scenes"}:
            if "level" not in head:
                off = abs(int(row[head]) - counts[name][head])
                assert off <= unsure[name][head], (name, head)
    told = README.split("One at a time, ")[1].split(".\n")[0].partition("worse than")
    for name, better, of in re.findall(r"`(\S+)` in (\d+) of (\d+)", told[0]):
        known = counts[name]["success: better"], ran[name]
        assert (int(better), int(of)) == known
    worse = {name: of["success: worse"] for name, of in counts.items()}
    said = {k: int(n) for k, n in re.findall(r"`(\S+)` in (\d+)", told[2])}
    assert said == {name: n for name, n in worse.items() if n}


def test_what_ours_loses_comes_first_each_with_its_why():
    first, more = tables(PAGE, "study")
    lost, orders = [], []
    for row in first + more:
        cells = {head.partition(", ")[0]: cell for head, cell in row.items()}
        keys = [key for key, cell in cells.items() if "worse**" in cell]
        if "success" not in keys:
            keys += ["success (level)"] * (behind(row) < 0.0)
        study, title = study_of(row), row["study"].partition("), ")[2]
        for key in (*CONTACTS, "time", "metric"):
            against = [
                place
                for place, (_, p) in widest(study).items()
                if place[0] == title and place[2] == key and is_other(place[1])
                if key == "metric" or often(runs(study)[title], place[1])
                if p < 0.05 and not gains(place, widest(study))
            ]
            if against and key not in keys:
                keys.append(f"{key} (level)")
        lost += [(row["study"], keys)] if keys else []
        words = [word_of(row, key) for key in (*CONTACTS, "time", "metric")]
        orders.append((word_of(row, "success"), behind(row), *words))
    ahead, rest = orders[: len(first)], orders[len(first) :]
    assert ahead == sorted(ahead) and rest == sorted(rest)
    names = [counted(row) for row in first]
    assert len(set(names)) == len(names)
    for row, order in zip(more, rest, strict=True):
        assert ahead[names.index(counted(row))] <= order
    listed = PAGE.split("![")[0].split("- Clearly quicker")[0]
    lines = re.findall(r"^- (\[.*?): ([a-z, ()]+)\. (.+)$", listed, re.M)
    told = [(x, keys.split(", ")) for many, keys, _ in lines for x in many.split("; ")]
    assert sorted(told) == sorted(lost) and told[0] == lost[0]
    assert all(len(why) > 20 and "not looked at" not in why for *_, why in lines)


def test_what_is_told_of_who_is_not_named():
    """Who is clearly best, but succeeds seldom; who is level for its company."""
    heads = "Clearly quicker", "Clearly fewer contacts", "Level for all that a study"
    listed = [re.search(rf"^- {head}.*?: (.*)\.$", PAGE, re.M)[1] for head in heads]
    rarely, alone = {"time": [], "contacts": []}, []
    for row in chain(*tables(PAGE, "study")):
        study, title = study_of(row), row["study"].partition("), ")[2]
        found, methods = judgement(study), runs(study)[title]
        others = [k for k in found if k[0] == title and is_other(k[1])]
        for quantity, told in rarely.items():
            rare = {
                k[1]: found[k][0]
                for k in others
                if k[2] == quantity and not often(methods, k[1])
                if found[k][1] < 0.05 and not gains(k, found)
            }
            if rare:
                name = max(rare, key=rare.get)
                some = runs(judged(study, title, name))[title][name].values()
                count = f"{sum(map(won, some))} of {len(some)}"
                times = f"{rare[name]:.2f}" * (quantity == "time")
                told.append((row["study"], name, count, times))
        kinds = defaultdict(list)
        for key in others:
            kinds[family_of(study, *key[:2]), key[2]].append(key)
        for keys in kinds.values():
            for key, p in raised(widest(study), keys).items():
                if not gains(key, found) and p < 0.05 <= found[key][1]:
                    alone.append((row["study"], *key[1:]))
    told = re.findall(r"(\[.*?): `(.+?)` \((.+?); .*?([\d.]+) times.*?\)", listed[0])
    assert sorted(told) == sorted(rarely["time"])
    told = re.findall(r"(\[.*?): `(.+?)` \((.+?); .*?()\)(?:; |$)", listed[1])
    assert sorted(told) == sorted(rarely["contacts"])
    told = [
        re.match(r"(.*?): `(.+?)` in (.*)", x).groups() for x in listed[2].split("; ")
    ]
    assert sorted(told) == sorted(alone)
