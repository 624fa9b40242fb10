"""From Python to C: what both mean differently, and what cannot be translated."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from in_c import COMPILER, loaded
from qpavoid.compiled import compiled
from qpavoid.export.build import compile_extension
from qpavoid.export.extension import extension_text
from qpavoid.export.translate import Translation
from qpavoid.export.values import TranslationError, Value
from qpavoid.types import VectorWritten

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

SIX, EIGHT = tuple[(float,) * 6], tuple[(float,) * 8]
STEP = 2.5
CHOICES = (0.5, -1.0, 7.0)


@compiled
def odd(x: float, n: int, values: VectorWritten) -> tuple[float, float, int]:
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


@compiled
def functions(x: float, y: float, n: int, m: int) -> EIGHT:
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


@compiled
def roundings(x: float, y: float) -> SIX:
    """Round to more than an int of C holds."""
    return (
        0.001 * math.floor(x / 0.001),
        y - math.ceil(x),
        min(y, math.floor(x), 3),
        float(math.floor(x)) + round(x) / 2,
        math.floor(x) / math.ceil(abs(y) + 1.0),
        1.0 if bool(x > y) and bool(y) else 2.0,
    )


@compiled
def shadowed(x: float, n: int) -> tuple[float, float]:
    """Read a counter after the inner of two loops that share it."""
    total = 0.0
    for i in range(n):
        for i in range(3):
            total += x * i
        total -= i
    return total, x


TRANSLATED = odd, functions, roundings, shadowed


@pytest.fixture(scope="module")
def in_c(tmp_path_factory):
    """An extension module of these functions."""
    folder = tmp_path_factory.mktemp("translated")
    text = extension_text({one.__name__: one for one in TRANSLATED}, {})
    (folder / "c.c").write_text(text)
    compile_extension(folder / "c.c", folder / "_native.so")
    return loaded(folder / "_native.so")


@pytest.mark.parametrize("function", TRANSLATED, ids=lambda one: one.__name__)
def test_c_returns_the_bits_of_python(in_c, function):
    rng = np.random.default_rng(1)
    for _ in range(300):
        x, y = rng.uniform(-3.0, 3.0, 2).tolist()
        n, m = rng.integers(-7, 8, 2).tolist()
        values = rng.uniform(-1.0, 1.0, 6)
        calls = {
            odd: [(2.0 * x, 2 + n % 4, values)],
            functions: [(x, y, n, m or 1)],
            roundings: [(scale * x, y) for scale in (1.0, 1e9, -1e12)],
            shadowed: [(x, abs(n))],
        }
        for given in calls[function]:
            seen = values.copy()
            other = (*given[:2], seen) if function is odd else given
            one, two = function(*given), getattr(in_c, function.__name__)(*other)
            np.testing.assert_array_equal(np.signbit(one), np.signbit(two))
            np.testing.assert_array_equal(one, two)
            np.testing.assert_array_equal(seen, values)


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
