"""Interfaces of Nav2's servers: the action ``follow_path``, and heartbeats of bond."""

from typing import Any
from uuid import uuid4

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.duration import Duration
from rclpy.task import Future

from qpavoid.avoidance.decision import Status
from qpavoid.ros.guard import Guard, GuardStep

HEARTBEAT_TIMEOUT = 4.0
"""s without heartbeats after which the other side is gone, as in all nodes of Nav2."""


class FollowPathServer:
    """Server of ``nav2_msgs/action/FollowPath`` for the guide role.

    A goal that is sent while another one is followed replaces it, as Nav2 does at 1 Hz;
    the plan is kept if the path is the same. It succeeds when the robot is at rest at
    the end. It is aborted if the guide is blocked or refuses the path, if another task
    is taken, and when the node is deactivated. A goal that is blocked or canceled
    leaves the robot where it is.

    Args:
        node: Of ROS.
        guard: In the guide role.

    Raises:
        ImportError: nav2_msgs is not installed.
    """

    def __init__(self, node: Any, guard: Guard) -> None:
        from nav2_msgs.action import FollowPath

        self._guard, self._kind, self._node = guard, FollowPath, node
        self._goal: Any = None
        self._end: Any = None
        reject, accept = GoalResponse
        self._server = ActionServer(
            *(node, FollowPath, "follow_path", self._follow),
            goal_callback=lambda _: accept if node.is_active else reject,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    async def _follow(self, goal: Any) -> Any:
        """Follow the path of a goal until it ends."""
        self.end("replaced by follow_path")
        if refused := self._guard.tasks.take("path", goal.request.path):
            return self._aborted(goal, "INVALID_PATH", f"refused: {refused}")
        self._goal, self._end = goal, Future()
        why = await self._end
        if why in ("canceled", "blocked"):
            self._guard.tasks.rest()
        if why not in ("arrived", "canceled"):
            code = "FAILED_TO_MAKE_PROGRESS" if why == "blocked" else "UNKNOWN"
            return self._aborted(goal, code, why)
        (goal.succeed if why == "arrived" else goal.canceled)()
        return self._kind.Result()

    def step(self, step: GuardStep) -> None:
        """Publish feedback, and end the action, after a control step."""
        if self._end is None or self._end.done():
            return
        if self._goal.is_cancel_requested:
            self._end.set_result("canceled")
        elif self._guard.has_arrived:
            self._end.set_result("arrived")
        elif step.decision is not None and step.decision.status is Status.BLOCKED:
            self._end.set_result("blocked")
        else:
            feedback = self._kind.Feedback(speed=float(step.v))
            feedback.distance_to_goal = float(self._guard.tasks.left[0])
            self._goal.publish_feedback(feedback)

    def end(self, why: str) -> None:
        """End a goal that is followed."""
        if self._end is not None and not self._end.done():
            self._end.set_result(why)

    def destroy(self) -> None:
        """Stop serving."""
        self._server.destroy()

    def _aborted(self, goal: Any, code: str, why: str) -> Any:
        """Abort a goal; return code and reason, as far as this version has them."""
        self._node.get_logger().warning(f"follow_path is aborted: {why}")
        result = self._kind.Result()
        known = {"error_code": getattr(result, code, 0), "error_msg": why}
        for name in known.keys() & result.get_fields_and_field_types().keys():
            setattr(result, name, known[name])
        goal.abort()
        return result


class Bond:
    """Heartbeats of an active node on the topic ``bond``, for a lifecycle manager.

    Args:
        node: Of ROS.
        period: Time from one to the next, s.

    Raises:
        ImportError: The package bond is not installed.
    """

    def __init__(self, node: Any, period: float) -> None:
        from bond.msg import Status

        self._node, self._message = node, Status(id=node.get_name(), active=True)
        self._message.instance_id = uuid4().hex
        self._message.heartbeat_period = period
        self._message.heartbeat_timeout = HEARTBEAT_TIMEOUT
        self._publisher = node.create_publisher(Status, "bond", 10)
        self._timer = node.create_timer(period, self._beat)
        self._beat()

    def _beat(self) -> None:
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(self._message)

    def destroy(self) -> None:
        """Break the bond; wait until all know, 0.5 s at most."""
        self._message.active = False
        self._beat()
        self._publisher.wait_for_all_acked(Duration(seconds=0.5))
        self._node.destroy_timer(self._timer)
        self._node.destroy_publisher(self._publisher)
