"""A mobile manipulator: rows against differences, pink against mink, the example."""

import sys

import numpy as np
import pytest

from places import COMPARISONS
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot

sys.path.append(str(COMPARISONS / "examples"))
from wholebody import FootprintLimit

pink = pytest.importorskip("pink")
pytest.importorskip("pinocchio")
example = pytest.importorskip("examples.mobile_manipulator")

DT = 0.02
ROBOT = Robot.mir100()
BASE = ("joint_0",)
Q = np.array([0.3, -0.2, np.cos(0.4), np.sin(0.4), 0.3, 0.5, 0.7, -0.2, 0.4, 0.6])
POST = Obstacles(discs=[(1.3, 0.3, 0.1)], disc_velocities=[(-0.2, 0.1)])


def configuration(q=Q):
    model = example.mobile_manipulator()
    return pink.Configuration(model, model.createData(), q)


def limit(frame=BASE):
    base = FootprintLimit(ROBOT, frame, AvoidanceSettings(dt=DT))
    base.obstacles = POST
    return base


def footprint_distance(one):
    place = one.get_transform_frame_to_world(*BASE)
    heading = np.arctan2(place.rotation[1, 0], place.rotation[0, 0])
    pose = (*place.translation[:2], heading)
    return Contacts.of(ROBOT.footprint, POST.seen_from(pose)).distance


def slopes(distance, one):
    """Central differences by each direction of the tangent space."""
    step, columns = 1e-6, []
    for direction in np.eye(one.model.nv):
        ends = [configuration(one.integrate(s * direction, step)) for s in (1.0, -1.0)]
        columns.append((distance(ends[0]) - distance(ends[1])) / (2.0 * step))
    return np.array(columns).T


def test_rows_are_the_slopes_of_distances():
    one, base = configuration(), limit()
    rows = base.compute_qp_inequalities(one, DT)
    (distance,) = footprint_distance(one)
    # beside it are limits of v and ω, and nothing lateral: that is in no row of a pose
    slope = slopes(footprint_distance, one)
    np.testing.assert_allclose(rows.G[0, [0, 2]], -slope[0, [0, 2]], atol=1e-6)
    place = one.get_transform_frame_to_world(*BASE)
    heading = np.arctan2(place.rotation[1, 0], place.rotation[0, 0])
    post = POST.seen_from((*place.translation[:2], heading))
    touch = -Contacts.of(ROBOT.footprint, post).normal[0]
    settings = AvoidanceSettings(dt=DT)
    spare = distance - settings.radius.r_min(np.hypot(0.2, 0.1))
    towards = touch @ post.disc_velocities[0]
    assert rows.h[0] == pytest.approx(DT * (settings.gamma * spare - towards))


def test_mink_takes_the_same_rows():
    """Of a base of two slides and a hinge, whose axes are those of the world."""
    mink, mujoco = map(pytest.importorskip, ("mink", "mujoco"))
    joints = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
    mass = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    base = f'<body name="joint_0">{joints}<joint axis="0 0 1"/>{mass}</body>'
    text = f"<mujoco><worldbody>{base}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    theirs = mink.Configuration(model, np.array([0.3, -0.2, 0.4]))
    c, s = np.cos(0.4), np.sin(0.4)
    into_base = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    rows = limit().compute_qp_inequalities(configuration(), DT)
    body = limit((*BASE, "body"))
    same = body.compute_qp_inequalities(theirs, DT)
    np.testing.assert_allclose(same.G, rows.G[:, :3] @ into_base, atol=1e-9)
    np.testing.assert_allclose(same.h, rows.h, atol=1e-9)
    task = mink.PostureTask(model, cost=1.0)
    task.set_target(np.array([0.4, -0.1, 0.5]))
    assert np.isfinite(mink.solve_ik(theirs, [task], DT, "daqp", limits=[body])).all()


def test_the_example_reaches_its_goal():
    way = example.reach((2.6, -0.1, 0.9), steps=400)
    post, least = Obstacles(discs=[example.POST]), np.inf
    for one in way:
        place = one.data.oMi[1]
        heading = np.arctan2(place.rotation[1, 0], place.rotation[0, 0])
        seen = post.seen_from((*place.translation[:2], heading))
        least = min(least, Contacts.of(ROBOT.footprint, seen).distance.min())
    assert 0.17 - 0.001 < least < 0.3
    tool = way[-1].data.oMi[7].translation
    assert np.linalg.norm(tool - (2.6, -0.1, 0.9)) < 0.01
    moves = np.diff([one.q[:2] for one in way], axis=0)
    ahead = np.array([one.q[2:4] for one in way[:-1]])
    drift = moves[:, 1] * ahead[:, 0] - moves[:, 0] * ahead[:, 1]
    assert abs(drift).max() < 0.02 * DT  # of turning within a step
