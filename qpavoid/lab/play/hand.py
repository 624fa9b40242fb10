"""Discs that a hand drags: physical obstacles, no faster than a hand is."""

import math
from dataclasses import dataclass

from qpavoid.lab.simulation.world import Track

HAND_SPEED = 1.5
"""m/s; a disc follows the pointer at this speed at most."""

EASE = 0.1
"""s; it follows with this lag: pointers move in jerks, hands do not."""

HOLD = 0.3
"""s; a grip that is not renewed for so long lets go: its browser may be lost."""

Place = tuple[float, float]


@dataclass
class Disc:
    """A disc, where it is and what moves it.

    Attributes:
        number: What clients and the velocity estimator call it, as long as it exists.
        place: x, y, m, world frame.
        radius: m.
        track: How it moves by itself; None from the first touch to the next restart.
        target: Where a hand pulls it; None: no hand.
        until: When the grip ends if it is not renewed, s.
    """

    number: int
    place: Place
    radius: float
    track: Track | None = None
    target: Place | None = None
    until: float = 0.0

    def __post_init__(self) -> None:
        self._first = self.place, self.track

    def pull(self, target: Place, time: float) -> None:
        """Take hold of the disc, or go on holding it, and pull it to a place."""
        self.track, self.target, self.until = None, target, time + HOLD

    def let_go(self) -> None:
        """Leave the disc where it is."""
        self.target = None

    def restart(self) -> None:
        """Go back to where it was put, or to the start of its track."""
        self.let_go()
        self.place, self.track = self._first
        if self.track is not None:
            self.place = _pair(self.track.at(0.0)[0].tolist())

    def after(self, time: float, dt: float) -> Place:
        """Return where the disc is at ``time + dt``."""
        if self.track is not None:
            return _pair(self.track.at(time + dt)[0].tolist())
        if self.target is not None and time > self.until:
            self.let_go()
        if self.target is None:
            return self.place
        way = self.target[0] - self.place[0], self.target[1] - self.place[1]
        far = math.hypot(*way)
        share = min(dt / max(EASE, dt), HAND_SPEED * dt / far) if far > 0.0 else 0.0
        return self.place[0] + share * way[0], self.place[1] + share * way[1]


def _pair(values: list[float]) -> Place:
    x, y = values
    return x, y
