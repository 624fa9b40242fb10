"""Rankings of a study: methods in order, and how our filter differs from each."""

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from page_runs import BEGAN, Row, by
from page_statistics import (
    Clusters,
    Difference,
    Hits,
    Pair,
    adjust,
    compare,
    difference,
    rates,
    share,
)
from qpavoid.lab.simulation.methods import parsed, solver_of
from qpavoid.lab.study.statistics import Interval

OURS = ("qp-ahead+guide", "qp-ahead+detour", "qp-ahead")
"""Our filter: the first of these that a study ran."""

OTHERS = "others"
"""The family of the comparisons that the words of the first tables are about."""

ANOTHER_MACHINE = ("omni", "orca-holonomic")
"""What drives them is ranked, and is no other method for the same robot."""


CONTACTS: Mapping[str, Callable[[Row], bool]] = {
    "contacts in motion": lambda row: row["outcome"] == "contact",
    "contacts": lambda row: row["contact"],
}
"""Contacts as they are compared: those begun in motion, and all."""


class Part(NamedTuple):
    """What a study says in one ranking.

    Attributes:
        title: Setting; empty if the study has but one.
        runs: Of all methods, the best first.
        ours: Name of our filter; empty if it did not run.
        clusters: Number of that of each scene.
        pairs: Our filter less each other method, on the same scenes.
        began: Scenes that are left out: they begin in contact.
        more: The same ranking with more scenes, of a study that has them for some
            methods; or None.
        judged: ``pairs``, each in the ranking with most of its scenes.
    """

    title: str
    runs: Mapping[str, Sequence[Row]]
    ours: str
    clusters: Clusters
    pairs: Mapping[str, Pair]
    began: Sequence[tuple[str, str]]
    more: "Part | None" = None
    judged: Mapping[str, Pair] = MappingProxyType({})

    @property
    def scenes(self) -> int:
        """How many different ones."""
        return len(self.clusters)

    def success(self, name: str) -> Interval:
        """Return the share of successes of a method, with its interval."""
        groups = [self.clusters[scene_of(row)] for row in self.runs[name]]
        hits = [row["success"] for row in self.runs[name]]
        return share(np.array(hits, float), np.array(groups))

    def won(self, name: str) -> int:
        """Return in how many runs a method succeeded."""
        return sum(row["success"] for row in self.runs[name])

    def most(self, name: str) -> "Part":
        """Return the ranking in which a method ran most scenes: this, or ``more``."""
        found = [one for one in (self, self.more) if one and name in one.runs]
        return max(found, key=lambda one: len(one.runs[name]))

    def pair(self, name: str) -> Pair:
        """Return ours and a method in the ranking with most of its scenes."""
        return (self.judged or self.pairs)[name]

    def versus(self, name: str) -> Mapping[str, Difference]:
        """Return how these two differ, by quantity."""
        return self.pair(name).differences


def scene_of(row: Row) -> tuple[str, str]:
    """Return what two runs of the same scene have in common."""
    return row["setting"], row["scene"]


def cluster_of(scene: tuple[str, str], rule: int | str) -> Hashable:
    """Return what the scenes that are not independent have in common.

    Args:
        scene: Its setting and name.
        rule: So many numbers in a row are of one world; or a pattern whose groups are
            the cluster of ``setting scene``; empty: each scene is its own.

    Raises:
        ValueError: A scene of which the rule does not say it.
    """
    if not rule:
        return scene
    if isinstance(rule, int):
        return scene[0], int(scene[1]) // rule
    found = re.search(rule, " ".join(scene))
    if found is None:
        raise ValueError(f"no cluster of {scene}: {rule!r}")
    return found.groups()


def grouped(
    rows: Sequence[Row], text: Mapping[str, Any], most: int
) -> Mapping[str, Sequence[Row]]:
    """Return the runs of every ranking by its title: one for each setting, or for all.

    With a pattern ``parts``: one for all settings that begin with the same match.
    """
    settings, most = by(rows, "setting"), text.get("most_parts", most)
    if "parts" not in text:
        return {"": rows} if len(settings) > most else settings
    begins = {name: re.match(text["parts"], name) for name in settings}
    parts_of = {name: found[0] if found else "" for name, found in begins.items()}
    return by(({**row, "part": parts_of[row["setting"]]} for row in rows), "part")


def make_parts(rows: Sequence[Row], text: Mapping[str, Any], most: int) -> list[Part]:
    """Return the rankings of the runs as they are :func:`grouped`; p is Holm's.

    Of the comparisons with others those in favour of ours over all, the rest over each
    :func:`family` and quantity, as those with variants.
    """
    groups = grouped(rows, text, most)
    parts = [make_part(title, some, text) for title, some in groups.items()]
    correct([(x, x.pairs) for x in parts], text)
    return parts


def with_more(
    parts: Sequence[Part], further: Sequence[Part], text: Mapping[str, Any]
) -> list[Part]:
    """Return rankings that know those with more of their scenes.

    In the first tables ours is judged in these where a method ran there; p is Holm's
    over as many comparisons as without them.
    """
    titled = {part.title: part for part in further}
    found = []
    for part in parts:
        judged, one = {}, part._replace(more=titled.get(part.title))
        for name in part.pairs:
            pair = one.most(name).pairs[name]
            each = {key: x._replace(p=x.single) for key, x in pair.differences.items()}
            judged[name] = pair._replace(differences=each)
        found.append(one._replace(judged=judged))
    correct([(part, part.judged) for part in found], text)
    return found


def correct(
    found: Sequence[tuple[Part, Mapping[str, Pair]]], text: Mapping[str, Any]
) -> None:
    """Raise every p of the rankings of a study to Holm's; see :func:`make_parts`."""
    families: defaultdict[str, list[Pair]] = defaultdict(list)
    for part, pairs in found:
        for name, pair in pairs.items():
            families["" if text.get("aside") else family(part, name)].append(pair)
    adjust(*(some for kind, some in families.items() if kind.startswith(OTHERS)))
    for kind, some in families.items():
        if not kind.startswith(OTHERS):
            adjust(some)


def make_part(title: str, rows: Sequence[Row], text: Mapping[str, Any]) -> Part:
    """Return ranking and differences of some runs; p as if each were the only one."""
    began = {scene_of(row): None for row in rows if row["outcome"] == BEGAN}
    runs = by((row for row in rows if scene_of(row) not in began), "method")
    runs = dict(sorted(runs.items(), key=lambda item: place(item[1])))
    scenes = {scene_of(row): None for some in runs.values() for row in some}
    groups = {x: cluster_of(x, text.get("cluster", "")) for x in scenes}
    number = {group: k for k, group in enumerate(dict.fromkeys(groups.values()))}
    clusters: Clusters = {x: number[group] for x, group in groups.items()}
    own = next((name for name in text.get("ours", OURS) if name in runs), "")
    pairs, times = {}, {name: times_of(some) for name, some in runs.items()}
    for name in runs if own else ():
        pair = compare(times[own], times[name], clusters)
        if name != own and pair is not None:
            pairs[name] = pair
            pair.differences.update(contacts_of(runs[own], runs[name], clusters))
            ours, theirs = (column(runs[x], "metric") for x in (own, name))
            scored = text.get("scored")
            found = difference(ours, theirs, clusters) if scored else None
            pair.differences.update({} if found is None else {"metric": found})
    return Part(title, runs, own, clusters, pairs, [*began])


def contacts_of(
    first: Sequence[Row], second: Sequence[Row], clusters: Clusters
) -> dict[str, Difference]:
    """Return how a method's contacts differ from another's; fewer are better."""
    found = {}
    for key, hit in CONTACTS.items():
        ours: Hits = {scene_of(row): hit(row) for row in first}
        theirs: Hits = {scene_of(row): hit(row) for row in second}
        more = rates(ours, theirs, clusters)
        found[key] = more._replace(better=-more.better)
    return found


def place(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Return what rankings go by: successes, contacts, median time of a success."""
    won = [row["arrived_s"] for row in rows if row["success"]]
    touched = np.mean([row["contact"] for row in rows])
    return -len(won) / len(rows), float(touched), float(np.median(won or [np.inf]))


def times_of(rows: Sequence[Row]) -> dict[Hashable, float | None]:
    """Return the time of every success by scene.

    Raises:
        ValueError: A scene was run twice.
    """
    times = column([row for row in rows if row["success"]], "arrived_s")
    times = {scene_of(row): times.get(scene_of(row)) for row in rows}
    if len(times) < len(rows):
        raise ValueError(f"{rows[0]['method']}: a scene was run twice")
    return times


def column(rows: Sequence[Row], key: str) -> dict[Hashable, float | None]:
    """Return a column by scene."""
    return {scene_of(row): row.get(key) for row in rows}


def outcomes(part: Part, name: str) -> Counter[str]:
    """Return how often a method's runs ended in what."""
    return Counter(row["outcome"] for row in part.runs[name])


def shared(part: Part, names: tuple[str, str]) -> tuple[list[Row], list[Row]]:
    """Return the runs of two methods in the scenes that both ran."""
    first, second = ({scene_of(row): row for row in part.runs[name]} for name in names)
    both = [scene for scene in first if scene in second]
    return [first[x] for x in both], [second[x] for x in both]


def on_both(
    part: Part, names: tuple[str, str], hit: Callable[[Row], bool]
) -> tuple[int, int, int]:
    """Return the hits of two methods in the scenes that both ran, and how many."""
    first, second = shared(part, names)
    return sum(map(hit, first)), sum(map(hit, second)), len(first)


def is_other(name: str) -> bool:
    """Return whether a method is one for the same robot that is not our filter."""
    return bool(solver_of(name, "")) and name not in ANOTHER_MACHINE


def family(part: Part, name: str) -> str:
    """Return with which other comparisons one is corrected for how many there are.

    Other methods for the same robot are apart from variants of ours and other machines,
    and those that drive a planner's path from those that do not: one more of a kind
    that ours is not of makes no loss to another less clear.
    """
    if not is_other(name):
        return "variants and machines"
    planned, ours = (bool(parsed(x).search) for x in (name, part.ours))
    return OTHERS if planned == ours else f"{OTHERS}, planned otherwise"
