"""Walls round a robot."""

HALF = 6.0


RADIUS = (0.17, 0.23, 0.1, 0.5)


def box(x_1, y_1, x_2, y_2):
    corners = [(x_1, y_1), (x_2, y_1), (x_2, y_2), (x_1, y_2)]
    return [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
