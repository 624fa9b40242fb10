"""The physical limit of an encounter, against what is known."""

import math
from itertools import pairwise

import numpy as np
import pytest

import limit
import limit_search
from qpavoid.errors import InvalidInputError
from qpavoid.model.contact import point_contact
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Limits, Robot

COARSE = limit.Grid(spacing=0.08, headings=72, ahead=3.0, cap=0.9)
SPEEDS = (0.3, 0.8, 1.5)
ROUND = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)


@pytest.fixture(scope="module")
def tables(robot):
    return limit.limit_tables(robot, SPEEDS, COARSE)


def disc_robot(limits, radius=0.3):
    """A robot that is round, so that what it can keep is known in closed form."""
    vertices = radius * np.column_stack([np.cos(ROUND), np.sin(ROUND)])
    return Robot("disc", Footprint.polygon(vertices), limits)


def encounters(count, seed=0, speed=None):
    each = speed or np.random.default_rng(seed).uniform(0.05, 1.5, (count, 1))
    rows = limit_search.sample_encounters(count, 1.0, seed)
    rows[:, 2:4] *= each
    return rows


def initial(robot, rows):
    edges = robot.footprint.edges
    return np.array([point_contact(edges, x, y).distance for x, y in rows[:, :2]])


def test_no_more_than_the_initial_clearance(robot, tables):
    rng = np.random.default_rng(1)
    rows = np.column_stack([rng.uniform(-2, 2, (500, 2)), rng.uniform(-1, 1, (500, 2))])
    first = initial(robot, rows)
    kept = tables.clearance(rows, radius=0.1)
    assert (kept <= first - 0.1 + 1e-12).all()
    assert (kept <= COARSE.cap - 0.1 + 1e-12).all()
    assert (kept < first - 0.11).mean() > 0.2


@pytest.mark.long
def test_mirrored_encounters_have_the_same_limit(robot, tables):
    rows = encounters(80)
    mirrored = rows * (1.0, -1.0, 1.0, -1.0, 1.0, -1.0)
    assert np.allclose(tables.clearance(rows), tables.clearance(mirrored), atol=2e-3)
    found = limit_search.search_limit(robot, rows, cap=0.9)
    assert np.allclose(
        found, limit_search.search_limit(robot, mirrored, cap=0.9), atol=0.06
    )


@pytest.mark.long
def test_a_static_obstacle_leaves_all_of_the_clearance(robot, tables):
    rows = encounters(200)
    rows[:, 2:4] = 0.0
    first = np.minimum(initial(robot, rows), COARSE.cap)
    assert np.array_equal(tables.clearance(rows), first)
    assert np.allclose(
        limit_search.search_limit(robot, rows, cap=0.9), first, atol=2e-3
    )
    values = limit.limit_table(robot, 0.0, COARSE)
    middle = values.shape[2] // 2
    zero = values.shape[0] - 1 - middle
    phi = 2.0 * math.pi * 5 / COARSE.headings
    for i, k in ((zero - 6, middle), (zero + 4, middle + 8), (zero + 10, middle - 9)):
        s, n = (i - zero) * COARSE.spacing, (k - middle) * COARSE.spacing
        d = limit.distance(robot.footprint.edges, s, n, phi)
        assert values[i, 5, k] == pytest.approx(min(d, COARSE.cap), abs=1e-6)


def test_who_turns_on_the_spot_keeps_the_distance_to_the_line():
    turning = disc_robot(Limits(0.0, 0.0, -1.5, 1.5))
    tables = limit.limit_tables(turning, (1.0,), COARSE)
    for beside in (0.45, -0.8):
        row = np.array([[-1.5, beside, 1.0, 0.0, 0.0, 0.0]])
        assert tables.clearance(row)[0] == pytest.approx(abs(beside) - 0.3, abs=0.01)
        found = limit_search.search_limit(turning, row)[0]
        assert found == pytest.approx(abs(beside) - 0.3, abs=0.002)


@pytest.mark.parametrize("far", [1.0, 1.5])
def test_who_heads_off_at_the_best_angle_keeps_the_ratio_of_speeds(far):
    """A point of speed v misses a head-on one of speed v_o by far · v/v_o at most.

    The angle between the courses is then acos v/v_o.
    """
    free = disc_robot(Limits.symmetric(1.0, 1.5))
    theta = -math.acos(1.0 / 1.5)
    c, s = math.cos(theta), math.sin(theta)
    row = np.array([[-far * c, -far * s, 1.5 * c, 1.5 * s, 0.0, 0.0]])
    best = far / 1.5 - 0.3
    tables = limit.limit_tables(free, (1.5,), COARSE)
    assert tables.clearance(row)[0] == pytest.approx(best, abs=0.03)
    assert best - 0.01 < limit_search.search_limit(free, row)[0] < best + 0.003


def test_acceleration_limits_cost_the_way_to_brake():
    straight = disc_robot(Limits(-1.0, 1.0, -1e-9, 1e-9, acceleration=2.0))
    row = np.array([[0.9, 0.0, 0.0, 0.0, 1.0, 0.0]])
    found = limit_search.search_limit(straight, row)[0]
    assert found == pytest.approx(0.6 - 1.0**2 / (2 * 2.0), abs=0.003)


def test_less_acceleration_keeps_less(robot):
    rows = encounters(80, speed=1.2)
    kept = [
        limit_search.search_limit(
            limit_search.with_accelerations(robot, v, omega), rows, cap=0.9
        )
        for v, omega in ((math.inf, math.inf), (2.0, 2.5), (0.5, 0.6))
    ]
    for more, less in pairwise(kept):
        assert (less < more + 0.05).all()
        assert less.mean() < more.mean() - 0.02


def drive(robot, row, plan, dt=1e-4):
    """Least d of one encounter under a plan, by the definition."""
    limits, edges = robot.limits, robot.footprint.edges
    pose, (x, y, v_x, v_y, v, omega) = (0.0, 0.0, 0.0), row
    least, t = math.inf, 0.0
    rest = ((0.0, 0.0, 5.0),)
    for target, turn, hold in (*plan, *rest):
        for _ in range(round(hold / dt)):
            step, yaw = limits.acceleration * dt, limits.angular_acceleration * dt
            v += min(max(target - v, -step), step)
            omega += min(max(turn - omega, -yaw), yaw)
            pose = arc(*pose, v, omega, dt)
            t += dt
            a, b = x + v_x * t - pose[0], y + v_y * t - pose[1]
            c, s = math.cos(pose[2]), math.sin(pose[2])
            least = min(
                least, point_contact(edges, c * a + s * b, c * b - s * a).distance
            )
    return least


def test_a_plan_is_driven_as_it_says(robot):
    real = limit_search.with_accelerations(robot, 2.0, 2.5)
    numbers = limit_search.limit_numbers(real.limits)
    rows = encounters(3, seed=5, speed=1.1)
    rows[:, 4:] = (0.6, -0.4)
    plan = np.array([(1.0, 1.5, 0.5), (-1.0, 0.3, 1.1), (0.4, -1.5, 0.7)])
    edges = robot.footprint.edges
    for row in rows:
        d = limit_search.plan_distance(edges, numbers, row, plan, -math.inf, 0.1)
        assert d == pytest.approx(drive(real, row, plan), abs=2e-3)


def follow(robot, tables, row, dt=0.05):
    """Least d of the robot that always does what the table thinks best."""
    edges, h = robot.footprint.edges, tables.grid.spacing
    values = tables.values[list(tables.speeds).index(round(math.hypot(*row[2:4]), 6))]
    s, n, phi, speed = limit.relative_state(row)
    least = limit.distance(edges, s, n, phi)
    while s < 1.0:
        options = []
        for v, omega in limit.extremal_twists(robot.limits):
            way = [
                limit.relative(s, n, phi, speed, v, omega, dt * k / 3)
                for k in (1, 2, 3)
            ]
            near = min(limit.distance(edges, *state) for state in way)
            after = limit.table_value(values, h, *way[-1])
            options.append((min(near, after, tables.grid.cap), near, way[-1]))
        _, near, (s, n, phi) = max(options)
        least = min(least, near)
    return least


def test_the_table_is_attained_by_its_own_policy(robot, tables):
    rows = encounters(40, seed=2, speed=1.5)
    promised = tables.clearance(rows)
    hard = promised < 0.8
    assert hard.sum() > 10
    kept = np.array([follow(robot, tables, row) for row in rows[hard]])
    assert (kept > promised[hard] - 0.05).all()
    assert np.median(np.abs(kept - promised[hard])) < 0.015


@pytest.mark.parametrize("speed", SPEEDS)
def test_search_and_tables_agree(robot, tables, speed):
    rows = encounters(200, seed=3, speed=speed)
    kept = tables.clearance(rows)
    below = kept < 0.85 * COARSE.cap
    assert below.sum() > 15
    gap = (kept - limit_search.search_limit(robot, rows))[below]
    assert gap.min() > -0.06
    assert np.quantile(gap, 0.95) < 0.03
    assert gap.max() < 0.10


def test_between_the_tabulated_speeds_it_is_linear(robot, tables):
    rows = encounters(1, seed=3, speed=1.5)
    at = [tables.clearance(rows * (1, 1, k, k, 1, 1))[0] for k in (0.8 / 1.5, 1.0)]
    half = tables.clearance(rows * (1, 1, 1.15 / 1.5, 1.15 / 1.5, 1, 1))[0]
    assert half == pytest.approx(np.mean(at), abs=1e-9)


def test_tables_are_kept_in_a_folder(robot, tmp_path):
    small = limit.Grid(0.2, 24, ahead=1.0, cap=0.4)
    make = limit.limit_tables.__wrapped__
    first = make(robot, (1.0,), small, tmp_path)
    file = tmp_path / "limit.npz"
    written = file.stat().st_mtime_ns
    again = make(robot, (1.0,), small, tmp_path)
    assert file.stat().st_mtime_ns == written
    assert np.array_equal(first.values, again.values)
    other = make(Robot.mir100_rectangle(), (1.0,), small, tmp_path)
    assert file.stat().st_mtime_ns != written
    assert not np.array_equal(first.values, other.values)


def test_what_it_does_not_cover_is_an_error(robot, tables):
    with pytest.raises(InvalidInputError, match=r"end at 1.5 m/s, not 1.6"):
        tables.clearance(encounters(2, speed=1.6))
    wheels = Limits(-1.0, 1.0, -1.5, 1.5, wheel_speed=1.0, track=0.4)
    with pytest.raises(InvalidInputError, match="wheel_speed"):
        limit.extremal_twists(wheels)


@pytest.mark.slow
def test_the_default_grid_has_converged(robot):
    real = limit_search.with_accelerations(robot, 2.0, 2.5)
    tables = limit.limit_tables(robot, (0.3, 0.8, 1.5))
    finer = limit.Grid(0.025, 192)
    for row in limit_search.quality(real, tables, finer, 600):
        assert abs(row["grid_q50_m"]) < 0.005
        assert row["grid_q0_m"] > -0.02 and row["grid_q100_m"] < 0.03
        assert row["gap_q0_m"] > -0.02 and row["gap_q90_m"] < 0.015
        assert row["gain_q99_m"] < 0.03
