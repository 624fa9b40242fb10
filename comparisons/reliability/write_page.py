"""The page of reliability: what was tried to break the filter, and what came of it.

    python comparisons/reliability/write_page.py

Every section is made of a table in ``comparisons/results/reliability``, which a module
beside this one gathers; a section without a table is left out. Those with a function of
their own stand here, the others in ``sections.toml``.
"""

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qpavoid.lab.study.tables import markdown_table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.data import rows_of

PAGE = Path(__file__).with_name("README.md")
TOLD = PAGE.with_name("sections.toml")
"""Sections that are a text and a whole table."""

HEAD = """# Reliability

<!-- Made by `python comparisons/reliability/write_page.py`: edit that or the data. -->

What was tried to break the filter, and what came of it. What a robot does when
something fails is told in [docs/reliability.md](../../docs/reliability.md). No figure
here is a certificate: each says what happened in so many trials.
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
`python comparisons/reliability/calls.py --solver exact --count 250000 --seed 0`
"""


def exported() -> str:
    """Return the section of the exported C."""
    shown = ("part", "threads", "calls", "invalid", "not finite", "beyond limits")
    return f"""## The exported C

{total("exported", "calls"):,} fuzzed calls, {sanitized():,} of them under sanitizers,
which end the program at the first thing that they find.

{table("exported", (*shown, "worst ms", "worst call"))}
`python comparisons/reliability/exported.py --filter plain --sanitizer thread`
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
`python comparisons/reliability/exported.py --filter plain --count 0`
"""


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
`python comparisons/reliability/loops.py --count 10000`
"""


SECTIONS = {
    "calls": calls,
    "exported": exported,
    "source": source,
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
