"""Guards as parameters make them."""

from qpavoid.model.footprint import Footprint
from qpavoid.ros.guard import Guard
from qpavoid.ros.parameters import Wiring, defaults, preset, setup_of

DT, R_MIN = 0.05, 0.1
AT_ONCE = {"freshness.good_s": 0.0}
SMALL = {"robot.footprint_m": str(Footprint.rectangle(0.5, 0.4).vertices.tolist()),
         "robot.acceleration_mps2": 1.5, "radius.r_min_slow_m": R_MIN,
         "radius.r_min_fast_m": R_MIN, **AT_ONCE}  # fmt: skip
"""The robot of ``ros_world``."""

LASER = {"frames": ("laser",), "frame_poses": (0.0,) * 6}


def setup(values=(), **changed):
    """Settings by names as they are, and by names with ``__`` for the dot."""
    robot = preset("mir100_rectangle")
    given = {name.replace("__", "."): value for name, value in changed.items()}
    return setup_of(defaults(robot) | dict(values) | given, robot, DT)


def guarded(values=(), **wiring):
    return Guard(setup(values), Wiring(**wiring))
