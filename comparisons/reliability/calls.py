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
from collections import Counter
from collections.abc import Iterator
from ctypes import CDLL
from dataclasses import replace
from datetime import date
from decimal import Decimal
from fractions import Fraction
from itertools import count, repeat
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from qpavoid import (
    AvoidanceSettings,
    Freshness,
    Limits,
    Margins,
    Obstacles,
    Robot,
    SafetyFilter,
    SafetyRadius,
    Stamps,
    Status,
)
from qpavoid.avoidance.inputs import StepMonitor, as_driven
from qpavoid.avoidance.settings import Actuation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from reliability.data import add_row

Call = dict[str, Any]

MIR = Robot.mir100()
LIMITED = Limits(-0.5, 2.0, -4.0, 4.0, 2.0, 5.0, wheel_speed=1.8, track=0.4)
ENDLESS = Limits(-math.inf, math.inf, -math.inf, math.inf, 2.0, 5.0)
CAREFUL = AvoidanceSettings(
    radius=SafetyRadius(closing_gain=0.3),
    margins=Margins(0.02, 0.3),
    weights=(1.0, 0.3),
    passive=True,
)
LATE = AvoidanceSettings(actuation=Actuation(0.05, 0.2, True))
FILTERS: dict[str, tuple[Robot, AvoidanceSettings, Call]] = {
    "plain": (MIR, AvoidanceSettings(), {}),
    "present": (MIR, AvoidanceSettings(), {"ahead": False}),
    "careful": (replace(MIR, limits=LIMITED), CAREFUL, {}),
    "late": (replace(MIR, limits=LIMITED), LATE, {}),
    "endless": (replace(MIR, limits=ENDLESS), AvoidanceSettings(), {}),
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
        *(Stamps, Stamps(0.0), Obstacles(some + 3.0), memoryview(some), bytearray(16)),
    ]


def some_number(rng: np.random.Generator) -> float:
    """Return a number, mostly an extreme one."""
    return float(rng.choice(NUMBERS)) if rng.random() < 0.8 else float(rng.normal())


def good_call(rng: np.random.Generator) -> Call:
    """Return a valid call."""
    size, n, m = rng.choice([1.0, 3.0]), int(rng.integers(30)), int(rng.integers(4))
    n = MOST if rng.random() < 0.002 else n
    call: Call = {"v": float(rng.uniform(-1, 2)), "omega": float(rng.uniform(-2, 2))}
    call["points"] = rng.uniform(-size, size, (n, 2))
    if rng.random() < 0.6:
        discs = np.abs(rng.uniform(-size, size, (m, 3))) - [[1.5, 1.5, 0.0]]
        velocities = rng.uniform(-1.0, 1.0, (m, 2))
        walls = rng.uniform(-size, size, (m, 4))
        corners = np.add([(0, 0), (0.5, 0), (0.2, 0.4)], rng.uniform(-size, size, 2))
        kinds = discs, velocities, walls, [corners], rng.uniform(-1.0, 1.0, (1, 3))
        call["obstacles"] = Obstacles(call.pop("points"), *kinds)
    if rng.random() < 0.3:
        call["age"] = float(rng.uniform(0.0, 0.2))
    if rng.random() < 0.2:
        call["driven"] = tuple(rng.uniform(-2.0, 2.0, 2).tolist())
    return call


def spoil(rng: np.random.Generator, call: Call, odd: list[Any]) -> None:
    """Replace one argument of a call by a wrong one."""
    names = [*call, "age", "driven", "stamps", "points", "discs"]
    name, how = str(rng.choice(names)), rng.integers(4)
    value = call.get(name)
    if how == 0 and type(value) is np.ndarray and 0 < value.size < 10_000:
        value = value.copy()
        value.flat[rng.integers(value.size)] = some_number(rng)
    elif how == 1:
        value = some_number(rng)
        if name == "driven":
            value = value, some_number(rng)
        elif name not in ("v", "omega", "age"):
            value = np.full(rng.integers(0, 5, 2), value)
    elif how == 2 and rng.random() < 0.5:
        given = [some_number(rng) for _ in range(6)]
        value = Stamps(*given[: rng.integers(1, 7)])
        name = "stamps"
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


def beyond(robot: Robot, last: tuple[float, float], dt: float, answer: Any) -> float:
    """Return the excess of a twist over limits and accelerations; NaN: infinite."""
    v_min, v_max, w_min, w_max, a, b, wheel, track, _ = robot.limit_vector
    v, omega = answer[:2]
    excess = [v_min - v, v - v_max, w_min - omega, omega - w_max]
    excess += [abs(v) + 0.5 * track * abs(omega) - wheel]
    excess += [abs(v - last[0]) - a * dt, abs(omega - last[1]) - b * dt]
    return math.inf if any(map(math.isnan, excess)) else max(excess)


def driven_before(
    safety: SafetyFilter, call: Call, status: Status
) -> tuple[float, float]:
    """Return the driven twist of a call, if valid; else the last answer."""
    last = safety._engine.state[0].item(), safety._engine.state[1].item()
    if call.get("driven") is None:
        return last
    try:
        return as_driven(call["driven"], safety._engine.setup.robot)
    except BaseException:
        return last


def resident() -> int:
    """Return the resident memory of the process, bytes, without freed blocks."""
    gc.collect()
    getattr(CDLL(None), "malloc_trim", int)(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


class Tally:
    """Counts of the answers of a filter."""

    def __init__(self) -> None:
        self.seen: Counter[str] = Counter()
        self.worst, self.worst_call = 0.0, ""

    def ask(self, safety: SafetyFilter, call: Call) -> None:
        """Make a call and count its answer."""
        given = dict(call)
        robot, dt = safety.robot, safety.settings.dt
        lasts = {driven_before(safety, given, Status.INVALID)}
        lasts.add((safety._engine.state[0].item(), safety._engine.state[1].item()))
        started = thread_time()
        try:
            answer = safety.step(**call)
        except BaseException as error:
            self.seen[f"raised {type(error).__name__}"] += 1
            return
        took = thread_time() - started
        if "stamps" in given:  # later calls have none
            safety._monitor = StepMonitor(safety.freshness, dt)
        self.seen["calls"] += 1
        self.seen["invalid"] += answer.status is Status.INVALID
        self.seen["not finite"] += not all(map(math.isfinite, answer[:2]))
        off = min(beyond(robot, last, dt, answer) for last in lasts)
        self.seen["beyond limits"] += int(off > ROUNDING)
        if took > self.worst:
            self.worst, self.worst_call = took, described(safety, given, answer.status)


def described(safety: SafetyFilter, call: Call, status: Status) -> str:
    """Return a call in words."""
    given = call.get("obstacles", call.get("points"))
    known = isinstance(given, (list, Obstacles)) or np.ndim(given) > 0
    return f"{status}: {len(given) if known else 'nothing'} near"


def study(solver: str, total: int, seed: int = 0) -> Call:
    """Return the row of a solver: calls shared evenly among :data:`FILTERS`."""
    tally, grown, made, warm = Tally(), 0, calls(seed), total // 20
    filters = [
        SafetyFilter(robot, settings, solver, freshness=Freshness(good=0.0), **how)
        for robot, settings, how in FILTERS.values()
    ]
    started = perf_counter()
    for safety in filters:  # allocates the largest workspace
        safety.step(0.0, 0.0, np.zeros((MOST, 2)))
    for i in range(total):
        if i == warm:
            grown, tally.worst = resident(), 0.0  # first calls compile and allocate
        tally.ask(filters[i % len(filters)], next(made))
    grown = resident() - grown
    seen = tally.seen
    return {
        "part": f"{solver} {seed}",
        "solver": solver,
        "calls": total,
        "invalid": seen["invalid"],
        "raised": sum(n for what, n in seen.items() if what.startswith("raised")),
        "not finite": seen["not finite"],
        "beyond limits": seen["beyond limits"],
        "MB grown": round(grown / 1e6, 2),
        "worst ms": round(1e3 * tally.worst, 2),
        "worst call": tally.worst_call,
        "s": round(perf_counter() - started),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solver", default="exact", help="back end")
    parser.add_argument("--seed", type=int, default=0, help="of the calls")
    parser.add_argument("--count", type=int, default=10_000, help="calls")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    row = study(options.solver, options.count, options.seed)
    add_row("calls", "part", row)
    print(row)


if __name__ == "__main__":
    main()
