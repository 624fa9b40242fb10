"""Numbers that the page's texts say of the rankings, filled in from their tables.

A text has ``{nmpc below}``: a method (``ours`` is one) and one of :data:`SAYS`; or
``{scenes}``, how many there are. Before that, where it is not plain, stands of which
study, and of which ranking or setting: ``{#crowdnav|10 people|mppi won}``; after it of
which scenes, if not of all that the method ran: ``{ours won where nmpc ran}``.
"""

import re
from collections.abc import Callable, Iterable, Mapping

from page_cells import below, in_words, least, mean_of, median_time, number
from page_parts import Part, outcomes, shared
from page_rivals import over
from page_studies import Study


def nearer(part: Part, name: str) -> str:
    """Return how much nearer than r_min its worst run came, in cm."""
    return number(-100.0 * (least(part.runs[name], "min_room_m") or 0.0), 0)


def times(part: Part, name: str) -> str:
    """Return how many times as long ours takes where both succeed, of most scenes."""
    found = over(part.most(name), part.ours, name)
    return number(found and found.value[0], 2)


def single(part: Part, name: str) -> str:
    """Return p of its successes against ours by itself, of most scenes."""
    return in_words(part.versus(name)["success"].single)


SAYS: Mapping[str, Callable[[Part, str], object]] = {
    "ran": lambda part, name: len(part.runs[name]),
    "won": lambda part, name: part.won(name),
    "moving": lambda part, name: outcomes(part, name)["contact"],
    "standing": lambda part, name: outcomes(part, name)["contact_standing"],
    "stalled": lambda part, name: outcomes(part, name)["stalled"],
    "late": lambda part, name: outcomes(part, name)["late"],
    "below": lambda part, name: below(part.runs[name]),
    "nearer": nearer,
    "median": lambda part, name: median_time(part.runs[name]),
    "metric": lambda part, name: mean_of(part.runs[name], "metric"),
    "times": times,
    "p": lambda part, name: in_words(part.versus(name)["success"].p),
    "single": single,
}
"""Of a method: its runs, those with success, with a contact begun in motion, or only
while it stood, that stood still at last, not over in time, nearer than r_min; how much
nearer in the worst, cm; median time of the successes, s; mean metric; how many times as
long ours takes; p of its successes against ours, Holm's, and by itself. The last three
of the ranking in which it ran most scenes, as the first tables have them."""


FILLED = re.compile(
    rf"{{([^{{}}]*\b(?:scenes|{'|'.join(SAYS)})(?: where [^{{}}]+ ran)?)}}"
)
"""What a text has in the place of a number."""


class Numbers:
    """The numbers of all rankings.

    Args:
        studies: All of them.
    """

    def __init__(self, studies: Iterable[Study]) -> None:
        self.studies = {study.name: study for study in studies}

    def fill(
        self, text: str, study: Study | None = None, part: Part | None = None
    ) -> str:
        """Return a text with its numbers; a dash for what did not run.

        Args:
            text: Of the page.
            study: Whose ranking is meant where no other study is named.
            part: The ranking, where none is named; else the study's first.
        """

        def told(found: re.Match[str]) -> str:
            *places, key = found[1].split("|")
            of, one = study, part
            if places and places[0].startswith("#"):
                of, one = self.studies.get(places.pop(0)[1:]), None
            if of is not None and (places or one is None):
                one = part_of(of, *places)
            return "–" if one is None else str(says(one, key))

        return FILLED.sub(told, text)


def part_of(study: Study, title: str = "") -> Part | None:
    """Return a study's ranking of that title, or what one has of that setting.

    Without a title the first.
    """
    if not title:
        return study.parts[0]
    known = {part.title: part for part in study.parts}
    if title in known:
        return known[title]
    for part in study.parts:
        runs = {
            name: [row for row in some if row["setting"] == title]
            for name, some in part.runs.items()
        }
        if any(runs.values()):
            return part._replace(title=title, runs=runs, pairs={}, more=None)
    return None


def says(part: Part, key: str) -> object:
    """Return the number of a ranking for a key."""
    if key == "scenes":
        return part.scenes
    key, _, other = key.partition(" where ")
    name, _, quantity = key.rpartition(" ")
    name = part.ours if name == "ours" else name
    if name not in part.runs:
        return "–"
    if other := other.removesuffix(" ran"):
        some = shared(part, (name, other))[0] if other in part.runs else []
        part = part._replace(runs={name: some}, pairs={})
    return SAYS[quantity](part, name)
