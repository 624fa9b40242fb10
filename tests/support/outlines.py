"""The outlines of robots on their ways, by shapely: an independent oracle."""

from itertools import combinations

from shapely import Polygon

from qpavoid.model.kinematics import to_world


def outlines(log):
    """Return that of a robot at every control step and after the last."""
    columns = (log[key].tolist() for key in ("x_m", "y_m", "heading_rad"))
    poses = [*zip(*columns, strict=True), tuple(log.final.tolist())]
    return [Polygon(to_world(log.vertices, pose)) for pose in poses]


def least_apart(logs):
    """Return the least distance of any two robots of a run, m; 0 if they touched."""
    together = zip(*map(outlines, logs), strict=True)
    return min(a.distance(b) for some in together for a, b in combinations(some, 2))
