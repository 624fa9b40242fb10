"""What ours still loses, and why, as the page says it.

In rankings in which it is clearly worse, and where what is level is against it. Numbers
in what is said of it are filled in from the tables: ``page_numbers.py``.
"""

from collections import defaultdict
from collections.abc import Iterable

from page_cells import code, won_of
from page_numbers import Numbers, times
from page_overview import linked, losses_of, ranked
from page_parts import CONTACTS, Part, family, on_both
from page_rivals import comparable, others
from page_statistics import LEVEL, holm
from page_studies import Study

HEAD = '<a id="what-ours-loses"></a>\n\n**What ours still loses, and why**'
"""Before the list of it."""

UNKNOWN = "Why was not looked at."
"""Said of a loss of which ``page.toml`` says nothing."""


def lost(studies: Iterable[Study]) -> str:
    """Return what ours still loses, and why as far as ``loses`` of a study says it.

    Which may be a table by the titles of its rankings.
    """
    found: dict[tuple[str, str], list[str]] = {}
    pairs, numbers = ranked(studies), Numbers(studies)
    for study, part in pairs:
        keys = losses_of(part)
        if keys:
            why = study.text.get("loses", UNKNOWN)
            why = why if isinstance(why, str) else why.get(part.title, UNKNOWN)
            why = " ".join(numbers.fill(why, study, part).split())
            told = f"{', '.join(keys)}. {why}"
            found.setdefault((study.name, told), []).append(linked(study, part))
    lines = [f"- {'; '.join(named)}: {told}" for (_, told), named in found.items()]
    tails = {
        "Clearly quicker where both succeed, but too seldom to be named above, of each "
        "ranking the quickest": [seldom(*pair, "time") for pair in pairs],
        "Clearly fewer contacts, but too few successes to be named above, of each "
        "ranking the fewest": [seldom(*pair, "contacts") for pair in pairs],
        "Level for all that a study compares, clearly better than ours were its "
        "ranking the only one": [x for pair in pairs for x in thinned(*pair)],
    }
    for head, items in tails.items():
        if any(items):
            lines.append(f"- {head}: {'; '.join(filter(None, items))}.")
    return "\n".join([f"{HEAD}\n", *lines] * bool(lines))


def seldom(study: Study, part: Part, key: str) -> str:
    """Return who is clearly best in a quantity, but succeeds not as often as asked.

    Not about as often as the best: nobody of the :func:`rivals`.
    """
    rare = set(others(part)) - set(comparable(part))
    found = {x: part.versus(x).get(key) for x in rare}
    clear = {name: x.value[0] for name, x in found.items() if x and x.clear < 0}
    if not clear:
        return ""
    name = max(clear, key=lambda name: clear[name])
    told, most = f"ours takes {times(part, name)} times as long", part.most(name)
    if key in CONTACTS:
        ours, theirs, _ = on_both(most, (part.ours, name), CONTACTS[key])
        told = f"{theirs} contacts, ours {ours}"
    return f"{linked(study, part)}: {code(name)} ({won_of(most.runs[name])}; {told})"


def thinned(study: Study, part: Part) -> list[str]:
    """Return who would be clearly better, were there no other ranking in the study.

    By Holm's p over those of its kind and quantity in this ranking alone.
    """
    kinds: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for name in others(part):
        for key in part.versus(name):
            kinds[family(part, name), key].append(name)
    found = []
    for (_, key), names in kinds.items():
        each = [part.versus(name)[key] for name in names]
        for name, x, p in zip(names, each, holm([x.single for x in each]), strict=True):
            if x.better < 0 and p < LEVEL <= x.p:
                found.append(f"{linked(study, part)}: {code(name)} in {key}")
    return found
