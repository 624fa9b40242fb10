"""Frames by tf and poses by time: chains, interpolation, and what is refused."""

import math
from itertools import pairwise
from types import SimpleNamespace as Fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from qpavoid.errors import InvalidInputError
from qpavoid.model.kinematics import integrate, relative
from qpavoid.ros.frames import BEYOND, MEMORY, STAMPS, Frames, Transform
from qpavoid.ros.odometry import MOST_POSES, Trail, placed
from ros_messages import link

NUMBERS = st.floats(-3.0, 3.0)
TURNS = st.tuples(*[NUMBERS] * 3).map(lambda x: Rotation.from_rotvec(x).as_quat())
PLACES = st.tuples(*[NUMBERS] * 3)


def matrix(place, turn):
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = Rotation.from_quat(turn).as_matrix(), place
    return made


def tree(*links):
    frames = Frames()
    for one in links:
        frames.add(Fields(transforms=[one]), fixed=one.fixed)
    return frames


def found(frames, base, frame, time=0.0):
    got = frames.find(base, frame, time)
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = got
    return made


@given(st.lists(st.tuples(PLACES, TURNS), min_size=4, max_size=4))
def test_chains_up_and_down(given):
    """map → odom → base → mast → laser, asked from either end."""
    names = ["odom", "base", "mast", "laser"]
    parents = ["map", "odom", "base", "mast"]
    links = [
        link(above, name, place, turn, fixed=True)
        for above, name, (place, turn) in zip(parents, names, given, strict=True)
    ]
    frames = tree(*links[::-1])
    odom, base, mast, laser = (matrix(*one) for one in given)
    expected = {
        ("base", "laser"): mast @ laser,
        ("laser", "base"): np.linalg.inv(mast @ laser),
        ("map", "laser"): odom @ base @ mast @ laser,
        ("mast", "odom"): np.linalg.inv(base @ mast),
        ("base", "base"): np.eye(4),
    }
    for (one, other), wanted in expected.items():
        np.testing.assert_allclose(found(frames, one, other), wanted, atol=1e-9)


@given(PLACES, TURNS, PLACES, TURNS, st.floats(0.0, 1.0))
def test_between_two_stamps(place, turn, later, turned, share):
    frames = tree(
        link("base", "mast", place, turn, 4.0), link("base", "mast", later, turned, 5.0)
    )
    ends = Rotation.from_quat([turn, turned])
    wanted = Slerp([4.0, 5.0], ends)(4.0 + share).as_matrix()
    got = found(frames, "base", "mast", 4.0 + share)
    np.testing.assert_allclose(got[:3, :3], wanted, atol=1e-6)
    way = np.array(place) + share * (np.array(later) - place)
    np.testing.assert_allclose(got[:3, 3], way, atol=1e-9)


def test_two_branches_meet_at_their_common_parent():
    """A base_link below base_footprint, and a laser beside it; with a slash, too."""
    frames = tree(
        link("base_footprint", "base_link", (0.1, 0.0, 0.2), fixed=True),
        link("/base_footprint", "/laser", (0.4, 0.0, 0.5), fixed=True),
    )
    place = frames.find("base_link", "laser", 0.0).translation
    np.testing.assert_allclose(place, (0.3, 0.0, 0.3), atol=1e-12)


def test_it_holds_still_for_a_while_and_no_longer():
    frames = tree(link("base", "mast", (1.0, 0.0, 0.0), time=4.0))
    for time in (4.001 - BEYOND, 4.0, 3.999 + BEYOND):
        assert frames.find("base", "mast", time).translation[0] == 1.0
    for time in (3.9 - BEYOND, 4.1 + BEYOND):
        with pytest.raises(InvalidInputError, match="'mast' only 0.3 s off"):
            frames.find("base", "mast", time)


def test_unordered_stamps_and_a_clock_set_back():
    frames = tree(
        *(link("base", "mast", (t, 0.0, 0.0), time=t) for t in (1.0, 3.0, 2.0))
    )
    assert frames.find("base", "mast", 2.5).translation[0] == pytest.approx(2.5)
    frames = tree(
        *(link("base", "mast", (t, 0.0, 0.0), time=t) for t in (1e6, 5.0, 6.0))
    )
    assert frames.find("base", "mast", 5.5).translation[0] == pytest.approx(5.5)


def test_what_is_remembered_is_bounded():
    for gap in (MEMORY / 100, MEMORY / 1e5):
        times = gap * np.arange(3 * STAMPS)
        frames = tree(*(link("base", "mast", (t, 0.0, 0.0), time=t) for t in times))
        _, kept, places = frames._links["mast"]
        assert len(kept) == len(places) <= STAMPS
        assert kept[-1] - kept[0] <= MEMORY


def test_a_frame_that_is_hung_elsewhere():
    frames = tree(
        link("base", "mast", (1.0, 0.0, 0.0), time=1.0),
        link("arm", "mast", (2.0, 0.0, 0.0), time=1.1),
    )
    with pytest.raises(InvalidInputError, match="neither in frames nor in tf"):
        frames.find("base", "mast", 1.1)
    assert frames.find("arm", "mast", 1.1).translation[0] == 2.0
    frames.add(Fields(transforms=[link("mast", "arm", (1.0, 0.0, 0.0), time=1.0)]))
    with pytest.raises(InvalidInputError, match="neither"):  # a circle
        frames.find("base", "mast", 1.0)


@pytest.mark.parametrize(
    "place, turn",
    [((math.nan, 0, 0), (0, 0, 0, 1)), ((0, 0, 0), (0, 0, 0, 0)),
     ((0, 0, 0), (math.inf, 0, 0, 1))],
)  # fmt: skip
def test_what_is_no_place_is_left_out_by_name(place, turn):
    """The others of its message count, and what was known of its frame still does."""
    errors, good = [], link("base", "laser", (0.1, 0.0, 0.2), fixed=True)
    frames = Frames(lambda *said: errors.append(said), ["camera"])
    bad = link("base", "mast", place, turn, fixed=True)
    frames.add(Fields(transforms=[bad, good]), fixed=True)
    assert frames.find("base", "laser", 0.0).translation[0] == 0.1
    (name, said), *_ = errors
    assert name == "tf" and said.startswith("the transform of 'mast' is left out: a")
    with pytest.raises(
        InvalidInputError, match="known: camera, laser; .*'mast' is left"
    ):
        frames.find("base", "mast", 0.0)
    sound = link("base", "mast", (1.0, 0.0, 0.0), fixed=True)
    frames.add(Fields(transforms=[sound, bad]), fixed=True)
    assert frames.find("base", "mast", 0.0).translation[0] == 1.0


def compose(frame, pose):
    """The place of a pose in a frame, as seen from where that frame is."""
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    x, y = cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1]
    return frame[0] + x, frame[1] + y, frame[2] + pose[2]


def test_relative_and_placed_are_inverse():
    then, now = (1.0, -2.0, 3.0), (0.5, 4.0, -3.0)
    assert compose(then, relative(then, now))[:2] == pytest.approx(now[:2])
    assert relative(then, now)[2] == pytest.approx(2 * math.pi - 6.0)
    assert relative(then, then) == (0.0, 0.0, 0.0)


def test_between_two_and_after_the_last():
    trail = Trail()
    assert trail.at(3.0) == (0.0, 0.0, 0.0)
    trail.record(1.0, (0.0, 0.0, 3.1), (0.0, 0.0))
    trail.record(2.0, (1.0, 2.0, -3.1), (0.5, 0.3))
    x, y, heading = trail.at(1.5)
    assert (x, y) == pytest.approx((0.5, 1.0))
    assert math.cos(heading) == pytest.approx(-1.0, abs=1e-9)
    driven = integrate((1.0, 2.0, -3.1), (0.5, 0.3), 0.0, 0.4)
    assert trail.at(2.4) == pytest.approx(driven)
    assert trail.at(0.0) == (0.0, 0.0, 3.1)


def test_between_two_of_many_that_are_not_evenly_apart():
    trail, times = Trail(), (0.0, 1.0, 3.0, 3.5, 7.0)
    for time in times:
        trail.record(time, (time * time, -time, 0.1 * time), (9.0, 9.0))
    for a, b in pairwise(times):
        for share in (0.0, 0.3, 0.9):
            time = a + share * (b - a)
            x, y, heading = trail.at(time)
            assert x == pytest.approx(a * a + share * (b * b - a * a))
            assert (-y, 10 * heading) == pytest.approx((time, time))


def test_many_times_at_once_and_points_from_their_poses():
    trail = Trail()
    for k in range(9):
        trail.record(0.1 * k, (0.1 * k, 0.0, 0.7 * k), (1.0, 7.0))
    times = np.linspace(-0.1, 1.0, 40)
    poses = trail.along(times)
    np.testing.assert_allclose(poses, [trail.at(t) for t in times.tolist()])
    driven = integrate((0.8, 0.0, 5.6), (1.0, 7.0), 0.0, 0.2)
    np.testing.assert_allclose(np.exp(1j * poses[-1, 2]), np.exp(1j * driven[2]))
    np.testing.assert_allclose(poses[-1, :2], driven[:2])
    seen = placed(np.ones((40, 2)), poses)
    wanted = [compose(pose, (1.0, 1.0, 0.0))[:2] for pose in poses.tolist()]
    np.testing.assert_allclose(seen, wanted)


def test_twists_are_compared_with_poses():
    """On an arc at 8 Hz, told what is driven, and 0.3 m/s and 0.1 rad/s too much."""
    for more, turned in ((0.0, 0.0), (0.3, 0.1)):
        trail, pose = Trail(), (5.0, -3.0, 3.0)
        assert trail.twist_to(0.0, pose).tolist() == [0.0, 0.0]
        for k in range(30):
            moved = integrate(pose, (0.5, 1.0), 0.0, 0.125)
            trail.record(0.125 * k, moved, (0.5 + more, 1.0 + turned))
            pose = moved
        off, path = trail.drift()
        np.testing.assert_allclose(off, (more, turned), atol=2e-3)
        np.testing.assert_allclose(path, (0.5, 1.0), atol=1e-3)
        ahead = integrate(pose, (0.5, 1.0), 0.0, 0.125)
        np.testing.assert_allclose(trail.twist_to(3.75, ahead), (0.5, 1.0), atol=1e-3)


def test_a_clock_that_goes_back_begins_a_new_trail():
    trail = Trail()
    for k in range(3 * MOST_POSES):
        trail.record(float(k), (float(k), 0.0, 0.0), (0.0, 0.0))
    assert trail.at(0.0)[0] == 3 * MOST_POSES - MOST_POSES - 1
    trail.record(5.0, (7.0, 0.0, 0.0), (0.0, 0.0))
    assert trail.at(9.0) == (7.0, 0.0, 0.0) == trail.at(0.0)


def test_angles_and_quaternions_agree():
    """Yaw of 0.7 after pitch of -0.4 after roll of 0.3, by half angles."""
    (a, b, c), (d, e, f) = np.cos([0.15, -0.2, 0.35]), np.sin([0.15, -0.2, 0.35])
    x, y = d * b * c - a * e * f, a * e * c + d * b * f
    z, w = a * b * f - d * e * c, a * b * c + d * e * f
    turned = Transform.of_quaternion([1, 2, 3], 2.0 * np.array([x, y, z, w]))
    same = Transform.of_angles([1, 2, 3, 0.3, -0.4, 0.7])
    np.testing.assert_allclose(turned.rotation, same.rotation, atol=1e-12)
    np.testing.assert_allclose(same.rotation @ same.rotation.T, np.eye(3), atol=1e-12)
    with pytest.raises(InvalidInputError, match="a frame needs"):
        Transform.of_quaternion([0, 0, 0], [0, 0, 0, 0])
