"""Walls round a robot."""

from qpavoid.avoidance.settings import SafetyRadius

HALF = 6.0

RADIUS = SafetyRadius().curve


def box(x_1, y_1, x_2, y_2):
    corners = [(x_1, y_1), (x_2, y_1), (x_2, y_2), (x_1, y_2)]
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
