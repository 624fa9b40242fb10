"""Action ``follow_path`` of Nav2, in place of its controller server."""

from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future

from qpavoid.avoidance.decision import Status
from qpavoid.ros.guard import Guard, GuardStep

ANSWERS = GoalResponse.REJECT, GoalResponse.ACCEPT
"""To a goal while the node is not active, and active."""


class FollowPathServer:
    """Server of ``nav2_msgs/action/FollowPath`` for the guide role.

    A goal that is sent while another one is followed replaces it, as Nav2 does at 1 Hz;
    the plan is kept if the path is the same. It succeeds when the robot is at rest at
    the end, and is aborted if the guide is blocked or refuses the path. When it ends
    otherwise than by another goal, the robot stays where it is.

    Args:
        node: Of ROS.
        guard: In the guide role.
        kind: Type of the action.
    """

    def __init__(self, node: Any, guard: Guard, kind: Any) -> None:
        self._guard, self._kind, self._node = guard, kind, node
        self._goal: Any = None
        self._end: Any = None
        self._server = ActionServer(
            *(node, kind, "follow_path", self._follow),
            goal_callback=lambda _: ANSWERS[node.is_active],
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    @classmethod
    def of(cls, node: Any, guard: Guard) -> "FollowPathServer | None":
        """Return the server; None where nav2_msgs is not installed."""
        try:
            from nav2_msgs.action import FollowPath
        except ImportError:
            node.get_logger().info("nav2_msgs is not installed: no action follow_path")
            return None
        return cls(node, guard, FollowPath)

    async def _follow(self, goal: Any) -> Any:
        """Follow the path of a goal until it ends."""
        self.end("replaced")
        result = self._kind.Result()
        refused = self._guard.tasks.take("path", goal.request.path)
        if refused:
            self._node.get_logger().warning(f"follow_path is refused: {refused}")
            self._say(result, "INVALID_PATH", refused)
            goal.abort()
            return result
        self._goal, self._end = goal, Future()
        why = await self._end
        if why == "arrived":
            goal.succeed()
        elif why == "canceled":
            goal.canceled()
        else:
            self._say(result, "FAILED_TO_MAKE_PROGRESS", why)
            goal.abort()
        if why in ("canceled", "blocked"):
            self._guard.tasks.rest()
        return result

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

    def _say(self, result: Any, code: str, why: str) -> None:
        """Write code and reason into a result, as far as its version has them."""
        known = {"error_code": getattr(result, code, 0), "error_msg": why}
        for name in known.keys() & result.get_fields_and_field_types().keys():
            setattr(result, name, known[name])
