"""What the page's tables say of all studies, recomputed from the rows."""

import math
import re
from collections import Counter
from itertools import chain, combinations

import numpy as np
import pytest

from page_rows import (
    ASIDE,
    CONTACTS,
    LISTED,
    RANKED,
    REPEATED,
    SENTENCES,
    expected,
    first,
    ours_of,
    ratios,
    raw,
    room_of,
    runs,
    scenes_of,
    sections,
    tables,
    tables_of,
    won,
)


def same_p(shown, p):
    """Equal but for rounding; on the same side of 0.05 unless that decides."""
    if shown == "< 0.001":
        return p < 2e-3
    clear = not 0.045 < p < 0.055
    side = (float(shown) < 0.05) == (p < 0.05)
    return float(shown) == pytest.approx(p, rel=0.5, abs=0.03) and (side or not clear)


def both_p(shown, p, single):
    """Holm's p, and the one by itself where only that is below 0.05."""
    told = shown.rstrip(")").split(" (")
    for text, known in zip(told, (p, single), strict=False):
        assert same_p(text, known), (shown, p, single)
    if not 0.045 < p < 0.055 and not 0.045 < single < 0.055:
        assert len(told) == 1 + (single < 0.05 <= p), (shown, p, single)


@pytest.mark.parametrize("study", LISTED)
def test_rankings(study):
    for title, methods in runs(study).items():
        _, ranking = tables_of(study, title)
        assert {row["method"] for row in ranking} == {m for m in methods if methods[m]}
        for row in ranking:
            ends = Counter(run["outcome"] for run in methods[row["method"]].values())
            assert row["success"] == f"{ends['success']} of {ends.total()}"
            assert row["contact moving"] == str(ends["contact"])
            assert row["contact standing"] == str(ends["contact_standing"])


def ends_of(study):
    """How each run ended, by method, setting and scene; DynaBARN's by nine times."""
    found = {}
    every = chain.from_iterable(of.items() for of in runs(study).values())
    for name, of in every:
        for (setting, scene), run in of.items():
            if study in ("dynabarn", "dynabarn_end"):
                world, phase = divmod(int(scene), 3)
                scene = str(9 * world + 3 * phase)
            ends = run["outcome"], run["arrived_s"], run["min_room_m"]
            found[name, setting, scene] = ends
    return found


SENSING = "sensing", "sensing_together", "sensing_levels", "sensing_more"
AGAIN = {(x, said["more"]) for x, said in SENTENCES["study"].items() if "more" in said}
AGAIN |= {*combinations(SENSING, 2), ("crowd", "crowd_all")}


@pytest.mark.parametrize(("study", "other"), sorted(AGAIN))
def test_a_run_that_stands_in_two_tables_is_the_same(study, other):
    first, second = ends_of(study), ends_of(other)
    both = first.keys() & second.keys()
    assert len(both) >= 20
    assert not {
        key: (first[key], second[key]) for key in both if first[key] != second[key]
    }


@pytest.mark.parametrize("study", LISTED)
def test_columns_of_rankings(study):
    """Wilson's bounds where no scene repeats, room, times and mean metrics."""
    alone = study not in REPEATED
    for title, methods in runs(study).items():
        for row in tables_of(study, title)[1]:
            some = [*methods[row["method"]].values()]
            rooms = [float(run["min_room_m"]) for run in some if run["min_room_m"]]
            times = [float(run["arrived_s"]) for run in some if won(run)]
            shown = {key: row.get(key, "–") for key in ("least room m", "metric")}
            if row.get("metric possible", "–") != "–":
                known = [won(run) for run in some if run["metric_possible"]]
                assert float(row["metric possible"]) == pytest.approx(
                    np.mean(known), abs=6e-4
                )
            if shown["least room m"] != "–":
                assert float(shown["least room m"]) == pytest.approx(
                    min(rooms), abs=6e-4
                )
            if "below r_min" in row:
                assert int(row["below r_min"]) == sum(room < -1e-3 for room in rooms)
            if times:
                median = float(np.median(times))
                assert float(row["median time s"]) == pytest.approx(median, abs=0.051)
            if shown["metric"] != "–":
                found = np.mean([float(run["metric"]) for run in some if run["metric"]])
                assert float(shown["metric"]) == pytest.approx(found, abs=6e-4)
            if alone:
                _, *told = map(float, re.findall(r"[\d.]+", row["% (95 %)"]))
                # Wilson: |p - x| = z sqrt(x (1 - x) / n) at both ends x
                z2, n, p = 1.959963984540054**2, len(some), len(times) / len(some)
                ends = np.roots([1 + z2 / n, -2 * p - z2 / n, p * p])
                assert told == pytest.approx(sorted(100.0 * ends), abs=0.051)


@pytest.mark.parametrize("study", LISTED)
def test_more_columns_of_rankings(study):
    """How runs end, what success in encounters asks for, ratios of times, jerk."""
    for title, methods in runs(study).items():
        for row in tables_of(study, title)[1]:
            mine = methods[row["method"]]
            some = [*mine.values()]
            ends = Counter(run["outcome"] for run in some)
            assert int(row["late"]) == ends["late"]
            assert int(row["stood still"]) == ends["stalled"]
            if "contact-free" in row:
                hit = ends["contact"] + ends["contact_standing"]
                near = sum(room_of(run) < -1e-3 for run in some)
                back = sum(bool(run["arrived_s"]) for run in some)
                told = [row[x] for x in ("contact-free", "r_min kept", "returned")]
                assert told == [str(len(some) - hit), str(len(some) - near), str(back)]
            head = next((x for x in row if x.startswith("time / ")), "")
            if row.get(head, "–") != "–":
                logs = ratios(mine, methods[head.split("`")[1]]).values()
                assert first(row[head]) == pytest.approx(
                    math.exp(np.mean([*logs])), abs=0.0051
                )
            blocks = {x[0]: run["jerk_mps3"] for x, run in mine.items()}
            blocks |= {
                x[0]: run["jerk_mps3"] for x, run in mine.items() if run["jerk_mps3"]
            }
            jerks = [float(blocks[x[0]]) for x in mine if blocks[x[0]]]
            if row.get("jerk m/s³", "–") != "–":
                told = float(row["jerk m/s³"])
                assert told == pytest.approx(np.mean(jerks), rel=6e-3)


@pytest.mark.parametrize("study", RANKED)
def test_who_begins_fewer_contacts(study):
    """Counted in the scenes of both, which is said where they are fewer."""
    for title, methods in runs(study).items():
        text = sections()[study].split(f"### {title}\n" if title else "\n", 1)[1]
        told = re.search(r"our (\d+): (.*?)(?:; |\.\n)", text.partition("\n### ")[0])
        own = ours_of(study, title)
        shown = (
            re.findall(r"`(.+?)` \((\d+)(?:, ours (\d+).*?(\d+))?\)", told[2])
            if told
            else []
        )
        found = {}
        for name in methods.keys() - {own}:
            both = methods[name].keys() & methods[own].keys()
            struck = [
                sum(methods[x][scene]["outcome"] == "contact" for scene in both)
                for x in (name, own)
            ]
            if struck[0] < struck[1]:
                few = len(both) < len(scenes_of(study, title))
                found[name] = [*struck, len(both)] if few else struck[:1]
        assert {x: [int(n) for n in of if n] for x, *of in shown} == found


def test_who_did_not_run_is_said():
    """Below every ranking that is counted: of 22 methods, on maps behind A*."""
    asked = "qp qp-repulsion vfh dwa orca c3bf mppi nmpc teb mpc-cbf ttc rpp apf stop"
    asked = {*asked.split(), "alone", "astar"}
    asked |= {f"eq{k}{how}" for k in "57" for how in ("", "-paper", "-tuned")}
    for study in {*RANKED} - ASIDE:
        for title, methods in runs(study).items():
            text = sections()[study].split(f"### {title}\n" if title else "\n", 1)[1]
            said = re.search(r"Did not run here.*?: (.*)", text.partition("\n### ")[0])
            before = "astar+" if study == "maps" else ""
            ran = {name.removeprefix(before) for name in methods}
            told = {*re.findall("`(.*?)`", said[1])} if said else set()
            if tables_of(study, title)[0] == []:
                continue
            assert told == asked - ran, study
            text = text.partition("\n### ")[0]
            local = asked | {"qp-ahead", ours_of(study, title)}
            led = {x for x in local if f"astar+{x}" in methods}
            if not before and not led:
                assert "Nobody ran behind A\\*." in text
            elif not before:
                said = re.search(r"Not behind A\\\*: (.*)", text)
                told = {*re.findall("`(.*?)`", said[1])} if said else set()
                assert told == local - led - {"alone", "astar"}


def test_grids_count_what_ran():
    """Of every setting, but for what begins in contact; a dash for who did not run."""
    for study in RANKED:
        grids = tables(sections()[study], "successes")
        rows = [row for methods in runs(study).values() for row in methods.items()]
        for row in chain(*grids):
            setting, _, most = row["successes"].rpartition(" (")
            for name in row.keys() - {"successes"}:
                some = [
                    won(run)
                    for method, of in rows
                    if method == name
                    for (place, _), run in of.items()
                    if place == setting
                ]
                whole = len(some) == int(most.split(" ")[0])
                told = f"{sum(some)}" + f" of {len(some)}" * (not whole)
                assert row[name] == (told if some else "–"), (study, setting, name)


@pytest.mark.parametrize("study", RANKED)
def test_differences(study):
    found = expected(study)
    for title, methods in runs(study).items():
        lines, _ = tables_of(study, title)
        own = methods[ours_of(study, title)]
        for line in lines:
            name = line["ours less"]
            ends = Counter(
                (won(own[x]), won(run)) for x, run in methods[name].items() if x in own
            )
            split = ends[True, False], ends[False, True]
            assert split == (int(line["only ours"]), int(line["only theirs"]))
            assert int(line["both"]) == ends[True, True]
            if any(split):
                g = split[0] / sum(split) - 0.5
                assert float(line["Cohen's g"]) == pytest.approx(g, abs=0.0051)
            for quantity, head, shown, digits in (
                ("success", "success, points (95 %)", "p", 0.051),
                ("time", "time, ours / theirs (95 %)", "p (time)", 0.0051),
                ("metric", "metric (95 %)", "p (metric)", 0.00051),
            ):
                if line.get(head, "–") == "–":
                    assert (title, name, quantity) not in found
                    continue
                value, p = found[title, name, quantity]
                assert first(line[head]) == pytest.approx(value, abs=digits), name
                both_p(line[shown], p, raw(study)[title, name, quantity][1])
            for quantity, kinds in CONTACTS.items():
                both = [x for x in methods[name] if x in own]
                counts = [
                    sum(of[x]["outcome"] in kinds for x in both)
                    for of in (own, methods[name])
                ]
                assert line[quantity] == " / ".join(map(str, counts))
                key = title, name, quantity
                both_p(line[f"p ({quantity})"], found[key][1], raw(study)[key][1])
