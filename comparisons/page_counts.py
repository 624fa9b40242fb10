"""In how many rankings ours is better, level and worse: against all, and one by one."""

from collections.abc import Iterable, Sequence
from statistics import median

from page_cells import PLANNER, code, table
from page_overview import (
    PREDICTIVE,
    QUANTITIES,
    WORDS,
    leading,
    losses_of,
    rank,
    ranked,
)
from page_rivals import at_the_top, others, unclear
from page_statistics import Pair
from page_studies import Study
from qpavoid.lab.simulation.methods import parsed

ALONE = "success", "contacts", "time"
"""Those of them in which ours is told against one other method at a time."""

FEWEST = 3
"""Rankings in which a method ran that is told by itself."""


def one_by_one(studies: Iterable[Study]) -> str:
    """Return the table of ours against one other method at a time."""
    heads = ["ours against", "rankings", "median scenes"]
    heads += [f"{key}: {word}" for key in ALONE for word in WORDS[::-1]]
    lines = []
    for name, pairs in duels(studies).items():
        line = [code(name), len(pairs), f"{median(x.scenes for x in pairs):.0f}"]
        for key in ALONE:
            clear = [x.differences[key].clear for x in pairs if key in x.differences]
            line += [clear.count(sign) for sign in (1, 0, -1)]
        lines.append(line)
    head = '<a id="one-by-one"></a>\n\n**Ours against one other method at a time**'
    head += ", in how many rankings (none of encounters, where 1 cm from the station "
    return f"{head}decides)\n\n{table(heads, lines)}"


def singly(studies: Iterable[Study]) -> str:
    """Return :func:`one_by_one` in success as a sentence.

    Better than those that plan ahead, by themselves and behind A*, worse than whoever
    it is; else level.
    """
    found = duels(studies)
    clear = {
        name: [pair.differences["success"].clear for pair in pairs]
        for name, pairs in found.items()
    }

    def better(before: str) -> str:
        names = [x for x in clear if x in (before + name for name in PREDICTIVE)]
        told = (f"{code(x)} in {clear[x].count(1)} of {len(clear[x])}" for x in names)
        return ", ".join(told)

    worse = [f"{code(k)} in {v.count(-1)}" for k, v in clear.items() if -1 in v]
    led = [x.scenes for k, v in found.items() if k.startswith(PLANNER) for x in v]
    told = [f"better than {better('')}"]
    if led:
        told.append(f"behind A* (median {median(led):.0f} scenes) {better(PLANNER)}")
    told += [f"worse than {', '.join(worse) or 'none'}", "else level"]
    return f"One at a time, but for encounters, in success it is {', '.join(told)}"


def duels(studies: Iterable[Study]) -> dict[str, list[Pair]]:
    """Return the comparisons of ours with each other method, the hardest first.

    On maps, where ours is behind A*, the others are that behind A*. Of rankings that
    repeat scenes of another one only those that did not run in that. None where what
    success asks for has columns of its own: in encounters 1 cm from a station decides.
    """
    found: dict[str, list[Pair]] = {}
    pairs = [pair for pair in ranked(studies) if not pair[0].text.get("apart")]
    ran = {(study.name, part.title): part.runs for study, part in pairs}
    for study, part in pairs:
        title = study.text.get("repeats", {}).get(part.title)
        before = PLANNER * part.ours.startswith(PLANNER)
        for name in others(part):
            if name in ran.get((study.counted, title), ()):
                continue
            if not before or parsed(name).search:
                found.setdefault(name.removeprefix(before), []).append(part.pair(name))
    most = sorted(found.items(), key=lambda item: won(item[1]))
    return {name: pairs for name, pairs in most if len(pairs) >= FEWEST}


def won(pairs: Sequence[Pair]) -> tuple[float, float]:
    """Return the shares in which ours is clearly better, and not clearly worse."""
    clear = [pair.differences["success"].clear for pair in pairs]
    return clear.count(1) / len(clear), -clear.count(-1) / len(clear)


def in_short(studies: Sequence[Study]) -> str:
    """Return in how many studies ours is better, level and worse, in a sentence.

    Of a study that ranking counts, column by column, in which ours stands worst.
    """
    found = ranked(studies)
    names = dict.fromkeys(study.counted for study, _ in found)
    worst = {
        key: [
            min(rank(x, key) for y, x in found if y.counted == name) for name in names
        ]
        for key in QUANTITIES
    }
    told = {key: [of.count(k) for k in (2, 1, 0)] for key, of in worst.items()}
    first = leading(studies)
    more, further = (
        sum("success (level)" in losses_of(part) for _, part in some)
        for some in (first, found)
    )
    top = sum(at_the_top(part, study.tests) for study, part in first)
    better, level, lost = told["success"]
    clear = (part for _, part in first if rank(part, "success") == 2)
    every = sum(not unclear(part, "success") for part in clear)
    rest = (
        f"In {key} it is better in {of[0]}, level in {of[1]}, worse in {of[2]}. "
        for key, of in told.items()
        if key not in ("success", "metric")
    )
    return (
        f"In success ours is better in {better} of {len(names)} studies (than every "
        f"other in {every}), level in {level}, worse in {lost}; in {more} of those "
        f"that are level\n(in {further} of all {len(found)} rankings) somebody "
        f"succeeded more often, and it is not shown. In {top} ours fails so seldom "
        "that even one who never fails could not be clearly better.\n"
        f"{''.join(rest)}Of a study with several rankings the worst "
        f"counts,\ncolumn by column. {singly(studies)}.\n"
    )
