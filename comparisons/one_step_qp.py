"""The plain idea: a QP finds the twist nearest to the tracking command that is allowed.

The paper's second test case, a parked robot that a point passes at 0.1 m/s, by Eq. 5,
by Eq. 7 and by the QP. What the paper leaves open (line, limits, activation, damping)
is as in ``configs/paper/test_case_2.toml``: one calibration of many. The QP's one row
says that the distance d of P_r may shrink by γ(d − r_min) at most, softly: abeam of the
axle no twist can keep it. Nothing but numpy and qpsolvers, no part of qpavoid.

    python comparisons/one_step_qp.py
"""

import numpy as np
from qpsolvers import solve_qp

# corners, m, x ahead of the axle
A = np.c_[[-0.445, 0.445, 0.688, 0.445, -0.445], [-0.29, -0.29, 0.0, 0.29, 0.29]]
BOX, GAINS = np.array([1.0, 1.5, np.inf]), np.array([1.0, 2.0])  # v, ω; of Eq. 6
R_MIN, R, GAMMA, PUSH, DAMPING, DT = 0.17, 0.17 * 4 / 3, 2.0, 10.0, 0.05, 0.01
W = np.diag([1.0, 0.03, 1e4])  # of v, ω and the slack


def nearest(o: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return P_r, the way from there to o, and the direction of its edge."""
    edges = np.roll(A, -1, axis=0) - A
    t = np.clip(np.sum((o - A) * edges, 1) / np.sum(edges**2, 1), 0.0, 1.0)
    gaps = o - A - t[:, None] * edges
    k = np.argmin(np.hypot(*gaps.T))
    return o - gaps[k], gaps[k], edges[k] / np.hypot(*edges[k])


def twist(law: str, u_f: np.ndarray, o: np.ndarray, v_o: np.ndarray) -> np.ndarray:
    """Return u = (v, ω) for the command u_f; o and v_o in the robot's frame."""
    p, gap, edge = nearest(o)
    n = gap / (d := np.hypot(*gap))
    if law == "QP":
        row = np.append(n @ [[1.0, -p[1]], [0.0, p[0]]], -1.0)  # d̂ᵀJ_0, slack
        parts = W, -W @ [*u_f, 0.0], row, np.array([GAMMA * (d - R_MIN) + n @ v_o])
        return np.array(solve_qp(*parts, lb=-BOX, ub=BOX, solver="daqp")[:2])
    share = np.clip((R - d) / (R - R_MIN), 0.0, 1.0)
    push = PUSH * share**2 * (3.0 - 2.0 * share)
    lever, along = (p[0], -n[1]) if law == "Eq. 5" else (p @ edge, 1.0)
    turn = push * along * lever / (lever**2 + DAMPING**2)
    back = p[1] * turn - push * n[0] if law == "Eq. 5" else 0.0
    return np.array(np.clip(u_f + np.array([back, turn]), -BOX[:2], BOX[:2]))


def run(law: str, seconds: float = 20.0) -> tuple[float, np.ndarray]:
    """Return the least distance, m, and the pose at the end: x, y, γ."""
    pose, least, v_o = np.zeros(3), np.inf, np.array([0.063, -0.075])
    for o in [-0.032, 0.733] + np.arange(0.0, seconds, DT)[:, None] * v_o:
        c, s = np.cos(pose[2]), np.sin(pose[2])
        into = np.array([[c, s], [-s, c]])
        seen, e_x = into @ (o - pose[:2]), (into @ -pose[:2])[0]
        least = min(least, np.hypot(*nearest(seen)[1]))
        u_f = np.clip(GAINS * [e_x, np.sin(-pose[2])], -BOX[:2], BOX[:2])
        v, omega = twist(law, u_f, seen, into @ v_o)
        pose += DT * np.append(v * into[0], omega)
    return least, pose


if __name__ == "__main__":
    for law in ("Eq. 5", "Eq. 7", "QP"):
        least, (x, y, _) = run(law)
        print(f"{law:5}  least distance {least:.3f} m, ends {np.hypot(x, y):.3f} m off")
