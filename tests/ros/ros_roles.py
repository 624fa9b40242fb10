"""Roles and modes of the node in closed loop on the wire: a simulator of another DDS.

Run by the Python of ``ros_environment``; prints what happened as JSON.

    python ros_roles.py DOMAIN [SCENE …]
"""

import json
import math
import subprocess
import sys
import time

import numpy as np

from ray_world import BOX, DOCK, ROOM, World
from ros_peer import (
    SURE,
    Header,
    Node,
    Peer,
    Point,
    Pose,
    Quaternion,
    Vector3,
    as_time,
    latencies,
    message,
    quantiles,
)

PoseStamped = message("geometry_msgs/msg/PoseStamped")
TransformStamped = message("geometry_msgs/msg/TransformStamped")
Transform = message("geometry_msgs/msg/Transform")
TFMessage = message("tf2_msgs/msg/TFMessage")
Status = message("diagnostic_msgs/msg/DiagnosticStatus")
PoseArray = message("geometry_msgs/msg/PoseArray")
Bool = message("std_msgs/msg/Bool")

RATE, R_MIN = 40.0, 0.1
ROBOT = {
    "robot_preset": "mir100_rectangle",
    "robot.footprint_m": "'[[0.25, 0.2], [-0.25, 0.2], [-0.25, -0.2], [0.25, -0.2]]'",
    "robot.acceleration_mps2": "1.5",
    "radius.r_min_slow_m": R_MIN,
    "radius.r_min_fast_m": R_MIN,
    "freshness.good_s": 0.3,
    "tf": "true",
}
MODES = {
    "dock_frame": "dock",
    "dock_m": "[-0.1, -0.35, 0.3, -0.35, 0.3, 0.35, -0.1, 0.35]",
}

SETS = """
import json, sys, rclpy
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
rclpy.init()
node = rclpy.create_node("client")
client = AsyncParameterClient(node, "qpavoid")
assert client.wait_for_services(10.0)
given = [Parameter(k, value=x) for k, x in json.loads(sys.argv[1]).items()]
future = client.set_parameters(given)
rclpy.spin_until_future_complete(node, future)
print(json.dumps([[one.successful, one.reason] for one in future.result().results]))
"""

FOLLOWS = """
import json, time, rclpy
from rclpy.action import ActionClient
from bond.msg import Status
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.srv import ChangeState
from nav2_msgs.action import FollowPath
rclpy.init()
node, found, seen, beats = rclpy.create_node("client"), [], [], []
node.create_subscription(Status, "bond", beats.append, 10)
goals = node.create_publisher(PoseStamped, "goal_pose", 1)
client = ActionClient(node, FollowPath, "follow_path")
assert client.wait_for_server(10.0)

def path(frame, y):
    goal = FollowPath.Goal()
    goal.path.header.frame_id = frame
    for k in range(9):
        one = PoseStamped()
        one.pose.position.x, one.pose.position.y = 3.0 - 0.5 * k, y
        one.pose.orientation.z = 1.0
        one.pose.orientation.w = 0.0
        goal.path.poses.append(one)
    return goal

def sent(goal):
    hear = lambda m: seen.append(m.feedback.distance_to_goal)
    future = client.send_goal_async(goal, feedback_callback=hear)
    rclpy.spin_until_future_complete(node, future)
    return future.result()

def ends(handle, timeout=40.0):
    future = handle.get_result_async()
    rclpy.spin_until_future_complete(node, future, timeout_sec=timeout)
    found.append([future.result().status, future.result().result.error_code])

ends(sent(path("moon", 0.0)))
first = sent(path("odom", 0.0))
rclpy.spin_once(node, timeout_sec=1.0)
second = sent(path("odom", 0.0))
ends(first)
ends(second)
last = seen[-1:]
other = path("odom", 2.0).path.poses[0]
other.header.frame_id = "odom"
change = ChangeState.Request()
change.transition.id = 4  # deactivate
changes = node.create_client(ChangeState, "qpavoid/change_state")
changes.wait_for_service()
handle = sent(path("odom", 2.0))
rclpy.spin_until_future_complete(node, handle.cancel_goal_async())
ends(handle)
for end in lambda: goals.publish(other), lambda: changes.call_async(change):
    handle = sent(path("odom", 2.0))
    end()
    ends(handle)
until = time.monotonic() + 10.0
while beats[-1].active and time.monotonic() < until:
    rclpy.spin_once(node, timeout_sec=0.1)
told = {"ends": found, "left": [seen[:1], last]}
told["beats"] = [[one.id, one.active, one.instance_id] for one in beats]
print(json.dumps(told))
"""


class Simulation(Peer):
    """A world whose robot drives what the node says."""

    def __init__(self, domain, world, beams=360):
        self.world, self.beams, self.rng = world, beams, np.random.default_rng(5)
        self.least, self.speeds, self.feedback, self.bounds = np.inf, [], None, 0
        self.blocked = set()
        heard = (
            ("qpavoid/feedback", Status, self._on_feedback),
            ("qpavoid/bounds", PoseArray, self._on_bounds),
            ("blocked", Bool, lambda _, one: self.blocked.add(one.data)),
        )
        super().__init__(domain, heard=heard)
        self.goals = self._writer("goal_pose", PoseStamped, SURE)
        self.tf = self._writer("tf", TFMessage, SURE)
        self.asked, self.shift = None, 0.0

    def _on_feedback(self, _, status):
        self.feedback = status.message, {one.key: one.value for one in status.values}

    def _on_bounds(self, _, found):
        self.bounds = max(self.bounds, len(found.poses))

    def goal(self, x, y, heading=0.0):
        turn = Quaternion(0, 0, math.sin(heading / 2), math.cos(heading / 2))
        pose = Pose(Point(x, y, 0), turn)
        self.goals.write(PoseStamped(Header(as_time(time.time()), "odom"), pose))

    def run(self, seconds, every=lambda k: None, held=False, until=lambda: False):
        """Simulate; ``held``: an emergency stop. Return the speeds driven."""
        begun, speeds = time.monotonic(), []
        for k in range(round(seconds * RATE)):
            twist = (0.0, 0.0) if held or not self.twists else self.twists[-1][1:]
            self.world.drive(*twist, 1.0 / RATE)
            x, y, heading = self.world.pose.tolist()
            self.pose, self.twist = (x + self.shift, y, heading), twist
            self.least = np.minimum(self.least, self.world.clearances())
            speeds.append(twist[0])
            noisy = self.world.ranges(self.beams, noise=0.005, rng=self.rng)
            self.odom()
            self.scan(ranges=noisy.tolist())
            if k % 10 == 0:
                still = Transform(
                    Vector3(4.0 + self.shift, 0.0, 0.0), Quaternion(0, 0, 0, 1)
                )
                header = Header(as_time(time.time()), "odom")
                self.tf.write(TFMessage([TransformStamped(header, "dock", still)]))
            if self.asked is not None:
                self.command(*self.asked)
            every(k)
            if until():
                break
            time.sleep(max(0.0, begun + (k + 1) / RATE - time.monotonic()))
        return speeds

    def wait(self):
        """Simulate at rest until the node gives twists."""
        self.run(60.0, until=lambda: len(self.twists) > 20)
        self.least = np.inf

    def client(self, code, *given, seconds=60.0):
        """Return what a process with rclpy prints, simulating meanwhile."""
        run = [sys.executable, "-P", "-c", code, *given]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(run, env=self.environment, **pipes)
        self.run(seconds, until=lambda: process.poll() is not None)
        said, errors = process.communicate(timeout=5.0)
        assert process.returncode == 0, errors[-1500:]
        return json.loads(said.splitlines()[-1])

    def begin(self, walls=ROOM, people=(), pose=(-3.0, 0.0, 0.0), **values):
        """Set mode and world; the pose jumps, so that the map begins anew."""
        self.asked = (0.0, 0.0)
        told = self.client(SETS, json.dumps(values)) if values else []
        self.world.__init__(walls, people, pose)
        self.shift, self.least, self.world.people[:, 3:] = (
            self.shift + 50.0,
            np.inf,
            0.0,
        )
        self.run(2.0)
        self.world.people = np.reshape(people, (-1, 5)).astype(float)
        return told


def guide(peer):
    """A goal sent at 1 Hz round a box; an emergency stop; then Nav2's action."""
    stays = max(map(abs, peer.run(1.5)))
    sends = lambda k: k % 40 or peer.goal(3.0, 0.0)  # noqa: E731
    before = peer.run(5.0, sends)
    peer.run(1.5, sends, held=True)
    after = peer.run(0.5, sends)
    peer.run(25.0, sends, until=lambda: peer.feedback[1]["arrived"] == "True")
    x, y, heading = peer.world.pose.tolist()
    found = {
        "stays": stays,
        "before": max(before),
        "released": max(after[:8]),
        "least": float(peer.least.min()),
        "off": [math.dist((x, y), (3.0, 0.0)), abs(heading)],
        "feedback": peer.feedback,
        "blocked": sorted(peer.blocked),
        "bounds": peer.bounds,
    }
    found["action"] = peer.client(FOLLOWS, seconds=70.0)
    found["rests"] = max(map(abs, peer.run(2.0)[40:]))
    return found


def teleop(peer):
    """Along a wall, round a box, past a person who crosses."""
    wall, found = -0.2 - R_MIN - 0.05, {}
    walls = [(-9.0, wall, 30.0, wall)]
    found["set"] = peer.begin(walls, **{"drive.mode": "teleop"})
    peer.asked = (0.8, 0.0)
    found["wall"] = min(peer.run(6.0)[80:])
    found["wall_least"] = float(peer.least.min())
    peer.begin([*ROOM, *BOX])
    peer.asked = (0.6, 0.0)
    peer.run(9.0)
    x, _, heading = peer.world.pose.tolist()
    found["box"] = {"x": x, "heading": heading, "least": float(peer.least.min())}
    peer.begin(people=[(0.5, -3.2, 0.25, 0.0, 0.8)])
    peer.asked = (0.8, 0.0)
    speeds = peer.run(6.0)
    found["person"] = {"slow": min(speeds[40:]), "then": speeds[-1]}
    found["person"]["least"] = float(peer.least.min())
    return found


def dock(peer):
    told = peer.begin([*DOCK, *ROOM], (), (2.5, 0, 0), **{"drive.mode": "dock"})

    def drives(k):
        peer.asked = (0.8 * (4.0 - 0.25 - 0.02 - peer.world.pose[0]), 0.0)

    peer.run(15.0, drives)
    found = {"set": told, "gap": float(peer.world.clearances()[0])}
    return found | {"others": float(peer.least[1:].min()), "said": peer.feedback[0]}


def follow(peer):
    person = (-1.2, 0.0, 0.25, 0.5, 0.0)
    found = {"set": peer.begin(ROOM, [person], **{"drive.mode": "follow"})}
    peer.asked = (1.0, 0.0)
    peer.run(7.0)
    found["gap"], found["v"] = float(peer.world.clearances()[-1]), peer.twists[-1][1]
    found["refused"] = peer.client(SETS, json.dumps({"drive.mode": "fly"}))
    return found


def person(peer):
    """Somebody comes at a parked robot without commands, seen by scans alone."""
    walks = [(1.5, 0.0, 0.25, -0.8, 0.0)]
    peer.begin(people=walks, **{"drive.mode": "command"})
    peer.asked, at = None, time.monotonic()
    peer.run(3.5)
    late = [(a, b) for t, a, b in peer.arrows if t > at + 2.0]
    rows = peer.since(at)
    moves = max(abs(v) + abs(omega) for _, v, omega in rows)
    occupied = max(n for t, _, n in peer.maps if t > at + 1.0)
    speeds = [math.dist(a, b) for a, b in late]
    return {"speeds": speeds, "moves": moves, "occupied": occupied}


def bench(peer):
    """Latency with perception at 40 Hz and 1,080 beams; twists per scan."""
    peer.begin(
        [*ROOM, *BOX], [(2.0, 2.0, 0.25, -0.3, 0.0)], **{"drive.mode": "command"}
    )
    peer.beams, peer.asked, at = 1080, (0.3, 0.1), time.monotonic()
    scans = len(peer.run(15.0))
    rate = len(peer.since(at, time.monotonic())) / scans
    peer.beams = 360
    return quantiles(latencies(peer, at)) | {"twists_per_scan": rate}


def play(domain, scenes, **settings):
    peer = Simulation(domain, World([*ROOM, *BOX], (), (-3.0, 0.0, 0.0)))
    node, found = Node(domain, **ROBOT, **settings), {}
    peer.environment = node.environment
    try:
        peer.wait()
        for scene in scenes:
            found[scene.__name__] = scene(peer)
            print(scene.__name__, found[scene.__name__], file=sys.stderr, flush=True)
    finally:
        peer.alive = False
        node.end(kill=True)
    return found


def main():
    domain, *names = sys.argv[1:]
    asked = lambda *all_of: [x for x in all_of if not names or x.__name__ in names]  # noqa: E731
    found = {}
    if guides := asked(guide):
        found |= play(int(domain), guides, role="guide", bond_heartbeat_period=0.1)
    if filters := asked(teleop, dock, follow, person, bench):
        found |= play(int(domain) + 1, filters, **MODES)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
