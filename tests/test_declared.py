"""Declarations of settings, and checks against them."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import pytest

from qpavoid.avoidance.inputs import Freshness
from qpavoid.avoidance.settings import (
    Actuation,
    AvoidanceSettings,
    LookAhead,
    Margins,
    Repulsion,
    SafetyRadius,
)
from qpavoid.errors import InvalidInputError
from qpavoid.guide.settings import GuideSettings
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.model.robot import Limits
from qpavoid.perception.settings import PerceptionSettings
from qpavoid.settings import FINITE, NO_KEY, POSITIVE, Range, check, declared
from qpavoid.tracking.clock import Waiting
from qpavoid.tracking.kanayama import Gains
from qpavoid.tracking.station import StationKeeping


@dataclass(frozen=True)
class Things:
    needed: Annotated[float, "m", POSITIVE]
    pair: Annotated[tuple[float, float], FINITE, ("pair_m", "pair_rad")] = (0.0, 1.0)
    word: Literal["a", "b"] = "a"
    switch: bool = False
    count: Annotated[int, NO_KEY, Range(ge=1)] = 1
    plain: float = 0.0

    def __post_init__(self):
        check(self, "things want")


def test_what_is_declared():
    needed, pair, word, switch, count = declared(Things)
    assert (needed.keys, needed.default, needed.range) == (("needed_m",), ..., POSITIVE)
    assert (pair.keys, pair.kind, pair.many) == (("pair_m", "pair_rad"), float, True)
    assert pair.of((2.0, 3.0)) == (2.0, 3.0) and needed.of(2.0) == (2.0,)
    assert (word.keys, word.choices, word.default) == (("word",), ("a", "b"), "a")
    assert (switch.keys, switch.choices, switch.range) == (("switch",), (), None)
    assert count.keys == () and count.kind is int


NEEDED = {
    Gains: {"k_x": 1.0, "k_y": 1.0, "k_gamma": 1.0},
    Limits: {"v_min": -1.0, "v_max": 1.0, "omega_min": -1.0, "omega_max": 1.0},
}
SETTINGS = [
    *(SafetyRadius, Repulsion, Margins, Actuation, LookAhead, AvoidanceSettings),
    *(Freshness, GuideSettings, Waiting, StationKeeping, *NEEDED),
    *(PerceptionSettings, LidarSettings),
]


def outside(setting):
    """Values that a setting may not have."""
    allowed = setting.range
    if allowed is None:
        held = setting.choices or setting.kind is bool
        return ["none", 7, None, math.nan] if held else []
    found = [math.nan, "1", None, 1j, [1.0], 10**400]
    found += [] if allowed.allow_inf_nan is None else [math.inf, -math.inf]
    least, most = (allowed.gt, allowed.ge), (allowed.lt, allowed.le)
    for (bound, included), away in ((least, -math.inf), (most, math.inf)):
        found += [] if bound is None else [bound]
        found += [] if included is None else [math.nextafter(included, away)]
    return found


@pytest.mark.parametrize("kind", SETTINGS)
def test_what_is_outside_of_a_range_is_refused_by_name(kind):
    for setting in declared(kind):
        for wrong in outside(setting):
            given = [wrong] * len(setting.keys) if setting.many else wrong
            with pytest.raises(InvalidInputError, match=setting.name):
                kind(**{**NEEDED.get(kind, {}), setting.name: given})
