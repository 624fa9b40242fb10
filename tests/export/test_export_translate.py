"""From Python to C: what both mean differently, and what cannot be translated."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from in_c import COMPILER, draws, in_c, same
from qpavoid.compiled import compiled
from qpavoid.export.translate import Translation
from qpavoid.export.values import TranslationError, Value

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

STEP = 2.5
CHOICES = (0.5, -1.0, 7.0)


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
    return max(*last, least, float(k)), rest[0], k if n == 0 or n == 7 else -k


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
    big = math.inf if x > 1.0 else 1e308
    ok = math.isinf(big * x) == (x > 0.0) and not math.isnan(y)
    i = n // m + n % m
    pair = (0.0, 1.0)
    if ok:
        pair = (x, y)
    return (
        math.hypot(x, y) + math.exp(-x) + math.tan(y),
        math.acos(max(-1.0, min(x, 1.0, y))),
        x % y,
        float(i) + min(n, m, 3) + max(n, m, -1),
        -math.inf if ok else math.nan,
        pair[0] / 2,
        n / m + (2 if 0 < n < 4 else 5) // 2,
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


class Plan(NamedTuple):
    """A record."""

    v: float
    omega: float
    ticks: int


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
def wrong_call(x: float) -> float:
    """Call what C does not know."""
    return math.gamma(x)


@compiled
def wrong_memory(x: float) -> float:
    """Make an array."""
    return float(np.zeros(3)[0] + x)


@pytest.mark.parametrize(
    ("function", "kind", "construct"),
    [
        (wrong_call, "double", "math.gamma(x)"),
        (wrong_memory, "double", "np.zeros(3)"),
        (wrong_turn, "double", "max(*two(x), x)': not always"),
        (wrong_kinds, "double", "two kinds of value, Plan and tuple_dd"),
    ],
)
def test_what_cannot_be_c_is_named(function, kind, construct):
    with pytest.raises(TranslationError) as error:
        Translation().call(function, [Value(kind, "x")])
    assert "test_export_translate.py:" in str(error.value)
    assert construct in str(error.value)
