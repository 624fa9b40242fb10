"""A fork-lift picks up a pallet: its footprint grows, and it leaves what is inside.

The forks are parts of the footprint and drive between the stringers of a pallet, which
then is a part, too. A post is measured within it: it is reported and only ever left.

Run: python comparisons/examples/fork_lift.py [fork_lift.png]
"""

import sys
from math import dist

import matplotlib.pyplot as plt

import qpavoid as qp
from qpavoid.model.kinematics import integrate, to_world


def box(x, y, length, width):
    """Return the corners of a rectangle about (x, y), m."""
    signs = (-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)
    return [(x + a * length, y + b * width) for a, b in signs]


LIFT = [box(0.0, 0.0, 1.0, 0.8), *(box(1.0, y, 1.0, 0.12) for y in (-0.225, 0.225))]
LOADED = [*LIFT, box(1.0, 0.0, 0.8, 1.0)]
LIMITS = qp.Limits(-1.0, 1.0, -1.0, 1.0, acceleration=1.0, angular_acceleration=2.0)
SETTINGS = qp.AvoidanceSettings(radius=qp.SafetyRadius(0.05, 0.2), dt=0.05)
STRINGERS = [box(4.4, y, 0.8, 0.1) for y in (-0.45, 0.0, 0.45)]
DOOR, POST = [[7.0, 0.85, 7.0, 3.0], [7.0, -0.85, 7.0, -3.0]], (4.2, -0.59, 0.1)
BEFORE = qp.Obstacles(walls=DOOR, discs=[POST], polygons=STRINGERS)


def drive(guide, way, goal, obstacles):
    """Return the poses from the end of a way to a goal, for at most 20 s."""
    guide.go_to(way[-1], goal)
    way, found = way[-1:], []
    while len(way) < 400 and (dist(way[-1][:2], goal[:2]) > 0.03 or found[-1].v != 0.0):
        found.append(guide.step(way[-1], obstacles.seen_from(way[-1])))
        way.append(integrate(way[-1], found[-1][:2], 0.0, 0.05))
    first, *_ = seen = [step.clearance for step in found]
    print(f"to x = {way[-1][0]:.1f} m, clearance {first:.3f}, least {min(seen):.3f} m")
    return way


if __name__ == "__main__":
    guide = qp.Guide(qp.Robot("fork-lift", qp.Footprint.union(LIFT), LIMITS), SETTINGS)
    there = drive(guide, [(0.0, 0.3, 0.0)], (2.0, 0.0, 0.0), BEFORE)
    there += drive(guide, there, (3.4, 0.0, 0.0), BEFORE)
    guide.footprint = qp.Footprint.union(LOADED)
    on = drive(guide, there, (10.0, 0.0, 0.0), qp.Obstacles(walls=DOOR, discs=[POST]))
    axes = plt.figure(figsize=(7.5, 2.7), layout="constrained").gca()
    for parts, poses, color in ((LIFT, there, "C0"), (LOADED, on, "C2")):
        for pose in (*poses[::50], poses[-1]):
            for part in parts:
                axes.fill(*to_world(part, pose).T, fill=False, ec=color, lw=0.8)
    axes.plot([7, 7], [0.85, 2.0], [7, 7], [-0.85, -2.0], color="0.25", lw=2)
    axes.fill(*(xs for one in STRINGERS for xs in zip(*one, strict=True)), color="0.25")
    axes.add_patch(plt.Circle(POST[:2], POST[2], color="C3"))
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", ylim=(-1.6, 1.6))
    axes.figure.savefig(sys.argv[1] if sys.argv[1:] else "fork_lift.png", dpi=120)
