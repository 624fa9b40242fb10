"""A mobile manipulator: rows against differences, pink against mink, the example."""

import sys

import numpy as np
import pytest

from places import COMPARISONS
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.model.contacts import Contacts
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot

sys.path.append(str(COMPARISONS / "examples"))
from wholebody import FootprintLimit, Sphere, SpheresLimit

pink = pytest.importorskip("pink")
pin = pytest.importorskip("pinocchio")
example = pytest.importorskip("examples.mobile_manipulator")

DT = 0.02
ROBOT = Robot.mir100()
BASE, TOOL = ("joint_0",), Sphere(("joint_6",), 0.08, (0.02, -0.03, 0.1))
Q = np.array([0.3, -0.2, np.cos(0.4), np.sin(0.4), 0.3, 0.5, 0.7, -0.2, 0.4, 0.6])
POST = Obstacles(discs=[(1.3, 0.3, 0.1)], disc_velocities=[(-0.2, 0.1)])
BALLS = np.array([(0.8, -0.3, 1.2, 0.2), (0.5, 0.4, 0.9, 0.1)])


def configuration(q=Q):
    model = example.mobile_manipulator()
    return pink.Configuration(model, model.createData(), q)


def limits(reach=2.0):
    base = FootprintLimit(ROBOT, BASE, AvoidanceSettings(dt=DT))
    arm = SpheresLimit([TOOL, Sphere(("joint_3",), 0.1)], 2.0, 0.05, reach)
    base.obstacles, arm.balls = POST, BALLS
    return base, arm


def footprint_distance(one):
    place = one.get_transform_frame_to_world(*BASE)
    heading = np.arctan2(place.rotation[1, 0], place.rotation[0, 0])
    pose = (*place.translation[:2], heading)
    return Contacts.of(ROBOT.footprint, POST.seen_from(pose)).distance


def sphere_distances(one):
    found = []
    for sphere in (TOOL, Sphere(("joint_3",), 0.1)):
        place = one.get_transform_frame_to_world(*sphere.frame)
        centre = place.rotation @ sphere.centre + place.translation
        away = np.linalg.norm(centre - BALLS[:, :3], axis=1)
        found.append(away - BALLS[:, 3] - sphere.radius)
    return np.concatenate(found)


def slopes(distance, one):
    """Central differences by each direction of the tangent space."""
    step, columns = 1e-6, []
    for direction in np.eye(one.model.nv):
        ends = [configuration(one.integrate(s * direction, step)) for s in (1.0, -1.0)]
        columns.append((distance(ends[0]) - distance(ends[1])) / (2.0 * step))
    return np.array(columns).T


def test_rows_are_the_slopes_of_distances():
    one, (base, arm) = configuration(), limits()
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
    rows = arm.compute_qp_inequalities(one, DT)
    np.testing.assert_allclose(rows.G, -slopes(sphere_distances, one), atol=1e-6)
    np.testing.assert_allclose(rows.h, DT * 2.0 * (sphere_distances(one) - 0.05))


def test_rows_know_velocities_and_reach():
    one, (_, arm) = configuration(), limits()
    still = arm.compute_qp_inequalities(one, DT)
    arm.velocities = np.array([0.3, 0.0, -0.1])
    moving = arm.compute_qp_inequalities(one, DT)
    later = arm.balls + DT * np.array([0.3, 0.0, -0.1, 0.0])
    _, other = limits()
    other.balls = later
    nearer = other.compute_qp_inequalities(one, DT).h - still.h
    np.testing.assert_allclose(moving.h - still.h, nearer / (2.0 * DT), atol=1e-4)
    arm.balls = arm.balls + 10.0
    none = arm.compute_qp_inequalities(one, DT)
    assert none.G.shape == (0, 9) and none.h.shape == (0,) and not none.inactive


def test_the_base_keeps_its_limits():
    slow = Limits(-0.5, 0.5, -1.0, 1.0, acceleration=1.0, wheel_speed=0.6, track=0.4)
    robot = Robot("slow", ROBOT.footprint, slow)
    base = FootprintLimit(robot, BASE, AvoidanceSettings(dt=DT))
    base.driven = 0.2, 0.0
    rows = base.compute_qp_inequalities(configuration(), DT)

    def holds(v, omega, aside=0.0):
        return (
            rows.G[:, :3] @ (DT * v, DT * aside, DT * omega) <= rows.h + 1e-12
        ).all()

    assert holds(0.2, 0.0) and holds(0.22, 0.9) and holds(0.18, -0.9)
    assert not holds(0.23, 0.0) and not holds(0.17, 0.0) and not holds(0.2, 1.1)
    base.driven = 0.5, 0.0
    rows = base.compute_qp_inequalities(configuration(), DT)
    assert holds(0.5, 0.4) and not holds(0.5, 0.6)  # a wheel at 0.6 m/s
    assert not holds(0.5, 0.0, 0.01) and not holds(0.5, 0.0, -0.01)


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
    body = FootprintLimit(ROBOT, ("joint_0", "body"), AvoidanceSettings(dt=DT))
    spheres = [
        s._replace(frame=(*s.frame, "body")) for s in (TOOL, Sphere(("joint_3",), 0.1))
    ]
    other = SpheresLimit(spheres, 2.0, 0.05, 2.0)
    body.obstacles, other.balls = POST, BALLS
    into_base = np.eye(9)  # from world axes to those of the base
    into_base[:2, :2] = [[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]]
    for mine, limit in zip(limits(), (body, other), strict=True):
        rows, same = (
            mine.compute_qp_inequalities(ours, DT),
            limit.compute_qp_inequalities(theirs, DT),
        )
        np.testing.assert_allclose(same.G, rows.G @ into_base, atol=1e-9)
        np.testing.assert_allclose(same.h, rows.h, atol=1e-9)
    task = mink.PostureTask(model, cost=1.0)
    task.set_target(q + 0.1)
    u = mink.solve_ik(theirs, [task], DT, "daqp", limits=[body, other])
    assert np.isfinite(u).all()


MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'


def clearances(way):
    """Least distance of footprint and post, of spheres of the arm and the world's."""
    radii = np.array([sphere.radius for sphere in example.SPHERES])[:, None]
    post, base, arm = Obstacles(discs=[example.POST]), [], []
    for one in way:
        place, *joints = (one.data.oMi[i] for i in range(1, 8))
        heading = np.arctan2(place.rotation[1, 0], place.rotation[0, 0])
        seen = post.seen_from((*place.translation[:2], heading))
        base.append(Contacts.of(ROBOT.footprint, seen).distance.min())
        centres = np.array([joint.translation for joint in joints[1:]])[:, None]
        away = np.linalg.norm(centres - example.BALLS[:, :3], axis=2)
        arm.append((away - example.BALLS[:, 3] - radii).min())
    return min(base), min(arm)


def test_the_example_reaches_its_goal():
    way = example.reach((2.6, -0.1, 0.9), steps=400)
    base, arm = clearances(way)
    assert base > 0.17 - 0.001 and arm > 0.05 - 0.002
    tool = way[-1].data.oMi[7].translation
    assert np.linalg.norm(tool - (2.6, -0.1, 0.9)) < 0.01
    moves = np.diff([one.q[:2] for one in way], axis=0)
    ahead = np.array([one.q[2:4] for one in way[:-1]])
    drift = moves[:, 1] * ahead[:, 0] - moves[:, 0] * ahead[:, 1]
    assert abs(drift).max() < 0.02 * DT  # of turning within a step


def test_where_the_goal_is_taken_the_arm_keeps_off_it():
    way = example.reach(example.BALLS[0, :3], steps=400)
    base, arm = clearances(way)
    assert base > 0.17 - 0.001
    assert 0.05 - 0.001 < arm < 0.06
