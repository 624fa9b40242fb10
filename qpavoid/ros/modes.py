"""Tasks of the guide role; modes of the filter role, which change its inputs.

- ``command``: nothing is changed.
- ``teleop``: where the path ahead is not free, the guide follows a line in the
  operator's direction: round static obstacles, and slower for people.
- ``dock``: static obstacles in the dock's region are exempt; the speed is limited.
- ``follow``: one person is exempt, and kept at a distance.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from qpavoid.guide.guide import Guide
from qpavoid.model.capsules import RADIUS, X1, Y2
from qpavoid.model.contacts import Contacts
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import TINY, to_world, wrap_angle
from qpavoid.model.obstacles import Obstacles
from qpavoid.ros.frames import Frames
from qpavoid.ros.mask import beyond
from qpavoid.ros.messages import UNREADABLE, Poses, read_poses
from qpavoid.ros.odometry import Odometry
from qpavoid.settings import POSITIVE, Range, check, want
from qpavoid.types import Array, Pose, Twist

LOST_AFTER, PLACED, IN_FRONT = 1.0, 0.6, math.radians(60.0)
"""s, m and rad: a person is lost that long after the last disc so near to the expected
place; half the angle in which the nearest person is looked for."""

LINE = 3.0
AHEAD = np.array([(0.0, 0.0), (LINE, 0.0)])
"""m; length of the path ahead in ``teleop``, and its ends in the robot frame."""

LEAST_STRAIGHT, ANEW, BACK_GAIN = 0.05, 0.25, 1.5
"""m/s and rad/s, above and below which an operator drives straight ahead; m or m/s of
change with which the line in that direction is drawn again; 1/s, return to it."""

FOLLOW_TIME, LEAST_AHEAD = 1.0, 0.2
"""s, in which an error of the followed distance is reduced; least cosine of the
person's bearing."""

LATEST = math.inf
"""s; time of the newest transform."""

PARKS_WITHIN, GOAL_MOVED = 0.1, 0.02
"""m: distance of a path's end from which on the robot parks there; motion on the ground
(m or rad) with which a task is given again."""


@dataclass(frozen=True)
class DriveSettings:
    """Settings of roles and modes.

    Attributes:
        mode: Of the filter role.
        speed: Greatest speed of the guide role.
        turn: Greatest angle between robot and operator's direction in ``teleop``.
        dock_speed: Greatest speed in ``dock``.
        follow: Distance of the outline from the followed person.
        person: Number of its track; −1: the nearest person in front.
    """

    mode: Literal["command", "teleop", "dock", "follow"] = "command"
    speed: Annotated[float, "mps", POSITIVE] = 0.5
    turn: Annotated[float, "rad", Range(gt=0.0, le=math.pi / 2)] = 1.5
    dock_speed: Annotated[float, "mps", POSITIVE] = 0.2
    follow: Annotated[float, "m", POSITIVE] = 1.0
    person: Annotated[int, Range(ge=-1)] = -1

    def __post_init__(self) -> None:
        check(self, "roles and modes need")


class Request(NamedTuple):
    """Input of a filter step: command, obstacles in the robot frame, and a note."""

    desired: Twist
    obstacles: Obstacles
    note: str = ""


def middles(seen: Obstacles) -> Array:
    """Return the middles (n, 2) of all points and capsules, m."""
    ends = seen.capsules[:, X1 : Y2 + 1]
    return np.vstack([seen.points, 0.5 * (ends[:, :2] + ends[:, 2:])])


def docking(asked: Request, at: Pose, region: Footprint, speed: float) -> Request:
    """Return a request without the static obstacles in the region of a dock.

    Args:
        asked: Command and obstacles.
        at: Pose of the robot in the dock's frame.
        region: Of the dock there.
        speed: Greatest, m/s.
    """
    (v, omega), seen, _ = asked
    places, count = to_world(middles(seen), at), len(seen.points)
    exempt = beyond(region, places) <= 0.0
    kept = ~exempt[count:] | (seen.speeds > TINY)
    rest = Obstacles.of(seen.points[~exempt[:count]], seen.capsules[kept])
    note = f"{exempt[:count].sum()} points in the dock are exempt"
    return Request((min(max(v, -speed), speed), omega), rest, note)


def is_free(seen: Obstacles, footprint: Footprint, turn: float, keep: float) -> bool:
    """Return whether the path ahead of a robot is free for :data:`LINE`.

    That is the width of the robot and ``keep`` (m) on both sides, in a direction to the
    left by ``turn``, rad. A moving obstacle within that distance is on it.
    """
    x, y = to_world(middles(seen), (0.0, 0.0, -turn)).T
    count, (front, wide) = len(seen.points), footprint.vertices.max(axis=0)
    wide = wide + keep + np.append(np.zeros(count), seen.capsules[:, RADIUS])
    moves = np.append(np.zeros(count, dtype=np.bool_), seen.speeds > TINY)
    near = (x > 0.0) & (np.hypot(x, y) < front + LINE)
    return not bool((near & (moves | (np.abs(y) < wide))).any())


class Tasks:
    """Task of the guide role, given again after it has moved on the ground.

    Without a task the robot stays where it is.

    Args:
        frames: Frames by tf.
        odometry: Pose history of the robot.
        frame: Of odometry.

    Attributes:
        refused: Reason why the newest task of a kind is refused.
    """

    def __init__(self, frames: Frames, odometry: Odometry, frame: str) -> None:
        self._frames, self._odometry, self._frame = frames, odometry, frame
        self._task: tuple[str, Poses] | None = None
        self._sent: Array | None = None
        self.refused: dict[str, str] = {}

    def use(self, guide: Guide | None, speed: float) -> None:
        """Give the task to another guide, with another greatest speed, m/s."""
        self._guide, self._speed, self._sent = guide, speed, None

    def take(self, kind: str, message: Any) -> str:
        """Take a task; return why it is refused and the last one kept, else nothing.

        Args:
            kind: ``goal_pose``, ``path`` or ``stay``.
            message: PoseStamped or Path.
        """
        before, self._sent = self._task, None
        try:
            self._task = kind, read_poses(message)
            self.send()
        except UNREADABLE as error:
            self._task, self.refused[kind] = before, f"refused: {error}"
            return str(error)
        self.refused.pop(kind, None)
        return ""

    def rest(self) -> None:
        """Replace the task by a stay at the present pose."""
        self._task = self._sent = None

    def send(self) -> None:
        """Give the task to the guide if it is new, or has moved on the ground.

        Raises:
            InvalidInputError: There is no odometry yet, or no guide; or the frame of
                the task is unknown, or the guide rejects it.
        """
        pose, guide = self._odometry.pose, self._guide
        want(pose is not None, "there is no odometry yet")
        want(guide is not None, "the role is not guide")
        assert pose is not None and guide is not None
        here = Poses(0.0, self._frame, np.array([pose]))
        self._task = kind, known = self._task or ("stay", here)
        rows = self._frames.poses_in(self._frame, known._replace(stamp=LATEST))
        x, y, heading = rows[-1].tolist()
        near = math.dist(pose[:2], (x, y)) < PARKS_WITHIN
        rows = rows if kind == "path" and not near else rows[-1:]
        old = self._sent
        if old is not None and old.shape == rows.shape:
            if np.abs(rows - old).max() < GOAL_MOVED:
                return
        if len(rows) > 1:
            guide.follow(rows[:, :2], self._speed)
        elif kind == "goal_pose":
            guide.go_to(pose, (x, y, heading), self._speed)
        else:
            guide.stay((x, y, heading))
        self._sent = rows

    @property
    def left(self) -> tuple[float, float]:
        """Distance to the end of the task, m and rad; NaN without one."""
        pose, guide = self._odometry.pose, self._guide
        if self._sent is None or guide is None or pose is None:
            return math.nan, math.nan
        return guide.left(pose)


class Teleop:
    """Assistance of an operator who drives straight ahead.

    Args:
        guide: Of the robot.
        drive: Settings.
        keep: Required distance, m.
    """

    def __init__(self, guide: Guide, drive: DriveSettings, keep: float) -> None:
        self._guide, self._drive, self._keep = guide, drive, keep
        self._heading, self._drawn = math.nan, np.full(3, math.inf)

    def step(self, asked: Request, pose: Pose) -> Request | None:
        """Return the changed command; None where the guide is to drive.

        That is where the path in the operator's direction is not free, along a line
        from the robot. ``pose``: of the robot, odometry frame.
        """
        (v, omega), (x, y, heading) = asked.desired, pose
        if v < LEAST_STRAIGHT or abs(omega) > LEAST_STRAIGHT:
            self._heading = math.nan
            return asked
        if math.isnan(self._heading):
            self._heading, self._drawn = heading, np.full(3, math.inf)
        off = wrap_angle(self._heading - heading)
        free = is_free(asked.obstacles, self._guide.footprint, off, self._keep)
        if free or abs(off) > self._drive.turn:
            self._drawn = np.full(3, math.inf)
            back = (v, BACK_GAIN * off) if free else (0.0, 0.0)
            return asked._replace(desired=back)
        now = np.array([x, y, v])
        if np.abs(now - self._drawn).max() > ANEW:
            self._guide.follow(to_world(AHEAD, (x, y, self._heading)), v)
            self._drawn = now
        return None


class Follow:
    """Exemption of one person, whose place and velocity over ground are stored."""

    def __init__(self, drive: DriveSettings, footprint: Footprint, dt: float) -> None:
        self._drive, self._footprint, self._dt = drive, footprint, dt
        self._person: Array | None = None
        self._missed = 0.0

    def step(self, asked: Request, pose: Pose, named: Array | None) -> Request:
        """Return a request without the person, whose distance limits the speed.

        A person nearer than half that distance is an obstacle as all others.

        Args:
            asked: Command and obstacles.
            pose: Of the robot, odometry frame.
            named: (2,) place of the person in it, m; None: the nearest one in front.
        """
        (v, omega), seen, _ = asked
        discs, away = seen.discs[:, :2], self._drive.follow
        places = to_world(discs, pose)
        if self._person is not None:
            self._person[:2] += self._dt * self._person[2:]
            off = np.hypot(*(places - self._person[:2]).T)
            off[off > PLACED] = math.inf
        elif named is not None:
            off = np.hypot(*(places - named).T)
        else:
            off = np.hypot(*discs.T)
            off[np.abs(np.arctan2(discs[:, 1], discs[:, 0])) > IN_FRONT] = math.inf
        if off.min(initial=math.inf) == math.inf:
            self._missed += self._dt
            self._person = None if self._missed > LOST_AFTER else self._person
            return asked._replace(note="nobody is followed")
        k, velocities = int(off.argmin()), seen.disc_velocities
        moves = to_world(velocities[k : k + 1], (0.0, 0.0, pose[2]))[0]
        self._person, self._missed = np.hstack([places[k], moves]), 0.0
        row = np.arange(len(seen.capsules)) == np.flatnonzero(seen.is_disc)[k]
        person = Obstacles.of(seen.points[:0], seen.capsules[row])
        gap = float(Contacts.of(self._footprint, person).distance.min())
        if gap < 0.5 * away:
            return asked._replace(note="the followed person is near: an obstacle")
        towards = discs[k] / max(math.hypot(*discs[k]), TINY)
        leaves = max(float(velocities[k] @ towards), 0.0)
        most = max(leaves + (gap - away) / FOLLOW_TIME, 0.0)
        slow = min(v, most / max(float(towards[0]), LEAST_AHEAD))
        return Request((slow, omega), seen.chosen(~row), f"a person {gap:.1f} m away")
