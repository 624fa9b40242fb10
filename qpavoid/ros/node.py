"""ROS 2 node: in place of Nav2's collision monitor, or of its controller server.

Role ``filter``: ``cmd_vel_in`` → ``cmd_vel_out``. Role ``guide``: ``goal_pose``,
``path``, ``stay``, and with nav2_msgs the action ``follow_path`` → ``cmd_vel_out`` and
``blocked``. Sensors are named by :class:`qpavoid.ros.parameters.Wiring`; an Empty on
``~/acknowledge`` opens the latch. Further outputs are in ``SafetyNode.OUTPUTS``.

A twist is published when a scan arrives, but not before ``dt_s`` has passed since the
last one; without a scan after ``dt_s`` (1 + ``actuation.jitter``): without commands the
robot evades, too. While the node is not active it publishes none.
"""

import gc
import math
import signal
import sys
from array import array
from collections import deque
from collections.abc import Sequence
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    PolygonStamped,
    Pose,
    PoseArray,
    PoseStamped,
    Twist,
    TwistStamped,
)
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import Bool, Empty
from visualization_msgs.msg import Marker, MarkerArray

from qpavoid.avoidance.decision import Status
from qpavoid.errors import QPAvoidError
from qpavoid.model.kinematics import relative
from qpavoid.ros.guard import Guard, GuardStep
from qpavoid.ros.messages import NANOSECOND
from qpavoid.ros.nav2 import Bond, FollowPathServer
from qpavoid.ros.parameters import TF, Wiring, defaults, preset, setup_of
from qpavoid.ros.report import bounds, diagnose, markers, warm
from qpavoid.types import Pair

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""QoS of sensors; of waiting messages only the newest is used."""

MANY = QoSProfile(depth=100)
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""QoS of tf, and of static tf."""

SHOWN_EVERY = 0.2
"""s; period of the outputs for display."""

TASKS = {"goal_pose": PoseStamped, "path": Path, "stay": PoseStamped}
"""Topics of the guide role."""

KINDS = {
    "scan": LaserScan,
    "cloud": PointCloud2,
    "tracks": PointCloud2,
    "costmap": OccupancyGrid,
    "odometry": Odometry,
}
"""Types of inputs, by kind of topic."""

SUCCESS = TransitionCallbackReturn.SUCCESS


class SafetyNode(LifecycleNode):  # type: ignore[misc]
    """The node; :class:`qpavoid.ros.guard.Guard` makes all decisions."""

    def __init__(self) -> None:
        super().__init__("qpavoid")
        fixed = Wiring()._asdict().items()
        self._wiring = Wiring(**{k: self._own(k, x, True) for k, x in fixed})
        self._robot = preset(self._wiring.robot_preset)
        self._values = {k: self._own(k, x) for k, x in defaults(self._robot).items()}
        self.add_on_set_parameters_callback(self._on_parameters)
        self._guard: Guard | None = None
        self._inputs: list[Any] = []
        self._outputs: dict[str, Any] = {}
        self._action: FollowPathServer | None = None
        self._bond: Bond | None = None
        self._timer: Any = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._latency: deque[float] = deque(maxlen=1000)
        self._due, self._shown, self._state = 0.0, 0.0, ""
        self._arrival, self._answered = 0.0, 0.0

    def _own(self, name: str, default: Any, fixed: bool = False) -> Any:
        """Declare a parameter and return its value."""
        descriptor = ParameterDescriptor(read_only=fixed)
        if not isinstance(default, tuple):
            return self.declare_parameter(name, default, descriptor).value
        numbers = name in ("frame_poses", "mask_boxes_m", "dock_m")
        kind = Parameter.Type.DOUBLE_ARRAY if numbers else Parameter.Type.STRING_ARRAY
        given = self.declare_parameter(name, kind, descriptor).value
        return default if given is None else tuple(filter(lambda x: x != "", given))

    @property
    def is_active(self) -> bool:
        """Whether twists are published."""
        return self._timer is not None

    def _now(self) -> Pair:
        """Return the times of the stamps' clock and of the monotonic one, s."""
        now, steady = self.get_clock().now(), self._steady.now()
        return NANOSECOND * now.nanoseconds, NANOSECOND * steady.nanoseconds

    def _on_parameters(self, changed: list[Any]) -> SetParametersResult:
        """Accept valid parameters from the next step on; reject others."""
        news = {one.name: one.value for one in changed if one.name in self._values}
        values = self._values | news
        try:
            setup = setup_of(values, self._robot, self._wiring.dt_s)
            if self._guard is not None:
                self._guard.change(setup)
        except (QPAvoidError, TypeError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._values = values
        return SetParametersResult(successful=True)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Create the filter, publishers and subscriptions, and compile."""
        try:
            setup = setup_of(self._values, self._robot, self._wiring.dt_s)
            warm(Guard(setup, self._wiring))
            guard = Guard(setup, self._wiring)
            if self._wiring.tf or self._wiring.odometry == TF:
                self._listen_to_frames(guard)
        except (QPAvoidError, ImportError) as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._guard, wiring = guard, self._wiring
        if "perception" in guard.errors:
            self.get_logger().warning(guard.errors["perception"])
        twist = TwistStamped if self._wiring.stamped else Twist
        for name, kind in wiring.topics.items():
            if name != TF:
                self._listen(KINDS[kind], name, partial(self._on_input, name), NEWEST)
        self._listen(Empty, "~/acknowledge", lambda _: guard.inputs.latch.acknowledge())
        if wiring.footprint:
            self._listen(PolygonStamped, wiring.footprint, guard.outline)
        outputs = {"cmd_vel_out": twist} | {k: x for k, (x, _) in self.OUTPUTS.items()}
        if wiring.role == "guide":
            outputs["blocked"] = Bool
            for name, task in TASKS.items():
                self._listen(task, name, partial(self._on_task, name))
            try:
                self._action = FollowPathServer(self, guard)
            except ImportError as error:
                self.get_logger().info(f"no action follow_path: {error}")
        else:
            take = lambda m: guard.command(m, *self._now())  # noqa: E731
            self._listen(twist, "cmd_vel_in", take)
        self._outputs = {k: self.create_publisher(x, k, 1) for k, x in outputs.items()}
        return SUCCESS

    def _listen(self, kind: Any, name: str, call: Any, qos: Any = 1) -> None:
        self._inputs.append(self.create_subscription(kind, name, call, qos))

    def _on_task(self, kind: str, message: Any) -> None:
        """Give a task to the guide; a refused one is logged."""
        guard, refused = self._guard, "the node is not active"
        if guard is not None and self.is_active:
            refused = guard.tasks.take(kind, message)
        if refused:
            self.get_logger().warning(f"{kind} is refused: {refused}")
        elif self._action is not None:
            self._action.end(f"replaced by {kind}")

    def _listen_to_frames(self, guard: Guard) -> None:
        """Subscribe to tf, whose messages come with ROS."""
        from tf2_msgs.msg import TFMessage

        moved = lambda m: guard.transforms(m, *self._now())  # noqa: E731
        self._listen(TFMessage, TF, moved, MANY)
        fixed = partial(guard.sensing.frames.add, fixed=True)
        self._listen(TFMessage, "/tf_static", fixed, LATCHED)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish twists from now on; the robot stands until all inputs are valid."""
        if self._wiring.bond_heartbeat_period > 0.0:
            try:
                self._bond = Bond(self, self._wiring.bond_heartbeat_period)
            except ImportError as error:
                self.get_logger().error(f"bond_heartbeat_period: {error}")
                return TransitionCallbackReturn.FAILURE
        gc.collect()
        gc.freeze()  # a full collection of all that exists now takes 30 ms
        dt = self._wiring.dt_s
        self._timer = self.create_timer(dt, self._step, None, self._steady)
        return SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a last twist, standing still."""
        self._stop()
        return SUCCESS

    on_shutdown = on_deactivate

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reset all but the parameters."""
        for one in self._inputs:
            self.destroy_subscription(one)
        for publisher in self._outputs.values():
            self.destroy_publisher(publisher)
        if self._action is not None:
            self._action.destroy()
        self._inputs, self._outputs, self._guard, self._action = [], {}, None, None
        return SUCCESS

    def _stop(self) -> None:
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None
            if self._action is not None:
                self._action.end("deactivated")
            self._give(0.0, 0.0)
            if self._guard is not None:
                self._guard.stop()
        if self._bond is not None:
            self._bond.destroy()
            self._bond = None

    def run(self) -> None:
        """Process messages until an exception is raised in a callback."""
        try:
            rclpy.spin(self)
        except Exception as error:
            self.get_logger().error(f"message ignored: {error!r}")

    def _on_input(self, topic: str, message: Any) -> None:
        """Register an input; a scan starts a step if one is due."""
        guard, (now, steady) = self._guard, self._now()
        if guard is None or guard.see(topic, message, now, steady) is not None:
            return
        if topic in self._wiring.scans:
            self._arrival = steady
            if self._timer is not None and steady >= self._due:
                self._step()
            elif self._timer is not None:
                self._wait(self._due - steady)

    def _wait(self, time: float) -> None:
        """Let the timer start the next step after a time, s."""
        self._timer.timer_period_ns = round(time / NANOSECOND)
        self._timer.reset()

    def _step(self) -> None:
        """Do a control step; on any exception the robot brakes."""
        guard, (now, steady) = self._guard, self._now()
        if guard is None:
            return
        self._due = steady + self._wiring.dt_s
        self._wait(self._wiring.dt_s * (1.0 + guard.setup.settings.actuation.jitter))
        measured = self._wiring.driven_from_odometry or guard.wiring.role == "guide"
        driven = guard.odometry.twist if measured else None
        try:
            step = guard.step(now, steady, driven)
        except Exception as error:
            self.get_logger().error(f"braking: {error!r}")
            step = guard.brake(str(error))
        self._give(step.v, step.omega)
        if self._arrival > self._answered:
            self._latency.append(self._now()[1] - self._arrival)
            self._answered = self._arrival
        if "blocked" in self._outputs and step.decision is not None:
            blocked = step.decision.status is Status.BLOCKED
            self._outputs["blocked"].publish(Bool(data=blocked))
        if self._action is not None:
            self._action.step(step)
        state = f"{step.faults} {step.decision and step.decision.status}"
        if state != self._state or steady - self._shown >= SHOWN_EVERY:
            self._shown, self._state = steady, state
            for name, (_, make) in self.OUTPUTS.items():
                if self._outputs[name].get_subscription_count():
                    self._outputs[name].publish(make(self, guard, step))

    def _bounds(self, guard: Guard, step: GuardStep) -> PoseArray:
        """Return the obstacle points whose constraints bound a step."""
        held, _ = bounds(guard.setup.robot.footprint, step)
        places = [Point(x=x, y=y) for x, y in held[1::2].tolist()]
        return self._on_base(PoseArray(poses=[Pose(position=x) for x in places]))

    def _local_map(self, guard: Guard, step: GuardStep) -> OccupancyGrid:
        """Return the local map, on the base at the last scan."""
        known = guard.sensing.perceiver.explain()
        if known is None:
            return self._on_base(OccupancyGrid())
        grid = self._on_base(OccupancyGrid(data=array("b", known.grid.tobytes())))
        grid.info.height, grid.info.width = known.grid.shape
        grid.info.resolution = known.resolution
        x, y, heading = relative(known.pose, (*known.origin, 0.0))
        corner, half = grid.info.origin, 0.5 * heading
        corner.position.x, corner.position.y = x, y
        corner.orientation.z, corner.orientation.w = math.sin(half), math.cos(half)
        return grid

    def _on_base(self, message: Any) -> Any:
        """Return a message with the header of the base frame and the present time."""
        message.header.frame_id = self._wiring.base_frame
        message.header.stamp = self.get_clock().now().to_msg()
        return message

    def _give(self, v: float, omega: float) -> None:
        """Publish a twist."""
        stamped = self._wiring.stamped
        message = self._on_base(TwistStamped()) if stamped else Twist()
        twist = message.twist if stamped else message
        twist.linear.x, twist.angular.z = v, omega
        self._outputs["cmd_vel_out"].publish(message)

    def _status(self, guard: Guard, step: GuardStep) -> DiagnosticStatus:
        """Return a step as a status of diagnostics."""
        level, values = diagnose(guard, step, self._latency)
        status = DiagnosticStatus(level=bytes([level]), message=step.sentence)
        status.name = self.get_fully_qualified_name()
        status.hardware_id = self._robot.name
        status.values = [KeyValue(key=k, value=x) for k, x in values.items()]
        return status

    def _diagnostics(self, guard: Guard, step: GuardStep) -> DiagnosticArray:
        """Return the status as diagnostics."""
        return self._on_base(DiagnosticArray(status=[self._status(guard, step)]))

    def _markers(self, guard: Guard, step: GuardStep) -> MarkerArray:
        """Return lines as markers on the base, one per namespace."""
        shown = markers(guard, step)
        made = [one.on(self._on_base(Marker()), Point) for one in shown]
        return MarkerArray(markers=made)

    OUTPUTS = {  # noqa: RUF012
        "~/markers": (MarkerArray, _markers),
        "~/local_map": (OccupancyGrid, _local_map),
        "~/feedback": (DiagnosticStatus, _status),
        "~/bounds": (PoseArray, _bounds),
        "/diagnostics": (DiagnosticArray, _diagnostics),
    }
    """Outputs for display: types, and functions from a step to messages."""


def interrupted(*_: Any) -> None:
    """Raise KeyboardInterrupt, as by Ctrl-C: with a last twist."""
    raise KeyboardInterrupt


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the node until it is interrupted; the arguments are those of ROS."""
    given = None if arguments is None else [sys.argv[0], *arguments]
    rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    signal.signal(signal.SIGTERM, interrupted)
    node = SafetyNode()
    try:
        if node._wiring.autostart and node.trigger_configure() is SUCCESS:
            node.trigger_activate()
        while True:
            node.run()
    except KeyboardInterrupt:
        node.trigger_shutdown()
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return 0
