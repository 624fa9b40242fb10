"""The filter in C: the same answers as in Python, warning-free, without allocation."""

import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from qpavoid import (
    AvoidanceSettings,
    InvalidInputError,
    Margins,
    Repulsion,
    Robot,
    SafetyFilter,
    SafetyRadius,
)
from qpavoid.avoidance.decision import INVALID
from qpavoid.cli import main
from qpavoid.errors import QPAvoidError
from qpavoid.export.replay import (
    ANSWER,
    COUNTED,
    compile_replay,
    problem_type,
    replay,
    step_times,
)
from qpavoid.export.write import Capacity, export_c
from qpavoid.model.robot import braking_twist
from qpavoid.study.bench.loops import drive

COMPILER = shutil.which("gcc") or shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Werror")
CAPACITY = Capacity(discs=8, points=5, walls=3, polygons=3, corners=14)
LIMITED = replace(
    Robot.jackal(),
    limits=replace(
        Robot.jackal().limits,
        acceleration=2.0,
        angular_acceleration=5.0,
        wheel_speed=1.8,
        track=0.4,
    ),
)
CAREFUL = AvoidanceSettings(
    radius=SafetyRadius(closing=0.3),
    margins=Margins(0.02, 0.3),
    weights=(1.0, 0.3),
    passive=True,
)
PRINTED = AvoidanceSettings(
    bound="repulsion", repulsion=Repulsion(activation="smooth"), braking_room=False
)
FILTERS = {
    "ahead": (Robot.mir100(), AvoidanceSettings(), True, 1500),
    "ahead-limited": (LIMITED, CAREFUL, True, 1500),
    "present": (Robot.mir100(), AvoidanceSettings(), False, 3000),
    "limited": (LIMITED, CAREFUL, False, 3000),
    "repulsion": (Robot.mir100_rectangle(), PRINTED, False, 2000),
    "unguarded": (
        Robot.mir100(),
        AvoidanceSettings(braking_room=False, reach=2.0),
        False,
        1000,
    ),
}
"""Robot, settings, look-ahead, and how many hostile problems."""

KINDS = 14


def hostile(rng, count, robot):
    """Return problems of every kind that went wrong somewhere, in random order."""
    problems = np.zeros(count, problem_type(CAPACITY))
    corners = robot.footprint.vertices
    for i, p in enumerate(problems):
        seen, size = p["obstacles"], rng.choice([0.7, 1.5, 4.0])
        for name in ("points", "discs", "walls"):
            seen[name] = rng.uniform(-size, size, seen[name].shape)
            seen[f"n_{name}"] = rng.integers(0, getattr(CAPACITY, name) + 1)
        seen["discs"][:, 2] = rng.uniform(0.0, 0.5, CAPACITY.discs)
        moving = rng.random((CAPACITY.discs, 1)) < 0.6
        seen["disc_velocities"] = moving * rng.uniform(-1, 1, (CAPACITY.discs, 2))
        some_polygons(rng, seen, size)
        seen["age"] = rng.choice([0.0, 0.1])
        p["v"], p["omega"], p["last_v"], p["last_omega"] = rng.uniform(-1.5, 1.5, 4)
        p["anew"] = i == 0 or rng.random() < 0.2
        spoil(rng, p, seen, corners, i % KINDS)
    return problems


def some_polygons(rng, seen, size):
    """Put polygons round the robot, moving, turning, and on top of it."""
    count, first = rng.integers(0, CAPACITY.polygons + 1), 0
    seen["n_polygons"] = count
    for i in range(count):
        n = int(rng.integers(3, 5))
        angles = (np.arange(n) + rng.uniform(0, 0.8, n)) * 2 * math.pi / n
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        corners = rng.uniform(-size, size, 2) + rng.uniform(0.05, 1) * circle
        seen["corners"][first : first + n] = corners
        motion = rng.uniform(-1, 1, 3) * rng.choice([0, 1], 3)
        seen["polygons"][i] = n, *motion
        first += n


def polygons_of(seen):
    """Return the polygons of a problem, and their motions."""
    corners, chosen = seen["corners"], seen["polygons"][: seen["n_polygons"]]
    if not ((chosen[:, 0] >= 3) & (chosen[:, 0] <= CAPACITY.corners)).all():
        raise InvalidInputError("no polygons")
    ends = np.cumsum(chosen[:, 0]).astype(int)
    if ends.max(initial=0) > CAPACITY.corners:
        raise InvalidInputError("too many corners")
    return np.split(corners[: ends.max(initial=0)], ends)[:-1], chosen[:, 1:]


def spoil(rng, p, seen, corners, kind):
    """Make one problem degenerate, infeasible or invalid."""
    if kind == 0:  # obstacles at a corner, also at distance 0
        seen["points"][:5] = corners[rng.integers(len(corners))] * rng.choice(
            [1, 1.001]
        )
        seen["n_points"] = 5
    elif kind == 1:  # duplicates
        seen["discs"][1:3], seen["n_discs"] = seen["discs"][0], CAPACITY.discs
    elif kind == 2:  # abeam of the axle: no twist moves away
        half = corners[:, 1].max()
        seen["points"][:2] = (0.0, half + 0.1), (0.0, -half - 0.1)
        seen["n_points"], seen["n_discs"], seen["n_walls"] = 2, 0, 0
    elif kind == 3:  # inside the footprint
        seen["points"][0], seen["n_points"] = rng.uniform(-0.1, 0.1, 2), 1
    elif kind == 4:  # walls of no length, and through the robot
        seen["walls"][0, 2:], seen["n_walls"] = seen["walls"][0, :2], 3
        seen["walls"][1] = -2.0, 0.1, 2.0, 0.1
    elif kind == 5:  # surrounded
        radius = np.hypot(*seen["discs"][:, :2].T)
        seen["discs"][:, :2] *= (1.05 / radius)[:, None]
        seen["n_discs"] = CAPACITY.discs
    elif kind == 6:  # nothing there
        seen["n_points"] = seen["n_discs"] = seen["n_walls"] = seen["n_polygons"] = 0
    elif kind == 7:
        p["v"] = rng.choice([math.nan, math.inf, 1e300])
    elif kind == 8:
        seen["discs"][0, 2], seen["n_discs"] = rng.choice([-1e-9, math.nan, 1e101]), 3
    elif kind == 9:
        name = rng.choice(["points", "discs", "walls", "polygons"])
        seen[f"n_{name}"] = rng.choice([-1, getattr(CAPACITY, name) + 1])
    elif kind == 10:
        seen["age"] = rng.choice([-1e-9, math.nan, math.inf, 0.5])
    elif kind == 11:  # no polygon: dented, not finite, of two or too many corners
        seen["n_polygons"], seen["polygons"][0, 0] = 1, 4
        seen["corners"][:4] = (2, 0), (3, 0), (2.1, 0.1), (2, 1)
        how = rng.integers(4)
        if how == 1:
            seen["corners"][2] = rng.choice([math.nan, math.inf, 1e200]), 1
        elif how > 1:
            seen["polygons"][0, 0] = rng.choice([2, 99, -1e30, math.nan])
    elif kind == 12:  # a polygon round everything
        seen["n_polygons"], seen["polygons"][0] = 1, (4, 0.1, 0.2, 0.3)
        seen["corners"][:4] = (-3, -3), (3, -3), (3, 2), (-3, 2.5)


def closed_loops(count):
    """Return what a filter is asked in loops, each with its memory."""
    problems = np.zeros(count, problem_type(CAPACITY))
    moments = drive(SafetyFilter(Robot.mir100(), ahead=False), np.random.default_rng(3))
    for p, moment in zip(problems, moments, strict=False):
        seen = p["obstacles"]
        seen["n_discs"] = len(moment.seen.discs)
        seen["discs"], seen["disc_velocities"] = (
            moment.seen.discs,
            moment.seen.disc_velocities,
        )
        p["v"], p["omega"], p["anew"] = moment.v, moment.omega, moment.step == 0
    return problems


def in_python(robot, settings, ahead, problems):
    """Return what the package answers; where it raises, C brakes."""
    safety = SafetyFilter(robot, settings, ahead=ahead)
    answers = np.zeros(len(problems), ANSWER)
    last, driven = (0.0, 0.0), None
    for i, p in enumerate(problems):
        seen = p["obstacles"]
        n = {k: int(seen[f"n_{k}"]) for k in COUNTED}
        if p["anew"]:
            last, driven = (float(p["last_v"]), float(p["last_omega"])), None
            safety.reset(*last)
        try:
            if not all(0 <= k <= getattr(CAPACITY, name) for name, k in n.items()):
                raise InvalidInputError("too many")
            decision = safety.filter(
                float(p["v"]),
                float(p["omega"]),
                seen["points"][: n["points"]],
                seen["discs"][: n["discs"]],
                seen["disc_velocities"][: n["discs"]],
                seen["walls"][: n["walls"]],
                *polygons_of(seen),
                float(seen["age"]),
                driven,
            )
        except InvalidInputError:
            last = driven = braking_twist(robot.numbers, *last, settings.dt)
            answers[i] = *driven, INVALID, math.inf, 0.0, 0.0, 0.0, (-1, -1), 0.0
            continue
        v, omega, status, *numbers, active, _, shortfall, _ = decision
        last, driven = (v, omega), None
        active = (*active, -1, -1)[:2]
        answers[i] = v, omega, status.number, *numbers, shortfall, active, 0.0
    return answers


@pytest.fixture(scope="module")
def filters(tmp_path_factory):
    """Export and compile every filter, without a warning."""
    programs = {}
    for name, (robot, settings, ahead, _) in FILTERS.items():
        folder = tmp_path_factory.mktemp(name)
        export_c(folder, robot, settings, CAPACITY, ahead)
        programs[name] = compile_replay(folder, STRICT)
    return programs


def problems_of(name):
    robot, _, _, count = FILTERS[name]
    known = hostile(np.random.default_rng(len(name)), count, robot)
    return np.concatenate([closed_loops(1500), known])


@pytest.mark.parametrize("name", FILTERS)
def test_same_answers_as_python(filters, name):
    robot, settings, ahead, _ = FILTERS[name]
    problems = problems_of(name)
    wanted = in_python(robot, settings, ahead, problems)
    given = replay(filters[name], problems)
    assert (given["status"] == wanted["status"]).all()
    assert (given["active"] == wanted["active"]).all()
    for field in ("v", "omega", "clearance", "slack", "shortfall"):
        np.testing.assert_allclose(given[field], wanted[field], rtol=0, atol=1e-9)
    assert np.isfinite([given["v"], given["omega"]]).all()
    seen = set(given["status"])
    assert seen >= {-1, 1, 2} and len(seen) >= 5, seen


def test_at_least_ten_thousand_problems():
    assert sum(1500 + count for *_, count in FILTERS.values()) >= 10_000


def test_invalid_data_brake_along_the_arc(filters):
    problems = hostile(np.random.default_rng(1), 12 * KINDS, LIMITED)
    problems["anew"], problems["last_v"], problems["last_omega"] = 1, 1.0, -0.8
    given = replay(filters["limited"], problems)
    invalid = given[given["status"] == INVALID]
    assert len(invalid) >= 40
    v, omega = braking_twist(LIMITED.numbers, 1.0, -0.8, CAREFUL.dt)
    np.testing.assert_allclose(invalid["v"], v, rtol=1e-12)
    np.testing.assert_allclose(invalid["omega"], omega, rtol=1e-12)


def test_reset_forgets_everything(filters):
    problems = problems_of("limited")[-400:]
    problems["anew"][0] = 1
    once = replay(filters["limited"], problems)
    twice = replay(filters["limited"], np.concatenate([problems, problems]))
    for field in ("v", "omega", "status", "active"):
        assert (twice[field][:400] == once[field]).all()
        assert (twice[field][400:] == once[field]).all()


@pytest.mark.parametrize("name", ["limited", "ahead"])
def test_no_undefined_behaviour(filters, name, tmp_path):
    for file in ("qpavoid_filter.h", "qpavoid_filter.c"):
        shutil.copy(filters[name].with_name(file), tmp_path)
    flags = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
    try:
        program = compile_replay(tmp_path, flags)
    except QPAvoidError:
        pytest.skip("no sanitizers")
    problems = problems_of(name)[1200:2400]
    assert len(replay(program, problems)) == len(problems)


@pytest.mark.parametrize("name", FILTERS)
def test_nothing_is_needed_beyond_libm(filters, name, tmp_path):
    source = filters[name].with_name("qpavoid_filter.c")
    command = [COMPILER, "-std=c99", *STRICT, "-O0", "-c", source, "-o", "filter.o"]
    subprocess.run(command, cwd=tmp_path, check=True)
    listed = subprocess.run(
        ["nm", "filter.o"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    libm = "sqrt sin cos atan2 copysign ceil floor fmod rint".split()
    assert set(re.findall(r" U (\w+)", listed)) <= {*libm, "memcpy", "memset"}
    assert not re.search(r" [BbDd] ", listed), "memory of its own"


def test_the_example_and_the_command_line(tmp_path, capsys):
    folder = tmp_path / "filter"
    known = ["--robot", "demo/crowd", "--obstacles", "3"]
    assert main(["export-c", *known, str(folder)]) == 0
    names = ["qpavoid_filter.h", "qpavoid_filter.c", "main.c"]
    assert capsys.readouterr().out.split() == [str(folder / name) for name in names]
    command = [COMPILER, "-std=c99", *STRICT, "-O2", *names[1:], "-lm", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run(["./main"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0 and "0.20 m from the goal" in done.stdout
    assert main(["export-c", "--robot", "mir10", str(folder)]) == 2
    assert main(["export-c", "--obstacles", "0", str(folder)]) == 1


def test_times_of_steps():
    scans = [(0.5, 0.0, np.array([[1.0, 0.1]] * n)) for n in (1, 1000)]
    few, many = step_times(Robot.mir100(), AvoidanceSettings(), scans, ahead=False)
    assert 0.0 < few < many < 1e6
