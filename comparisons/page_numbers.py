"""Numbers that the page's texts say of a ranking, filled in from its tables.

A text has ``{nmpc below}``: a method (``ours`` is one) and one of :data:`SAYS`; or
``{scenes}``, how many there are.
"""

from collections.abc import Callable, Mapping

from page_parts import Part, outcomes
from page_text import below, least, mean_of, median_time, number


def nearer(part: Part, name: str) -> str:
    """Return how much nearer than r_min its worst run came, in cm."""
    return number(-100.0 * (least(part.runs[name], "min_room_m") or 0.0), 0)


def times(part: Part, name: str) -> str:
    """Return how many times as long ours takes where both succeed."""
    return number(part.pairs[name].differences["time"].value[0], 2)


SAYS: Mapping[str, Callable[[Part, str], object]] = {
    "won": lambda part, name: part.won(name),
    "moving": lambda part, name: outcomes(part, name)["contact"],
    "standing": lambda part, name: outcomes(part, name)["contact_standing"],
    "late": lambda part, name: outcomes(part, name)["late"],
    "below": lambda part, name: below(part.runs[name]),
    "nearer": nearer,
    "median": lambda part, name: median_time(part.runs[name]),
    "metric": lambda part, name: mean_of(part.runs[name], "metric"),
    "times": times,
}
"""Of a method: runs with success, with a contact begun in motion, or only while it
stood, not over in time, nearer than r_min; how much nearer in the worst, cm; median
time of the successes, s; mean metric; how many times as long ours takes."""


class Numbers:
    """The numbers of a ranking by key, for ``str.format_map``.

    Args:
        part: The ranking.
    """

    def __init__(self, part: Part) -> None:
        self.part = part

    def __getitem__(self, key: str) -> object:
        if key == "scenes":
            return self.part.scenes
        name, _, quantity = key.rpartition(" ")
        return SAYS[quantity](self.part, self.part.ours if name == "ours" else name)
