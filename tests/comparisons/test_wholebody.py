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
pin = pytest.importorskip("pinocchio")
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
    mink = pytest.importorskip("mink")
    mujoco = pytest.importorskip("mujoco")
    axes = ["0 0 1", "0 1 0", "0 1 0"] * 2
    arm = "".join(
        f'<body name="joint_{i}" pos="0 0 {height}"><joint axis="{axis}"/>{MASS}'
        for i, (height, axis) in enumerate(
            zip(example.HEIGHTS[1:], axes, strict=True), start=1
        )
    )
    base = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
    base += f'<joint axis="0 0 1"/>{MASS}'
    text = f'<body name="joint_0">{base}{arm}{"</body>" * 7}'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{text}</worldbody></mujoco>"
    )
    q = np.concatenate([[0.3, -0.2, 0.4], Q[4:]])
    theirs, ours = mink.Configuration(model, q), configuration()
    body = limit((*BASE, "body"))
    into_base = np.eye(9)  # from world axes to those of the base
    into_base[:2, :2] = [[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]]
    rows = limit().compute_qp_inequalities(ours, DT)
    same = body.compute_qp_inequalities(theirs, DT)
    np.testing.assert_allclose(same.G, rows.G @ into_base, atol=1e-9)
    np.testing.assert_allclose(same.h, rows.h, atol=1e-9)
    task = mink.PostureTask(model, cost=1.0)
    task.set_target(q + 0.1)
    u = mink.solve_ik(theirs, [task], DT, "daqp", limits=[body])
    assert np.isfinite(u).all()


MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'


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
