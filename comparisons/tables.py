"""Tables and figure of the comparisons, made from the rows in ``comparisons/results``.

    python comparisons/tables.py               # write the tables and the figure
    python comparisons/tables.py --print barn  # a table with every method that ran

The success interval is Wilson's (95 %). Scenes that repeat (phases of a world, levels
of a scene) form one cluster, and n is divided by the design effect [Korn1998]. The
paired test sums the signs of the differences of two methods by cluster and counts all
signs of these sums [Fisher1935]: McNemar's exact test where each scene is a cluster of
its own, and a sign test for times. All p of a quantity are Holm's [Holm1979].
"""

import argparse
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from scipy import stats

from qpavoid.lab.study.tables import markdown_table
from qpavoid.types import Array
from rows import (
    FLEETS,
    RANKINGS,
    REACTING,
    Ranking,
    Run,
    Runs,
    chosen,
    cluster,
    read_costs,
)

HERE = Path(__file__).resolve().parent
FIGURE = HERE / "figures" / "success.png"
PAGES = HERE / "README.md", HERE.parent / "README.md", HERE / "crowdnav" / "README.md"

OURS = "qp-ahead+guide"
NAMED = {"mppi": "MPPI", "nmpc": "NMPC", "teb": "TEB", "mpc-cbf": "MPC-CBF"}
NAMED["orca"] = "ORCA"
"""Methods that every table shows, with their labels."""

COLORS = "#1a8f3c", "#1f77b4", "#d95f02", "#7b5ea7", "#b8860b", "#7f7f7f"
"""Of ours and the named methods."""

VARIANT = re.compile(r"qp-ahead(?!\+guide@)|\+guide(?!@)|^omni$|holonomic")
"""Variants of our method, and other machines: printed by ``--print`` only."""

LEVEL, CLOSE, FEW = 0.05, 0.8, 8
"""Level of the paired test; part of the best success from which on contacts and time
are compared; common successes from which on a ratio of times is shown."""

FIRST = (
    *("Forests", "Moving discs, perception", "Moving discs as points"),
    *("BARN, 2 m/s, LiDAR", "DynaBARN, 1 m/s", "Recorded crowds, LiDAR"),
    *("CrowdNav, 10 people", "Maps, after A*"),
)
"""Rankings of the first table."""


class Summary(NamedTuple):
    """Numbers of runs of a method, its success and its time."""

    ran: int
    success: tuple[float, float, float]  # share and 95 % interval
    moving: int  # with a contact that began while the robot moved
    contacts: int
    ratio: float  # median time / MPPI on common successes; NaN: fewer than FEW
    below: int  # nearer than r_min by more than 1 mm


def share(hits: Array, clusters: Array) -> tuple[float, float, float]:
    """Return the share of hits (n,) and Wilson's 95 % interval, by clusters (n,).

    n is divided by the design effect: the variance of the mean between k clusters over
    that of independent runs, times (t of k - 1 over t of n - 1 degrees of freedom)².
    Where all runs end alike, n is k.
    """
    n, rate = len(hits), float(np.mean(hits))
    _, number = np.unique(clusters, return_inverse=True)
    k = number.max() + 1
    between = (np.bincount(number, hits - rate) ** 2).sum() / n**2 * k / max(k - 1, 1)
    within = rate * (1.0 - rate) / max(n - 1, 1)
    size = float(k)
    if within > 0.0 and k > 1:
        wider = stats.t.ppf(0.975, k - 1) / stats.t.ppf(0.975, n - 1)
        size = n / max(between / within, 1.0) / wider**2
    z2 = float(stats.norm.ppf(0.975)) ** 2 / size
    middle = (rate + z2 / 2.0) / (1.0 + z2)
    half = math.sqrt(z2 * (rate * (1.0 - rate) + z2 / 4.0)) / (1.0 + z2)
    return rate, max(0.0, middle - half), min(1.0, middle + half)


def exact_p(sums: Iterable[int]) -> float:
    """Return the share of all signs with a sum as far from 0 [Streitberg1986]."""
    spread, total = np.ones(1), 0  # of the sum of those with a plus
    for number in sums:
        step, total = abs(number), total + number
        spread = 0.5 * (np.pad(spread, (0, step)) + np.pad(spread, (step, 0)))
    reached = np.abs(2 * np.arange(len(spread)) - len(spread) + 1)
    return min(1.0, float(spread[reached >= abs(total)].sum()))


def holm(p: Sequence[float]) -> list[float]:
    """Return Holm's p of several, in their order."""
    order = np.argsort(p, kind="stable")
    times = np.arange(len(p), 0, -1)
    raised = np.minimum(np.maximum.accumulate(np.asarray(p)[order] * times), 1.0)
    return [float(x) for x in raised[np.argsort(order, kind="stable")]]


QUANTITIES: Mapping[str, Callable[[Run], float]] = {
    "success": lambda run: float(not run.end),
    "moving": lambda run: -float(run.end == "c"),
    "contacts": lambda run: -float(run.end in ("c", "t")),
    "time": lambda run: -run.time,  # NaN: compared on common successes only
}
"""Quantities of the paired test; more is better."""


def paired(ranking: Ranking, key: str, first: Runs, second: Runs) -> tuple[int, float]:
    """Return the sum of the signs of first less second on common scenes, and its p."""
    sums: Counter[object] = Counter()
    for scene in first.keys() & second.keys():
        less = QUANTITIES[key](first[scene]) - QUANTITIES[key](second[scene])
        sums[cluster(ranking, scene)] += (less > 0.0) - (less < 0.0)
    return sums.total(), exact_p(sums.values())


def summarise(ranking: Ranking, runs: Runs, mppi: Runs) -> Summary:
    """Return the numbers of a method."""
    numbers = {one: k for k, one in enumerate({cluster(ranking, x) for x in runs})}
    hits = np.array([not run.end for run in runs.values()], float)
    ends = Counter(run.end for run in runs.values())
    ratios = [x.time / mppi[k].time for k, x in runs.items() if k in mppi]
    ratios = [x for x in ratios if not math.isnan(x)]
    return Summary(
        len(runs),
        share(hits, np.array([numbers[cluster(ranking, x)] for x in runs])),
        ends["c"],
        ends["c"] + ends["t"],
        median(ratios) if len(ratios) >= FEW else math.nan,
        sum(run.inside > 0 for run in runs.values()),
    )


class Compared(NamedTuple):
    """A ranking: runs and numbers by method, and what is best by quantity."""

    ranking: Ranking
    runs: Mapping[str, Runs]
    rows: Mapping[str, Summary]
    best: Mapping[str, set[str]]

    def shown(self) -> list[str]:
        """Return the methods of the table: ours, the named ones, the best other."""
        names = [self.ranking.before + name for name in (OURS, *NAMED)]
        rest = [x for x in self.rated() if x not in names]
        return [x for x in names if x in self.rows] + rest[:1]

    def rated(self) -> list[str]:
        """Return ours and the other methods for the same robot, the best first."""
        ours = self.ranking.before + OURS
        some = [x for x in self.rows if x == ours or not VARIANT.search(x)]
        named = [self.rows.get(self.ranking.before + name) for name in NAMED]
        few = min((row.ran for row in named if row), default=0) / 2
        return sorted((x for x in some if self.rows[x].ran >= few), key=self.order)

    def order(self, name: str) -> tuple[float, ...]:
        """Return what methods are sorted by: success, contacts, time."""
        row = self.rows[name]
        ratio = math.inf if math.isnan(row.ratio) else row.ratio
        return -row.success[0], row.contacts / row.ran, ratio


@lru_cache
def compare(ranking: Ranking) -> Compared:
    """Return a ranking with all its numbers and paired tests."""
    runs = chosen(ranking)
    mppi = runs.get(ranking.before + "mppi", {})
    rows = {x: summarise(ranking, some, mppi) for x, some in runs.items()}
    found = Compared(ranking, runs, rows, {})
    rated = found.rated()
    top = CLOSE * rows[rated[0]].success[0]
    close = [x for x in rated if rows[x].success[0] >= top]
    timed = [x for x in close if not math.isnan(rows[x].ratio)]
    rate = {
        "success": (rated, lambda x: -rows[x].success[0]),
        "moving": (close, lambda x: rows[x].moving / rows[x].ran),
        "contacts": (close, lambda x: rows[x].contacts / rows[x].ran),
        "time": (timed, lambda x: rows[x].ratio),
    }
    best = {}
    for key, (names, loss) in rate.items():
        first, *others = sorted(names, key=loss) or [""]
        tests = [paired(ranking, key, runs[first], runs[x]) for x in others]
        level = zip(others, tests, holm([p for _, p in tests]), strict=True)
        best[key] = {first} | {x for x, (s, _), p in level if s <= 0 or p >= LEVEL}
    return found._replace(best=best)


HEADS = (
    *("n", "success, % (95 %)", "moving contacts", "contacts", "time / MPPI"),
    *("below r_min", "solve, ms"),
)


def number(value: float, form: str) -> str:
    """Return a number as a cell; NaN is a dash."""
    return "–" if math.isnan(value) else format(value, form if value < 100.0 else ".0f")


def label(found: Compared, name: str) -> str:
    """Return what a table calls a method."""
    plain = name.removeprefix(found.ranking.before)
    return "**ours**" if plain == OURS else NAMED.get(plain, f"`{name}`")


def costs(ranking: Ranking, name: str) -> list[float]:
    """Return median and p99 of the solve time, ms, and BARN's metric."""
    places = read_costs().items()
    mine = [(k[1], x) for k, x in places if (k[0], k[2]) == (ranking.study, name)]
    some = [x for setting, x in mine if re.search(ranking.settings, setting)]
    middle, high, metric = np.median(some, axis=0).tolist()
    return [1e-3 * middle, 1e-3 * high, metric]


def cells(found: Compared, name: str) -> list[str]:
    """Return the cells of a method behind its name; bold: among the best."""
    row, (middle, high, metric) = found.rows[name], costs(found.ranking, name)

    def mark(key: str, text: str) -> str:
        return f"**{text}**" if name in found.best[key] and text != "–" else text

    rate, low, top = (100.0 * x for x in row.success)
    return [
        str(row.ran),
        mark("success", f"{rate:.1f}") + f" ({low:.0f}–{top:.0f})",
        mark("moving", str(row.moving)),
        mark("contacts", str(row.contacts)),
        mark("time", number(row.ratio, ".2f")),
        str(row.below),
        f"{number(middle, '.2g')} / {number(high, '.2g')}",
    ] + [number(metric, ".3f")] * found.ranking.study.startswith("barn")


def written(heads: Sequence[str], lines: Iterable[Sequence[str]], words: int) -> str:
    """Return a table in Markdown, its first columns words, the others numbers."""
    return markdown_table(heads, lines, heads[words:]).rstrip("\n")


def study_table(name: str, every: bool = False) -> str:
    """Return the table of a study; ``every``: with all methods that ran."""
    some = [compare(x) for x in RANKINGS + REACTING if x.table == name]
    lines = []
    for found in some:
        shown = found.shown()
        names = sorted(found.rows, key=found.order) if every else shown
        title = [found.ranking.title] if len(some) > 1 else []
        for place, one in enumerate(names):
            first = [title[0] if place == 0 else ""] if title else []
            lines.append([*first, label(found, one), *cells(found, one)])
    heads = ["scenes"] * (len(some) > 1) + ["method", *HEADS]
    heads += ["metric"] * some[0].ranking.study.startswith("barn")
    return written(heads, lines, heads.index("n"))


def short_table(rankings: Iterable[Ranking]) -> str:
    """Return success and contacts, %, of ours and the named methods."""
    lines = []
    for ranking in rankings:
        found, line = compare(ranking), [ranking.title]
        for name in (OURS, *NAMED):
            row = found.rows.get(ranking.before + name)
            line.append(in_short(found, ranking.before + name, row) if row else "–")
        lines.append([line[0], str(found.rows[ranking.before + OURS].ran), *line[1:]])
    return written(["scenes", "n", "ours", *NAMED.values()], lines, 1)


def in_short(found: Compared, name: str, row: Summary) -> str:
    """Return success and contacts, %, of a method."""
    text = f"{100.0 * row.success[0]:.0f}"
    tested = found.ranking not in FLEETS and name in found.best["success"]
    text = f"**{text}**" if tested else text
    return f"{text} / {100.0 * row.contacts / row.ran:.0f}"


def draw(path: Path) -> None:
    """Draw success with its interval, a row a study, a colour a method."""
    plt.rcParams["axes.spines.top"] = plt.rcParams["axes.spines.right"] = False
    half = (len(RANKINGS) + 1) // 2
    figure, panels = plt.subplots(
        1, 2, figsize=(10.0, 6.2), dpi=110, layout="constrained"
    )
    for axes, some in zip(panels, (RANKINGS[:half], RANKINGS[half:]), strict=True):
        for place, ranking in enumerate(some):
            if place % 2:
                axes.axhspan(place - 0.5, place + 0.5, color="0.95", lw=0.0)
            plot(axes, compare(ranking), place)
        axes.set(xlim=(-2, 102), ylim=(half - 0.5, -0.5), xlabel="success, % (95 %)")
        axes.set_yticks(range(len(some)), [x.title for x in some], fontsize=9)
        axes.tick_params(axis="y", length=0)
    handles = [Line2D([], [], color=x, marker="o", lw=2.0) for x in COLORS]
    names = ["ours", *NAMED.values()]
    figure.legend(handles, names, loc="outside upper center", ncols=6, frameon=False)
    figure.savefig(path, metadata={"Software": ""})
    plt.close(figure)


def plot(axes: Axes, found: Compared, place: int) -> None:
    """Draw the methods of one study, one below the other."""
    for k, (name, color) in enumerate(zip((OURS, *NAMED), COLORS, strict=True)):
        row = found.rows.get(found.ranking.before + name)
        if row:
            y = place + 0.14 * (k - 2.5)
            rate, low, high = (100.0 * x for x in row.success)
            axes.plot([low, high], [y, y], color=color, lw=1.6, solid_capstyle="butt")
            axes.plot(rate, y, "o", color=color, ms=4.5 if k == 0 else 3.0)


def filled(text: str, tables: Mapping[str, Callable[[], str]]) -> str:
    """Return a page with its tables replaced."""

    def table(found: re.Match[str]) -> str:
        head, name, end = found.groups()
        return f"{head}\n{tables[name]()}\n{end}"

    pattern = r"(<!-- table: (\w+) -->)\n.*?(<!-- end -->)"
    return re.sub(pattern, table, text, flags=re.DOTALL)


def tables() -> Mapping[str, Callable[[], str]]:
    """Return the tables of the page by name."""
    by_title = {x.title: x for x in RANKINGS}
    first = [by_title[title] for title in FIRST]
    named = {x.table: partial(study_table, x.table) for x in RANKINGS}
    named["reacting"] = partial(study_table, "reacting", every=True)
    short = {
        "first": partial(short_table, first),
        "fleet": partial(short_table, FLEETS),
    }
    return {**named, **short}


def main() -> None:
    """Write all tables and the figure, or print a table."""
    parser = argparse.ArgumentParser(
        description="Tables and figure of the comparisons."
    )
    names = sorted({x.table for x in RANKINGS + REACTING})
    parser.add_argument("--print", dest="table", choices=names, help="one table whole")
    if table := parser.parse_args().table:
        print(study_table(table, every=True))
        return
    for path in PAGES:
        text = filled(path.read_text(encoding="utf-8"), tables())
        path.write_text(text, encoding="utf-8")
    draw(FIGURE)


if __name__ == "__main__":
    main()
