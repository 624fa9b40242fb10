"""Colours and lines of all figures: the same for a method wherever it appears."""

from collections.abc import Sequence
from itertools import cycle
from typing import NamedTuple, TypeAlias

from qpavoid.lab.scenario.methods import labelled
from qpavoid.lab.simulation.log import Log

BLACK, BLUE, RED, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"

PURPLE, ORANGE, SKY = "#CC79A7", "#E69F00", "#56B4E9"
"""Colours that the colour-blind tell apart [Okabe2008]."""

COLORS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)

MARGIN, DANGER, SOLID = "#D9D9D9", "#F6C9BC", "#404040"
"""Fill of the band from r_min to r, of what is nearer than r_min, and of obstacles."""

WIDTH = 9.0
"""Width of all figures, in."""

Line: TypeAlias = str | tuple[float, tuple[float, ...]]


class Style(NamedTuple):
    """How a method looks in every figure."""

    label: str
    color: str
    line: Line


NAMED = {
    "eq5": Style("Eq. 5", BLUE, (0, (1.2, 1.0))),
    "eq7": Style("Eq. 7", RED, (0, (6, 1.5, 1.2, 1.5))),
    "qp": Style("one-step QP", ORANGE, (0, (4, 1))),
    "qp-ahead": Style("look-ahead QP", GREEN, "-"),
    "qp-ahead+guide": Style("guided QP", PURPLE, (0, (3, 1, 1, 1, 1, 1))),
}

OTHERS = (
    (SKY, (0, (8, 2))),
    (BLACK, (0, (1, 2))),
)


def styles(logs: Sequence[Log]) -> list[Style]:
    """Return the style of every log: the same for a method wherever it appears."""
    others = cycle(OTHERS)
    chosen = []
    for log in logs:
        name = str(log.meta["controller"])
        style = NAMED[name] if name in NAMED else Style(name, *next(others))
        chosen.append(style._replace(label=labelled(log.meta, style.label)))
    return chosen
