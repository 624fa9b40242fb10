"""Figure of the QP: rows, limits, desired twist and answer in the (v, ω) plane.

Run: python comparisons/examples/velocity_plane.py [velocity_plane.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import qpavoid as qp

DESIRED = (0.9, 0.0)
POINTS = [(1.0, 0.15), (0.3, 0.55), (-0.2, -0.5)]


def problem():
    """Return the one-step QP of a robot among three points, and its solution."""
    safety = qp.SafetyFilter(qp.Robot.mir100(), ahead=False)
    found = safety.problem(*DESIRED, points=POINTS)
    return found, qp.solve(found)


def draw(found, solution):
    """Return the plane: what is shaded is forbidden by a row."""
    figure, axes = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
    (v_low, omega_low), (v_high, omega_high) = found.lower, found.upper
    v, omega = np.meshgrid(
        np.linspace(v_low, v_high, 401), np.linspace(omega_low, omega_high, 401)
    )
    for k, (row, bound) in enumerate(zip(found.A, found.b, strict=True)):
        room = row[0] * v + row[1] * omega - bound
        axes.contourf(v, omega, room, levels=[-1e9, 0.0], colors=[f"C{k}"], alpha=0.3)
        axes.contour(v, omega, room, levels=[0.0], colors=[f"C{k}"])
        axes.plot([], [], f"C{k}", label=f"forbidden by {POINTS[found.obstacle[k]]}")
    (w_v, w_omega), (a, b) = found.weights, found.desired
    cost = w_v * (v - a) ** 2 + w_omega * (omega - b) ** 2
    axes.contour(v, omega, cost, levels=8, colors="0.6", linewidths=0.5)
    axes.plot(a, b, "kx", label="desired")
    axes.plot(*solution.u, "ko", label="driven")
    axes.set(xlabel="v (m/s)", ylabel="ω (rad/s)")
    axes.legend()
    return figure


if __name__ == "__main__":
    found, solution = problem()
    print(f"desired {found.desired}, driven {solution.u}, {len(found.b)} rows")
    name = sys.argv[1] if sys.argv[1:] else "velocity_plane.png"
    draw(found, solution).savefig(name, dpi=120)
