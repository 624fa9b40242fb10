"""Static and moving obstacles by all sensors of the node, in the odometry frame."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from qpavoid.model.footprint import Footprint, offset_outline
from qpavoid.model.kinematics import relative, to_world
from qpavoid.model.obstacles import NO_OBSTACLES, NO_POINTS, Obstacles
from qpavoid.ros import mask
from qpavoid.ros.frames import Frames, Transform
from qpavoid.ros.messages import READERS, Fan, Poses, Sight, Tracks
from qpavoid.ros.odometry import Odometry, placed
from qpavoid.ros.parameters import GuardSetup, Wiring
from qpavoid.ros.perceiver import Perceiver
from qpavoid.types import Array, Pose

ORIGIN: Pose = (0.0, 0.0, 0.0)

LEAST_AWAY, AROUND, CORNER_POINTS = 0.05, 1.0, 5
"""m: least distance of an unknown sector's border beyond the required distance;
greatest distance beyond the circumradius at which it is stored; points round its
corners."""

AT_OUTLINE = 0.02
"""m; echoes so near to the outline count beside the perceived obstacles, which leave
out all that is inside."""

FROZEN_WAY, FROZEN_BEAMS = 0.3, 10
"""m or rad of motion and number of echoes from which on equal ranges are repeated ones,
not measurements."""


class Sensing:
    """Obstacles seen by scans, clouds, tracker and costmap.

    Args:
        setup: Robot, and settings of perception.
        wiring: Topics and frames.
        odometry: Pose history of the robot.
        note: Function that registers a finding about a topic.

    Attributes:
        frames: Frames by tf.
        perceiver: Map and tracks of scans and clouds.
        stamps: s; of the measurements in use, by topic.
    """

    def __init__(
        self,
        setup: GuardSetup,
        wiring: Wiring,
        odometry: Odometry,
        note: Callable[[str, str], None],
    ) -> None:
        self._setup, self._wiring, self._odometry = setup, wiring, odometry
        self._note, self._kinds = note, wiring.topics
        self._boxes, self._sensors = wiring.boxes, wiring.sensors
        self.frames = Frames(note, self._sensors)
        self._own = {name: mask.OwnPlaces() for name in (*wiring.scans, *wiring.clouds)}
        self._ground, self._unknown = dict[str, Array](), dict[str, Array]()
        self._scanned = dict[str, tuple[bytes, Pose]]()
        self._tracked = NO_OBSTACLES
        self.stamps, self._driven = dict[str, float](), (0.0, 0.0)
        self._has_driven = False
        self.perceiver = Perceiver(setup.robot, setup.perception)

    def fit(self, setup: GuardSetup) -> None:
        """Set other settings; the map is kept unless perception or footprint change."""
        before, edges, self._setup = self.perceiver, setup.robot.footprint.edges, setup
        same = np.array_equal(before.robot.footprint.edges, edges)
        if not same or before.settings != setup.perception:
            self.perceiver = Perceiver(setup.robot, setup.perception)

    def drives(self, v: float, omega: float) -> None:
        """Register the twist of a step; the robot's own points are learnt before."""
        self._driven = v, omega
        self._has_driven |= self._driven != (0.0, 0.0)

    def read(self, topic: str, message: Any, now: float, posed: bool) -> str:
        """Decode a message; return why it is blind, or an empty string.

        Args:
            topic: Of the message.
            message: Of the type of its topic.
            now: Time of its arrival, s.
            posed: Whether odometry is valid.

        Raises:
            InvalidInputError: It is not valid, or its frame unknown; or any exception
                of a message without the fields of its type.
        """
        seen, blind = READERS[self._kinds[topic]](message), ""
        if isinstance(seen, Poses):
            odom = self._wiring.odom_frame
            self._ground[topic] = self.frames.poses_in(odom, seen)[:, :2]
            return ""
        if isinstance(seen, Tracks):
            self._tracked = self._tracks(seen)
        else:
            seen = self._begun(topic, seen, now)
            blind = self._process(topic, seen, posed)
        if not blind:
            self.stamps[topic] = seen.stamp
        return blind

    def rebase(self, before: Pose, pose: Pose) -> None:
        """Count echoes as seen from another pose than before; begin the map anew.

        Tracks are dropped: they may be in the frame that jumped.
        """
        back = relative(before, ORIGIN)
        for points in (*self._unknown.values(), *self._ground.values()):
            points[:] = to_world(to_world(points, back), pose)
        self._scanned, self._tracked = {}, NO_OBSTACLES
        self.perceiver.forget()

    def obstacles(self, now: float) -> Obstacles:
        """Return all obstacles in the present robot frame.

        Of a message in the map only echoes at the outline are added to the map's.
        """
        here = self._odometry.at(now)
        found, back = self.perceiver.obstacles(now, here), relative(here, ORIGIN)
        points, outline = [found.points], self._setup.robot.footprint
        for topic, ground in self._ground.items():
            echoes = to_world(ground, back)
            if topic in self.perceiver.taken:
                echoes = echoes[mask.beyond(outline, echoes) <= AT_OUTLINE]
            points.append(echoes)
        points += [to_world(ground, back) for ground in self._unknown.values()]
        seen = Obstacles.of(np.vstack(points), found.capsules)
        tracked = self._tracked
        return seen.joined(tracked.seen_from(here)) if len(tracked) else seen

    def _begun(self, topic: str, seen: Sight, now: float) -> Sight:
        """Return a scan with the stamp of its first beam; its last has arrived."""
        if seen.fan is None or seen.fan.span <= 0.0:
            return seen
        latest = max(seen.stamp, now) - seen.fan.span
        if topic in self._wiring.last_beam_stamps:
            latest = seen.stamp - seen.fan.span
        return seen._replace(stamp=min(seen.stamp, latest))

    def _process(self, topic: str, seen: Sight, posed: bool) -> str:
        """Store the echoes of a sensor, and enter them into the map; see :meth:`read`.

        Learns and removes the robot's own points, marks unknown sectors. Beams that end
        on the robot, or in its outline, do not count as valid.
        """
        place, outline, fan = self._place(seen), self._setup.robot.footprint, seen.fan
        points, valid = place.apply(seen.points), seen.valid
        if fan is None:
            low, high = self._wiring.height_min_m, self._wiring.height_max_m
            points = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
        flat = np.ascontiguousarray(points[:, :2])
        margin = mask.beyond(outline, flat)
        near, inside = margin <= self._wiring.mask_m, margin <= 0.0
        own = self._is_own(topic, flat, near)
        if fan is not None:
            valid -= float((own | inside).sum()) / max(len(fan.unknown), 1)
        if seen.empty and topic in self._wiring.empty_is_free:
            valid = 1.0
        why = self._frozen(topic, seen, posed)
        if not why and (seen.stuck or valid < self._setup.freshness.valid):
            why = f"{valid:.0%} valid"
        learns = not why and not self._has_driven
        if learns and self._own[topic].messages < mask.RECORDED:
            sensor = place.translation[:2]
            self._own[topic].learn(flat[near], sensor, fan is not None)
            own = self._is_own(topic, flat, near)
        if fan is not None:
            self._mark(topic, seen, fan, place)
            fan.ranges[np.flatnonzero(np.isfinite(fan.ranges))[own | inside]] = np.nan
        if (inside & ~own).any():
            self._note(topic, "a point has entered the outline")
        if why:
            return why
        after, poses = seen.after[: len(own)][~own], self._odometry
        if after.any():
            ground = placed(flat[~own], poses.along(seen.stamp + after))
        else:
            ground = to_world(flat[~own], poses.at(seen.stamp))
        self._ground[topic] = ground
        self.perceiver.taken.discard(topic)
        if posed and self._setup.perception.enabled:
            around = seen._replace(points=flat[~(own | inside)])
            note = self.perceiver.take(topic, around, place, poses)
            if note:
                self._note(topic, note)
        return ""

    def _frozen(self, topic: str, seen: Sight, posed: bool) -> str:
        """Return a reason if the ranges have not changed while the robot moved."""
        if seen.fan is None or not posed:
            self._scanned.pop(topic, None)
            return ""
        here, ranges = self._odometry.at(seen.stamp), seen.fan.ranges
        known, there = self._scanned.get(topic, (b"", here))
        if (now := ranges.tobytes()) != known:
            self._scanned[topic] = now, here
            return ""
        x, y, turn = relative(there, here)
        moved = max(math.hypot(x, y), abs(turn)) > FROZEN_WAY
        repeats = moved and np.isfinite(ranges).sum() >= FROZEN_BEAMS
        return "the ranges repeat while the robot moves" if repeats else ""

    def _mark(self, topic: str, seen: Sight, fan: Fan, place: Transform) -> None:
        """Bound the unknown sectors of a scan by static points on the ground.

        Points seen there last, and the border of the stopping distance. Each is removed
        when its bearing is known again, or the robot has left it.
        """
        least = math.radians(self._wiring.blind_sector_deg)
        beams = mask.unknown_sectors(fan, place, self._boxes, least)
        before = self._unknown.pop(topic, NO_POINTS)
        if not beams.any():
            return
        before = np.vstack([before, self._ground.get(topic, NO_POINTS)])
        footprint = self._setup.robot.footprint
        pose, away = self._odometry.at(seen.stamp), self._away
        known = to_world(before, relative(pose, ORIGIN))
        kept = np.hypot(*known.T) < footprint.circumradius + away + AROUND
        kept &= mask.hidden(known, fan, beams, place)
        parts = (offset_outline(x, away, CORNER_POINTS) for x in footprint.parts)
        added = mask.border(fan, beams, place, Footprint.union([*parts]))
        bound = to_world(np.vstack([known[kept], added]), pose)
        first = np.unique(np.floor(bound / mask.SPACING), axis=0, return_index=True)[1]
        self._unknown[topic] = bound[np.sort(first)]
        width = math.degrees(abs(fan.step) * beams.sum())
        bearing = math.degrees(math.atan2(*added[len(added) // 2, ::-1]))
        note = f"some {width:.0f} degrees are unknown, as at {round(bearing, -1):g}"
        self._note(topic, note)

    @property
    def _away(self) -> float:
        """Distance of a border from the outline, m: required, and to stop."""
        s, speed, kept = self._setup.settings, abs(self._driven[0]), self._setup.keep
        stopping = speed * (s.dt + s.actuation.delay)
        stopping += 0.5 * speed * speed / self._setup.robot.limits.acceleration
        return kept + max(0.5 * kept, LEAST_AWAY) + stopping

    def _place(self, seen: Sight | Tracks) -> Transform:
        """Return the transform of a sensor's frame; an unknown one is an error."""
        if seen.frame in self._sensors:
            return self._sensors[seen.frame]
        return self.frames.find(self._wiring.base_frame, seen.frame, seen.stamp)

    def _is_own(self, topic: str, flat: Array, near: mask.Flags) -> mask.Flags:
        """Return which points (n, 2) are the robot itself; ``near``: candidates."""
        if len(self._boxes):
            return mask.in_boxes(self._boxes, flat)
        own = near.copy()
        own[near] = self._own[topic].hold(flat[near])
        return own

    def _tracks(self, seen: Tracks) -> Obstacles:
        """Return tracked discs in the odometry frame."""
        discs, velocities = seen.discs, seen.velocities
        if seen.frame != self._wiring.odom_frame:
            place, lift = self._place(seen), np.zeros((len(discs), 1))
            centres = place.apply(np.hstack([discs[:, :2], lift]))[:, :2]
            velocities = (np.hstack([velocities, lift]) @ place.rotation.T)[:, :2]
            x, y, heading = self._odometry.at(seen.stamp)
            centres = to_world(centres, (x, y, heading))
            velocities = to_world(velocities, (0.0, 0.0, heading))
            discs = np.column_stack([centres, discs[:, 2]])
        return Obstacles((), discs, velocities)
