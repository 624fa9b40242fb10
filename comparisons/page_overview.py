"""The first screen of the page: ours against the best other, a row a study.

Who is named in a column is clearly better than ours if anybody is, and the best of
those; else the best. The worst for ours comes first: by the word of success, how far
ours is behind, then the words of contacts, time and metric. The row of a study with
several rankings is the first of these by that order.
"""

from collections.abc import Iterable, Sequence

from page_cells import code, table
from page_differences import standing
from page_parts import CONTACTS, Part
from page_rivals import others, rival, rivals
from page_statistics import LEVEL
from page_studies import Study
from qpavoid.lab.simulation.methods import parsed

QUANTITIES = "success", *CONTACTS, "time", "metric"
"""In which ours stands against the best other."""

WORDS = "worse", "level", "better"
"""How ours stands, the worst first."""

PREDICTIVE = "mppi", "nmpc", "teb", "mpc-cbf"
"""Who plan for seconds ahead: the first tables say where they did not run."""


def overview(studies: Iterable[Study]) -> str:
    """Return the table with a row a study."""
    return table_of(leading(studies))


def further(studies: Sequence[Study]) -> str:
    """Return the table of all other rankings, and where nobody else ran."""
    shown = {linked(*pair) for pair in leading(studies)}
    more = [pair for pair in ranked(studies) if linked(*pair) not in shown]
    alone = [linked(*pair) for pair in driven(studies) if not rival(pair[1], "success")]
    said = f"\nNobody else ran: {'; '.join(alone)}.\n" * bool(alone)
    head = '<a id="further-rankings"></a>\n\n**Further rankings of these studies**\n\n'
    return head + table_of(more) + said


def table_of(pairs: Iterable[tuple[Study, Part]]) -> str:
    """Return a table of rankings: ours against the best other."""
    heads = ["study", "scenes", "ours", "others", *map(headed, QUANTITIES)]
    lines = []
    for study, part in pairs:
        line = [linked(study, part), said_scenes(part), code(part.ours), against(part)]
        lines.append([*line, *(standing(part, key) for key in QUANTITIES)])
    return table(heads, lines)


def headed(key: str) -> str:
    """Return the head of the column of a quantity."""
    how = "over best other (95 %)" if key == "time" else "/ best other"
    return f"{key}, ours {how}"


def brief(studies: Iterable[Study]) -> str:
    """Return the table of the project's README, a row a study."""
    lines = []
    for study, part in leading(studies):
        link = linked(study, part).replace("](#", "](comparisons/README.md#")
        words = (standing(part, key) for key in QUANTITIES)
        lines.append([link, said_scenes(part), against(part), *words])
    return table(["study", "scenes", "others", *map(headed, QUANTITIES)], lines)


def parts_of(studies: Iterable[Study]) -> list[tuple[Study, Part]]:
    """Return the rankings of all studies that do not stand aside."""
    return [
        (study, part)
        for study in studies
        if not study.text.get("aside")
        for part in study.parts
        if part.scenes > 1
    ]


def driven(studies: Iterable[Study]) -> list[tuple[Study, Part]]:
    """Return the rankings with ours."""
    return [pair for pair in parts_of(studies) if pair[1].ours]


def ranked(studies: Iterable[Study]) -> list[tuple[Study, Part]]:
    """Return those where others ran too, the worst for ours first."""
    found = [(study, part) for study, part in driven(studies) if rival(part, "success")]
    return sorted(found, key=lambda pair: standing_of(pair[1]))


def leading(studies: Iterable[Study]) -> list[tuple[Study, Part]]:
    """Return the first of these of each study: that in which ours stands worst."""
    found: dict[str, tuple[Study, Part]] = {}
    for study, part in ranked(studies):
        found.setdefault(study.counted, (study, part))
    return [*found.values()]


def standing_of(part: Part) -> list[float]:
    """Return what sorts rankings: the word of success, how far behind, other words."""
    success, *rest = (rank(part, key) for key in QUANTITIES)
    return [success, behind(part), *rest]


def behind(part: Part) -> float:
    """Return how much less often ours succeeds than any other, below 0, or 0."""
    found = [part.versus(name)["success"] for name in others(part)]
    return min(0.0, *(x.value[0] for x in found))


def rank(part: Part, key: str) -> int:
    """Return the place of ours in a quantity among :data:`WORDS`."""
    name = rival(part, key)
    return part.versus(name)[key].clear + 1 if name else len(WORDS)


def against(part: Part) -> str:
    """Return how many other methods ran, and which of the four planners did not.

    ``21 + 12``: the second follow a path of A* or Dijkstra's search.
    """
    names = others(part)
    led = sum(bool(parsed(name).search) for name in names)
    count = f"{len(names) - led}" + f" + {led}" * bool(led)
    ran = {parsed(name).controller for name in names}
    missing = [code(name) for name in PREDICTIVE if name not in ran]
    if len(missing) == len(PREDICTIVE):
        return f"{count}, none of the four"
    return count + f", not {', '.join(missing)}" * bool(missing)


def worse(part: Part) -> list[str]:
    """Return the quantities in which the best other is clearly better than ours."""
    return [key for key in QUANTITIES if rank(part, key) == WORDS.index("worse")]


def losses_of(part: Part) -> list[str]:
    """Return the same, and what is level but against ours.

    Successes of which any other has more, and what speaks for another by itself.
    """
    keys = worse(part)
    if behind(part) < 0.0 and "success" not in keys:
        keys.append("success (level)")
    for key in QUANTITIES[1:]:
        found = [part.versus(x)[key] for x in rivals(part, key)]
        if key not in keys and any(x.better < 0 and x.single < LEVEL for x in found):
            keys.append(f"{key} (level)")
    return keys


def linked(study: Study, part: Part) -> str:
    """Return the title of a ranking, with a link to it."""
    return f"[{study.title}](#{study.name}), {part.title}".removesuffix(", ")


def said_scenes(part: Part) -> str:
    """Return how many scenes there are, and of how many clusters."""
    clusters = len(set(part.clusters.values()))
    return f"{part.scenes}" + f" in {clusters} clusters" * (clusters < part.scenes)
