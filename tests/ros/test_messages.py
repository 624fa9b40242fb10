"""Messages as plain values: what a beam means, clouds of any layout, frames."""

import math

import numpy as np
import pytest

import ros_messages as ros
from qpavoid.errors import InvalidInputError
from qpavoid.ros.messages import (
    read_cloud,
    read_odometry,
    read_scan,
    read_tracks,
    read_twist,
)


def test_what_a_beam_means():
    beams = [1.0, math.inf, 12.0, math.nan, 0.0, -math.inf, 0.05, 2.0]
    seen = read_scan(ros.scan(5.25, beams, first=0.0))
    assert seen.stamp == 5.25 and seen.frame == "base_link" and not seen.stuck
    assert seen.valid == 5 / 8, "NaN and what is nearer than range_min are unknown"
    around = np.hypot(*seen.points[:, :2].T)
    np.testing.assert_allclose(around, [1.0, 0.1, 2.0], rtol=1e-7)
    angles = np.arctan2(seen.points[:, 1], seen.points[:, 0]) % (2 * math.pi)
    np.testing.assert_allclose(angles, np.array([0, 5, 7]) * math.pi / 4, atol=1e-7)


def test_all_at_one_value_is_stuck():
    assert read_scan(ros.scan(0.0, [0.5] * 9)).stuck
    assert not read_scan(ros.scan(0.0, [0.5] * 8 + [math.inf])).stuck
    assert not read_scan(ros.scan(0.0, [0.5] * 8 + [0.6])).stuck


@pytest.mark.parametrize("name", ["angle_min", "angle_increment", "range_min"])
def test_a_scan_without_angles_is_refused(name):
    message = ros.scan(0.0, [1.0])
    setattr(message, name, math.nan)
    with pytest.raises(InvalidInputError, match="a scan needs finite angles"):
        read_scan(message)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_clouds_of_any_layout(order, kind):
    rows = [(1.0, 2.0, 3.0), (math.nan, 0.0, 0.0), (-1.0, 0.5, 0.25)]
    seen = read_cloud(ros.cloud(1.0, "zyx", rows, kind=kind, order=order))
    np.testing.assert_array_equal(seen.points, [(3, 2, 1), (0.25, 0.5, -1)])
    assert seen.valid == pytest.approx(2 / 3)


def test_a_cloud_with_padded_rows():
    message = ros.cloud(1.0, "xyz", [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)])
    step = message.point_step
    message.height, message.width, message.row_step = 2, 1, step + 8
    data = message.data
    message.data = data[:step] + bytes(8) + data[step:] + bytes(8)
    np.testing.assert_array_equal(read_cloud(message).points, [(1, 2, 3), (4, 5, 6)])


def test_an_empty_cloud_is_unknown():
    seen = read_cloud(ros.cloud(1.0, "xyz", []))
    assert seen.points.shape == (0, 3) and seen.valid == 0.0 and seen.empty


@pytest.mark.parametrize("fill", [(0, 0, 0), (0.02, 0, -0.01), (math.inf, 0, 0)])
def test_points_at_the_lens_are_no_returns(fill):
    seen = read_cloud(ros.cloud(1.0, "xyz", [fill] * 3 + [(1.0, 2.0, 3.0)]))
    np.testing.assert_array_equal(seen.points, [(1, 2, 3)])
    assert seen.valid == 0.25 and not seen.stuck
    same = [(0.3, 0.0, 0.2)] * 3 + [(1.0, 2.0, 3.0)]
    assert read_cloud(ros.cloud(1.0, "xyz", same)).stuck


def test_a_range_of_0_is_no_return_where_range_min_is_0():
    seen = read_scan(ros.scan(0.0, [0.0, 3.0, 0.03, math.inf], near=0.0))
    assert seen.valid == 0.5 and seen.fan.unknown.tolist() == [1, 0, 1, 0]


@pytest.mark.parametrize("far", [0.8, 25.0])
def test_an_echo_at_range_max_is_an_echo(far):
    """Also of drivers that set it to the largest range of the scan, in float32."""
    ranges = [math.inf] * 300 + [0.8] * 5 + [25.1]
    seen = read_scan(ros.scan(0.0, ranges, far=float(np.float32(far))))
    assert len(seen.points) == 5 and seen.valid == 1.0


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("angle_max", 1.0, "angle_max is 1 rad, but 9 beams end at 2.443 rad"),
     ("angle_max", math.nan, "angle_max is nan"),
     ("time_increment", math.nan, "time_increment makes a scan of nan s"),
     ("time_increment", 0.2, "a scan of 1.6 s"),
     ("time_increment", 0.03, "scan_time is 0.1")],
)  # fmt: skip
def test_a_scan_that_contradicts_itself_is_refused(name, value, said):
    message = ros.scan(0.0, [1.0] * 9)
    message.scan_time = 0.1
    setattr(message, name, value)
    with pytest.raises(InvalidInputError, match=said):
        read_scan(message)


@pytest.mark.parametrize("beams", [-1, 0, 1])
def test_drivers_count_their_increments_differently(beams):
    message = ros.scan(0.0, [1.0] * 9)
    message.angle_max = message.angle_min + (8 + beams) * message.angle_increment
    message.time_increment = -0.001  # the last beam is measured first
    seen = read_scan(message)
    np.testing.assert_allclose(seen.after, -0.001 * np.arange(9))


def test_clouds_that_do_not_fit_are_refused():
    with pytest.raises(InvalidInputError, match=r"lacks z; it has \['x', 'y'\]"):
        read_cloud(ros.cloud(1.0, "xy", [(1.0, 2.0)]))
    message = ros.cloud(1.0, "xyz", [(1.0, 2.0, 3.0)] * 4)
    for name, value in (("width", 5), ("data", b"12345"), ("point_step", 8)):
        broken = ros.Fields(**{**vars(message), name: value})
        with pytest.raises(InvalidInputError, match="a cloud's data"):
            read_cloud(broken)
    with pytest.raises(InvalidInputError, match="too large"):
        read_cloud(ros.Fields(**{**vars(message), "width": 10**9}))
    message.fields[0].datatype = 99
    with pytest.raises(InvalidInputError, match="do not fit"):
        read_cloud(message)


def test_tracks():
    seen = read_tracks(ros.tracks(2.0, [(1.0, 2.0, 0.5, -0.25, 0.75)]))
    np.testing.assert_array_equal(seen.discs, [(1.0, 2.0, 0.5)])
    np.testing.assert_array_equal(seen.velocities, [(-0.25, 0.75)])
    for wrong in ((1.0, 2.0, -0.5, 0.0, 0.0), (math.nan, 0.0, 0.1, 0.0, 0.0)):
        with pytest.raises(InvalidInputError, match="tracked discs need"):
            read_tracks(ros.tracks(2.0, [wrong]))


def test_odometry_and_twists():
    pose, driven = read_odometry(ros.odometry(1.0, (1.0, 2.0, -2.5), 0.3, 0.4))
    assert pose == pytest.approx((1.0, 2.0, -2.5)) and driven == (0.3, 0.4)
    assert read_twist(ros.twist(0.1, 0.2)) == (0.1, 0.2)
    assert read_twist(ros.twist(0.1, 0.2, time=3.0)) == (0.1, 0.2)
    with pytest.raises(InvalidInputError, match="a twist needs finite"):
        read_twist(ros.twist(math.nan))
    with pytest.raises(InvalidInputError, match="needs finite"):
        read_odometry(ros.odometry(1.0, (math.inf, 0.0, 0.0)))
