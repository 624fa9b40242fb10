"""Recorded drives as messages in the order of time: rosbag2.

A bag is a folder of rosbag2, one of its ``.mcap`` or ``.db3`` files, or a ROS 1
``.bag``; its messages are read by the types that it holds, without ROS. A drive that is
written is a folder with an MCAP file, as Foxglove and ``ros2 bag`` open it.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import DataError, MissingExtraError, UnknownNameError
from qpavoid.files import MOST_UNPACKED, below, open_file, reading
from qpavoid.ros.messages import seconds
from qpavoid.ros.parameters import Wiring
from qpavoid.types import Array

ROS_TYPES = {
    "scans": "sensor_msgs/msg/LaserScan",
    "odometry": "nav_msgs/msg/Odometry",
    "command": "geometry_msgs/msg/Twist",
    "stamped": "geometry_msgs/msg/TwistStamped",
}

STATIC, MOVING = "/tf_static", "/tf"

OTHER_CLOCK, CLOCK_AHEAD = 10.0, 0.05
"""s; stamps that are so far from the times of recording, or so much later than these,
are of another clock."""

SET_BACK = 1.0
"""s; by so much stamps of a topic go back where its clock was set back."""

COMMANDS = "cmd_vel_in", "cmd_vel_nav", "cmd_vel_smoothed", "cmd_vel"
"""How commands are called, the first that there is: before a monitor, then after."""

SPLITS = ".mcap", ".db3"
"""Suffixes of the files of rosbag2."""

NO_TOPIC = "odometry of a robot at rest"
"""Name of a topic that is not in the bag."""

MOST_BAG = 100_000_000_000
"""Bytes of a file of a bag; only the chosen messages are held."""


class Event(NamedTuple):
    """A message of a drive.

    Attributes:
        time: s, on the clock of its stamps.
        topic: As in the wiring; ``command``: a desired twist; ``tf``: moving frames.
        message: Whatever has its fields.
    """

    time: float
    topic: str
    message: Any


class Recording(NamedTuple):
    """A recorded drive.

    Attributes:
        wiring: What there is in it.
        static: What it says of fixed frames, ``tf2_msgs/TFMessage``.
        events: In the order of time.
        name: Of the file or folder.
        notes: Assumptions about what is not in it.
    """

    wiring: Wiring
    static: Sequence[Any]
    events: Sequence[Event]
    name: str = "drive"
    notes: Sequence[str] = ()

    @property
    def has_commands(self) -> bool:
        """Whether it has a desired twist."""
        return any(event.topic == "command" for event in self.events)


def bag_drive(
    path: Path, wiring: Wiring | None, command: str, odometry: str = ""
) -> Recording:
    """Return a bag; one without commands as :func:`perceivable` makes it.

    Args:
        path: Of the folder, or the file.
        wiring: What of it counts; None: all its scans, and its odometry.
        command: Topic of the desired twists; empty: the first of :data:`COMMANDS`.
        odometry: Topic of ``Odometry`` or ``PoseStamped``; empty: as in the wiring.

    Raises:
        DataError: It cannot be read, or lacks a topic.
        MissingExtraError: ``rosbags`` is not installed.
    """
    chosen: list[Wiring] = [] if wiring is None else [wiring]

    def choose(held: dict[str, str]) -> dict[str, str]:
        wired = chosen.pop() if chosen else found_topics(held)
        wired = wired._replace(odometry=odometry or wired.odometry)
        chosen.append(wired)
        topics = {topic_of(name, held): name for name in wired.topics}
        moving = {MOVING: "tf"} if MOVING in held else {}
        desired = command or found_commands(held)
        named = {topic_of(desired, held): "command"} if desired else {}
        return topics | moving | named

    static, events = read_bag(path, choose)
    for k, (time, name, one) in enumerate(events):
        if name == chosen[0].odometry and not hasattr(one, "twist"):
            events[k] = Event(time, name, _odometry(one.header, one.pose))
    drive = Recording(chosen[0], static, events, path.name)
    return drive if drive.has_commands else perceivable(drive)


def _stamp(time: float) -> SimpleNamespace:
    whole = math.floor(time)
    return SimpleNamespace(sec=whole, nanosec=round((time - whole) * 1e9))


def _odometry(header: Any, pose: Any) -> SimpleNamespace:
    """Return a pose as an ``Odometry`` whose twist is not filled in."""
    zero = SimpleNamespace(x=0.0, y=0.0, z=0.0)
    still = SimpleNamespace(twist=SimpleNamespace(linear=zero, angular=zero))
    return SimpleNamespace(header=header, pose=SimpleNamespace(pose=pose), twist=still)


def perceivable(drive: Recording) -> Recording:
    """Return a drive without commands that has odometry and places of all sensors.

    Without odometry the robot is at rest; the frame of a sensor that no transform
    places is that of the robot.
    """
    wired, events, notes = drive.wiring, drive.events, list[str]()
    moved = [event.message for event in events if event.topic == "tf"]
    links = [link for one in (*drive.static, *moved) for link in one.transforms]
    placed = {link.child_frame_id.strip("/") for link in links}
    placed |= {wired.base_frame, *wired.frames}
    sensors = {*wired.scans, *wired.clouds}
    seen = [event for event in events if event.topic in sensors]
    frames = dict.fromkeys(str(event.message.header.frame_id) for event in seen)
    lost = [name for name in frames if name.strip("/") not in placed]
    if lost:
        poses = (*wired.frame_poses, *(0.0,) * 6 * len(lost))
        wired = wired._replace(frames=(*wired.frames, *lost), frame_poses=poses)
        notes.append(f"no transform of {', '.join(lost)}: at the robot's origin")
    if not wired.odometry:
        zero = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
        pose = SimpleNamespace(position=zero, orientation=zero)
        still = [
            Event(time, NO_TOPIC, _odometry(SimpleNamespace(stamp=_stamp(time)), pose))
            for time, *_ in seen
        ]
        events = sorted([*still, *events], key=lambda event: event.time)
        wired = wired._replace(odometry=NO_TOPIC)
        notes.append("no odometry: the robot is at rest")
    return drive._replace(wiring=wired, events=events, notes=notes)


def read_bag(
    path: Path, choose: Callable[[dict[str, str]], dict[str, str]]
) -> tuple[list[Any], list[Event]]:
    """Return what is said of fixed frames, and the chosen messages of a bag.

    ``choose`` is given the types of all topics, and gives what those are called that
    count.
    """
    highlevel, _ = _rosbags()
    if not path.exists():
        raise DataError(f"{path}: no such file or folder")
    before, files = _files(path)
    with reading(path):
        for file in (*before, *(path.iterdir() if path.is_dir() else files)):
            open_file(below(file, path, *before), MOST_BAG).close()
        types, files = _types(), [*before, *files]
        with highlevel.AnyReader(files, default_typestore=types) as reader:
            early = (len(x.connections) for x in reader.readers[: len(before)])
            own = reader.connections[sum(early) :]
            topics = choose({one.topic: one.msgtype for one in own})
            chosen = [one for one in own if one.topic in topics]
            chosen += [one for one in reader.connections if one.topic == STATIC]
            messages, left = list[tuple[float, str, Any]](), MOST_UNPACKED
            for one, time, data in reader.messages(chosen):
                left -= len(data)
                if left < 0:
                    most = f"{MOST_UNPACKED:,} bytes"
                    raise DataError(f"its messages have more than {most}")
                told = reader.deserialize(data, one.msgtype)
                messages.append((1e-9 * time, one.topic, told))
    static = [one for _, topic, one in messages if topic == STATIC]
    rest = [one for one in messages if one[1] != STATIC]
    if not rest:
        raise DataError(f"{path}: holds no message of {', '.join(topics)}")
    stamps, now = _stamps(rest), np.array([time for time, *_ in rest])
    clocks = [
        stamps[k] for k, name in topics.items() if k in stamps and name != "command"
    ]
    times = stamp_clock(*clocks[0].T)(now).tolist() if clocks else now.tolist()
    pairs = zip(times, rest, strict=True)
    return static, [Event(time, topics[topic], one) for time, (_, topic, one) in pairs]


def _files(path: Path) -> tuple[list[Path], list[Path]]:
    """Return the first split, where a later one is given, and what is opened of a bag.

    Recorders write static transforms into the first split alone. A folder without
    metadata is all of its files.
    """
    if path.is_dir():
        if (path / "metadata.yaml").exists():
            return [], [path]
        files = sorted(one for one in path.iterdir() if one.suffix in SPLITS)
        if not files:
            raise DataError(f"{path}: no bag of ROS 2; its metadata.yaml is not there")
        return [], files
    stem, _, number = path.stem.rpartition("_")
    first = path.with_name(f"{stem}_0{path.suffix}")
    later = path.suffix in SPLITS and number.isdigit() and first != path
    return [first] if later and first.is_file() else [], [path]


def _rosbags() -> tuple[Any, Any]:
    try:
        from rosbags import highlevel, rosbag2
    except ImportError:
        raise MissingExtraError("rosbags", "bags") from None
    return highlevel, rosbag2


def _types() -> Any:
    """Return the types of Jazzy."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def topic_of(name: str, held: dict[str, str]) -> str:
    """Return the topic of a name, with or without its slash; one there must be."""
    for topic in (name, f"/{name}"):
        if topic in held:
            return topic
    raise UnknownNameError("topic", name, held)


def found_topics(held: dict[str, str]) -> Wiring:
    """Return all scans, and the first odometry."""
    scans = tuple(sorted(t for t, kind in held.items() if kind == ROS_TYPES["scans"]))
    odometry = sorted(t for t, kind in held.items() if kind == ROS_TYPES["odometry"])
    return Wiring(scans=scans, odometry=next(iter(odometry), ""))


def found_commands(held: dict[str, str]) -> str:
    """Return the topic of the commands; empty if there is none."""
    kinds = ROS_TYPES["command"], ROS_TYPES["stamped"]
    there = sorted(topic for topic, kind in held.items() if kind in kinds)
    known = [t for name in COMMANDS for t in there if t.rpartition("/")[2] == name]
    return next(iter([*known, *there]), "")


def _stamps(messages: Iterable[tuple[float, str, Any]]) -> dict[str, Array]:
    """Return times of recording and stamps (n, 2) of every stamped topic, s.

    Raises:
        DataError: Stamps of a topic are all the same, or go back.
    """
    pairs: dict[str, list[tuple[float, float]]] = {}
    for time, topic, one in messages:
        if hasattr(one, "header"):
            pairs.setdefault(topic, []).append((time, seconds(one.header.stamp)))
    found = {topic: np.array(some) for topic, some in pairs.items()}
    for topic, some in found.items():
        stamps = some[:, 1]
        if len(stamps) > 2 and np.ptp(stamps) == 0.0:
            said = f"all {len(stamps)} messages of its {topic} are stamped"
            said += f" {stamps[0]:g} s: whoever made them fills no stamps in"
            raise DataError(said)
        back = -np.diff(stamps, prepend=stamps[0]).min()
        if back > SET_BACK:
            said = f"the stamps of its {topic} go back by {back:.4g} s"
            raise DataError(f"{said}: a clock was set back; cut the bag there")
    return found


def stamp_clock(received: Array, stamps: Array) -> Callable[[Array], Array]:
    """Return the function from times of recording to times of the stamps' clock, s.

    It is the identity where both are one clock. Else it is linear between the greatest
    stamps until then, whatever the rate of that clock, as of a simulation.

    Args:
        received: (n,) times of recording, s, in order.
        stamps: (n,) of a topic, s.
    """
    if -CLOCK_AHEAD <= np.median(received - stamps) <= OTHER_CLOCK:
        return lambda times: times
    latest = np.maximum.accumulate(stamps)
    return lambda times: (
        np.interp(times, received, latest) + np.maximum(times - received[-1], 0.0)
    )


class BagWriter:
    """Writes a folder of rosbag2 with one MCAP file; a context manager.

    One that is there already is replaced, if nothing but a bag is in it.

    Raises:
        DataError: The folder has something else in it, or cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        _, self._rosbag2 = _rosbags()
        self._store = _types()
        plugin = self._rosbag2.StoragePlugin.MCAP
        files = {folder / "metadata.yaml", folder / f"{folder.name}.mcap"}
        if folder.is_dir() and not folder.is_symlink() and {*folder.iterdir()} <= files:
            for file in folder.iterdir():
                file.unlink()
            folder.rmdir()
        try:
            writer = self._rosbag2.Writer(folder, version=9, storage_plugin=plugin)
            self._writer = writer.__enter__()
        except self._rosbag2.WriterError as error:
            raise DataError(str(error)) from None
        self._topics: dict[str, Any] = {}

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *how: Any) -> None:
        self._writer.__exit__(*how)

    def blank(self, kind: str) -> Any:
        """Return a message with zeros, empty texts and sequences."""
        given = {}
        for name, (node, told) in self._store.fielddefs[kind][1]:
            given[name] = self._zero(int(node), told)
        return self._store.types[kind](**given)

    def _zero(self, node: int, told: Any) -> Any:
        if node == 1:
            return {"string": "", "bool": False}.get(
                told[0], 0.0 if told[0].startswith("float") else 0
            )
        if node == 2:
            return self.blank(told)
        (inner, what), many = told
        if int(inner) == 1 and what[0] != "string":
            return np.zeros(
                many if node == 3 else 0, dtype=DTYPES.get(what[0], what[0])
            )
        return [self._zero(int(inner), what) for _ in range(many if node == 3 else 0)]

    def stamped(self, kind: str, time: float, frame: str) -> Any:
        """Return a blank message with a header."""
        made = self.blank(kind)
        vars(made.header.stamp).update(vars(_stamp(time)))
        made.header.frame_id = frame
        return made

    def write(self, topic: str, kind: str, time: float, message: Any) -> None:
        """Write a message."""
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(
                topic, kind, typestore=self._store
            )
        data = self._store.serialize_cdr(message, kind)
        self._writer.write(self._topics[topic], round(1e9 * time), data)


DTYPES = {"byte": "uint8", "char": "uint8", "octet": "uint8"}
"""Of numpy, where it has another name."""
