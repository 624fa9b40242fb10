"""Moving and static obstacles of a scenario, world frame, at any time."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from qpavoid.errors import InvalidInputError
from qpavoid.model.obstacles import NO_DISCS, NO_POINTS, NO_WALLS, Obstacles
from qpavoid.types import Array

ABSENT = 1e4
"""m; x and y, at least, of a disc that is not there: far from all its places."""


@dataclass(frozen=True, eq=False)
class Track:
    """A disc that moves along straight lines between way-points with times.

    Attributes:
        times: (n,) s, increasing.
        positions: (n, 2) m.
        radius: m.
        endless: Keep the first and last velocity beyond the ends, instead of standing.
        fleeting: Not there before the first and after the last time; then it is
            :data:`ABSENT`.

    Raises:
        InvalidInputError: Shapes do not fit, times do not increase.
    """

    times: Array
    positions: Array
    radius: float
    endless: bool = False
    fleeting: bool = False

    def __post_init__(self) -> None:
        times = np.array(self.times, dtype=np.float64)
        positions = np.array(self.positions, dtype=np.float64)
        if times.ndim != 1 or positions.shape != (len(times), 2) or not len(times):
            raise InvalidInputError("a track needs (n,) times and (n, 2) positions")
        if (np.diff(times) <= 0).any():
            raise InvalidInputError("the times of a track must increase")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)

    @classmethod
    def straight(cls, position: Array, velocity: Array, radius: float) -> "Track":
        """Return a disc at ``position`` at time 0 with a constant velocity."""
        places = np.array([position, np.add(position, velocity)])
        return cls(np.array([0.0, 1.0]), places, radius, endless=True)

    def at(self, time: float) -> tuple[Array, Array]:
        """Return position (2,) and velocity (2,) at a time."""
        if self.fleeting and not self.times[0] <= time <= self.times[-1]:
            farthest = float(np.abs(self.positions).max())
            return np.full(2, ABSENT * (1.0 + farthest // (0.5 * ABSENT))), np.zeros(2)
        last = len(self.times) - 1
        # The piece that begins at or before the time; −1 before the first way-point.
        i = int(np.searchsorted(self.times, time, side="right")) - 1
        beyond = i < 0 or i >= last
        if last == 0 or (beyond and not self.endless):
            return self.positions[min(max(i, 0), last)], np.zeros(2)
        i = min(max(i, 0), last - 1)
        velocity = (self.positions[i + 1] - self.positions[i]) / (
            self.times[i + 1] - self.times[i]
        )
        return self.positions[i] + velocity * (time - self.times[i]), velocity


class Pushed(NamedTuple):
    """A convex polygon that is pushed about without turning.

    Attributes:
        vertices: (n, 2) m, counter-clockwise.
        shifts: Its way from there.
    """

    vertices: Array
    shifts: Track


@dataclass(frozen=True, eq=False)
class World:
    """All obstacles of a scenario.

    Attributes:
        discs: (M, 3) discs that stand still: x, y, radius in m.
        tracks: Discs that move; they are numbered after the others.
        points: (N, 2) m.
        walls: (K, 4) m.
        polygons: Obstacles that are convex polygons at time 0, with their velocities
            and rates of turn, which they keep; numbered after all these.
        pushed: Polygons that are pushed about; numbered last.
    """

    discs: Array = field(default_factory=lambda: NO_DISCS)
    tracks: tuple[Track, ...] = ()
    points: Array = field(default_factory=lambda: NO_POINTS)
    walls: Array = field(default_factory=lambda: NO_WALLS)
    polygons: Obstacles = field(default_factory=Obstacles)
    pushed: tuple[Pushed, ...] = ()

    @cached_property
    def _still(self) -> Obstacles:
        """All obstacles of a world in which nothing moves."""
        return Obstacles(self.points, self.discs, walls=self.walls)

    def at(self, time: float) -> Obstacles:
        """Return the obstacles, world frame, at a time in s."""
        if not self.tracks and not self.polygons and not self.pushed:
            return self._still
        still = len(self.discs)
        discs = np.zeros((still + len(self.tracks), 3))
        velocities = np.zeros((len(discs), 2))
        discs[:still] = self.discs
        for i, track in enumerate(self.tracks, start=still):
            discs[i, :2], velocities[i] = track.at(time)
            discs[i, 2] = track.radius
        others = Obstacles(self.points, discs, velocities, self.walls)
        if self.polygons:
            others = others.joined(self.polygons.moved(time))
        if not self.pushed:
            return others
        there, speeds = list[Array](), []
        for one in self.pushed:
            way, speed = one.shifts.at(time)
            there.append(one.vertices + way)
            speeds.append((*speed, 0.0))
        return others.joined(Obstacles(polygons=there, polygon_velocities=speeds))
