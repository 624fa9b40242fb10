"""Named records, views and constants of compiled functions, the same in C."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from in_c import COMPILER, draws, in_c, same
from qpavoid.compiled import compiled, compiled_once
from qpavoid.export.translate import Translation
from qpavoid.export.values import TranslationError, Value

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

ENDS = (0.5, 1.5, -2.0)
PAIRS = ((1.0, 2), (0.5, 3))
SPEED, WIDTH = 1, 3


class Plan(NamedTuple):
    """Two twists, m/s and rad/s: a row of this part."""

    v: float
    omega: float
    ticks: int


class Rollout(NamedTuple):
    arcs: np.ndarray
    speed: float
    end: tuple[float, float]
    default: bool


NOTHING = Plan(0.0, math.inf, -1)


@compiled
def faster(plan: Plan, share: float) -> Plan:
    """Return a faster plan."""
    return Plan(plan.v * (1.0 + share), plan.omega, plan.ticks + 1)


@compiled_once
def slower(v: float, omega: float, ticks: int = 2) -> Plan:
    """Return a plan, by keyword."""
    return Plan(omega=omega, ticks=ticks, v=v / 2)


@compiled
def least(one: Plan, other: Plan) -> Plan:
    """Return the slower of two."""
    if one.v < other.v:
        return one
    return other


@compiled
def search(x: float, y: float, n: int) -> tuple[float, float, int, float]:
    """Look for the best plan: records in loops, branches and conditions."""
    best = NOTHING
    plan = slower(x, omega=y)
    rounds = 0
    while True:
        candidate = faster(plan, 0.25) if rounds % 2 == 0 else slower(*plan)
        candidate = least(candidate, plan if y > 0 else faster(plan, 0.5))
        if candidate.omega < best.omega or candidate.v > best[0]:
            best = candidate
        if rounds >= n or not math.isfinite(best.v):
            break
        v, omega, _ = candidate
        plan = Plan(omega, v, rounds)
        rounds += 1
    for k in range(n - 1, -1, -2):
        if k < best.ticks:
            best, plan = plan, best
            break
    return best.v, best[1], best.ticks + k, faster(plan, 1.0).v


@compiled
def rolled(memory: np.ndarray, n: int, plan: Plan) -> Rollout:
    """Carve a matrix out of memory and fill it."""
    arcs = memory[1 : 1 + n * WIDTH].reshape(n, WIDTH)
    for k in range(arcs.shape[0]):
        arcs[k, SPEED] = plan.v * k
        arcs[k, 0] += plan.omega
        arcs[k, -1] -= arcs[k, SPEED] * 0.5
    return Rollout(arcs, arcs[n - 1, SPEED], (plan.v, 1.0), plan.ticks > 2)


@compiled
def views(
    memory: np.ndarray, x: float, i: int
) -> tuple[float, float, float, float, float, int]:
    """Take views of what records hold."""
    n = 2 + i % 3
    rollout = rolled(memory, n, Plan(x, -x, i))
    later = Rollout(rollout.arcs[1:n], 0.0, rollout.end, True)
    arcs, speed, end, flag = rollout if not rollout.default else later
    arcs[0, 0] += 10.0
    rows, columns = arcs.shape
    row = later.arcs[0]
    total = 0.0
    for value in rollout.end:
        total += value
    for a, b in PAIRS:
        total -= a * b
    for end_ in ENDS:
        total = max(total, end_ * x, speed)
    some = rolled(memory, n, Plan(v=1.0, omega=x, ticks=1)).arcs[:1][0, SPEED]
    return (
        total + ENDS[i % 3],
        row[-1] + arcs[0, 1:][0] + later.arcs[-1, 0],
        rollout.arcs[n - 1, SPEED] + end[1] / 2 + some,
        memory[-1],
        later.end[0] if flag else min(speed, x, 0.0),
        rows * columns + len(rollout) + len(arcs) + (1 if i not in (1, 2) else 0),
    )


def test_records_in_loops_and_branches(tmp_path):
    ask = in_c(tmp_path, search, x="f", y="f", n="i")
    for draw in draws():
        given = draw["x"], draw["y"], 1 + abs(draw["n"])
        assert same(ask(*given), search(*given))
        assert same(ask(*given), search.py_func(*given))


def test_records_that_hold_matrices(tmp_path):
    ask = in_c(tmp_path, views, memory="v", x="f", i="i")
    for draw in draws():
        memory = draw["rng"].uniform(-1.0, 1.0, 20)
        seen = memory.copy()
        x, i = draw["x"], 1 + abs(draw["n"])
        answer = views(memory, x, i)
        assert same(ask(seen, x, i), answer)
        assert same(seen, memory)


@compiled
def wrong_field(x: float) -> float:
    """Ask a record for what it has not."""
    return Plan(x, x, 1).speed


@compiled
def wrong_number(x: float) -> Plan:
    """Leave a field out."""
    return Plan(x, x)


@compiled
def two(x: float) -> tuple[float, float]:
    """Return two numbers."""
    return x, 2.0 * x


@compiled
def wrong_turn(x: float) -> float:
    """Write before what is not always evaluated."""
    return x if x > 0.0 else max(*two(x), x)


@compiled
def wrong_kinds(x: float) -> float:
    """Give a variable two kinds of record."""
    plan = Plan(x, x, 1)
    if x > 0.0:
        plan = (x, x)
    return plan[0]


@pytest.mark.parametrize(
    ("function", "why"),
    [
        (wrong_field, "'Plan(x, x, 1).speed'"),
        (wrong_number, "missing a required argument: 'ticks'"),
        (wrong_turn, "max(*two(x), x)': not always"),
        (wrong_kinds, "two kinds of value, Plan and tuple_dd"),
    ],
)
def test_what_a_record_cannot_be_is_named(function, why):
    with pytest.raises(TranslationError) as error:
        Translation().call(function, [Value("double", "x")])
    assert why in str(error.value) and "test_export_records.py:" in str(error.value)
