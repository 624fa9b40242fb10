"""Hostile calls of ``SafetyFilter.step``, and their answers.

Arguments of wrong kinds, shapes and counts; NaN, infinities, huge, tiny and denormal
numbers; masked arrays, text, dates, generators; objects that raise or exit when they
are converted; stamps, ages and driven twists of any kind; and valid calls between them.
The table counts exceptions, answers that are not finite or beyond the robot's limits,
the greatest processor time of a call, and the growth of memory.

    python comparisons/reliability/calls.py --solver exact --count 1000000
"""

import argparse
import gc
import math
import sys
import warnings
from collections.abc import Iterator
from contextlib import suppress
from ctypes import CDLL
from dataclasses import replace
from datetime import date
from decimal import Decimal
from fractions import Fraction
from itertools import count, islice, repeat
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np

import qpavoid as qp
from qpavoid.avoidance.inputs import StepMonitor, as_driven
from qpavoid.avoidance.settings import Actuation
from qpavoid.types import Twist

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.page import add_row

Call = dict[str, Any]

MIR = qp.Robot.mir100()
LIMITED = qp.Limits(-0.5, 2.0, -4.0, 4.0, 2.0, 5.0, wheel_speed=1.8, track=0.4)
ENDLESS = qp.Limits(-math.inf, math.inf, -math.inf, math.inf, 2.0, 5.0)
CAREFUL = qp.AvoidanceSettings(
    radius=qp.SafetyRadius(closing_gain=0.3),
    margins=qp.Margins(0.02, 0.3),
    weights=(1.0, 0.3),
    passive=True,
)
LATE = qp.AvoidanceSettings(actuation=Actuation(0.05, 0.2, True))
FILTERS: dict[str, tuple[qp.Robot, qp.AvoidanceSettings, Call]] = {
    "plain": (MIR, qp.AvoidanceSettings(), {}),
    "present": (MIR, qp.AvoidanceSettings(), {"ahead": False}),
    "careful": (replace(MIR, limits=LIMITED), CAREFUL, {}),
    "late": (replace(MIR, limits=LIMITED), LATE, {}),
    "endless": (replace(MIR, limits=ENDLESS), qp.AvoidanceSettings(), {}),
}
"""Robot, settings, and further arguments of the filter."""

NUMBERS = (
    *(0.0, -0.0, 5e-324, -1e-310, 1e-160, 1e-9, 1e3, -1e9, 1e16, -1e50, 9.9e99, 1e155),
    *(1e308, -1e308, math.nan, math.inf, -math.inf),
)
MOST = 3000
"""Points of a call."""

ROUNDING = 1e-9
"""Tolerance of the limits, m/s and rad/s."""


class Evil:
    """Object that raises in every conversion."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def __float__(self) -> float:
        raise self.error

    __array__ = __len__ = __iter__ = __str__ = __index__ = __bool__ = __float__
    __getitem__ = __eq__ = __lt__ = __repr__ = __hash__ = lambda self, *_: float(self)


class Array:
    """Object that converts itself to some array."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __array__(self, *_: Any, **__: Any) -> Any:
        return self.value


def odd_things(rng: np.random.Generator) -> list[Any]:
    """Return objects that are no valid numbers or arrays, or hardly."""
    ring: list[Any] = []
    ring.append(ring)
    some = rng.uniform(-2.0, 2.0, (4, 2))
    errors = SystemExit(1), ValueError("no"), MemoryError(), OSError(), GeneratorExit()
    return [
        *(None, True, "fast", "0.5", b"1", 1j, 10**400, -(10**400), object(), ring, {}),
        *({"v": 1.0}, {1.0, 2.0}, date(2026, 1, 1), Decimal("0.3"), Fraction(1, 3)),
        *(np.float32(0.25), np.float16(6e4), np.int8(3), np.datetime64("now")),
        *(np.ma.masked, np.ma.array(some, mask=some > 1.0), np.matrix(some), some.T),
        *(some[:, ::-1], some.astype(">f8"), some.astype("f2"), some.astype(complex)),
        *(some.astype("O"), some.astype("U8"), some.astype(np.longdouble), some > 0.0),
        *(np.zeros((0,)), np.zeros((3, 0)), np.zeros((0, 5)), np.zeros((2, 2, 2))),
        *(np.broadcast_to(0.5, (10**12, 2)), np.broadcast_to(0.5, (3, 10**12))),
        *([[1.0], [1.0, 2.0]], [["1", "2"]], [[None, 1.0]], [[10**400, 0]], [some]),
        *((x for x in some), iter(some), count(), repeat(some), range(10**9)),
        *(Evil(error) for error in (*errors, RecursionError())),
        *(Array(value) for value in (some, "no", None, np.zeros((2, 2), "V8"))),
        *(lambda: 0.0, np.array(0.5), Array(some[0]), [Evil(BaseException())]),
        *(qp.Stamps, qp.Stamps(0.0), qp.Obstacles(some + 3.0), memoryview(some)),
        bytearray(16),
    ]


def some_number(rng: np.random.Generator) -> float:
    """Return a number, mostly an extreme one."""
    return float(rng.choice(NUMBERS)) if rng.random() < 0.8 else float(rng.normal())


def good_call(rng: np.random.Generator) -> Call:
    """Return a valid call."""
    size, m = rng.choice([1.0, 3.0]), int(rng.integers(4))
    n = MOST if rng.random() < 0.002 else int(rng.integers(30))
    call: Call = {"v": float(rng.uniform(-1, 2)), "omega": float(rng.uniform(-2, 2))}
    call["points"] = rng.uniform(-size, size, (n, 2))
    if rng.random() < 0.6:
        discs = np.abs(rng.uniform(-size, size, (m, 3))) - [[1.5, 1.5, 0.0]]
        velocities = rng.uniform(-1.0, 1.0, (m, 2))
        walls = rng.uniform(-size, size, (m, 4))
        corners = np.add([(0, 0), (0.5, 0), (0.2, 0.4)], rng.uniform(-size, size, 2))
        kinds = discs, velocities, walls, [corners], rng.uniform(-1.0, 1.0, (1, 3))
        call["obstacles"] = qp.Obstacles(call.pop("points"), *kinds)
    if rng.random() < 0.3:
        call["age"] = float(rng.uniform(0.0, 0.2))
    if rng.random() < 0.2:
        call["driven"] = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
    return call


def spoil(rng: np.random.Generator, call: Call, odd: list[Any]) -> None:
    """Replace one argument of a call by a wrong one."""
    name = str(rng.choice([*call, "age", "driven", "stamps", "points", "discs"]))
    value, how = call.get(name), rng.integers(4)
    if how == 0 and type(value) is np.ndarray and 0 < value.size < 10_000:
        value = value.copy()
        value.flat[rng.integers(value.size)] = some_number(rng)
    elif how == 1 and name == "driven":
        value = some_number(rng), some_number(rng)
    elif how == 1 and name in ("v", "omega", "age"):
        value = some_number(rng)
    elif how == 1:
        value = np.full(rng.integers(0, 5, 2), some_number(rng))
    elif how == 2 and rng.random() < 0.5:
        stamps = [some_number(rng) for _ in range(rng.integers(1, 7))]
        name, value = "stamps", qp.Stamps(*stamps)
    else:
        value = odd[rng.integers(len(odd))]
    call[name] = value


def calls(seed: int) -> Iterator[Call]:
    """Yield calls without end, two of three of them with wrong arguments."""
    rng = np.random.default_rng(seed)
    while True:
        odd = odd_things(rng)
        for _ in range(50):
            call = good_call(rng)
            for _ in range(rng.choice([0, 1, 3])):
                spoil(rng, call, odd)
            if rng.random() < 0.02:
                del call[str(rng.choice([*call]))]
            yield call


def within(robot: qp.Robot, last: Twist, dt: float, twist: Twist) -> bool:
    """Return whether a twist is within limits, and accelerations from the last one."""
    v_min, v_max, w_min, w_max, a, b, wheel, track, _ = robot.limit_vector
    v, omega = twist
    excess = [v_min - v, v - v_max, w_min - omega, omega - w_max]
    excess += [abs(v) + 0.5 * track * abs(omega) - wheel]
    excess += [abs(v - last[0]) - a * dt, abs(omega - last[1]) - b * dt]
    return all(one <= ROUNDING for one in excess)


def resident() -> int:
    """Return the resident memory of the process, bytes, without freed blocks."""
    gc.collect()
    getattr(CDLL(None), "malloc_trim", int)(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def ask(safety: qp.SafetyFilter, call: Call) -> tuple[dict[str, bool], float, str]:
    """Make a call; return its faults, the processor time in s, and what it was."""
    lasts, dt = [tuple(safety._engine.state[:2].tolist())], safety.settings.dt
    with suppress(BaseException):  # no driven twist, or a wrong one
        lasts.append(as_driven(call["driven"], safety._engine.setup.robot))
    started = thread_time()
    try:
        answer = safety.step(**call)
    except BaseException:
        return {"raised": True}, 0.0, ""
    took = thread_time() - started
    if "stamps" in call:  # later calls have none
        safety.monitor = StepMonitor(safety.freshness, dt)
    twist, near = (answer.v, answer.omega), call.get("obstacles", call.get("points"))
    found = {
        "invalid": answer.status is qp.Status.INVALID,
        "not finite": not all(map(math.isfinite, twist)),
        "beyond limits": not any(within(safety.robot, x, dt, twist) for x in lasts),
    }
    sized = type(near) is qp.Obstacles or getattr(near, "shape", ())
    return found, took, f"{answer.status}: {len(near) if sized else 0} near"


def study(solver: str, total: int, seed: int = 0) -> Call:
    """Return the row of a solver: calls shared evenly among :data:`FILTERS`."""
    row = dict.fromkeys(("invalid", "raised", "not finite", "beyond limits"), 0)
    warm, grown, worst = total // 20, 0, (0.0, "")
    fresh = qp.Freshness(good=0.0)
    filters = [
        qp.SafetyFilter(robot, settings, solver, freshness=fresh, **how)
        for robot, settings, how in FILTERS.values()
    ]
    for safety in filters:  # allocates the largest workspace
        safety.step(0.0, 0.0, np.zeros((MOST, 2)))
    for i, call in enumerate(islice(calls(seed), total)):
        if i == warm:
            grown, worst = resident(), (0.0, "")  # first calls compile and allocate
        found, took, what = ask(filters[i % len(filters)], call)
        worst = max(worst, (took, what))
        for name, holds in found.items():
            row[name] += holds
    more = {"MB grown": round((resident() - grown) / 1e6, 2)}
    more |= {"worst ms": round(1e3 * worst[0], 2), "worst call": worst[1]}
    return {"part": f"{solver} {seed}", "calls": total} | row | more


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solver", default="exact", help="back end")
    parser.add_argument("--seed", type=int, default=0, help="of the calls")
    parser.add_argument("--count", type=int, default=10_000, help="calls")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    row = study(options.solver, options.count, options.seed)
    add_row("calls", row)
    print(row)


if __name__ == "__main__":
    main()
