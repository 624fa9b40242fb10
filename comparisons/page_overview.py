"""The first screen of the page: ours against the best other, a row a study.

Who is named in a column is clearly better than ours if anybody is, and the best of
those; else the best. The worst for ours comes first: by the word of success, how far
ours is behind, then the words of contacts, time and metric. The row of a study with
several rankings is the first of these by that order.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from statistics import median

from page_parts import CONTACTS, Part, on_both
from page_rivals import at_the_top, others, rival, rivals
from page_statistics import LEVEL, Pair
from page_studies import Study
from page_text import PLANNER, code, standing, table
from qpavoid.lab.simulation.methods import parsed

QUANTITIES = "success", *CONTACTS, "time", "metric"
"""In which ours stands against the best other."""

ALONE = "success", "contacts", "time"
"""Those of them in which ours is told against one other method at a time."""

WORDS = "worse", "level", "better"
"""How ours stands, the worst first."""

PREDICTIVE = "mppi", "nmpc", "teb", "mpc-cbf"
"""Who plan for seconds ahead: the first tables say where they did not run."""

FEWEST = 3
"""Rankings in which a method ran that is told by itself."""

WIDE = 5.0
"""Points; intervals of success are not to be wider to either side."""


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
        lines.append([link, against(part), *words])
    return table(["study", "others", *map(headed, QUANTITIES)], lines)


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


def planned(studies: Iterable[Study]) -> str:
    """Return the table of successes by itself and behind A*, a row a ranking.

    Of the scenes in which a method ran both ways; and of how many methods that avoid
    something these are more behind A*, as many, and fewer.
    """
    found: dict[str, dict[str, str]] = {}
    signs: defaultdict[str, Counter[int]] = defaultdict(Counter)
    for study, part in parts_of(studies):
        for name in part.runs:
            behind = "astar" if name == "alone" else PLANNER + name
            if behind in part.runs:
                first, second, both = on_both(
                    part, (name, behind), lambda row: row["success"]
                )
                told, head = f"{first} → {second} of {both}", linked(study, part)
                found.setdefault(head, {})[name] = told
                signs[head][(second > first) - (second < first)] += name != "alone"
    ran = Counter(name for row in found.values() for name in row)
    names = [name for name, _ in ran.most_common()]
    lines = [
        [head, *(signs[head][k] for k in (1, 0, -1)), *(row.get(x, "–") for x in names)]
        for head, row in found.items()
    ]
    heads = ["ranking", "more", "as many", "fewer", *map(code, names)]
    return table(heads, lines) if lines else ""


def singly(studies: Iterable[Study]) -> str:
    """Return :func:`one_by_one` in success as a sentence.

    Better than those that plan ahead, worse than whoever it is.
    """
    clear = {
        name: [pair.differences["success"].clear for pair in pairs]
        for name, pairs in duels(studies).items()
    }
    better = [
        f"{code(k)} in {v.count(1)} of {len(v)}"
        for k, v in clear.items()
        if k in PREDICTIVE
    ]
    worse = [f"{code(k)} in {v.count(-1)}" for k, v in clear.items() if -1 in v]
    told = f"better than {', '.join(better)}, worse than {', '.join(worse) or 'none'}"
    return f"One at a time, but for encounters, in success it is {told}"


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


def wide(studies: Sequence[Study]) -> str:
    """Return where intervals of two planners and ours are wider than ± 5 points."""
    pairs, lines = ranked(studies), []
    for name in "nmpc", "mppi", "":
        halves, absent = [], []
        for study, part in pairs:
            mine = PLANNER * part.ours.startswith(PLANNER) + name if name else part.ours
            if mine not in part.runs:
                absent.append(linked(study, part))
                continue
            most = part.most(mine)
            _, low, high = most.success(mine)
            half = 50.0 * (high - low)
            if half > WIDE:
                ran = len(most.runs[mine])
                words = [f"{ran} runs", f"{ran * (half / WIDE) ** 2:.0f} wanted"]
                words += [study.text["all_there"]] if "all_there" in study.text else []
                told = f"{linked(study, part)}: ± {half:.1f} ({', '.join(words)})"
                halves.append(told)
        told = f"- {code(name) if name else 'Ours'}: {'; '.join(halves) or 'nowhere'}."
        lines.append(told + f" It did not run in {'; '.join(absent)}." * bool(absent))
    said = "**Intervals of success wider than ± {:g} points**, of NMPC, MPPI and ours: "
    said += "half their width, and how many runs there are, and would be wanted, as "
    said += f"widths go with 1/√n{of_more(studies)}:"
    head = '<a id="more-scenes"></a>\n\n'
    return "\n".join([head + said.format(WIDE), "", *lines])


def of_more(studies: Sequence[Study]) -> str:
    """Return in which studies there are more of the scenes of others."""
    named = {study.more.name for study in studies if study.more}
    links = [f"[{x.title}](#{x.name})" for x in studies if x.name in named]
    return f"; with all scenes of {', '.join(links)}" * bool(links)


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
    rest = (
        f"In {key} it is better in {of[0]}, level in {of[1]}, worse in {of[2]}. "
        for key, of in told.items()
        if key not in ("success", "metric")
    )
    return (
        f"In success ours is better in {better} of {len(names)} studies, level in "
        f"{level}, worse in {lost}; in {more} of those that are level (in {further} of "
        f"all {len(found)} rankings) somebody succeeded\nmore often, and it is not "
        f"shown. In {top} ours fails so seldom that even one who never fails could not "
        f"be clearly better.\n{''.join(rest)}Of a study with "
        f"several rankings the worst counts,\ncolumn by column. {singly(studies)}.\n\n"
    )
