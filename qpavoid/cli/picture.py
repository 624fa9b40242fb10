"""A scene and what was driven in it, on a terminal: eight dots of Braille a letter."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.text import Text

    from qpavoid.lab.simulation.log import Log
    from qpavoid.types import Array

WIDEST, TALLEST = 96, 24
"""Letters."""

DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Of Braille by row and column, added to U+2800."""


PLAIN = "default"
"""Of obstacles: as a terminal writes, whatever its background."""


class Canvas:
    """Dots of a box of the world, in colours.

    Args:
        box: x_low, x_high, y_low, y_high, m.
        width: Letters at most.
    """

    def __init__(self, box: Sequence[float], width: int) -> None:
        x_low, x_high, y_low, y_high = box
        wide, high = x_high - x_low, y_high - y_low
        self._scale = min(2 * width / wide, 4 * TALLEST / high)  # dots a metre
        self._origin = x_low, y_high
        self._columns = math.ceil(wide * self._scale / 2)
        self._rows = math.ceil(high * self._scale / 4)
        self._dots: dict[tuple[int, int], int] = {}
        self._colors: dict[tuple[int, int], str] = {}

    def draw(self, points: "Array", color: str) -> None:
        """Set the dots of points (n, 2), m; the colour drawn last stays."""
        for x, y in points:
            column = math.floor((x - self._origin[0]) * self._scale)
            row = math.floor((self._origin[1] - y) * self._scale)
            cell = row // 4, column // 2
            if 0 <= cell[0] < self._rows and 0 <= cell[1] < self._columns:
                self._dots[cell] = self._dots.get(cell, 0) | DOTS[row % 4][column % 2]
                self._colors[cell] = color

    def text(self) -> "Text":
        """Return its lines, from the first with a dot to the last."""
        from rich.text import Text

        lines, drawn = Text(), [row for row, _ in self._dots]
        for row in range(min(drawn), max(drawn) + 1):
            for column in range(self._columns):
                dots = chr(0x2800 + self._dots.get((row, column), 0))
                lines.append(dots, self._colors.get((row, column), ""))
            lines.append("\n")
        return lines


def picture(logs: "Sequence[Log]", width: int) -> "Text":
    """Return plan, obstacles at the decisive moment and every way, as on a figure."""
    import numpy as np

    from qpavoid.lab.study.scene import decisive_step, fleets_of, view_box
    from qpavoid.lab.study.style import styles

    fleets = fleets_of(logs)
    first, step = logs[0], decisive_step(fleets[0])
    canvas = Canvas(view_box(logs, [step], surroundings=2.0), width)
    rim = np.linspace(0.0, math.tau, 64)
    for x, y, radius in first.discs[step]:
        disc = np.stack([x + radius * np.cos(rim), y + radius * np.sin(rim)], axis=1)
        canvas.draw(disc, PLAIN)
    walls = first.walls.reshape(-1, 2, 2)
    sides = [
        (a, b)
        for corners in first.polygons_at(step)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)
    ]
    along = np.linspace(0.0, 1.0, 200)[:, None]
    for a, b in (*walls, *sides):
        canvas.draw(a + along * (b - a), PLAIN)
    canvas.draw(first.points, PLAIN)
    looks = styles([fleet[0] for fleet in fleets])
    for fleet, look in zip(reversed(fleets), reversed(looks), strict=True):
        for log in fleet:
            canvas.draw(np.column_stack([log["x_m"], log["y_m"]]), look.color)
    text = canvas.text()
    for look in looks:
        text.append(f"── {look.label}  ", look.color)
    return text
