"""MPPI, NMPC, MPC-CBF and TEB: plans against oracles, and what they do on failure."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from baselines import HEAVY, HERE, SETTINGS, following, make
from qpavoid.avoidance.decision import Status
from qpavoid.lab.baselines import nmpc
from qpavoid.lab.baselines.drive import body_discs, reference_ahead, wide_discs
from qpavoid.lab.baselines.mppi import Judgement, depth_within, rollout
from qpavoid.lab.baselines.predictive import Situation
from qpavoid.model.capsules import RADIUS
from qpavoid.model.footprint import Footprint
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Robot, braking_twist
from shapes import ROBOT, clearance


def test_mppi_is_seeded():
    disc = Obstacles(discs=[(2.0, 0.1, 0.3)])

    def drive(seed):
        step = make("mppi", seed=seed).start(0.5)
        return [step(0.5, 0.0, disc, following())[:2] for _ in range(6)]

    assert drive(0) == drive(0) != drive(1)
    assert drive(0)[0] == drive(0)[1]  # held for 0.1 s


@pytest.mark.parametrize("seed", range(10))
def test_mppi_depth_is_that_of_the_contacts(seed):
    rng = np.random.default_rng(seed)
    pose, time = (*rng.uniform(-1, 1, 2).tolist(), rng.uniform(-3, 3)), 0.7
    discs = np.column_stack([rng.uniform(-2, 2, (4, 2)), rng.uniform(0, 0.4, 4)])
    moves, walls = rng.uniform(-1, 1, (4, 2)), rng.uniform(-3, 3, (2, 4))
    there = Obstacles([], discs + np.pad(time * moves, ((0, 0), (0, 1))), [], walls)
    r_min = 0.3
    wide = np.column_stack([discs[:, :2], discs[:, 2] + r_min, moves])
    lines = Obstacles(walls=walls).capsules
    lines[:, RADIUS] = r_min
    body = ROBOT.footprint.edges, ROBOT.limit_vector
    known = *body, wide, np.zeros(len(wide)), lines, r_min
    by = Judgement(*known, np.empty((0, 3)), (0.0, 0.0), (0.0, 0.0))
    depth = depth_within(by, pose, time)
    assert depth == pytest.approx(max(0.0, r_min - clearance(there, pose)))


@pytest.mark.parametrize("seed", range(10))
def test_mppi_misses_nothing_that_it_can_reach(seed):
    """Costs equal those with every obstacle checked from the first stage on."""
    rng = np.random.default_rng(seed)
    ways, far = rng.uniform(-3.1, 3.1, 60), rng.uniform(1.4, 9.0, 60)
    places = far * np.array([np.cos(ways), np.sin(ways)])
    discs = np.column_stack([places.T, rng.uniform(0, 0.2, 60)])
    moves = rng.uniform(-0.6, 0.6, (60, 2)) * (np.arange(60) % 2)[:, None]
    seen = Obstacles([], discs, moves)
    method = make("mppi", seed=seed, samples=64)
    driven = rng.uniform(0.0, 1.5), 0.0  # some drive faster than they may
    by = method.judgement(seen, following()._replace(driven=driven))
    assert np.all(np.diff(by.soonest) >= 0.0) and by.soonest[-1] > 4.0
    samples = rng.uniform(-3, 3, (64, 82))
    first, second, least = samples.copy(), samples.copy(), np.zeros(len(by.soonest))
    rollout(by, first)
    rollout(by._replace(soonest=least), second)
    assert_array_equal(first, second)
    assert np.ptp(first[:, 81]) > 0.0


def planned(name, obstacles, **changes):
    """Return the plan of one step, its method and the discs."""
    method, context = make(name, **changes), following()
    discs = wide_discs(obstacles, SETTINGS)
    reference = reference_ahead(context, ROBOT, method.stages, method.tick)
    start = next(iter(method.starts(None, reference, (0.5, 0.0))))
    to = Situation((0.5, 0.0), context, discs)
    return method.solve(start, reference, to), method, discs


def test_nmpc_plan_is_a_motion_of_the_unicycle_and_keeps_its_distance():
    there = Obstacles(discs=[(2.0, 0.3, 0.3)])
    plan, method, _ = planned("nmpc", there)
    exact = np.array([HERE])
    for k, (v, omega) in enumerate(plan.twists):
        step = nmpc.driven_along(plan.twists[: k + 1], method.tick)[-1]
        assert plan.poses[k + 1] == pytest.approx(step, abs=1e-3)
        exact = np.vstack([exact, arc(*exact[-1], v, omega, method.tick)])
    assert plan.poses == pytest.approx(exact, abs=0.02)
    assert plan.slack.max() < 1e-3
    for pose in plan.poses:
        assert clearance(there, tuple(pose)) > SETTINGS.radius.r_min_slow - 2e-3


def test_nmpc_distance_is_that_of_the_polygon():
    import casadi as ca

    vertices = tuple(map(tuple, ROBOT.footprint.vertices.tolist()))
    pose, point = ca.SX.sym("pose", 3), ca.SX.sym("point", 2)
    distance = nmpc.polygon_distance(vertices, pose, point)
    function = ca.Function("distance", [pose, point], [distance])
    rng = np.random.default_rng(0)
    for *there, x, y in rng.uniform(-1.5, 1.5, (200, 5)):
        expected = clearance(Obstacles(points=[(x, y)]), tuple(there))
        assert float(function(there, (x, y))) == pytest.approx(expected, abs=1e-5)


def test_nmpc_brakes_where_the_solver_fails(monkeypatch):
    monkeypatch.setattr(nmpc, "IPOPT", {**nmpc.IPOPT, "max_iter": 0})
    nmpc.make_program.cache_clear()
    step = make("nmpc", HEAVY).start(0.5, 0.0)
    decision = step(0.5, 0.0, Obstacles(discs=[(1.5, 0.1, 0.3)]))
    nmpc.make_program.cache_clear()
    braked = braking_twist(HEAVY.limit_vector, 0.5, 0.0, SETTINGS.dt)
    assert decision[:3] == (*braked, Status.STOPPED)


CROSSES = Obstacles(discs=[(2.0, -0.6, 0.3)], disc_velocities=[(-0.1, 0.3)])


def barriers(poses, disc, tick, count):
    """Least h of the body's discs after each stage."""
    times = tick * np.arange(len(poses))
    there = disc[:2] + times[:, None] * disc[3:]
    rows = []
    for x, radius in body_discs(ROBOT, count):
        turned = np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
        off = np.hypot(*(poses[:, :2] + x * turned - there).T)
        rows.append(off - radius - disc[2])
    return np.array(rows)


@pytest.mark.parametrize("gamma", [0.1, 0.4])
@pytest.mark.parametrize("count", [1, 2])
def test_no_barrier_shrinks_faster_than_by_its_share(gamma, count):
    plan, _, discs = planned("mpc-cbf", CROSSES, gamma=gamma, discs=count)
    h = barriers(plan.poses, discs[0], 0.2, count)
    assert plan.slack.max() < 1e-3
    assert (h[:, 1:] - (1.0 - gamma) * h[:, :-1] > -2e-3).all()
    assert (h[:, 1:] < h[:, :-1]).any()


DODECAGON = [[0.3 * np.cos(t), 0.3 * np.sin(t)] for t in np.arange(0, 6.2, 0.5236)]


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize(
    "corners",
    [ROBOT.footprint.vertices, DODECAGON, [[-2.0, -0.2], [-1.0, -0.2], [-1.5, 0.3]]],
    ids=["pentagon", "round", "behind the axle"],
)
def test_the_discs_of_a_body_hold_it(corners, count):
    robot = Robot("any", Footprint.polygon(corners), ROBOT.limits)
    (x, radius), corners = np.array(body_discs(robot, count)).T, np.array(corners)
    share = np.linspace(0.0, 1.0, 50)[:, None, None]
    edges = (1.0 - share) * corners + share * np.roll(corners, -1, axis=0)
    edges = edges.reshape(-1, 2)
    places = np.vstack([edges, 0.5 * (edges + corners.mean(axis=0))])
    off = np.hypot(places[:, :1] - x, places[:, 1:])
    assert ((off - radius).min(axis=1) < 1e-9).all()
    assert radius.max() <= body_discs(robot, 1)[0][1] + 1e-3


METHOD = make("teb")
END = (2.8, 0.0, 0.0)


def bands(obstacles, method=METHOD, driven=(0.5, 0.0), end=END):
    """Return the bands that a first step finds, the cheapest first."""
    discs = wide_discs(obstacles, SETTINGS)
    to = Situation((0.5, 0.0), following(driven=driven), discs)
    bands = [method.solve(x, end, to) for x in method.starts(None, end, to)]
    return sorted(bands, key=lambda band: band.cost)


def where(disc, velocity, time):
    x, y, radius = disc
    return x + time * velocity[0], y + time * velocity[1], radius


def test_a_free_way_is_driven_in_the_least_time():
    (band,) = bands(Obstacles())
    assert band.steps.sum() == pytest.approx(END[0] / ROBOT.limits.v_max, abs=0.05)
    assert band.twists[:, 0] == pytest.approx(ROBOT.limits.v_max, abs=0.02)
    assert band.poses[-1] == pytest.approx(END, abs=0.05)


def test_a_band_is_a_motion_of_the_unicycle():
    band = bands(Obstacles(discs=[(1.5, 0.1, 0.3)]))[0]
    pose = HERE
    for (v, omega), time, there in zip(
        band.twists, band.steps, band.poses[1:], strict=True
    ):
        pose = arc(*pose, v, omega, time)
        assert there == pytest.approx(pose, abs=0.02)


@pytest.mark.parametrize(
    ("disc", "velocity"),
    [((1.5, 0.1, 0.3), (0.0, 0.0)), ((1.6, -1.2, 0.3), (0.0, 0.6))],
    ids=["stands", "crosses"],
)
def test_every_way_round_keeps_r_min(disc, velocity):
    found = bands(Obstacles(discs=[disc], disc_velocities=[velocity]))
    wide = wide_discs(Obstacles(discs=[disc], disc_velocities=[velocity]), SETTINGS)
    sides = set()
    for band in found:
        assert band.slack.max() < 1e-3
        times = np.cumsum(band.steps)
        for pose, time in zip(band.poses[1:], times, strict=True):
            there = Obstacles(discs=[where(disc, velocity, time)])
            assert clearance(there, tuple(pose)) > wide[0, 2] - disc[2] - 5e-3
        sides.add(np.sign(band.poses[:, 1].sum()))
    assert sides == {1.0, -1.0}


def test_limits_hold_from_the_twist_driven_last_to_rest():
    obstacles, driven = Obstacles(discs=[(1.5, 0.1, 0.3)]), (0.2, 0.1)
    band, limits = (
        bands(obstacles, make("teb", HEAVY), driven)[0],
        HEAVY.limits,
    )
    v, omega = band.twists.T
    assert limits.v_min - 1e-6 <= v.min() and v.max() <= limits.v_max + 1e-6
    assert np.abs(omega).max() <= limits.omega_max + 1e-6
    wheels = np.abs(v) + 0.5 * limits.track * np.abs(omega)
    assert wheels.max() <= limits.wheel_speed + 1e-3
    changes = np.abs(np.diff(np.vstack([driven, band.twists, (0.0, 0.0)]), axis=0))
    steps = band.steps
    times = np.concatenate([steps[:1], 0.5 * (steps[1:] + steps[:-1]), steps[-1:]])
    most = limits.acceleration, limits.angular_acceleration
    assert (changes <= times[:, None] * most + 1e-3).all()


def test_where_no_band_keeps_clear_it_relaxes_or_brakes():
    both = [(1.3, 0.0, 0.3), (-1.3, 0.0, 0.3)]
    closing = Obstacles(discs=both, disc_velocities=[(-1.5, 0.0), (1.5, 0.0)])
    decision = METHOD.start(0.5)(0.5, 0.0, closing, following())
    assert decision.status in (Status.RELAXED, Status.STOPPED)
    assert np.isfinite(decision[:2]).all()
