"""The page of reliability: what was tried to break the filter, and what came of it.

    python comparisons/reliability.py

Every section is made of a table in ``comparisons/results/reliability``, which a module
of ``comparisons/reliable`` gathers; a section without a table is left out. Those with a
function of their own stand here, the others in ``reliability.toml``.
"""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qpavoid.lab.study.statistics import wilson
from qpavoid.lab.study.tables import markdown_table
from reliable.data import rows_of

PAGE = Path(__file__).with_name("reliability.md")
TOLD = PAGE.with_suffix(".toml")
"""Sections that are a text and a whole table."""

EQUIVALENT = "equivalent: "
"""So begins the reason of a mutant that no call could tell."""

HEAD = """# Reliability

<!-- Made by `python comparisons/reliability.py`; edit that or the data, not this. -->

What was tried to break the filter, and what came of it. What a robot does when
something fails is told in [docs/reliability.md](../docs/reliability.md). No figure here
is a certificate: each says what happened in so many trials.
"""


def table(name: str, columns: Sequence[str]) -> str:
    """Return some columns of a table; the first is text."""
    lines = [[row[column] for column in columns] for row in rows_of(name)]
    return markdown_table(columns, lines, columns[1:])


def total(name: str, column: str) -> int:
    """Return the sum of a column."""
    return sum(int(row[column]) for row in rows_of(name))


def calls() -> str:
    """Return the section of hostile calls in Python."""
    shown = ("part", "calls", "invalid", "raised", "not finite", "beyond limits")
    return f"""## Always an answer: hostile calls of `step`

{total("calls", "calls"):,} calls, two of three spoilt: wrong kinds, shapes and counts,
NaN, infinities, denormals, masked arrays, text, generators, objects that raise or leave
when asked for numbers, stamps, ages and twists driven of any sort. Most of the worst
calls, by the time of the processor, have 3,000 points on and around the robot.
OSQP once took 12.6 s over 30 obstacles: back ends run in the caller's thread. Memory is
what is added after a twentieth of the calls, with the workspace for the most crowded
scene met; CasADi keeps a program for every power of two
of rows, some of them made later.

{table("calls", (*shown, "MB grown", "worst ms", "worst call"))}
`python comparisons/reliable/calls.py --solver exact --count 250000 --seed 0`
"""


def exported() -> str:
    """Return the section of the exported C."""
    shown = ("part", "threads", "calls", "invalid", "not finite", "beyond limits")
    return f"""## The exported C

{total("exported", "calls"):,} fuzzed calls, {sanitized():,} of them under sanitizers,
which end the program at the first thing that they find.

{table("exported", (*shown, "worst ms", "worst call"))}
`python comparisons/reliable/exported.py --filter plain --sanitizer thread`
"""


def sanitized() -> int:
    """Return how many calls were made under sanitizers."""
    rows = [row for row in rows_of("exported") if row["sanitizer"] != "none"]
    return sum(int(row["calls"]) for row in rows)


def source() -> str:
    """Return the section of stack, loops and warnings."""
    most = ("filter", "lines", "stack bytes", "loops", "counted", "warnings of gcc")
    shown = *most, "warnings of clang"
    return f"""### Stack, loops, warnings

The stack is the deepest path of gcc's call graph (`-fcallgraph-info=su`, -O2), in which
no function calls itself and every frame has a bound; what the C library uses is extra.
Nothing is allocated. Loops that are counted run over an index to a limit that is known
when they begin; the others are `while` loops over rows of a table, over ticks of the
horizon, or that halve an interval. Clang (zig) compiles for this machine and for 32-bit
ARM (`arm-linux-gnueabihf`).

{table("source", shown)}
`python comparisons/reliable/exported.py --filter plain --count 0`
"""


def mutants() -> str:
    """Return the section of mutants."""
    rows = [row for row in rows_of("mutants") if row["killed by"] != "does not compile"]
    seeds = sorted({row["seed"] for row in rows})
    alive = [row for row in rows if not row["killed by"]]
    told = [row for row in alive if not row["reason"].startswith(EQUIVALENT)]
    count = len(rows) - len(alive)
    since = count + sum(row["reason"].startswith("killed") for row in alive)
    head = "seed", "file", "function", "line", "change", "reason"
    lines = [[{**row, **place(row["mutant"])}[name] for name in head] for row in alive]
    return f"""## Tests that would notice: mutants

One place of one function is changed, at random over the folders `qp`, `model`, `guide`
and `avoidance`; machine code is made anew of the change. Each mutant has 30 s of the
processor, in which the tests run that take less than 1 s without numba: those named
after the module first, then the answers on record (their place in the order, and 30 s
instead of 20, were chosen with sample 3). When a sample was drawn no test had been
written against it. Killed, with Wilson's intervals of 95 %; 90 % were wanted:

{markdown_table(("sample", "mutants", "killed", "% (95 %)"), killed(rows, seeds))}
Of the survivors {len(alive) - len(told)} are equivalent, for the reasons given: no call
tells them from what they were. Without these it is
**{share(count, count + len(told))}**. With the tests written since against survivors
{since} are killed, which says nothing about others. Those that survived:

{markdown_table(head, lines)}
`python comparisons/reliable/mutants.py --count 101 --seed 3`
"""


def place(mutant: str) -> dict[str, str]:
    """Return file, function and change of a mutant from its name."""
    return dict(zip(("file", "function", "change"), mutant.split(", "), strict=False))


def killed(rows: Sequence[dict[str, str]], seeds: Sequence[str]) -> list[list[Any]]:
    """Return a line a sample, and one of all."""
    parts = {seed: [row for row in rows if row["seed"] == seed] for seed in seeds}
    parts["all"] = list(rows)
    hits = {
        name: sum(bool(row["killed by"]) for row in of) for name, of in parts.items()
    }
    return [
        [name, len(of), hits[name], share(hits[name], len(of))]
        for name, of in parts.items()
    ]


def share(count: int, of: int) -> str:
    """Return a share in per cent, with its interval."""
    rate, low, high = (100.0 * x for x in wilson(count, of))
    return f"{rate:.0f} % ({low:.0f} to {high:.0f})"


def loops() -> str:
    """Return the section of faults in the loop."""
    within = [row for row in rows_of("loops") if row["within the premises"] == "yes"]
    touched = sum(int(row["contacts"]) for row in within)
    shown = ("fault", "within the premises", "loops", "contacts", "below r_min")
    return f"""## Faults in the loop

{total("loops", "loops"):,} closed loops of 6 s among 40 posts that stand, the desired
twist unmindful, one fault from a random time on for 0.1 to 2 s, then none. Within the
premises what fails shows in the stamps, or the robot brakes by itself: **{touched}
contacts** in {sum(int(r["loops"]) for r in within):,} loops. Outside them the robot is
told what is not so. A contact counts where the robot moved.

{table("loops", (*shown, "least clearance m"))}
`python comparisons/reliable/loops.py --count 10000`
"""


SECTIONS = {
    "calls": calls,
    "exported": exported,
    "source": source,
    "mutants": mutants,
    "loops": loops,
}
"""By the table that each is made of."""


def page() -> str:
    """Return the page, of the tables that there are."""
    made = [section() for name, section in SECTIONS.items() if rows_of(name)]
    told = tomllib.loads(TOLD.read_text(encoding="utf-8"))["section"]
    return "\n".join(
        [HEAD, *made, *(shown(one) for one in told if rows_of(one["table"]))]
    )


def shown(told: dict[str, Any]) -> str:
    """Return a section whose whole table is shown."""
    rows = rows_of(told["table"])
    lines = [[*row.values()] for row in rows]
    ends = f"Held by {told['test']}; made by `{told['make']}`."
    table = markdown_table([*rows[0]], lines)
    return f"## {told['title']}\n\n{told['text'].strip()}\n\n{table}\n{ends}\n"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
