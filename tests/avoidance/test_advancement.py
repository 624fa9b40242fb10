"""Conservative advancement: no violation is missed, and the work is bounded."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given

from driven import driven_to, gap_at, least_of
from qpavoid.avoidance import bodies as table
from qpavoid.avoidance import margin
from qpavoid.avoidance.margin import LOOKS, STEP, sampled_margin, too_near
from qpavoid.avoidance.plan import Plan, hold
from qpavoid.model.footprint import Footprint
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import Limits, Robot
from rollouts import (
    HORIZON,
    LIMITED,
    ROBOT,
    SETTINGS,
    every_robot,
    line_of,
    mixed,
    rolled,
    scene_of,
    seeds,
    some_plan,
    steps_of,
)

DT = SETTINGS.dt
NEVER = 1e9
"""m; more room than anything has."""


def true_room(scene, trace, body, begin, end):
    """The least room of a body from ``begin`` to ``end``, on a trace."""
    line, least = line_of(body), math.inf
    for k, row in enumerate(trace):
        start, past = max(begin - k * DT, 0.0), min(end - k * DT, DT)
        if start < past or start == past == 0.0:
            pose = driven_to(tuple(row[:3]), *row[3:], start)
            time = past - start
            for part in scene.parts:
                known = part, pose, row[3:], time, k * DT + start, line
                least = least_of(*known, least)
    return least


def room_now(scene, trace, body, time):
    """The room of a body at a time."""
    k = min(int(time / DT + 1e-9), len(trace) - 1)
    pose = driven_to(tuple(trace[k, :3]), *trace[k, 3:], time - k * DT)
    return min(gap_at(x, pose, line_of(body), time) for x in scene.parts)


class Judged:
    """A scene with the corners of its robot, a rollout, and the steps of its plan."""

    def __init__(self, robot, world, plan, now, seconds=HORIZON + 1.5, **more):
        self.scene = scene_of(robot, world, now, **more)
        self.rollout = rolled(self.scene, plan)
        self.trace = steps_of(robot, plan, now, DT, seconds)
        self.parts, self.bodies = robot.footprint.parts, self.scene.bodies

    def near(self, i, span, level):
        return too_near(self.scene, self.rollout, i, span, level, 0.0)

    def room(self, i, end, enough):
        return sampled_margin(self.scene, self.rollout, i, end, enough)

    def true(self, i, begin, end):
        return true_room(self, self.trace, self.bodies[i], begin, end)

    def at(self, i, time):
        return room_now(self, self.trace, self.bodies[i], time)


def drawn(robot, rng, size):
    """Things at random, a plan, and what is driven next."""
    limits = robot.limits
    box = limits.v_min, limits.v_max, limits.omega_min, limits.omega_max
    now = tuple(0.5 * rng.uniform(box[::2], box[1::2]))
    return Judged(robot, mixed(rng, size), some_plan(rng, box), now)


@every_robot
@given(seeds)
def test_no_violation_is_missed(robot, seed):
    """Levels right at the true least room, and a hair's breadth above and below it."""
    rng = np.random.default_rng(seed)
    judged = drawn(robot, rng, rng.uniform(0.8, 3.0))
    assume(len(judged.bodies))
    for i in rng.choice(len(judged.bodies), min(4, len(judged.bodies)), False):
        begin = DT * int(rng.integers(0, 30)) * (rng.random() < 0.3)
        span = begin, float(rng.choice([HORIZON, judged.rollout.rest, 0.7])) + begin
        true = judged.true(i, *span)
        for above in (0.0, 1e-8, -1e-8, 1e-5, -1e-5, 1e-3, -1e-3, 0.1, -0.1):
            near, when = judged.near(i, span, true + above)
            assert near or above <= 1e-9
            assert span[0] - 1e-9 <= when <= span[1] + 1e-9
            if near and above <= -0.1:
                assert judged.at(i, when) < true + above


def test_seldom_counts_as_too_near_what_is_not():
    """False alarms are rare: tangential passes, at the threshold or just above."""
    near, far, count = 0, 0, 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        judged = drawn(LIMITED, rng, rng.uniform(0.8, 3.0))
        for i in range(len(judged.bodies)):
            true = judged.true(i, 0.0, HORIZON)
            near += judged.near(i, (0.0, HORIZON), true - 1e-3)[0]
            far += judged.near(i, (0.0, HORIZON), true - 1e-2)[0]
            count += 1
    assert far == 0 and near <= 0.02 * count


@every_robot
@given(seeds)
def test_the_least_room_is_the_least_of_dense_looks(robot, seed):
    """Never less, and no more than changes between two looks."""
    rng = np.random.default_rng(seed)
    judged = drawn(robot, rng, rng.uniform(0.8, 3.0))
    assume(len(judged.bodies))
    pace = judged.rollout.speed
    pace += judged.rollout.turning * robot.footprint.circumradius
    for i in rng.choice(len(judged.bodies), min(4, len(judged.bodies)), False):
        true = judged.true(i, 0.0, HORIZON)
        for enough in (NEVER, true + 0.05, true - 0.05):
            room = judged.room(i, HORIZON, enough)
            if true < enough:
                missed = STEP * (pace + judged.bodies[i].speed)
                gap = true + judged.bodies[i].required
                assert room >= true - (1e-6 if gap > 0.0 else 1e-4)
                assert room <= true + missed + 1e-7
            else:
                assert room >= enough - 1e-9


@pytest.fixture
def looks(monkeypatch):
    """Count the distances that a function asks for, run as plain Python."""
    made = []

    def counting(contact):
        def counted(*given):
            made.append(given)
            assert len(made) < 9 * LOOKS, "no end"
            return contact(*given)

        return counted

    monkeypatch.setattr(margin, "line_contact", counting(margin.line_contact))
    monkeypatch.setattr(margin, "part_contact", counting(margin.part_contact))
    monkeypatch.setattr(margin, "clear_time", margin.clear_time.py_func)

    def count(function, judged, i, span, *level):
        made.clear()
        given = judged.scene, judged.rollout, i, span, *level
        assert function.py_func(*given) == function(*given)
        return len(made)

    return count


FREE = Limits(*(-math.inf, math.inf) * 2)
BAR = Footprint.rectangle(0.9, 0.5)
RING = [(0.687 * math.cos(a), 0.687 * math.sin(a)) for a in np.linspace(0, 6.28, 60)]
NEAR = Obstacles(
    points=[(1.0, 0.1), (0.3, 0.7), (-0.2, -0.8)],
    discs=[(2.0, 0.3, 0.2)],
    disc_velocities=[(-0.8, 0.0)],
    walls=[(-1.0, 1.0, 3.0, 1.2)],
)


def slow(acceleration):
    return Limits(-1.0, 1.0, -1.5, 1.5, acceleration, acceleration)


def wall(y):
    return Obstacles(walls=[(-1e8, y, 1e8, y), (-1e8, -y, 1e8, -y)])


def disc(x, y, radius, v_x, v_y):
    return Obstacles(discs=[(x, y, radius)], disc_velocities=[(v_x, v_y)])


ENDLESS = {
    "accelerations of 1e-6": (slow(1e-6), NEAR, (1.0, 1.5)),
    "accelerations of 1e-3": (slow(1e-3), NEAR, (1.0, -1.5)),
    "a ring, turning": (slow(1e-3), Obstacles(points=RING), (0.0, 1.5)),
    "a ring, turning fast": (FREE, Obstacles(points=RING), (0.0, 1e2)),
    "a ring, turning at once": (FREE, Obstacles(points=RING), (0.0, 1e3)),
    "near things, at 1000": (FREE, NEAR, (1e3, 1e3)),
    "a corridor, at 1000 m/s": (FREE, wall(0.43), (1e3, 0.0)),
    "a corridor, turning": (FREE, wall(0.43), (1.0, 1e3)),
    "far walls": (slow(0.5), wall(5.0), (1.0, 0.3)),
    "along a wall": (slow(0.5), wall(0.25 + 0.17), (1.0, 0.0)),
    "along a wall, a hair nearer": (slow(0.5), wall(0.25 + 0.17 + 1e-9), (1.0, 0.0)),
    "past a wall, tangentially": (slow(0.5), wall(0.25 + 0.17 + 0.3), (0.4, 0.3)),
    "a disc at 3e7 m/s": (slow(1.0), disc(3e7, 0.0, 0.3, -3e7, 0.0), (0.5, 0.0)),
    "a disc at 3e7 m/s aside": (slow(1.0), disc(9e7, 0.8, 0.3, -3e7, 0.0), (0.5, 0.0)),
    "a disc as great as a town": (slow(1.0), disc(0.9, -1e4, 1e4, 0, 0), (0.5, 0.0)),
    "a disc that keeps pace": (slow(1.0), disc(0.0, 0.62, 0.2, 1.0, 0.0), (1.0, 0.0)),
    "a bar that spins": (
        slow(1.0),
        Obstacles(
            polygons=[[(0.8, -0.4), (0.9, -0.4), (0.9, 0.4), (0.8, 0.4)]],
            polygon_velocities=[(0.0, 0.0, 50.0)],
        ),
        (0.1, 0.0),
    ),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_the_looks_at_a_body_are_bounded(name, looks):
    """:data:`LOOKS` and one for every arc, whatever is driven past whatever."""
    limits, world, twist = ENDLESS[name]
    robot = Robot(name, BAR, limits)
    judged = Judged(robot, world, hold(*twist, HORIZON), twist, seconds=0.1)
    assert len(judged.bodies)
    arcs, rest = len(judged.rollout.arcs), judged.rollout.rest
    for i in range(0, len(judged.bodies), max(1, len(judged.bodies) // 8)):
        least = judged.room(i, HORIZON, NEVER)
        for end in (rest, HORIZON):
            for level in (0.0, -1e-3, least):
                assert (
                    looks(too_near, judged, i, (0.0, end), level, 0.0) <= LOOKS + arcs
                )


def test_a_plan_that_is_not_decided_counts_as_too_near(monkeypatch):
    """No looks left, and nothing found: not clear, rather than clear."""
    judged = Judged(ROBOT, NEAR, Plan(0.3, 0.5, 1.0, -0.3, 0.2, 3.0), (0.3, 0.5))
    i = judged.bodies["kind"].tolist().index(table.MOVES)
    level = judged.room(i, HORIZON, NEVER) - 0.01
    known = judged.scene, judged.rollout, i, (0.0, HORIZON), level, 0.0
    assert not too_near.py_func(*known)[0]
    monkeypatch.setattr(margin, "LOOKS", 1 - len(judged.rollout.arcs))
    assert too_near.py_func(*known)[0]


COUNTED = """
import math
import numpy as np
from qpavoid import AvoidanceSettings, Footprint, Limits, Obstacles, Robot
from qpavoid import SafetyFilter
from qpavoid.avoidance import margin, proposals, selection, step, verdict

made, planned, bodies = [0], [0], [0]
contact, part = margin.line_contact, margin.part_contact
roll_out = verdict.roll_out
reach = step.bodies_in_reach

def counted(*given):
    made[0] += 1
    return (contact if len(given) == 3 else part)(*given)

def rolled(*given):
    planned[0] += 1
    return roll_out(*given)

def reached(*given):
    bodies[0] = reach(*given)
    return bodies[0]

margin.line_contact = margin.part_contact = proposals.part_contact = counted
verdict.roll_out = proposals.roll_out = selection.roll_out = rolled
step.bodies_in_reach = reached
slow = Limits(-1.0, 1.0, -1.5, 1.5, 0.5, 0.02)
quick = Limits(-1.0, 1.0, -1.5, 1.5, 2.0, 2.5)
endless = Limits(-math.inf, math.inf, -math.inf, math.inf)
angle = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
ring = np.column_stack([np.cos(angle), np.sin(angle)])
ahead = {"discs": [[1.1, 0.0, 0.3]], "disc_velocities": [[0.5, 0.0]]}
fast = {"discs": [[1.5, 0.0, 0.2]], "disc_velocities": [[-3e7, 0.0]]}
walls = {"walls": [[-3.0, y, 3.0, y] for y in (0.4205, -0.4205)]}
for limits, passive, given, wish in (
    (slow, False, {"points": 0.72 * ring}, (0.3, 1.5)),
    (quick, False, {"driven": (0.0, 1e4)}, (1.0, 0.0)),
    (endless, False, {}, (1.0, 1e7)),
    (quick, True, {"points": 0.8 * ring[::8], **fast}, (1.0, 0.0)),
    (quick, False, ahead, (0.5, 0.0)),
    (quick, False, walls, (1.0, 0.0)),
):
    robot = Robot("any", Footprint.rectangle(0.9, 0.5), limits)
    safety = SafetyFilter(robot, AvoidanceSettings(dt=0.05, passive=passive))
    for _ in range(6):
        made[0] = planned[0] = bodies[0] = 0
        driven, seen = given.get("driven"), {**given}
        seen.pop("driven", None)
        safety.filter(*wish, Obstacles(**seen), driven=driven)
        print(made[0] / max(bodies[0], 1), planned[0])
"""


def test_a_call_of_the_filter_asks_for_few_distances():
    """Counted in plain Python, not timed, in all that was slow or endless once."""
    plain = os.environ | {"NUMBA_DISABLE_JIT": "1", "QPAVOID_NATIVE": "0"}
    command = [sys.executable, "-c", COUNTED]
    done = subprocess.run(command, env=plain, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    counts = np.array([line.split() for line in done.stdout.splitlines()], float)
    assert len(counts) == 36
    assert (counts.max(axis=0) < (8000, 1400)).all() and counts[:, 1].max() > 30
