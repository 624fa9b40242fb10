"""Transforms, and the tree of coordinate frames from tf messages.

``/tf_static`` gives fixed transforms, ``/tf`` transforms over time, which are
interpolated between two stamps: linearly, and by the shortest rotation (slerp). tf2 is
not used, so that bags are processed like live messages.
"""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from qpavoid.errors import InvalidInputError
from qpavoid.ros.messages import Poses, seconds
from qpavoid.settings import want
from qpavoid.types import Array, Pose

MEMORY, STAMPS = 10.0, 2000
"""s for which a moving frame is stored, as by tf2; and greatest number of stamps."""

BEYOND = 0.2
"""s; extrapolation limit of a moving frame, before and after its stamps."""

MOST_ANGLE = 2.0 * math.pi + 0.02
"""rad; a greater angle of a frame is taken for degrees, and rejected."""


class Transform(NamedTuple):
    """Rigid transform p ↦ R p + t: rotation R (3, 3), t (3,) in m."""

    rotation: Array
    translation: Array

    @classmethod
    def of_quaternion(
        cls, place: Sequence[float], turn: Sequence[float]
    ) -> "Transform":
        """Return the transform of x, y, z in m and a quaternion x, y, z, w, not 0.

        Raises:
            InvalidInputError: Not finite, or the quaternion is 0.
        """
        numbers = np.array([*place, *turn])
        known = bool(np.isfinite(numbers).all()) and bool(numbers[3:].any())
        want(known, "a frame needs numbers")
        return cls(Rotation.from_quat(numbers[3:]).as_matrix(), numbers[:3])

    @classmethod
    def of_angles(cls, numbers: Sequence[float]) -> "Transform":
        """Return that of x, y, z (m), roll, pitch, yaw (rad): fixed axes, as URDF.

        Raises:
            InvalidInputError: One is not finite, or an angle above :data:`MOST_ANGLE`.
        """
        x, y, z, *angles = map(float, numbers)
        want(all(map(math.isfinite, (x, y, z, *angles))), "a frame needs numbers")
        most = max(angles, key=abs)
        said = f"an angle of a frame is {most:g} rad; {most:g} degrees are"
        said = f"{said} {math.radians(most):.4g} rad"
        want(abs(most) <= MOST_ANGLE, said)
        rotation = Rotation.from_euler("xyz", angles)
        return cls(rotation.as_matrix(), np.array([x, y, z]))

    def apply(self, points: Array) -> Array:
        """Return points (N, 3) of the frame in the other one, m."""
        return np.asarray(points @ self.rotation.T + self.translation)


class Link(NamedTuple):
    """Transform of a frame to its parent, over time.

    Attributes:
        parent: Its name.
        times: s, rising; of a fixed one −∞.
        places: Transform at each.
    """

    parent: str
    times: list[float]
    places: list[Transform]


class Frames:
    """Tree of frames; a frame's parent is the last one published.

    A transform that is not finite, or whose quaternion is 0, is left out, as by tf2.

    Args:
        note: Function that registers such transforms, under ``tf``.
        named: Other known frames, for error messages.
    """

    def __init__(
        self,
        note: Callable[[str, str], None] = lambda *_: None,
        named: Iterable[str] = (),
    ) -> None:
        self._links, self._refused = dict[str, Link](), dict[str, str]()
        self._note, self._named = note, [*named]

    def add(self, message: Any, fixed: bool = False) -> None:
        """Add a ``tf2_msgs/TFMessage``, ``fixed`` if from ``/tf_static``."""
        for one in message.transforms:
            name, parent = _name(one.child_frame_id), _name(one.header.frame_id)
            time = -math.inf if fixed else seconds(one.header.stamp)
            try:
                place = _place(one.transform)
            except InvalidInputError as error:
                self._refused[name] = f"the transform of {name!r} is left out: {error}"
                self._note("tf", self._refused[name])
                continue
            self._refused.pop(name, None)
            self._record(name, parent, time, place)

    def _record(self, name: str, parent: str, time: float, place: Transform) -> None:
        link = self._links.get(name)
        news = link is None or link.parent != parent or time < link.times[-1] - MEMORY
        if news or time == -math.inf or link is None or link.times[0] == -math.inf:
            self._links[name] = Link(parent, [time], [place])
            return
        at = bisect_right(link.times, time)
        link.times.insert(at, time)
        link.places.insert(at, place)
        while link.times[0] < link.times[-1] - MEMORY or len(link.times) > STAMPS:
            del link.times[0], link.places[0]

    def find(self, base: str, frame: str, time: float) -> Transform:
        """Return the transform of a frame to the base at a time, s; inf: the newest.

        Raises:
            InvalidInputError: They have no common ancestor, or a transform between them
                is not known within :data:`BEYOND` of that time.
        """
        up, down = self._above(_name(base)), self._above(_name(frame))
        shared = [name for name in down if name in up]
        if not shared:
            problem = f"unknown frame {frame!r}: it is neither in frames nor in tf"
            known = sorted({*self._links, *self._named})
            refused = [self._refused[n] for n in (*down, *up) if n in self._refused]
            problem = f"{problem} on {base!r}; known: {', '.join(known) or 'none'}"
            raise InvalidInputError("; ".join([problem, *refused]))
        there = self._on(down[: down.index(shared[0])], time)
        here = self._on(up[: up.index(shared[0])], time)
        rotation = here.rotation.T @ there.rotation
        lever = there.translation - here.translation
        return Transform(rotation, here.rotation.T @ lever)

    def poses_in(self, base: str, seen: Poses) -> Array:
        """Return poses (n, 3) in the frame ``base``; errors as of :meth:`find`."""
        if seen.frame == base:
            return seen.poses
        place = self.find(base, seen.frame, seen.stamp)
        flat = np.column_stack([seen.poses[:, :2], np.zeros(len(seen.poses))])
        turn = math.atan2(place.rotation[1, 0], place.rotation[0, 0])
        return np.column_stack([place.apply(flat)[:, :2], seen.poses[:, 2] + turn])

    def pose_of(self, frame: str, base: str, time: float) -> Pose:
        """Return the pose of a frame in the frame ``base``; see :meth:`find`."""
        seen = Poses(time, frame, np.zeros((1, 3)))
        x, y, heading = self.poses_in(base, seen)[0].tolist()
        return x, y, heading

    def mover(self, base: str) -> str:
        """Return the first frame from a base upwards that moves on its parent."""
        links = [(name, self._links.get(name)) for name in self._above(_name(base))]
        return next((k for k, x in links if x and x.times[0] > -math.inf), base)

    def _above(self, name: str) -> list[str]:
        """Return a frame and its ancestors; a cycle ends where it closes."""
        found = [name]
        while name in self._links and self._links[name].parent not in found:
            name = self._links[name].parent
            found.append(name)
        return found

    def _on(self, names: list[str], time: float) -> Transform:
        """Return the transform of the first frame to the parent of the last."""
        made = Transform(np.eye(3), np.zeros(3))
        for name in names:
            link = self._at(name, time)
            moved = link.rotation @ made.translation + link.translation
            made = Transform(link.rotation @ made.rotation, moved)
        return made

    def _at(self, name: str, time: float) -> Transform:
        """Return the transform of a frame to its parent."""
        _, times, places = self._links[name]
        if times[0] == -math.inf or time == math.inf:
            return places[-1]
        gap = max(times[0] - time, time - times[-1])
        want(gap <= BEYOND, f"tf has the frame {name!r} only {gap:.2g} s off")
        i = bisect_right(times, time)
        if i in (0, len(times)):
            return places[min(i, len(times) - 1)]
        (turn, lever), (turned, moved) = places[i - 1 : i + 1]
        share = (time - times[i - 1]) / (times[i] - times[i - 1])
        between = Slerp((0.0, 1.0), Rotation.from_matrix([turn, turned]))(share)
        return Transform(between.as_matrix(), lever + share * (moved - lever))


def _name(frame: str) -> str:
    """Return a frame's name without the leading slash of ROS 1."""
    return str(frame).removeprefix("/")


def _place(transform: Any) -> Transform:
    place, turn = transform.translation, transform.rotation
    centre = [float(getattr(place, name)) for name in "xyz"]
    return Transform.of_quaternion(centre, [float(getattr(turn, k)) for k in "xyzw"])
