"""Frames by tf: chains, time, and what is refused; scipy as the oracle."""

import math
from types import SimpleNamespace as Fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from qpavoid.errors import InvalidInputError
from qpavoid.ros.frames import BEYOND, MEMORY, STAMPS, Frames
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
