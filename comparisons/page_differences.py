"""Markdown of ours against the others: differences, where it stands, where it loses."""

from page_cells import between, code, in_words, mean_of, number, p_of, table, won_of
from page_parts import CONTACTS, Part, on_both, outcomes, scene_of, shared
from page_rivals import best, others, unclear
from page_statistics import Difference

WORDS = {1: "better", 0: "level", -1: "worse"}

MOST_NAMED = 4
"""Others with whom ours is level that are named; of more only how many there are."""


def differences(part: Part, scored: bool) -> str:
    """Return our filter less each other method as a table."""
    heads = ["ours less", "only ours", "only theirs", "success, points (95 %)", "p"]
    heads += ["Cohen's g"]
    heads += [head for key in CONTACTS for head in (key, f"p ({key})")]
    heads += ["both", "time, ours / theirs (95 %)", "p (time)"]
    heads += ["metric (95 %)", "p (metric)"] * scored
    lines = []
    for name, pair in part.pairs.items():
        found = pair.differences
        same = pair.only_first == pair.only_second == 0
        points = between(found["success"].value, 100.0)
        line = [code(name), pair.only_first, pair.only_second]
        line += ["0, nowhere different" if same else points]
        line += [p_of(found["success"]), "–" if same else number(pair.g, 2)]
        for key in CONTACTS:
            line += [struck(part, name, key), p_of(found[key])]
        line += [pair.both, *both_of(found.get("time"), 2)]
        line += both_of(found.get("metric"), 3) if scored else []
        lines.append(line)
    return table(heads, lines)


def struck(part: Part, name: str, key: str) -> str:
    """Return in how many of the scenes of both ours and another have a contact."""
    ours, theirs, _ = on_both(part, (part.ours, name), CONTACTS[key])
    return f"{ours} / {theirs}"


def both_of(found: Difference | None, digits: int) -> list[str]:
    """Return value and p of a difference, or two dashes."""
    if found is None:
        return ["–", "–"]
    return [between(found.value, digits=digits), p_of(found)]


def standing(part: Part, key: str) -> str:
    """Return where ours stands against the best other in a quantity; p is Holm's.

    Both in the scenes that both ran, of the ranking with most. Of others that are
    equally good one is named.
    """
    name, *equals = best(part, key) or [""]
    if not name:
        return "–"
    one, found = part.most(name), part.versus(name)[key]
    if key == "time":
        how = between(found.value, digits=2)
    elif key in CONTACTS:
        how = struck(one, name, key)
    else:
        each = shared(one, (part.ours, name))
        of = [won_of(some) for some in each]
        if key == "metric":
            of = [mean_of(some, "metric") for some in each]
        how = " / ".join(of)
    who = code(name) + in_scenes(part, name) * (key != "success")
    who += f" and {len(equals)} more" * bool(equals)
    ahead = leads(part, name) if key == "success" else ""
    also = alike(part, key) if found.clear > 0 else ""
    return f"**{WORDS[found.clear]}**: {how}, {who}{ahead}{also}"


def in_scenes(part: Part, name: str) -> str:
    """Return in how many scenes ours stands against another, if not in the ranking's.

    Or if it is more in another column of contacts.
    """
    runs, one = part.pair(name).scenes, part.most(name)
    beside = {part.pair(x).scenes for key in CONTACTS for x in best(part, key)[:1]}
    if {runs} | beside == {part.scenes}:
        return ""
    clusters = len({one.clusters[scene_of(row)] for row in one.runs[name]})
    some = f" ({clusters} clusters)" * (clusters < runs != part.scenes)
    return f" in {runs} scenes{some}"


def alike(part: Part, key: str) -> str:
    """Return with whom ours is level in a quantity, where it is with anybody."""
    rest = unclear(part, key)
    told = f"{len(rest)} others"
    if len(rest) <= MOST_NAMED:
        told = ", ".join(map(code, rest))
    return f"; level with {told}" * bool(rest)


def leads(part: Part, named: str) -> str:
    """Return who succeeds most often, where that is more often than ours, and level.

    With the p of that comparison by itself.
    """
    found = {name: part.versus(name)["success"] for name in others(part)}
    most = min(found, key=lambda name: (found[name].value[0], name != named))
    if found[most].clear or found[most].value[0] >= 0.0:
        return ""
    both = " / ".join(map(won_of, shared(part.most(most), (part.ours, most))))
    who = f"; level: {both}, {code(most)}" * (most != named)
    return f"{who} (p {in_words(found[most].single)} by itself)"


def not_best(part: Part, scored: bool) -> str:
    """Return in words where our filter is not best, computed from the tables.

    Args:
        part: Of a study.
        scored: Whether ``metric`` says how good a method is, the more the better.
    """
    found = []
    ahead = [x for x, pair in part.pairs.items() if pair.only_first < pair.only_second]
    if ahead:
        found.append("more successes: " + ", ".join(lead(part, name) for name in ahead))
    fewer = [told for name in part.pairs if (told := struck_less(part, name))]
    if fewer:
        ours = outcomes(part, part.ours)["contact"]
        found.append(f"fewer contacts than our {ours}: {', '.join(fewer)}")
    quick = losses(part, "time", "ours takes {} times as long", 2)
    found += [f"quicker where both succeed: {quick}"] if quick else []
    more = losses(part, "metric", "ours less {}", 3) if scored else ""
    found += [f"a higher metric: {more}"] if more else []
    seen = ["success", "contacts begun in motion", "time", *["metric"] * scored]
    return "; ".join(found) or f"nowhere in {', '.join(seen[:-1])} and {seen[-1]}"


def struck_less(part: Part, name: str) -> str:
    """Return who begins fewer contacts than ours, in the scenes of both, or nothing."""
    hit = CONTACTS["contacts in motion"]
    theirs, ours, both = on_both(part, (name, part.ours), hit)
    some = f", ours {ours} in the same {both}" * (both < part.scenes)
    return f"{code(name)} ({theirs}{some})" * (theirs < ours)


def losses(part: Part, key: str, how: str, digits: int) -> str:
    """Return in words the methods that are clearly better than ours in a quantity."""
    found = {name: pair.differences.get(key) for name, pair in part.pairs.items()}
    return ", ".join(
        f"{code(name)} ({how.format(between(x.value, digits=digits))})"
        for name, x in found.items()
        if x is not None and x.clear < 0
    )


def lead(part: Part, name: str) -> str:
    """Return in words by how much another method is ahead of ours."""
    success = part.pairs[name].differences["success"]
    middle, low, high = success.value
    points = between((-middle, -high, -low), 100.0)
    return f"{code(name)} by {points} points" + ("" if success.clear else ", level")
