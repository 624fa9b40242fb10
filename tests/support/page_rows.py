"""The page's tables read and recomputed by code that shares nothing with its own.

Own reader, own sign tests, own Holm. p of times and metrics are counted on another grid
here.
"""

import csv
import math
import re
import tomllib
from collections import Counter, defaultdict
from functools import cache

import numpy as np

from places import COMPARISONS

CLUSTERS = {
    "dynabarn": lambda setting, scene: (setting, int(scene) // 3),
    "dynabarn_fast": lambda setting, scene: (setting, int(scene) // 3),
    "dynabarn_end": lambda setting, scene: (setting, int(scene) // 3),
    "dynabarn_more": lambda setting, scene: (setting, int(scene) // 9),
    "dynabarn_end_more": lambda setting, scene: (setting, int(scene) // 9),
    "sensing": lambda setting, scene: (setting.split()[0], scene),
    "sensing_levels": lambda setting, scene: (setting.split()[0], scene),
    "barn_physics_more": lambda setting, scene: (setting, scene.split()[-1]),
    "ablation": lambda setting, scene: (world_of(setting, scene), scene.split()[-1]),
}
REPEATED = {*CLUSTERS}  # crowdnav, encounters: not within a ranking
SCORED = {"barn", "barn_fast", "barn_lidar", "barn_lidar_fast", "barn_physics"}
SCORED |= {"barn_physics_more"}
SCORED |= {"outlook"}
PARTS = dict.fromkeys(("sensing", "sensing_levels"), lambda x: x.partition(":")[0])
MORE = {"forest_all", "sensing_more", "encounters_more", "strangers_physics_more"}
MORE |= {
    "barn_physics_more",
    "sensing_levels",
    "dynabarn_more",
    "dynabarn_end_more",
    "maps_more",
}
ASIDE = {"ablation", "crowd_all", "outlook", "outlook_paper", *MORE}
EXCLUDED = ("omni", "orca-holonomic")
CONTACTS = {
    "contacts in motion": ("contact",),
    "contacts": ("contact", "contact_standing"),
}
FEWER = {*CONTACTS, "time"}
FEW = 8
PAGE = (COMPARISONS / "README.md").read_text()
SENTENCES = tomllib.loads((COMPARISONS / "page.toml").read_text())
README = (COMPARISONS.parent / "README.md").read_text()


def cells(line):
    return [cell.strip(" *`").replace("−", "-") for cell in line.split("|")[1:-1]]


def tables(text, head):
    """The tables that begin with a head, as dictionaries a row."""
    found, heads, rows = [], [], None
    for line in text.splitlines():
        if not line.startswith("|"):
            rows = None
        elif rows is not None:
            rows.append(dict(zip(heads, cells(line), strict=True)))
        elif cells(line)[0] == head:
            heads, rows = cells(line), []
            found.append(rows)
    return [[row for row in rows if "---" not in row[head]] for rows in found]


def sections():
    parts = re.split(r'<a id="(\w+)"></a>', PAGE.split("\n## Methods")[0])
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def titles(text):
    return re.findall(r"^### (.*)$", text, re.M) or [""]


LISTED = [name for name, text in sections().items() if "|success|% (95 %)|" in text]
RANKED = [name for name in LISTED if "|ours less|" in sections()[name]]


@cache
def runs(study):
    """Every run by title of its ranking, method and scene."""
    found, last = defaultdict(lambda: defaultdict(dict)), {}
    shown, place, scenes = titles(sections()[study]), 0, {}
    with (COMPARISONS / "results" / f"{study}.csv").open() as file:
        for row in csv.DictReader(file, restval=""):
            place = 0 if row["method"] + row["setting"] else place + 1
            scenes[place] = row["scene"] or scenes.get(place, "")
            row["scene"] = scenes[place]
            for key in ("method", "setting", "outcome"):
                row[key] = row[key] or last.get(key, "")
            last, setting = row, row["setting"]
            title = PARTS.get(study, str)(setting)
            title = title if title in shown else ""
            found[title][row["method"]][setting, row["scene"]] = row
    for methods in found.values():
        out = {
            scene
            for of in methods.values()
            for scene in of
            if of[scene]["outcome"] == "began"
        }
        for name, of in methods.items():
            methods[name] = {k: row for k, row in of.items() if k not in out}
    return found


def scenes_of(study, title):
    """All that anybody ran in a ranking."""
    return {scene for of in runs(study)[title].values() for scene in of}


def world_of(setting, scene):
    """Of the ablation: what is seen in several studies is one."""
    if setting.startswith(("barn", "dynabarn")):
        return setting.split("-")[0]
    if scene.startswith("forest"):
        return "forests that are seen"
    alike = setting.startswith(("strangers", "tracks")) or scene.startswith("strangers")
    return "strangers" if alike else (setting, scene)


def won(row):
    return row["outcome"] == "success"


def by_cluster(study, values):
    sums = defaultdict(float)
    for scene, value in values.items():
        sums[CLUSTERS.get(study, lambda *scene: scene)(*scene)] += value
    return [*sums.values()]


def all_signs(sums):
    """The share of all choices of signs with as great a sum: McNemar's p for units."""
    reached = {0: 1}
    for step in map(int, sums):
        longer = Counter()
        for total, ways in reached.items():
            for sign in (-1, 1):
                longer[total + sign * step] += ways
        reached = longer if step else reached
    great = sum(n for s, n in reached.items() if abs(s) >= abs(sum(sums)))
    return great / sum(reached.values())


def signs_of_any(sums):
    sums = np.array([x for x in sums if x])
    if len(sums) <= 18:
        reached = np.zeros(1)
        for x in sums:
            reached = np.concatenate([reached + x, reached - x])
        return np.mean(np.abs(reached) >= abs(sums.sum()) - 1e-9)
    # The inverse transform of the characteristic function of the sum, on a grid.
    steps, n = np.rint(sums * (8_000 / np.abs(sums).sum())).astype(int), 2**15
    half, cosines = np.arange(n // 2 + 1), np.cos(2.0 * np.pi * np.arange(n) / n)
    spread = np.ones(len(half))  # it is even
    for step in np.abs(steps):
        spread *= cosines[step * half % n]
    far = np.abs(np.fft.fftfreq(n, 1.0 / n)) >= abs(steps.sum()) - 0.5
    return max(np.fft.hfft(spread, n)[far].sum() / n, 0.0)


def ours_of(study, title):
    """Which method of a ranking is ours: it is in bold."""
    return next(m for m in tables_of(study, title)[1] if m["bold"])["method"]


def ratios(first, second):
    """Logarithms of times over times by scene, where both succeed."""
    both = [x for x in first if x in second and won(first[x]) and won(second[x])]
    return {x: math.log(time_of(first[x]) / time_of(second[x])) for x in both}


def scored(first, second):
    """A metric less another's by scene, where both have one."""
    pairs = {x: (first[x]["metric"], second[x]["metric"]) for x in first if x in second}
    return {x: float(a) - float(b) for x, (a, b) in pairs.items() if a and b}


@cache
def raw(study):
    """Value and p by title, method and quantity: ours less each other method."""
    found = {}
    for title, methods in runs(study).items():
        own = ours_of(study, title)
        for name in methods:
            if name == own:
                continue
            both = [scene for scene in methods[own] if scene in methods[name]]
            pairs = {x: (methods[own][x], methods[name][x]) for x in both}
            gain = {x: won(a) - won(b) for x, (a, b) in pairs.items()}
            key = title, name
            p = all_signs(by_cluster(study, gain))
            found[*key, "success"] = 100 * sum(gain.values()) / len(gain), p
            for quantity, kinds in CONTACTS.items():
                more = {
                    x: (a["outcome"] in kinds) - (b["outcome"] in kinds)
                    for x, (a, b) in pairs.items()
                }
                p = all_signs(by_cluster(study, more))
                found[*key, quantity] = 100 * sum(more.values()) / len(more), p
            logs = ratios(methods[own], methods[name])
            if len(by_cluster(study, logs)) >= FEW:
                ratio = math.exp(sum(logs.values()) / len(logs))
                found[*key, "time"] = ratio, signs_of_any(by_cluster(study, logs))
            less = scored(methods[own], methods[name]) if study in SCORED else {}
            if len(by_cluster(study, less)) >= FEW:
                value = sum(less.values()) / len(less)
                found[*key, "metric"] = value, signs_of_any(by_cluster(study, less))
    return found


def judged(study, title, name):
    """The study in which a method ran most of a ranking's scenes, with ours."""
    more = SENTENCES["study"][study].get("more", study)
    ran = [len(runs(x).get(title, {}).get(name, ())) for x in (study, more)]
    return more if ran[1] > ran[0] else study


@cache
def widest(study):
    """As ``raw``, each where a method ran most scenes, as the first tables judge."""
    pairs = {key[:2]: judged(study, *key[:2]) for key in raw(study)}
    return {
        key: value
        for pair, place in pairs.items()
        for key, value in raw(place).items()
        if key[:2] == pair
    }


def expected(study):
    """As ``raw``, with Holm's p."""
    return corrected(study, raw)


def judgement(study):
    """As ``widest``, with Holm's p."""
    return corrected(study, widest)


@cache
def corrected(study, values):
    """For ours Holm's p over all with others, against it over a kind and quantity."""
    found, told = values(study), {}
    kinds = defaultdict(list)
    for key in found:
        kinds[family_of(study, *key[:2])].append(key)
    others = [key for kind in kinds if is_counted(kind) for key in kinds[kind]]
    for kind, keys in kinds.items():
        over_all = raised(found, others if is_counted(kind) else keys)
        for quantity in {key[2] for key in keys}:
            some = [key for key in keys if key[2] == quantity]
            for key, p in raised(found, some).items():
                told[key] = found[key][0], over_all[key] if gains(key, found) else p
    return told


def gains(key, found):
    """Whether a difference is in favour of ours."""
    value, least = found[key][0], 1.0 if key[2] == "time" else 0.0
    return value < least if key[2] in FEWER else value > least


def raised(found, keys):
    """Holm's p of some comparisons."""
    least, told = 0.0, {}
    for k, key in enumerate(sorted(keys, key=lambda key: found[key][1])):
        least = max(least, min(1.0, found[key][1] * (len(keys) - k)))
        told[key] = least
    return told


def is_counted(kind):
    """Whether a kind is of other methods for the same robot."""
    return isinstance(kind, tuple) and kind[0]


def family_of(study, title, name):
    """Others for the same robot, with a plan if ours has one or not, and the rest."""
    own = ours_of(study, title)
    plans = [x.startswith(("astar", "dijkstra")) for x in (name, own)]
    return study in ASIDE or (is_other(name), is_other(name) and plans[0] == plans[1])


def is_other(name):
    return "qp" not in name and name not in EXCLUDED


@cache
def tables_of(study, title):
    """Differences, none where ours ran alone, and ranking, with who is bold."""
    text = sections()[study]
    if title:
        text = text.split(f"### {title}\n")[1].split("\n### ")[0]
    ranking, less = tables(text, "method")[0], tables(text, "ours less")
    bold = re.findall(r"^\|\*\*`(.+?)`\*\*\|\d+ of", text, re.M)
    assert len(bold) == bool(less) or not less
    return less[0] if less else [], [
        {**row, "bold": row["method"] in bold} for row in ranking
    ]


def first(text):
    return float(text.split(" ")[0].replace(",", ""))


def room_of(row):
    return float(row["min_room_m"] or 0.0)


def time_of(row):
    return float(row["arrived_s"])


def study_of(row):
    return re.search(r"#(\w+)\)", row["study"])[1]
