"""Global planning: the cheapest way by an oracle, and runs that plan anew."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from shapely import Point, Polygon

from qpavoid.lab.planning import planner as planners
from qpavoid.lab.planning.grid import SEARCHES, Grid, cheapest_way
from qpavoid.lab.planning.planner import Planner, PlanningProblem
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.run import run
from qpavoid.model.obstacles import Obstacles

pytest.importorskip("tcod", reason="needs qpavoid[baselines]")


def least_cost(costs, start, goal):
    """Return the cost of the cheapest way of the graph, by scipy's Dijkstra."""
    cells = np.arange(costs.size).reshape(costs.shape)
    rows, columns, weights = [], [], []
    for d_i, d_j in ((0, 1), (1, 0), (1, 1), (1, -1)):
        here = cells[
            : costs.shape[0] - d_i, max(0, -d_j) : costs.shape[1] - max(0, d_j)
        ]
        there = cells[d_i:, max(0, d_j) : costs.shape[1] - max(0, -d_j)]
        for a, b in ((here, there), (there, here)):
            free = (costs.flat[a] > 0) & (costs.flat[b] > 0)
            rows.append(a[free])
            columns.append(b[free])
            weights.append((99 if d_i and d_j else 70) * costs.flat[b[free]])
    ends = np.concatenate(rows), np.concatenate(columns)
    graph = csr_matrix((np.concatenate(weights), ends), (costs.size, costs.size))
    return dijkstra(graph, indices=cells[start])[cells[goal]]


def cost_of(way, costs):
    turns = np.abs(np.diff(way, axis=0)).sum(axis=1)
    steps = np.where(turns == 2, 99, 70) * costs[way[1:, 0], way[1:, 1]]
    return steps.sum()


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("seed", range(6))
def test_the_way_is_the_cheapest(search, seed):
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((30, 40)) < 0.35, 0, rng.integers(1, 9, (30, 40)))
    start, goal = (1, 2), (28, 37)
    costs[start] = costs[goal] = 1
    best = least_cost(costs, start, goal)
    way = cheapest_way(search, costs.astype(np.int32), start, goal)
    if math.isinf(best):
        assert len(way) == 0
    else:
        assert tuple(way[0]) == start and tuple(way[-1]) == goal
        assert cost_of(way, costs) == best
        assert np.abs(np.diff(way, axis=0)).max() == 1


def test_marks_and_clearance():
    grid = Grid.around(np.array([[0.0, 0.0], [4.0, 2.0]]), 1.0, 0.1)
    assert grid.seen.shape == (40, 60)
    walls = [(0.0, 0.0, 4.0, 0.0)]
    grid.mark(
        Obstacles([(2.0, 1.05), (99.0, 0.0)], [(0.05, 1.05, 0.3)], walls=walls), 5.0
    )
    far = grid.clearance(4.0)
    middles = grid.places(np.argwhere(far >= 0.0)).reshape(40, 60, 2)
    x, y = middles[..., 0], middles[..., 1]
    wall = np.hypot(np.maximum(0.0, np.maximum(-x, x - 4.0)), y)
    disc = np.hypot(x - 0.05, y - 1.05) - 0.3
    point = np.hypot(x - 2.0, y - 1.05)
    exact = np.maximum(0.0, np.minimum(np.minimum(wall, disc), point))
    assert np.abs(far - exact).max() < 0.16  # 1.5 cells
    assert np.isinf(grid.clearance(5.0)).all()  # forgotten
    now = grid.copy()
    now.mark(Obstacles([(3.0, 1.5)]), math.inf)
    assert grid.clearance(4.0).max() > now.clearance(4.0).max() - 1e-9
    assert np.isfinite(now.clearance(5.0)).all() and np.isinf(grid.clearance(5.0)).all()


def test_a_grid_is_marked_within_a_polygon():
    box = [(1.6, 0.9), (2.3, 0.9), (2.3, 1.3), (1.6, 1.3)]
    grid, solid = (
        Grid.around(np.array([[0.0, 0.0], [3.0, 2.0]]), 0.5, 0.1),
        Polygon(box),
    )
    grid.mark(Obstacles(polygons=[box]), 1.0)
    places = grid.places(np.argwhere(grid.seen == 1.0))
    assert all(solid.distance(Point(place)) < 0.08 for place in places)
    assert len(places) >= solid.area / 0.01


def planner(chart, search="astar"):
    times = np.arange(0.0, 60.0, 0.1)
    course = PlanningProblem(
        (0.0, 0.0, 0.0), (8.0, 0.0, 1.0), 0.4, 0.8, 1.0, 0.5, times
    )
    return Planner(search, course, chart)


WALL = Obstacles(walls=[(4.0, -2.0, 4.0, 2.0)])


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-8])
def test_at_the_goal_there_is_no_way_to_plan(off):
    """Wherever cells meet: at a station a hair lies between two of them."""
    times, here = np.arange(0.0, 2.0, 0.1), np.linspace(-0.1, 0.1, 41)
    for x in here:
        at = (x, 0.0, 0.0)
        course = PlanningProblem((0.0, 0.0, 0.0), at, 0.4, 0.8, 1.0, 0.5, times)
        led = Planner("astar", course, Obstacles())
        assert led(0.0, (x - off, -off, 0.0), 0.0, Obstacles()) is None


@pytest.mark.parametrize("search", SEARCHES)
def test_a_plan_keeps_clear_of_the_map_and_ends_at_the_goal(search):
    plan = planner(WALL, search)(0.0, (0.0, 0.0, 0.0), 0.3, Obstacles())
    assert plan[0, 3] == pytest.approx(0.3) and plan[-1, 3:].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(plan[-1, :2], [8.0, 0.0])
    assert math.cos(plan[-1, 2] - 1.0) == pytest.approx(1.0)
    away = np.hypot(plan[:, 0] - 4.0, np.maximum(0.0, abs(plan[:, 1]) - 2.0))
    assert 0.4 < away.min() < 1.2
    assert np.abs(np.diff(plan[:, 3])).max() < 0.5 * 0.1 + 1e-6


def test_it_looks_at_intervals_and_plans_only_when_blocked_or_astray(monkeypatch):
    monkeypatch.setattr(planners, "LOOK_EVERY", 1.0)
    plan = planner(WALL)
    here = (0.0, 0.0, 0.0)
    first = plan(0.0, here, 0.0, Obstacles())
    row = int(np.argmin(np.hypot(*(first[:, :2] - (2.0, 1.5)).T)))
    block = Obstacles(discs=[(*first[row, :2], 0.2)])
    assert plan(0.5, here, 0.0, block) is None  # not yet due
    second = plan(1.0, here, 0.0, block)
    away = np.hypot(*(second[:, :2] - first[row, :2]).T) - 0.2
    assert away.min() > 0.4
    assert plan(2.0, here, 0.0, Obstacles()) is None  # remembered, and free
    assert plan(3.0, tuple(second[100, :3]), 0.0, Obstacles()) is None
    x, y, heading = second[100, :3]
    aside = (x - 1.2 * math.sin(heading), y + 1.2 * math.cos(heading), heading)
    astray = plan(4.0, aside, 0.0, Obstacles())
    np.testing.assert_allclose(astray[0, :2], aside[:2], atol=0.1)


def test_what_is_out_of_sight_or_has_moved_on_is_not_known(monkeypatch):
    monkeypatch.setattr(planners, "SIGHT", 3.0)
    plan = planner(Obstacles())
    here = (0.0, 0.0, 0.0)
    straight = plan(0.0, here, 0.0, Obstacles(discs=[(4.0, 0.0, 0.5)]))
    assert abs(straight[:, 1]).max() < 0.1
    walker = Obstacles(discs=[(2.0, 0.0, 0.3)], disc_velocities=[(0.0, 1.0)])
    assert abs(plan(1.0, here, 0.0, walker)[:, 1]).max() > 0.5
    assert plan(2.0, here, 0.0, Obstacles()) is None


GAPS = Obstacles(walls=[(4.0, -0.8, 4.0, -9.0), (4.0, 0.8, 4.0, 5.0)])
"""A gap ahead, and the way round, 5 m to the left."""


def test_a_way_that_only_what_moves_bars_is_kept_where_the_other_one_is_long(
    monkeypatch,
):
    def person(speed):
        return Obstacles(discs=[(4.0, 0.0, 0.3)], disc_velocities=[(0.0, speed)])

    start = (0.0, 0.0, 0.0)
    for speed, kept in ((0.5, True), (0.0, False)):
        plan = planner(GAPS)
        straight = plan(0.0, start, 0.0, Obstacles())
        assert np.abs(straight[:, 1]).max() < 0.5
        other = plan(1.0, start, 0.0, person(speed))
        assert (other is None) is kept
        if not kept:
            assert other[:, 1].max() > 5.0
    monkeypatch.setattr(planners, "LONGER_WAY", 20.0)
    plan = planner(GAPS)
    plan(0.0, start, 0.0, Obstacles())
    assert plan(1.0, start, 0.0, person(0.5))[:, 1].max() > 5.0


def test_without_a_way_it_stands_until_there_is_one(monkeypatch):
    monkeypatch.setattr(planners, "REMEMBERED", 0.0)
    sides = [(7, -1, 9, -1), (9, -1, 9, 1), (9, 1, 7, 1), (7, 1, 7, -1)]
    cage = Obstacles(walls=sides)
    plan, here = planner(cage), (0.3, 0.1, 0.2)
    assert plan(0.0, here, 0.0, Obstacles()) is None  # it stands from the beginning
    monkeypatch.setattr(planners, "SIGHT", 9.0)
    monkeypatch.setattr(planners, "GRID_MARGIN", 1.0)
    free = planner(Obstacles())
    assert free(0.0, here, 0.0, Obstacles()) is not None
    fence = [(2.0, 0.1 * k) for k in range(-30, 31)]
    stop = free(1.0, here, 0.5, Obstacles(fence))
    assert (stop == [*here, 0.0, 0.0]).all()
    assert free(2.0, here, 0.0, Obstacles(fence)) is None
    assert free(3.0, here, 0.0, Obstacles()) is not None


@pytest.mark.parametrize("name", ["astar", "dijkstra", "astar+eq5", "astar+qp-ahead"])
def test_out_of_the_trap_at_once(name):
    log = run(load_scenario("demo/trap"), name)
    assert log["least_clearance_m"].min() > 0.1
    assert math.dist(log.final[:2], log.final_reference[:2]) < 0.05
    assert log.meta["controller"] == name


@pytest.mark.parametrize("acceleration", [0.5, 2.0])
def test_a_planned_way_gains_speed_as_the_reference_does(acceleration):
    scenario = load_scenario("demo/trap")
    path = replace(scenario.path, acceleration=acceleration)
    log = run(replace(scenario, path=path, duration=0.4), "astar+alone")
    gained = np.diff(log["v_ref_mps"]) / np.diff(log["t_s"])
    assert gained.max() == pytest.approx(acceleration, rel=0.02)
