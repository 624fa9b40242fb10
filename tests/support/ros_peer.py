"""A robot's sensors and base by cyclonedds, against the node in a process of its own.

Run by the Python of :mod:`ros_environment`; prints what happened as JSON. Times are
those of this process: from the writing of a message to the arrival of the twist.

    python ros_peer.py DOMAIN [SCENE …]
"""

import ctypes
import json
import math
import os
import signal
import subprocess
import sys
import time
from functools import cache
from itertools import pairwise
from pathlib import Path
from struct import pack
from threading import Thread

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.typesys import Stores, get_typestore

RATE, BEAMS, DT = 50.0, 360, 0.018
BEST = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1))
SURE = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(50)
)
WAITED = 0.06
"""s; a longer gap in what a process does says that the machine kept it waiting."""

RUN = "import sys; from qpavoid.ros.node import main; sys.exit(main(sys.argv[1:]))"
SETTINGS = {
    "dt_s": DT,
    "actuation.jitter": 0.2,
    "freshness.good_s": 0.3,
    "scans": "[scan]",
    "odometry": "odom",
    "tracks": "tracks",
}


OTHERS = {"string": str, "bool": bool, "byte": types.uint8, "octet": types.uint8}
STORE = get_typestore(Stores.ROS2_JAZZY)


@cache
def message(name):
    """The type of a message on the wire, by its definition in Jazzy."""

    def of(node, told):
        if node in (3, 4):
            inner = of(*told[0])
            return types.array[inner, told[1]] if node == 3 else types.sequence[inner]
        if node == 2:
            return message(told)
        return OTHERS.get(told[0]) or getattr(types, told[0])

    package, _, short = name.split("/")
    fields = {field: of(*node) for field, node in STORE.fielddefs[name][1]}
    return make_idl_struct(short, f"{package}.msg.dds_.{short}_", fields)


def messages(package, *names):
    return (message(f"{package}/msg/{name}") for name in names)


(Time,) = messages("builtin_interfaces", "Time")
(Clock,) = messages("rosgraph_msgs", "Clock")
(Header,) = messages("std_msgs", "Header")
Point, Vector3, Quaternion, Twist, Pose, PoseCovariance, TwistCovariance = messages(
    *("geometry_msgs", "Point", "Vector3", "Quaternion", "Twist", "Pose"),
    *("PoseWithCovariance", "TwistWithCovariance"),
)
Odometry, OccupancyGrid = messages("nav_msgs", "Odometry", "OccupancyGrid")
LaserScan, PointField, PointCloud2 = messages(
    "sensor_msgs", "LaserScan", "PointField", "PointCloud2"
)
(DiagnosticArray,) = messages("diagnostic_msgs", "DiagnosticArray")
(MarkerArray,) = messages("visualization_msgs", "MarkerArray")


def as_time(seconds):
    whole = math.floor(seconds)
    return Time(whole, int((seconds - whole) * 1e9))


class Peer:
    """Writes what sensors do, hears what the base is told."""

    def __init__(self, domain, sim=False, heard=()):
        self.participant, self.sim, self.now = DomainParticipant(domain), sim, 1e4
        write = self._writer
        self.scans, self.odometry = (
            write("scan", LaserScan, BEST),
            write("odom", Odometry, BEST),
        )
        self.tracks = write("tracks", PointCloud2, BEST)
        self.commands = write("cmd_vel_in", Twist, SURE)
        self.clock = write("clock", Clock, BEST) if sim else None
        self.twists, self.told, self.written, self.alive = [], [], [], True
        self.ticks, self.arrows, self.maps = [], [], []
        self.people, self.pose, self.twist = [], (0.0, 0.0, 0.0), (0.0, 0.0)
        readers = (
            (self._reader("cmd_vel_out", Twist), self._on_twist),
            (self._reader("diagnostics", DiagnosticArray), self._on_told),
            (self._reader("qpavoid/markers", MarkerArray), self._on_drawn),
            (self._reader("qpavoid/local_map", OccupancyGrid), self._on_map),
            *((self._reader(name, kind), call) for name, kind, call in heard),
        )
        for reader, call in readers:
            Thread(target=self._hear, args=(reader, call), daemon=True).start()

    def _writer(self, name, kind, qos):
        topic = Topic(self.participant, f"rt/{name}", kind)
        return DataWriter(self.participant, topic, qos)

    def _reader(self, name, kind):
        topic = Topic(self.participant, f"rt/{name}", kind)
        return DataReader(self.participant, topic, SURE)

    def _hear(self, reader, call):
        while self.alive:
            for sample in reader.take_iter(timeout=duration(milliseconds=200)):
                call(time.monotonic(), sample)

    def _on_twist(self, at, twist):
        self.twists.append((at, twist.linear.x, twist.angular.z))

    def _on_told(self, at, message):
        for status in message.status:
            self.told.append((at, status.level, status.message, status.values))

    def _on_drawn(self, at, message):
        for marker in message.markers:
            if marker.ns == "velocities":
                ends = [(point.x, point.y) for point in marker.points]
                self.arrows += [
                    (at, *pair) for pair in zip(ends[::2], ends[1::2], strict=True)
                ]

    def _on_map(self, at, message):
        self.maps.append((at, message.info.width, sum(x == 100 for x in message.data)))

    def time(self):
        return self.now if self.sim else time.time()

    def scan(self, distance=math.inf, stamp=None, ranges=None):
        """A wall of 60 degrees ahead at a distance, m; all else is free."""
        if ranges is None:
            ranges = [math.inf] * BEAMS
            ranges[150:210] = [distance + 1e-4 * (k % 7) for k in range(60)]
        step = 2.0 * math.pi / len(ranges)
        header = Header(as_time(self.time() if stamp is None else stamp), "base_link")
        self.written.append(time.monotonic())
        scan = LaserScan(header, -math.pi, math.pi, step, 0, 0, 0.05, 10.0, ranges, [])
        self.scans.write(scan)

    def odom(self):
        (x, y, heading), (v, omega) = self.pose, self.twist
        turn = Quaternion(0, 0, math.sin(heading / 2), math.cos(heading / 2))
        pose = PoseCovariance(Pose(Point(x, y, 0), turn), [0.0] * 36)
        driven = Twist(Vector3(v, 0, 0), Vector3(0, 0, omega))
        header = Header(as_time(self.time()), "odom")
        twist = TwistCovariance(driven, [0.0] * 36)
        self.odometry.write(Odometry(header, "base_link", pose, twist))

    def track(self, rows):
        """Tracked discs in the frame of odometry: x, y, radius, v_x, v_y."""
        names = ("x", "y", "radius", "vx", "vy")
        fields = [PointField(name, 4 * k, 7, 1) for k, name in enumerate(names)]
        data = list(b"".join(pack("<5f", *row) for row in rows))
        header = Header(as_time(self.time()), "odom")
        self.tracks.write(
            PointCloud2(header, 1, len(rows), fields, False, 20, len(data), data, True)
        )

    def command(self, v, omega=0.0):
        self.commands.write(Twist(Vector3(v, 0, 0), Vector3(0, 0, omega)))

    def drive(self, seconds, v=0.3, scan=None, odom=True, tick=1.0, command=True):
        """Do as a robot does; ``scan(k)`` writes the scan of a period.

        The other messages come half a period later.
        """
        begun, k = time.monotonic(), 0
        while time.monotonic() - begun < seconds:
            self.ticks.append(time.monotonic())
            if self.clock is not None:
                self.now += tick / RATE
                self.clock.write(Clock(as_time(self.now)))
            (scan or (lambda _: self.scan(5.0)))(k)
            time.sleep(max(0.0, begun + (k + 0.5) / RATE - time.monotonic()))
            if odom:
                self.odom()
            self.track(self.people)
            if command and k % 3 == 0:
                self.command(v)
            k += 1
            time.sleep(max(0.0, begun + k / RATE - time.monotonic()))
        return begun

    def since(self, at, until=math.inf):
        return [row for row in self.twists if at <= row[0] < until]

    def waits(self, at):
        """Return the times since ``at`` when the node or this process went on late."""
        series = [t for t, *_ in self.twists], self.ticks
        pairs = (pair for times in series for pair in pairwise(times))
        return [b for a, b in pairs if b >= at and b - a > WAITED]

    def false_stops(self, at, until=math.inf):
        """Return the share of standing twists, but for a second after a wait."""
        waits = self.waits(at - 1.0)
        rows = self.since(at, until)
        calm = [v for t, v, _ in rows if not any(0 <= t - w < 1.0 for w in waits)]
        return sum(abs(v) < 1e-9 for v in calm) / len(calm) if calm else math.nan

    def stops(self, at):
        """Return the time from ``at`` to the first of only standing twists, s."""
        rows = self.since(at)
        moving = [t for t, v, omega in rows if abs(v) + abs(omega) > 1e-9]
        still = [t for t, *_ in rows if not moving or t > moving[-1]]
        return still[0] - at if still else math.inf

    def goes(self, at):
        rows = [t for t, v, omega in self.since(at) if abs(v) + abs(omega) > 1e-9]
        return rows[0] - at if rows else math.inf

    def messages(self, at):
        return sorted({text for t, _, text, _ in self.told if t >= at})

    def ready(self, patience=300.0):
        """Wait until the node drives."""
        begun = time.monotonic()
        while time.monotonic() - begun < patience:
            at = time.monotonic()
            self.drive(1.0)
            if math.isfinite(self.goes(at)):
                self.drive(1.0)
                return time.monotonic() - begun
        raise TimeoutError("the node gives no twist: " + str(self.told[-3:]))


def dies_with_its_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


class Node:
    """The node in a process of its own."""

    def __init__(self, domain, **settings):
        named = [w for k, x in settings.items() for w in ("-p", f"{k}:={x}")]
        self.environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        command = [sys.executable, "-P", "-c", RUN, "--ros-args", *named]
        self.process = subprocess.Popen(
            command, env=self.environment, preexec_fn=dies_with_its_parent
        )

    def memory(self):
        """Return the memory that is resident, MB."""
        text = Path(f"/proc/{self.process.pid}/status").read_text()
        (line,) = [line for line in text.splitlines() if line.startswith("VmRSS")]
        return int(line.split()[1]) / 1024

    def end(self, kill=False):
        (self.process.kill if kill else self.process.terminate)()
        return self.process.wait(20.0)


def quantiles(values):
    values = sorted(values)
    at = lambda share: values[min(int(share * len(values)), len(values) - 1)]  # noqa: E731
    return {"n": len(values), "p50": at(0.5), "p99": at(0.99), "most": values[-1]}


def latencies(peer, at):
    """Return the times from each scan to the next twist, s."""
    twists, found, i = [t for t, *_ in peer.since(at)], [], 0
    for written in (t for t in peer.written if t >= at):
        while i < len(twists) and twists[i] < written:
            i += 1
        if i < len(twists):
            found.append(twists[i] - written)
    return found


def latency(peer, node, seconds=30.0):
    at = time.monotonic()
    peer.drive(seconds)
    rows = peer.since(at)
    told = {"false_stops": peer.false_stops(at), "per_s": len(rows) / seconds}
    return quantiles(latencies(peer, at)) | told


def outage(peer, node, *failing, tries=5):
    """Return what an input's failure does, on a machine that keeps nobody waiting."""
    for _ in range(tries):
        at = time.monotonic()
        found = fail(peer, *failing)
        if not peer.waits(at):
            break
    return found


def fail(peer, scan=None, odom=True, seconds=1.5):
    """Return what a second and a half of an input's failure does."""
    peer.drive(1.0)
    last = peer.written[-1]
    begun = peer.drive(seconds, scan=scan or (lambda _: None), odom=odom)
    told, until = peer.messages(begun), time.monotonic()
    stops = peer.stops(last)
    held = [abs(v) < 1e-9 for t, v, _ in peer.since(last + stops, until)]
    again = time.monotonic()
    peer.drive(1.5)
    hold = sum(held) / max(len(held), 1)
    return {"stops": stops, "hold": hold, "resumes": peer.goes(again), "said": told}


def kill(peer, node):
    found = [outage(peer, node) for _ in range(5)]
    worst = {key: max(one[key] for one in found) for key in ("stops", "resumes")}
    return {**found[0], **worst, "hold": min(one["hold"] for one in found)}


def odometry(peer, node):
    return outage(peer, node, lambda _: peer.scan(5.0), False)


def blind(peer, node):
    nothing = [math.nan] * BEAMS
    return outage(peer, node, lambda _: peer.scan(ranges=nothing))


def reorder(peer, node):
    """Every second scan overtakes the one before; another comes twice."""

    def scan(k):
        stamps = [peer.time() - late for late in ((0.0,), (0.0, 0.03, 0.0))[k % 2]]
        for stamp in stamps:
            peer.scan(5.0, stamp)

    begun = peer.drive(4.0, scan=scan)
    return {"false_stops": peer.false_stops(begun + 0.5)}


def flood(peer, node, seconds=6.0, times=40):
    def scan(k):
        for _ in range(times):
            peer.scan(5.0)

    peer.drive(1.0)
    begun = peer.drive(seconds, scan=scan)
    rows = peer.since(begun + 0.5, begun + seconds)
    gaps = [b[0] - a[0] for a, b in pairwise(rows)]
    written = sum(t >= begun for t in peer.written) / seconds
    false = peer.false_stops(begun + 0.5, begun + seconds)
    return {"written_per_s": written, "false_stops": false, **quantiles(gaps)}


def silence(peer, node):
    """No commands: it stands, and still gives twists; then somebody comes at it."""
    begun = peer.drive(1.5, command=False)
    stands = peer.stops(begun)
    begun = time.monotonic()
    for k in range(75):
        peer.people = [(1.8 - 0.4 * k / RATE, 0.0, 0.2, -0.4, 0.0)]
        peer.drive(1.0 / RATE, command=False)
    rows, peer.people = peer.since(begun), []
    least = min(v for _, v, _ in rows)
    return {"stands": stands, "twists": len(rows), "backs_up": least}


def restart(peer, node):
    peer.drive(1.0)
    node.end(kill=True)
    at = time.monotonic()
    fresh = Node(node.environment["ROS_DOMAIN_ID"], **SETTINGS)
    node.process = fresh.process
    peer.ready()
    return {"goes": peer.goes(at + 0.2)}


def memory(peer, node, seconds=180.0):
    flood(peer, node, seconds=5.0)
    before, many = node.memory(), len(peer.written)
    flood(peer, node, seconds=seconds, times=20)
    many = len(peer.written) - many
    return {"before": before, "after": node.memory(), "scans": many}


def ends(peer, node):
    """A last twist of standing still, and exit status 0."""
    peer.drive(1.0)
    status = node.end()
    time.sleep(0.3)
    return {"status": status, "last": peer.twists[-1][1:]}


def frozen(peer, node):
    """The clock stands still, and so do all stamps."""
    peer.drive(1.0)
    last = peer.written[-1]
    peer.drive(1.5, tick=0.0)
    stops = peer.stops(last)
    again = time.monotonic()
    peer.drive(1.5)
    return {"stops": stops, "resumes": peer.goes(again)}


def jump(peer, node):
    """The clock jumps an hour ahead, then back; sensors go on with the new time."""
    found = {}
    for name, by in (("ahead", 3600.0), ("back", -7200.0)):
        peer.drive(1.0)
        peer.now += by
        at = time.monotonic()
        peer.clock.write(Clock(as_time(peer.now)))
        time.sleep(0.1)  # a step at the new time, before messages have it
        peer.drive(3.0)
        still = [t for t, v, _ in peer.since(at) if abs(v) < 1e-9]
        found[name] = {"stopped": bool(still), "drives": peer.goes([*still, at][0]) < 9}
    return found


def bad_clock(peer, node):
    """A time before 1970 is no time: it is said, and the node goes on."""
    peer.drive(1.0)
    peer.clock.write(Clock(Time(-5, 0)))
    at = time.monotonic()
    peer.drive(1.0)
    return {"drives": peer.since(at)[-1][1] > 0.0}


SCENES = (
    *(latency, kill, odometry, blind, reorder, flood),
    *(silence, restart, memory, ends),
)
CLOCKED = frozen, jump, bad_clock


def play(domain, scenes, sim=False, **settings):
    node, peer, found = Node(domain, **SETTINGS, **settings), Peer(domain, sim), {}
    try:
        found["ready"] = peer.ready()
        for scene in scenes:
            found[scene.__name__] = scene(peer, node)
            print(scene.__name__, found[scene.__name__], file=sys.stderr, flush=True)
    finally:
        peer.alive = False
        if node.process.poll() is None:
            node.end(kill=True)
    return found


def main():
    domain, *names = sys.argv[1:]
    real, clocked = (
        [scene for scene in scenes if not names or scene.__name__ in names]
        for scenes in (SCENES, CLOCKED)
    )
    found = play(int(domain), real) if real else {}
    if clocked:
        found |= play(int(domain) + 1, clocked, sim=True, use_sim_time="true")
    print(json.dumps(found))


if __name__ == "__main__":
    main()
