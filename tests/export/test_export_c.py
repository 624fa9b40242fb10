"""The filter in C: the same answers as in Python, warning-free, without allocation."""

import math
import re
import shutil
import subprocess
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from export_problems import CAPACITY, KINDS, hostile, polygons_of
from in_c import COMPILER, STRICT
from qpavoid import (
    AvoidanceSettings,
    InvalidInputError,
    Margins,
    Repulsion,
    Robot,
    SafetyFilter,
    SafetyRadius,
)
from qpavoid.avoidance.decision import BRAKING, HOLDING, INVALID, PLANNED
from qpavoid.avoidance.settings import Actuation
from qpavoid.avoidance.validation import as_driven
from qpavoid.cli import main
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
from qpavoid.model.robot import braking_twist
from timing.exported import (
    ANSWER,
    COUNTED,
    compile_replay,
    problem_type,
    replay,
    step_times,
)
from timing.loops import drive

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

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
    radius=SafetyRadius(closing_gain=0.3),
    margins=Margins(0.02, 0.3),
    weights=(1.0, 0.3),
    passive=True,
)
LATE = AvoidanceSettings(actuation=Actuation(0.05, 0.2, True))
PRINTED = AvoidanceSettings(
    bound="repulsion", repulsion=Repulsion(activation="smooth"), braking_room=False
)
FILTERS = {
    "ahead": (Robot.mir100(), AvoidanceSettings(), True, 800),
    "ahead-limited": (LIMITED, CAREFUL, True, 800),
    "ahead-late": (LIMITED, LATE, True, 600),
    "late": (LIMITED, LATE, False, 600),
    "present": (Robot.mir100(), AvoidanceSettings(), False, 1500),
    "limited": (LIMITED, CAREFUL, False, 1500),
    "repulsion": (Robot.mir100_rectangle(), PRINTED, False, 1000),
    "unguarded": (
        Robot.mir100(),
        AvoidanceSettings(braking_room=False, reach=2.0),
        False,
        600,
    ),
}
"""Robot, settings, look-ahead, and how many hostile problems."""

REST = sorted(set(FILTERS) - {"ahead-limited"})

SEEN = {
    "ahead": {PLANNED, HOLDING},
    "ahead-limited": {PLANNED, BRAKING, HOLDING},
    "limited": {BRAKING},
}
"""Statuses that come up beside the common ones."""


LOOPS = 400
"""Steps of closed loops before them."""


@cache
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
            last = as_driven((p["last_v"], p["last_omega"]), robot.limit_vector)
            driven = None
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
            last = driven = braking_twist(robot.limit_vector, *last, settings.dt)
            answers[i] = *driven, INVALID, math.inf, 0.0, 0.0, 0.0, (-1, -1), 0.0
            continue
        last, driven = decision[:2], None
        numbers = decision.clearance, decision.slack, decision.residual
        active = (*decision.active, -1, -1)[:2]
        said = decision.status.number, *numbers, decision.shortfall, active
        answers[i] = *last, *said, 0.0
    return answers


class Programs(dict):
    """Every filter, exported and compiled without a warning when it is asked for."""

    def __init__(self, factory):
        super().__init__()
        self.factory = factory

    def __missing__(self, name):
        robot, settings, ahead, _ = FILTERS[name]
        folder = self.factory.mktemp(name)
        export_c(folder, robot, settings, CAPACITY, ahead)
        self[name] = compile_replay(folder, STRICT)
        return self[name]


@pytest.fixture(scope="module")
def filters(tmp_path_factory):
    return Programs(tmp_path_factory)


def problems_of(name):
    robot, _, _, count = FILTERS[name]
    known = hostile(np.random.default_rng(len(name)), count, robot)
    return np.concatenate([closed_loops(LOOPS), known])


@pytest.mark.parametrize("name", FILTERS)
def test_same_answers_as_python(filters, name):
    robot, settings, ahead, _ = FILTERS[name]
    problems = problems_of(name)
    wanted = in_python(robot, settings, ahead, problems)
    given = replay(filters[name], problems)
    assert (given["status"] == wanted["status"]).all()
    assert (given["active"] == wanted["active"]).all()
    for field in ("v", "omega", "clearance", "slack", "shortfall"):
        np.testing.assert_array_equal(given[field], wanted[field])
    assert np.isfinite([given["v"], given["omega"]]).all()
    seen = set(given["status"])
    assert seen >= {-1, 0, 1, 2, *SEEN.get(name, ())}, seen


def test_at_least_ten_thousand_problems():
    assert sum(LOOPS + count for *_, count in FILTERS.values()) >= 10_000


def test_invalid_data_brake_along_the_arc(filters):
    problems = hostile(np.random.default_rng(1), 12 * KINDS, LIMITED)
    problems["anew"], problems["last_v"], problems["last_omega"] = 1, 1.0, -0.8
    given = replay(filters["limited"], problems)
    invalid = given[given["status"] == INVALID]
    assert len(invalid) >= 40
    v, omega = braking_twist(LIMITED.limit_vector, 1.0, -0.8, CAREFUL.dt)
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


@pytest.mark.parametrize(
    "name", ["ahead-limited", *(pytest.param(n, marks=pytest.mark.slow) for n in REST)]
)
def test_no_undefined_behaviour(filters, name, tmp_path):
    for file in ("qpavoid_filter.h", "qpavoid_filter.c"):
        shutil.copy(filters[name].with_name(file), tmp_path)
    flags = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
    try:
        program = compile_replay(tmp_path, flags)
    except QPAvoidError:
        pytest.skip("no sanitizers")
    problems = problems_of(name)[LOOPS - 100 : LOOPS + 700]
    assert len(replay(program, problems)) == len(problems)


@pytest.mark.parametrize("name", ["ahead-limited", "repulsion"])
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
