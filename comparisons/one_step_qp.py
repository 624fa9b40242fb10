"""The plain idea: a QP finds the twist nearest to the tracking command that is allowed.

The paper's second test case, a parked robot that a point passes at 0.1 m/s, by Eq. 5,
by Eq. 7 and by the QP, whose one row says that the distance d of P_r may shrink by
γ(d − r_min) at most, softly: abeam of the axle no twist can keep it. Nothing but numpy
and qpsolvers, no part of qpavoid.

    python comparisons/one_step_qp.py
"""

import numpy as np
from qpsolvers import solve_qp

CORNERS = [[-0.445, -0.29], [0.445, -0.29], [0.688, 0], [0.445, 0.29], [-0.445, 0.29]]
LIMITS, GAINS = np.array([1.0, 1.5]), np.array([1.0, 2.0])  # v, ω; k_x, k_γ of Eq. 6
R_MIN, R, GAMMA, PUSH, DAMPING, DT = 0.17, 0.17 * 4 / 3, 2.0, 10.0, 0.05, 0.01
WEIGHTS = np.diag([1.0, 0.03, 1e4])  # of v, ω and the slack


def nearest(o: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return P_r, the way from there to o, and the normal of its segment."""
    a, b = np.array(CORNERS), np.roll(CORNERS, -1, axis=0)
    t = np.clip(np.sum((o - a) * (b - a), 1) / np.sum((b - a) ** 2, 1), 0.0, 1.0)
    points = a + t[:, None] * (b - a)
    k = np.argmin(np.hypot(*(o - points).T))
    side = np.array([b[k, 1] - a[k, 1], a[k, 0] - b[k, 0]])
    return points[k], o - points[k], side


def twist(law: str, u_f: np.ndarray, o: np.ndarray, v_o: np.ndarray) -> np.ndarray:
    """Return u = (v, ω) for the command u_f; o and v_o in the robot's frame."""
    (p_x, p_y), gap, side = nearest(o)
    d = np.hypot(*gap)
    n = gap / d
    share = np.clip((R - d) / (R - R_MIN), 0.0, 1.0)
    push = PUSH * share**2 * (3.0 - 2.0 * share)
    u: np.ndarray
    if law == "QP":
        row = np.append(n @ [[1.0, -p_y], [0.0, p_x]], -1.0)  # d̂ᵀJ_0, slack
        most = np.array([GAMMA * (d - R_MIN) + n @ v_o])
        free = np.append(LIMITS, np.inf)
        wish = -WEIGHTS @ np.append(u_f, 0.0)
        u = solve_qp(WEIGHTS, wish, row, most, lb=-free, ub=free, solver="daqp")[:2]
    elif law == "Eq. 5":
        turn = -push * n[1] * p_x / (p_x**2 + DAMPING**2)
        u = np.clip(u_f + np.array([p_y * turn - push * n[0], turn]), -LIMITS, LIMITS)
    else:
        # Eq. 7 only turns.
        lever = (p_y * side[0] - p_x * side[1]) / np.hypot(*side)
        turn = push * lever / (lever**2 + DAMPING**2)
        u = np.clip(u_f + np.array([0.0, turn]), -LIMITS, LIMITS)
    return u


def run(law: str, seconds: float = 20.0) -> tuple[float, tuple[float, float, float]]:
    """Return the least distance, m, and where the robot ends: x, y, γ."""
    x, y, heading, least = 0.0, 0.0, 0.0, np.inf
    o, v_o = np.array([-0.032, 0.733]), np.array([0.063, -0.075])
    for _ in range(round(seconds / DT)):
        into = np.array([[np.cos(heading), np.sin(heading)],
                         [-np.sin(heading), np.cos(heading)]])  # fmt: skip
        e_x = (into @ [-x, -y])[0]
        least = min(least, np.hypot(*nearest(into @ (o - [x, y]))[1]))
        u_f = np.clip(GAINS * [e_x, np.sin(-heading)], -LIMITS, LIMITS)
        v, omega = twist(law, u_f, into @ (o - [x, y]), into @ v_o)
        x += v * DT * np.cos(heading + omega * DT / 2)
        y += v * DT * np.sin(heading + omega * DT / 2)
        heading, o = heading + omega * DT, o + v_o * DT
    return least, (x, y, heading)


if __name__ == "__main__":
    for law in ("Eq. 5", "Eq. 7", "QP"):
        least, (x, y, _) = run(law)
        print(f"{law:5}  least distance {least:.3f} m, ends {np.hypot(x, y):.3f} m off")
