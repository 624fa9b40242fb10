"""The numbers in the page's sentences, recomputed from the rows."""

import csv
import re
import tomllib
from collections import Counter
from itertools import chain

import numpy as np
import pytest

from page_rows import (
    ASIDE,
    PAGE,
    RANKED,
    README,
    SENTENCES,
    judged,
    judgement,
    ours_of,
    ratios,
    raw,
    room_of,
    runs,
    scenes_of,
    study_of,
    tables,
    time_of,
    widest,
    won,
)
from places import COMPARISONS
from qpavoid import Robot
from qpavoid.lab.baselines.discs import body_discs

FILLED = r"\{((?:[^{}]+\|)?(?:[^{}|]+ [a-z]+|scenes))\}"  # not the v_{k+1} of a formula
QUANTITIES = {
    "ran": len,
    "won": lambda rows: sum(map(won, rows)),
    "moving": lambda rows: sum(row["outcome"] == "contact" for row in rows),
    "standing": lambda rows: sum(row["outcome"] == "contact_standing" for row in rows),
    "stalled": lambda rows: sum(row["outcome"] == "stalled" for row in rows),
    "late": lambda rows: sum(row["outcome"] == "late" for row in rows),
    "below": lambda rows: sum(float(row["min_room_m"] or 0) < -1e-3 for row in rows),
    "nearer": lambda rows: f"{-100 * min(map(room_of, rows)):.0f}",
    "median": lambda rows: f"{np.median([*map(time_of, filter(won, rows))]):.1f}",
    "metric": lambda rows: f"{np.mean([float(row['metric']) for row in rows]):.3f}",
}


def number_of(key, study, title):
    """A number of a sentence: of this ranking, or of the place that it names."""
    *places, key = key.split("|")
    if places and places[0].startswith("#"):
        study, title = places.pop(0)[1:], None
    title = places[0] if places else title
    shown = runs(study)
    title = next(iter(shown)) if title is None else title
    at = next((x for x in shown if x == title), None)
    inside = {x for x in shown for of in shown[x].values() for k in of if k[0] == title}
    at, only = (at, None) if at is not None else (*inside, title)
    if key == "scenes":
        return len(scenes_of(study, at))
    key, *other = re.split(" where (.+) ran$", key)[:2]
    name, _, quantity = key.rpartition(" ")
    name = ours_of(study, at) if name == "ours" else name
    if quantity == "times":
        return f"{ratio_of(study, at, name, only):.2f}"
    if quantity in ("p", "single"):
        of = judgement if quantity == "p" else widest
        p = of(study)[at, name, "success"][1]
        return "< 0.001" if p < 1e-3 else f"{p:.3f}"
    own = {k: x for k, x in shown[at][name].items() if only in (None, k[0])}
    for one in other:
        own = {k: x for k, x in own.items() if k in shown[at][one]}
    return QUANTITIES[quantity]([*own.values()])


def ratio_of(study, title, name, setting=None):
    """How many times as long ours takes where both succeed, of most scenes."""
    place = study if setting else judged(study, title, name)
    first, second = (runs(place)[title][x] for x in (ours_of(study, title), name))
    logs = ratios(first, second).items()
    return np.exp(np.mean([x for k, x in logs if setting in (None, k[0])]))


def filled(text, study=None, title=None):
    told = re.sub(FILLED, lambda x: str(number_of(x[1], study, title)), text)
    return " ".join(told.split())


def test_numbers_in_sentences_are_those_of_the_tables():
    page, count = " ".join(PAGE.split()), 0
    texts = [(text, None, [None]) for text in SENTENCES["page"].values()]
    for study, said in SENTENCES["study"].items():
        texts += [
            (said.get(key, ""), study, [None]) for key in ("asks", "why", "limits")
        ]
        loses = said.get("loses", "")
        if isinstance(loses, dict):
            texts += [(text, study, [title]) for title, text in loses.items()]
        elif loses:
            texts.append((loses, study, [*runs(study)]))
    for text, study, places in texts:
        if found := re.findall(FILLED, text):
            told = [filled(text, study, title) for title in places]
            assert any(x in page for x in told), (study, told)
            count += len(found)
    assert count > 150 and not re.findall(FILLED, PAGE)


def test_the_readme_says_what_tracks_are_worth():
    ours, eq5 = "qp-ahead+guide", "eq5-tuned"

    def won_and_ran(study, setting, method):
        some = runs(study)[f"strangers as {setting}"][method].values()
        return sum(map(won, some)), len(some)

    base = [
        won_and_ran("sensing_together", f"{seen}: base", method)[0]
        for method, seen in (
            (ours, "tracks"), ("mppi", "tracks"), (ours, "points"), (eq5, "points"),
        )
    ]  # fmt: skip
    together = [
        count
        for seen in ("tracks", "points")
        for count in won_and_ran("sensing_more", f"{seen}: together all", ours)
    ]
    said = (
        "`tracks`: {} of 60 arrive, MPPI's {}; with points {}, Eq. 5 as tuned {}; "
        "all bad at once, in more scenes, {} of {} as tracks and {} of {} as points"
    ).format(*base, *together)
    assert said in " ".join(README.split())


def test_which_method_says_what_points_cost():
    text = (COMPARISONS.parent / "docs" / "which-method.md").read_text()
    methods = "qp-ahead+guide", "mpc-cbf", "orca", "eq5-tuned"
    of = runs("sensing")["strangers as points"]
    hits = [sum(x["outcome"][:7] == "contact" for x in of[m].values()) for m in methods]
    wins = [sum(map(won, of[m].values())) for m in methods]
    said = (
        "of {} runs ours succeeds in {} and touches or is touched in {}, MPC-CBF in {} "
        "and {}, ORCA in {} and {}, in 1.4 times the time, Eq. 5 as tuned in {} and {} "
    )
    pairs = zip(wins, hits, strict=True)
    assert said.format(len(of["orca"]), *chain(*pairs)) in text
    value, _ = raw("sensing")["strangers as points", "orca", "time"]
    assert 1.0 / value == pytest.approx(1.4, abs=0.05)
    counts = {
        setting: [sum(map(won, some[method].values())) for method in methods]
        for setting, some in runs("sensing_together").items()
    }
    said = "with all at once {}, {}, {} and {} of 60."
    assert said.format(*counts["strangers as points: together all"]) in text
    said = (
        "In forests it is {}, {}, {} and {} of 60, with all at once {}, {}, {} and {} |"
    )
    forests = (counts[f"forest as points: {x}"] for x in ("base", "together all"))
    assert said.format(*chain(*forests)) in text


def test_what_the_text_says_of_the_first_scenes_of_more():
    some = runs("sensing_more")["strangers as tracks: together all"]["qp-ahead+guide"]
    first = [run for (_, scene), run in some.items() if int(scene) < 110]
    assert f"of the first {len(first)} {sum(map(won, first))})" in " ".join(
        PAGE.split()
    )


def test_the_yard_of_the_search_is_that_of_its_record():
    """By loss; ours, of which what was found is not driven, as it was before."""
    path = COMPARISONS / "results" / "tuned.toml"
    found = {k: x["all_kinds"] for k, x in tomllib.loads(path.read_text()).items()
             if "all_kinds" in x}  # fmt: skip
    shown = re.search(r"^- By our own loss.*?: (.*)\.$", PAGE, re.M)[1]
    told = re.findall(r"`(.+?)` ([\d.]+) \(([\d.]+) \+ ([\d.]+) %\)", shown)
    rows = [(float(loss), name) for name, loss, *_ in told]
    assert rows == sorted(rows) and len(rows) == len(found)
    for name, *numbers in told:
        ours = name == "qp-ahead+guide"
        of = found["guide"]["before"] if ours else found[name]["after"]
        known = of["loss"], 100.0 * of["failure"], 100.0 * of["contact"]
        assert [*map(float, numbers)] == pytest.approx(known, abs=6e-4)


def test_who_stalls_behind_a_planner_in_forests():
    behind = {m: x.values() for m, x in runs("forest")[""].items() if m[:6] == "astar+"}
    stalls = {m[6:].upper() for m, some in behind.items() if not all(map(won, some))}
    assert f"all arrive but {' and '.join(sorted(stalls))}, which stall" in PAGE
    assert {x["outcome"] for some in behind.values() for x in some} == {
        "success",
        "stalled",
    }


def test_the_rerun_is_what_its_rows_say():
    path = COMPARISONS / "results" / "rerun" / "rows.csv"
    rows = list(csv.DictReader(path.read_text().splitlines()))
    agree = [row for row in rows if not row["what"]]
    assert f"Of {len(rows)} random rows" in PAGE and len(rows) >= 100
    assert f"**{len(agree)} agree**" in PAGE
    for row in rows:
        differs = f"- `{row['study']}`, `{row['method']}`"
        assert bool(row["what"]) <= (differs in PAGE)


def test_what_a_planner_adds():
    """Successes in the scenes in which a method ran both alone and behind A*."""
    (rows,) = tables(PAGE, "ranking")
    for row in rows:
        study, title = study_of({"study": row["ranking"]}), row["ranking"]
        ran = runs(study)[title.partition("), ")[2]]
        ways = {name: f"astar+{name}" for name in ran} | {"alone": "astar"}
        pairs = {name for name in ways if name in ran and ways[name] in ran}
        heads, signs = ("more", "as many", "fewer"), Counter()
        assert {x for x in row if row[x] != "–"} - {"ranking", *heads} == pairs
        for name in pairs:
            alone, led = ran[name], ran[ways[name]]
            both = alone.keys() & led.keys()
            first, second = (sum(won(of[x]) for x in both) for of in (alone, led))
            assert row[name] == f"{first} → {second} of {len(both)}"
            if name != "alone":
                signs[heads[int(np.sign(first - second)) + 1]] += 1
        assert [int(row[x]) for x in heads] == [signs[x] for x in heads]
    shown = {study_of({"study": row["ranking"]}) for row in rows}
    assert shown == {
        study
        for study in {*RANKED} - ASIDE
        for ran in runs(study).values()
        if any(f"astar+{name}" in ran for name in ran) or {"alone", "astar"} <= {*ran}
    }


def test_what_methods_take_the_robot_for_in_metres():
    """About which point what radius holds the polygon, by its corners."""
    robot = Robot.mir100()
    x, y = robot.footprint.vertices.T
    around = {ahead: np.hypot(x - ahead, y).max() for ahead in (0.2, 0.3)}
    said = f"{around[0.3]:.2f} and {around[0.2]:.2f} m for the MiR100"
    front, rear = (radius for _, radius in body_discs(robot, 2)[::-1])
    said_too = f"two discs, of {rear:.2f} and {front:.2f} m"
    inner = robot.footprint.edges[:, :2] * robot.footprint.edges[:, 2:4]
    circle = 0.75 * np.hypot(x, y).max() + 0.25 * inner.sum(axis=1).min() + 0.05
    assert all(x in PAGE for x in (said, said_too, f"middle of {circle:.2f} m, 0.05"))
    assert np.hypot(x, y).max() > circle
    space = tomllib.loads((COMPARISONS / "results" / "tuned.toml").read_text())
    best = {name: space[name]["all_kinds"]["best"] for name in ("orca", "c3bf", "vfh")}
    assert [best[name]["ahead"] for name in ("orca", "c3bf")] == [0.3, 0.2]
    assert best["vfh"]["radius"] == 0.75
