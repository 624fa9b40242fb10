"""Against whom ours stands in a ranking: the other methods, and the best of them."""

import math
from collections.abc import Hashable, Sequence

from page_parts import CONTACTS, Part, is_other, scene_of, times_of
from page_statistics import LEVEL, Difference, exact_p, holm, summed, time_ratio

COMPARABLE = 0.8
"""Of the greatest share of successes: from here on a method's times are comparable."""


def others(part: Part) -> list[str]:
    """Return the methods for the same robot that are not our filter, best first."""
    return [name for name in part.pairs if is_other(name)]


def many(part: Part) -> list[str]:
    """Return the other methods that ran half as many scenes as one of them, or ours."""
    runs = {name: len(part.runs[name]) for name in others(part)}
    most = min(len(part.runs[part.ours]), max(runs.values(), default=0))
    return [name for name in runs if runs[name] >= 0.5 * most]


def comparable(part: Part) -> list[str]:
    """Return the methods that succeed about as often as the best."""
    rate = {name: part.won(name) / len(rows) for name, rows in part.runs.items()}
    return [x for x in rate if rate[x] >= COMPARABLE * max(rate.values())]


def rivals(part: Part, key: str) -> list[str]:
    """Return the other methods that ours stands against in a quantity.

    In time and contacts those that succeed about as often as the best.
    """
    near = comparable(part) if fewer(key) else others(part)
    return [x for x in others(part) if x in near and key in part.versus(x)]


def fewer(key: str) -> bool:
    """Return whether less of a quantity is better."""
    return key == "time" or key in CONTACTS


def rival(part: Part, key: str) -> str:
    """Return the other method that is best in a quantity; empty: there is none."""
    return next(iter(best(part, key)), "")


def best(part: Part, key: str) -> list[str]:
    """Return the other methods that are best in a quantity; of most scenes first.

    Of the :func:`rivals` that are clearly better than ours, if there are such, else of
    those that ran in :func:`many` scenes.
    """
    found = {x: part.versus(x)[key] for x in rivals(part, key)}
    clear = {name: x for name, x in found.items() if x.clear < 0}
    level = {name: found[name] for name in many(part) if name in found}
    sign = -1.0 if fewer(key) else 1.0

    def order(name: str) -> tuple[float, int]:
        return sign * found[name].value[0], -len(part.runs[name])

    names = sorted(clear or level or found, key=order)
    least = order(names[0])[0] if names else 0.0
    return [x for x in names if math.isclose(order(x)[0], least, abs_tol=1e-9)]


def unclear(part: Part, key: str) -> list[str]:
    """Return those of the :func:`rivals` in many scenes that ours is level with."""
    level = [x for x in rivals(part, key) if not part.versus(x)[key].clear]
    return [name for name in level if name in many(part)]


def over(part: Part, name: str, other: str) -> Difference | None:
    """Return the times of a method over those of another."""
    first, second = (times_of(part.runs[x]) for x in (name, other))
    return time_ratio(first, second, part.clusters)


def quickest(part: Part) -> str:
    """Return the quickest of the methods that succeed about as often as the best.

    By the times over ours where both succeed; without ours, over the best.
    """
    yard = part.ours or next(iter(part.runs))
    ratios = {x: over(part, x, yard) for x in comparable(part) if part.won(x)}
    known = {name: found.value[0] for name, found in ratios.items() if found}
    return min(known, key=lambda name: known[name]) if known else ""


def at_the_top(part: Part, tests: Sequence[float]) -> bool:
    """Return whether ours fails so seldom that nobody could clearly succeed more often.

    Not one who never fails: Holm's p of that is not below 0.05.

    Args:
        part: A ranking.
        tests: p of the comparisons of its study, each by itself.
    """
    most = part.most(part.ours)
    lost: dict[Hashable, float]
    lost = {scene_of(row): 1.0 for row in most.runs[part.ours] if not row["success"]}
    sums, _ = summed(lost, most.clusters)
    return not lost or holm([exact_p(sums), *sorted(tests)[:-1]])[0] >= LEVEL
