"""The outlines of robots on their ways, by shapely: an independent oracle."""

from shapely import Polygon

from qpavoid.model.kinematics import to_world


def outlines(log):
    """Return that of a robot at every control step and after the last."""
    columns = (log[key].tolist() for key in ("x_m", "y_m", "heading_rad"))
    poses = [*zip(*columns, strict=True), tuple(log.final.tolist())]
    return [Polygon(to_world(log.vertices, pose)) for pose in poses]
