"""Search the settings of the other methods on training scenes, with equal budgets.

One setting after the other, in the order below, takes the best of its values; the rest
stay as they were found. Then the first again, until ``--tries`` settings have been
tried, the first as they stand, or none is left that differs from the best in one value.
Scenes: forests of family 7, and strangers with seeds from 100000 on, in control steps
of 0.05 s. The loss is the share of failures, plus ten times the share of runs with a
contact, plus half the mean time over the time allowed.

    python comparisons/tune_baselines.py --method apf --record

records space, scenes, budget and best in ``comparisons/results/tuned.toml``.
"""

import argparse
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from math import isfinite
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

from qpavoid.errors import MissingExtraError
from qpavoid.lab.planning import planner
from qpavoid.lab.planning.search import SEARCHES
from qpavoid.lab.simulation.config import find_config, read_document
from qpavoid.lab.simulation.methods import REGISTRY
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import Scenario, make_scenario
from qpavoid.lab.worlds.forest import forest_document

try:
    import tomli_w
except ImportError:
    sys.exit(str(MissingExtraError("tomli-w", "study")))

Settings = Mapping[str, float | str]

RECORD = Path(__file__).parent / "results" / "tuned.toml"
FAMILY, FIRST = 7, 100_000
"""Of the forests; seed of the first strangers."""

LAWS: Mapping[str, Sequence[float | str]] = {
    "speed": (1.0, 3.0, 10.0),
    "activation": ("step", "linear", "smooth"),
    "damping": (0.0, 0.05, 0.2),
    "zone_ratio": (4.0 / 3.0, 2.0, 3.0),
}
"""Of Eq. 5 and Eq. 7."""

SEARCH: dict[str, Mapping[str, Sequence[float | str]]] = {
    "eq5-tuned": LAWS,
    "eq7-tuned": LAWS,
    "stop": {
        "margin": (0.3, 0.6, 1.0, 1.5),
        "slow_time": (0.5, 1.0, 2.0),
        "slow_share": (0.3, 0.5),
    },
    "apf": {
        "lever": (0.1, 0.3, 1.0),
        "strength": (0.003, 0.01, 0.03, 0.1),
        "reach": (0.3, 0.5, 0.8, 1.2),
    },
    "vfh": {
        "radius": (0.0, 0.25, 0.5, 0.75, 1.0),
        "window": (1.0, 1.5, 2.0, 3.0),
        "turn": (1.0, 2.0, 4.0, 8.0),
        "preview": (1.0, 2.0, 3.0),
    },
    "dwa": {
        "clearance": (0.5, 1.0, 2.0),
        "velocity": (0.1, 0.3, 1.0),
        "look": (0.3, 0.6, 1.2),
        "margin": (0.3, 0.6, 1.0, 1.5),
        "preview": (1.0, 2.0, 3.0),
    },
    "rpp": {
        "time": (0.6, 1.2, 2.0),
        "near": (0.3, 0.6, 1.0),
        "slow": (0.0, 0.2),
        "look_time": (1.0, 1.5, 2.5),
    },
    "ttc": {
        "weight": (0.3, 1.0, 3.0),
        "preview": (1.0, 1.5, 2.0, 2.5),
        "horizon": (3.0, 5.0, 8.0),
        "turn": (0.25, 0.5, 1.0),
    },
    "mpc-cbf": {
        "gamma": (0.1, 0.3, 1.0),
        "discs": (1, 2),
        "stages": (8, 12),
        "effort": (0.03, 0.1, 0.3),
        "heading": (0.1, 0.4, 1.0),
        "last": (1.0, 5.0, 20.0),
    },
    "nmpc": {
        "effort": (0.03, 0.1, 0.3),
        "heading": (0.1, 0.4, 1.0),
        "stages": (14, 20, 28),
    },
    "teb": {
        "horizon": (3.0, 4.0, 5.0),
        "gather": (0.02, 0.05, 0.2),
        "stages": (12, 16, 20),
        "smooth": (0.02, 0.05, 0.2),
        "end": (20.0, 50.0, 100.0),
        "heading": (0.5, 2.0),
    },
    "orca": {
        "discs": (1, 2),
        "ahead": (0.1, 0.2),
        "horizon": (1.0, 2.0, 3.0),
        "horizon_still": (0.5, 1.0, 2.0),
        "gain": (1.0, 1.5, 3.0),
    },
    "c3bf": {
        "discs": (1, 2),
        "reach": (0.3, 0.5, 1.0, 1.5, 2.0, 4.0),
        "gamma": (1.0, 2.0, 5.0),
        "ahead": (0.1, 0.2, 0.4),
    },
    "mppi": {
        "noise_v": (0.3, 0.5),
        "noise_omega": (0.6, 1.0, 1.5),
        "temperature": (0.1, 0.3, 1.0),
        "nearness": (10.0, 30.0, 100.0),
        "ticks": (20, 30, 40),
        "heading": (0.1, 0.3, 1.0),
    },
    "astar": {
        "inflation": (0.0, 0.05, 0.1, 0.2),
        "weight": (0.0, 4.0, 9.0),
        "interval": (0.2, 0.5, 1.0),
        "memory": (2.0, 10.0),
        "sight": (3.0, 5.0, 8.0),
    },
}
"""What is searched; the window's weight of the heading is 1. ``astar`` stands for the
global planner, tracked by Eq. 6 alone."""


@cache
def scenes(count: int) -> tuple[Scenario, ...]:
    """Return the training scenes."""
    _, path = find_config("demo/strangers")
    strangers, _ = read_document(path)
    forests = [forest_document(FAMILY, k) | {"dt_s": 0.05} for k in range(count)]
    documents = forests + [strangers | {"seed": FIRST + k} for k in range(count)]
    return tuple(make_scenario(document, "training", path) for document in documents)


def judged(method: str, settings: Settings, count: int) -> dict[str, float]:
    """Return loss and metrics of a method with some settings."""
    module, name = found(method)
    made = partial(getattr(module, name), **settings)
    failed, touched, times = [], [], []
    with patch.object(module, name, made):
        for scene in scenes(count):
            if method in SEARCHES:
                scene = replace(scene, planner=made())
            outcome = outcome_of(run(scene, method))[0]
            touched.append(outcome["clearance"] < 0.0)
            failed.append(touched[-1] or not isfinite(outcome["arrived"]))
            share = outcome["arrived"] / scene.duration
            times.append(1.0 if failed[-1] else share)
    runs = len(times)
    metrics = {
        "failed in forests": 2 * sum(failed[:count]) / runs,
        "failed among strangers": 2 * sum(failed[count:]) / runs,
        "contact": sum(touched) / runs,
        "time": sum(times) / runs,
    }
    loss = sum(failed) / runs + 10.0 * metrics["contact"] + 0.5 * metrics["time"]
    return {"loss": loss} | metrics


def found(method: str) -> tuple[ModuleType, str]:
    """Return the module and the class whose settings are searched."""
    if method in SEARCHES:
        return planner, "PlannerSettings"
    module, _, name = str(REGISTRY[method].make).partition(":")
    return import_module(f"qpavoid.lab.baselines.{module}"), name


def search(
    method: str, count: int, tries: int
) -> Iterator[tuple[Settings, Mapping[str, float]]]:
    """Yield all settings that were tried, with what they gave; the best one last.

    Args:
        method: Whose settings are searched.
        count: Forests, and as many strangers.
        tries: How many settings are tried, those that stand among them.
    """
    best = standing(method)
    least = judged(method, best, count)
    done = [best]
    yield best, least
    pairs = [(key, x) for key, some in SEARCH.get(method, {}).items() for x in some]
    last = 0
    while last < len(done):
        last = len(done)
        for key, value in pairs:
            tried = {**best, key: value}
            if tried in done or len(done) >= tries:
                continue
            done.append(tried)
            result = judged(method, tried, count)
            yield tried, result
            if result["loss"] < least["loss"]:
                best, least = tried, result
    yield best, least


def standing(method: str) -> dict[str, float | str]:
    """Return the defaults of what is searched of a method."""
    module, name = found(method)
    fields = getattr(module, name).__dataclass_fields__
    return {key: fields[key].default for key in SEARCH.get(method, {})}


def record(
    method: str,
    count: int,
    tried: list[tuple[Settings, Mapping[str, float]]],
    path: Path = RECORD,
) -> None:
    """Write what a search was and found into the file; the other methods' stay.

    Args:
        method: Whose settings were searched.
        count: Forests, and as many strangers.
        tried: What :func:`search` yields.
        path: The file.
    """
    known: dict[str, Any] = tomllib.loads(path.read_text()) if path.is_file() else {}
    best, least = tried[-1]
    known[method] = {
        "forests": {"family": FAMILY, "seed": 0, "count": count},
        "strangers": {"seed": FIRST, "count": count},
        "tried": len(tried) - 1,
        "runs": 2 * count * (len(tried) - 1),
        "loss": {"before": tried[0][1]["loss"], "best": least["loss"]},
        "space": SEARCH.get(method, {}),
        "start": dict(tried[0][0]),
        "best": dict(best),
    }
    path.write_text(tomli_w.dumps(known))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--method", choices=["alone", *SEARCH], default=None)
    parser.add_argument("--count", type=int, default=8, metavar="N", help="of a kind")
    parser.add_argument("--tries", type=int, default=12, metavar="N", help="settings")
    parser.add_argument("--record", action="store_true", help="into results/tuned.toml")
    options = parser.parse_args()
    for method in [options.method] if options.method else SEARCH:
        tried = []
        for settings, result in search(method, options.count, options.tries):
            words = [f"{method:5}", *(f"{k} {v:.3f}" for k, v in result.items())]
            print(" | ".join([*words, str(settings)]), flush=True)
            tried.append((settings, result))
        if options.record:
            record(method, options.count, tried)


if __name__ == "__main__":
    main()
