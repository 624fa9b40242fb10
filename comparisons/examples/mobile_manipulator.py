"""A base with an arm reaches past a post.

Run: python comparisons/examples/mobile_manipulator.py [figure.png]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import qpavoid as qp

try:
    import pink
    import pinocchio as pin
except ImportError:
    sys.exit(str(qp.MissingExtraError("pink", "wholebody")))

from wholebody import FootprintLimit

DT, POST = 0.02, (1.4, 0.35, 0.15)
TURNS = [pin.JointModelRZ, pin.JointModelRY, pin.JointModelRY] * 2
HEIGHTS = [0.0, 0.3, 0.15, 0.35, 0.3, 0.1, 0.1]


def mobile_manipulator():
    """Return its model: joint_0, the base in the plane, and six, a frame at each."""
    model, parent = pin.Model(), 0
    for i, joint in enumerate([pin.JointModelPlanar, *TURNS]):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, HEIGHTS[i]]))
        parent = model.addJoint(parent, joint(), place, f"joint_{i}")
        model.addJointFrame(parent)
    model.velocityLimit = np.ones(model.nv)  # m/s and rad/s
    return model


def reach(goal, steps=600):
    """Return the configurations on the way of the last joint to a goal."""
    base = FootprintLimit(qp.Robot.mir100(), ("joint_0",), qp.AvoidanceSettings(dt=DT))
    base.obstacles = qp.Obstacles(discs=[POST])
    task = pink.tasks.FrameTask("joint_6", 1.0, 0.0, gain=0.05)
    task.set_target(pin.SE3(np.eye(3), np.array(goal)))
    model, q = mobile_manipulator(), np.array([0, 0, 1, 0, 0, 0.4, 1, 0, 0.6, 0])
    limits = [base, pink.limits.VelocityLimit(model)]
    way = [pink.Configuration(model, model.createData(), q)]
    for _ in range(steps):
        u = pink.solve_ik(way[-1], [task], DT, "daqp", 1e-4, limits)
        base.driven = u[0], u[2]
        way.append(pink.Configuration(model, way[-1].data, way[-1].integrate(u, DT)))
    return way


if __name__ == "__main__":
    figure, axes = plt.subplots(figsize=(8.0, 3.6), layout="constrained")
    for one in reach((2.6, -0.1, 0.9))[:241:40]:
        base, *arm = (one.data.oMi[i] for i in range(1, 8))
        outline = qp.Robot.mir100().footprint.vertices @ base.rotation[:2, :2].T
        axes.fill(*(outline + base.translation[:2]).T, fill=False, color="0.7")
        axes.plot(*np.array([f.translation[:2] for f in arm]).T, "o-", color="C0", ms=3)
    axes.add_patch(plt.Circle(POST[:2], POST[2], color="0.25"))
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    figure.savefig(sys.argv[1] if sys.argv[1:] else "mobile_manipulator.png", dpi=120)
