"""What scenes leave open: by itself or behind A*, and intervals that are still wide."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence

from page_cells import PLANNER, code, table
from page_overview import linked, parts_of, ranked
from page_parts import Part, on_both
from page_studies import Study

WIDE = 5.0
"""Points; intervals of success are not to be wider to either side."""


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
            half = half_width(most, mine)
            if half > WIDE:
                ran = len(most.runs[mine])
                words = [f"{ran} runs", f"{ran * (half / WIDE) ** 2:.0f} wanted"]
                words += [study.text["all_there"]] if "all_there" in study.text else []
                told = f"{linked(study, part)}: ± {half:.1f} ({', '.join(words)})"
                halves.append(told)
        told = f"- {code(name) if name else 'Ours'}: {'; '.join(halves) or 'nowhere'}."
        told += f" It did not run in {'; '.join(absent)}." * bool(absent)
        lines.append(told + behind_planner(pairs, name) * bool(name))
    said = "**Intervals of success wider than ± {:g} points**, of NMPC, MPPI and ours: "
    said += "half their width, and how many runs there are, and would be wanted, as "
    said += f"widths go with 1/√n{of_more(studies)}:"
    head = '<a id="more-scenes"></a>\n\n'
    return "\n".join([head + said.format(WIDE), "", *lines])


def half_width(part: Part, name: str) -> float:
    """Return half the width of a method's interval of success, in points."""
    _, low, high = part.success(name)
    return 50.0 * (high - low)


def behind_planner(pairs: Iterable[tuple[Study, Part]], name: str) -> str:
    """Return how wide intervals of a method are behind A*, where ours is not, too."""
    led = PLANNER + name
    parts = [x for _, x in pairs if led in x.runs and not x.ours.startswith(PLANNER)]
    halves = [half_width(part, led) for part in parts]
    many = [len(part.runs[led]) for part in parts]
    if not parts:
        return ""
    return (
        f" Behind A*, in {len(parts)} rankings, it has {min(many)} to {max(many)} "
        f"runs: ± {min(halves):.1f} to {max(halves):.1f}."
    )


def of_more(studies: Sequence[Study]) -> str:
    """Return in which studies there are more of the scenes of others."""
    named = {study.more.name for study in studies if study.more}
    links = [f"[{x.title}](#{x.name})" for x in studies if x.name in named]
    return f"; with all scenes of {', '.join(links)}" * bool(links)
