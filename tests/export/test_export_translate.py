"""From Python to C: what both mean differently, and what cannot be translated."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from in_c import COMPILER, draws, in_c, same
from qpavoid.compiled import compiled, compiled_once
from qpavoid.export.translate import Translation
from qpavoid.export.values import TranslationError, Value
from qpavoid.types import layout

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

STEP = 2.5
CHOICES = (0.5, -1.0, 7.0)
TABLE = np.array([1.0, 2.0])


@compiled
def odd(x: float, n: int, values: np.ndarray) -> tuple[float, float, int]:
    """Use what Python and C mean differently."""
    a, b = x, STEP
    a, b = b, a
    cos, least = math.cos(a), math.inf
    for value in CHOICES:
        least = min(least, value * x)
    for i in range(n):
        n = 0
        values[i] = 2 * i / 4
    values[0], values[1] = values[1], values[0]
    k = (n - 3) % 5 + (n - 3) // 5 + int(-x) + round(x)
    k -= 1 - 2
    rest = values[1:]
    if 0.0 < x <= 1.0 or not k > 3:
        rest[0] += cos - (a - b) - x
    last = (a, x % 1.5)
    return max(*last, least, float(k)), rest[0], k if n in (0, 7) else -k


def test_python_and_c_agree_where_they_differ(tmp_path):
    ask = in_c(tmp_path, odd, x="f", n="i", values="v")
    for draw in draws():
        given = 2.0 * draw["x"], 2 + draw["n"] % 4
        values = draw["rng"].uniform(-1.0, 1.0, 6)
        seen = values.copy()
        assert same(ask(*given, seen), odd(*given, values))
        assert same(seen, values)


@compiled
def functions(x: float, y: float, n: int, m: int) -> tuple[float, ...]:
    """Use every function of numbers."""
    big = float("inf") if x > 1.0 else math.inf
    ok = math.isinf(big * x) == (x > 0.0) and not math.isnan(y)
    i = n // m + n % m
    pair = (0, 1.0)
    if ok:
        pair = (x, y)
    return (
        math.hypot(x, y) + math.exp(-x) + math.tan(y),
        math.acos(max(-1.0, min(x, 1.0, y))),
        x % y,
        float(i) + min(n, m, 3) + max(n, m, -1),
        float("-inf") if ok else math.nan,
        pair[0] / 2,
        n / m + (2 if n in (1, 2, 3) else 5) // 2,
        abs(n - m) * 1.0 + math.floor(x) + int(y),
    )


def test_functions_of_numbers(tmp_path):
    ask = in_c(tmp_path, functions, x="f", y="f", n="i", m="i")
    for draw in draws():
        given = [draw[name] for name in "xynm"]
        assert same(ask(*given), functions(*given))


@compiled
def roundings(x: float, y: float) -> tuple[float, ...]:
    """Round to more than an int of C holds."""
    return (
        0.001 * math.floor(x / 0.001),
        y - math.ceil(x),
        min(y, math.floor(x), 3),
        float(math.floor(x)) + round(x) / 2,
        math.floor(x) / math.ceil(abs(y) + 1.0),
        1.0 if bool(x > y) and bool(y) else 2.0,
    )


def test_what_is_rounded_may_be_large(tmp_path):
    ask = in_c(tmp_path, roundings, x="f", y="f")
    for x, y in [(draw["x"], draw["y"]) for draw in draws()]:
        for scale in (1.0, 1e9, -1e12):
            assert same(ask(x * scale, y), roundings(x * scale, y))


@compiled
def shadowed(x: float, n: int) -> tuple[float, float]:
    """Read a counter after the inner of two loops that share it."""
    total = 0.0
    for i in range(n):
        for i in range(3):
            total += x * i
        total -= i
    return total, x


def test_a_counter_has_its_last_value_after_the_loop(tmp_path):
    ask = in_c(tmp_path, shadowed, x="f", n="i")
    for draw in draws():
        given = draw["x"], abs(draw["n"])
        assert same(ask(*given), shadowed(*given))


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


PLANS = layout(Plan)


@compiled_once
def sorted_plans(memory: np.ndarray, x: float, n: int) -> tuple[float, int, int]:
    """Fill, change, copy and sort rows of a table of records."""
    plans = memory[1:].view(PLANS)[: 3 + n % 3]
    for i in range(plans.shape[0]):
        plans[i] = Plan(x, x * i * (3 - i), 2 * i)
        plans[i].v += plans[i].omega
        plans[i].ticks -= n
    for i in range(1, len(plans)):
        one, other = plans[i], plans[i - 1]
        if (one.v, one.ticks, one.omega) < (other.v, other.ticks, other.omega):
            kept = Plan(other.v, other.omega, other.ticks)
            plans[i - 1] = plans[i]
            plans[i] = kept
    later = plans[1:]
    return faster(later[0], 0.5).v, later[len(later) - 1].ticks, slower(x, x).ticks


def test_tables_of_records(tmp_path):
    ask = in_c(tmp_path, sorted_plans, memory="v", x="f", n="i")
    for draw in draws():
        memory = draw["rng"].uniform(-1.0, 1.0, 19)
        seen, plain, given = memory.copy(), memory.copy(), (draw["x"], abs(draw["n"]))
        answer = sorted_plans(memory, *given)
        assert same(ask(seen, *given), answer)
        assert same(sorted_plans.py_func(plain, *given), answer)
        for name in Plan._fields:
            rows = [one[1:].view(PLANS)[name] for one in (seen, plain, memory)]
            assert same(rows[0], rows[2]) and same(rows[1], rows[2])


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


@compiled
def wrong_comparison(x: float) -> bool:
    """Order tuples."""
    return (x, 1.0) <= (1.0, x)


@compiled
def wrong_call(x: float) -> float:
    """Call what C does not know."""
    return math.gamma(x)


@compiled
def wrong_memory(x: float) -> float:
    """Make an array."""
    return float(np.zeros(3)[0] + x)


@compiled
def wrong_array(n: int) -> float:
    """Look into an array of the module."""
    return float(TABLE[n])


@compiled
def wrong_part(a: np.ndarray) -> float:
    """Take what is not contiguous."""
    return float(a[:, 0][0])


@pytest.mark.parametrize(
    ("function", "kind", "construct"),
    [
        (wrong_comparison, "double", "(x, 1.0) <= (1.0, x)"),
        (wrong_call, "double", "math.gamma(x)"),
        (wrong_memory, "double", "np.zeros(3)"),
        (wrong_array, "int", "TABLE"),
        (wrong_part, "matrix", "a[:, 0]"),
        (wrong_field, "double", "'Plan(x, x, 1).speed'"),
        (wrong_number, "double", "missing a required argument: 'ticks'"),
        (wrong_turn, "double", "max(*two(x), x)': not always"),
        (wrong_kinds, "double", "two kinds of value, Plan and tuple_dd"),
    ],
)
def test_what_cannot_be_c_is_named(function, kind, construct):
    with pytest.raises(TranslationError) as error:
        Translation().call(function, [Value(kind, "x")])
    assert "test_export_translate.py:" in str(error.value)
    assert construct in str(error.value)
