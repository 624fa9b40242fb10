"""Search the settings of the other methods, with the budget and the cases of ours.

The cases are those that ``tune_guide.toml`` trains our guide on: strangers, forests,
BARN worlds, recorded crowds and CrowdNav's people, 40 in all. The loss is that file's:
the share of failures, plus ten times the share of runs with a contact, plus the mean
time over the time allowed, all of it where a run fails. One setting after the other, in
the order below, takes a value that is better by 0.025; the rest stay as they were. Then
the first again, until ``--tries`` settings have been tried, the first as they stand, or
none is left that differs from the best in one value. What is left of the tries then is
drawn from the space (``--rest``), of settings that differ in two values or more. Where
one of those is better by as much, both are driven on the 142 cases that the file holds
out (``--held-out``): what is not better there, too, is not driven with. What the search
itself found is driven with in any case; how that and what it started from do on these
cases is recorded (``--check``).

    python comparisons/tune_baselines.py --data PATH --method apf --record
    python comparisons/tune_baselines.py --data PATH --method apf --record --rest
    python comparisons/tune_baselines.py --data PATH --method apf --held-out
    python comparisons/tune_baselines.py --data PATH --method apf --check

records space, cases, budget and best in ``comparisons/results/tuned.toml``, under
``all_kinds``. What it starts from was found in the same way before, in up to 12
settings on 8 forests and 8 strangers: that is what else the file says of a method. The
best of all kinds are the defaults of the classes, and what the tables' rows drive with.
Ours, searched with the same budget by ``qpavoid tune``, is recorded beside them; the
tables' rows drive with what it had before (``driven = "start"``), for the best is not
better on cases held out:

    qpavoid tune comparisons/tune_guide.toml --data PATH --out out/tune_guide
    python comparisons/tune_baselines.py --data PATH --ours out/tune_guide/tuning.json
"""

import argparse
import json
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import product
from math import isfinite
from pathlib import Path
from random import Random
from statistics import fmean
from types import ModuleType
from typing import Any, NamedTuple, cast
from unittest.mock import patch

from qpavoid.errors import MissingExtraError
from qpavoid.lab.planning import planner
from qpavoid.lab.planning.search import SEARCHES
from qpavoid.lab.simulation.methods import REGISTRY
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.sweep.job import find_scene
from qpavoid.lab.worlds.source import Source

try:
    import tomli_w
    from joblib import Parallel, delayed

    from qpavoid.lab.study.tune import read_tuning
except MissingExtraError as error:
    sys.exit(str(error))
except ImportError:
    sys.exit(str(MissingExtraError("tomli-w", "study")))

Settings = Mapping[str, float | str]

HERE = Path(__file__).parent
ENOUGH = 0.025
"""Of the loss: what a setting has to gain to be taken, that of one failed run of 40."""

SEED = 0
"""Of what is drawn."""

RECORD, CASES = HERE / "results" / "tuned.toml", HERE / "tune_guide.toml"


class Case(NamedTuple):
    """A training case.

    Attributes:
        source: Where it comes from.
        seed: Which of them.
        data: Folder of published data sets.
    """

    source: Source
    seed: int | None
    data: str


LAWS: Mapping[str, Sequence[float | str]] = {
    "speed": (1.0, 3.0, 10.0, 20.0),
    "activation": ("step", "linear", "smooth"),
    "damping": (0.0, 0.05, 0.2, 0.4),
    "zone_ratio": (1.2, 4.0 / 3.0, 2.0, 3.0),
}
"""Of Eq. 5 and Eq. 7."""

SEARCH: dict[str, Mapping[str, Sequence[float | str]]] = {
    "eq5-tuned": LAWS,
    "eq7-tuned": LAWS,
    "stop": {
        "margin": (0.6, 1.0, 1.5, 2.0),
        "slow_time": (0.5, 1.0, 2.0),
        "slow_share": (0.15, 0.3, 0.5),
    },
    "apf": {
        "lever": (0.3, 1.0, 2.0),
        "strength": (0.03, 0.1, 0.3),
        "reach": (0.2, 0.3, 0.5, 0.8, 1.2),
    },
    "vfh": {
        "radius": (0.5, 0.75, 1.0, 1.2),
        "window": (1.0, 1.5, 2.0, 3.0),
        "turn": (2.0, 4.0, 8.0, 12.0),
        "preview": (1.0, 2.0, 3.0),
    },
    "dwa": {
        "clearance": (0.5, 1.0, 2.0),
        "velocity": (0.03, 0.1, 0.3),
        "look": (0.2, 0.3, 0.6, 1.2),
        "margin": (0.3, 0.6, 1.0, 1.5),
        "preview": (0.5, 1.0, 2.0),
    },
    "rpp": {
        "time": (0.6, 1.2, 2.0),
        "near": (0.15, 0.3, 0.6, 1.0),
        "slow": (0.0, 0.2),
        "look_time": (0.7, 1.0, 1.5, 2.5),
    },
    "ttc": {
        "weight": (0.3, 1.0, 3.0),
        "preview": (1.0, 1.5, 2.0, 2.5),
        "horizon": (3.0, 5.0, 8.0),
        "turn": (0.25, 0.5, 1.0),
    },
    "mpc-cbf": {
        "gamma": (0.3, 0.6, 1.0),
        "discs": (1, 2, 3),
        "stages": (8, 12, 16),
        "effort": (0.1, 0.3, 1.0),
        "heading": (0.03, 0.1, 0.4),
        "last": (5.0, 20.0, 50.0),
    },
    "nmpc": {
        "effort": (0.01, 0.03, 0.1),
        "heading": (0.03, 0.1, 0.4),
        "stages": (20, 28, 36),
    },
    "teb": {
        "horizon": (2.0, 3.0, 4.0),
        "gather": (0.05, 0.2, 0.5),
        "stages": (12, 16, 20),
        "smooth": (0.01, 0.02, 0.05),
        "end": (20.0, 50.0, 100.0),
        "heading": (0.5, 2.0, 5.0),
    },
    "orca": {
        "discs": (1, 2),
        "ahead": (0.1, 0.2, 0.3),
        "horizon": (1.0, 2.0, 3.0),
        "horizon_still": (0.5, 1.0, 2.0),
        "gain": (1.5, 3.0, 5.0),
    },
    "c3bf": {
        "discs": (1, 2),
        "reach": (0.5, 1.0, 1.5, 2.0, 4.0),
        "gamma": (2.0, 5.0, 10.0),
        "ahead": (0.1, 0.2, 0.4),
    },
    "mppi": {
        "noise_v": (0.2, 0.3, 0.5),
        "noise_omega": (0.4, 0.6, 1.0, 1.5),
        "temperature": (0.1, 0.3, 1.0),
        "nearness": (10.0, 30.0, 100.0),
        "ticks": (20, 30, 40, 50),
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


def cases_of(data: Path, kind: str = "training") -> list[Case]:
    """Return the training cases, or those that are held out."""
    scenes = read_tuning(CASES, data).scenes[kind]
    return [Case(source, seed, str(data)) for source, seeds in scenes for seed in seeds]


def judged(
    method: str, settings: Settings, cases: Sequence[Case], workers: int = -1
) -> dict[str, float]:
    """Return loss and metrics of a method with some settings."""
    jobs = (delayed(met)(method, settings, case) for case in cases)
    ends = cast("list[tuple[bool, bool, float]]", Parallel(workers)(jobs))
    failed, touched, times = map(fmean, zip(*ends, strict=True))
    loss = failed + 10.0 * touched + times
    found = {"loss": loss, "failure": failed, "contact": touched, "time": times}
    return {key: round(x, 6) for key, x in found.items()}


def judged_both(
    method: str, before: Settings, after: Settings, cases: Sequence[Case]
) -> dict[str, dict[str, float]]:
    """Return the same of two settings, as the record has them."""
    each = {"before": before, "after": after}
    return {when: judged(method, settings, cases) for when, settings in each.items()}


def met(method: str, settings: Settings, case: Case) -> tuple[bool, bool, float]:
    """Return whether a run fails, whether it touches, and its share of the time."""
    scene = find_scene(case.source, case.seed, "{}", case.data)
    module, name = found(method)
    made = partial(getattr(module, name), **settings)
    with patch.object(module, name, made):
        if method in SEARCHES:
            scene = replace(scene, planner=made())
        outcome = outcome_of(run(scene, method))[0]
    touched = bool(outcome["clearance"] < 0.0)
    failed = touched or not isfinite(outcome["arrived"])
    return failed, touched, 1.0 if failed else outcome["arrived"] / scene.duration


def found(method: str) -> tuple[ModuleType, str]:
    """Return the module and the class whose settings are searched."""
    if method in SEARCHES:
        return planner, "PlannerSettings"
    module, _, name = str(REGISTRY[method].make).partition(":")
    return import_module(f"qpavoid.lab.baselines.{module}"), name


def search(
    method: str, cases: Sequence[Case], tries: int
) -> Iterator[tuple[Settings, Mapping[str, float]]]:
    """Yield all settings that were tried, with what they gave; the best one last.

    Args:
        method: Whose settings are searched.
        cases: What it is searched on.
        tries: How many settings are tried, those that stand among them.
    """
    best = standing(method)
    least = judged(method, best, cases)
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
            result = judged(method, tried, cases)
            yield tried, result
            if result["loss"] < least["loss"] - ENOUGH:
                best, least = tried, result
    yield best, least


def rest(
    method: str, cases: Sequence[Case], known: Mapping[str, Any], tries: int
) -> Iterator[tuple[Settings, Mapping[str, float]]]:
    """Yield the settings that the record of a search left, with what they gave.

    Args:
        method: Whose settings are searched.
        cases: What it is searched on.
        known: The record of its search.
        tries: How many settings are tried with those of the search.
    """
    best, space = known["best"], known["space"]
    every = [dict(zip(space, some, strict=True)) for some in product(*space.values())]
    far = [x for x in every if sum(x[key] != best[key] for key in best) > 1]
    Random(SEED).shuffle(far)
    for tried in far[: tries - known["tried"]]:
        yield tried, judged(method, tried, cases)


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
        count: Training cases.
        tried: What :func:`search` yields.
        path: The file.
    """
    (start, before), (best, after) = tried[0], tried[-1]
    told = {"before": dict(before), "after": dict(after), "start": dict(start)}
    told |= {"space": SEARCH.get(method, {}), "best": dict(best)}
    tries = len(tried) - 1
    _write(path, method, {"tried": tries, "runs": count * tries} | told)


def record_rest(
    method: str,
    drawn: list[tuple[Settings, Mapping[str, float]]],
    path: Path = RECORD,
) -> None:
    """Add what :func:`rest` yielded to the record of a search."""
    known = recorded(method, path)
    runs = known["runs"] // known["tried"]
    known |= {"tried": known["tried"] + len(drawn), "drawn": len(drawn), "seed": SEED}
    known["runs"] = runs * known["tried"]
    if drawn:
        settings, result = min(drawn, key=lambda one: one[1]["loss"])
        known["best_drawn"] = {"settings": dict(settings), **result}
    _write(path, method, known)


def gains(known: Mapping[str, Any]) -> bool:
    """Return whether what was drawn gains as much as a search asks for."""
    least: float = known.get("best_drawn", known["after"])["loss"]
    return bool(least < known["after"]["loss"] - ENOUGH)


def record_held_out(
    method: str, cases: Sequence[Case], path: Path = RECORD
) -> dict[str, dict[str, float]]:
    """Judge the best that was drawn and the best before on cases that neither saw.

    The first is the best from then on if it is better there.
    """
    known = recorded(method, path)
    drawn = known["best_drawn"]
    held = judged_both(method, known["best"], drawn["settings"], cases)
    known["held_out"] = held
    if held["after"]["loss"] < held["before"]["loss"]:
        after = {key: drawn[key] for key in known["after"]}
        known |= {"best": drawn["settings"], "after": after}
    _write(path, method, known)
    return held


def record_check(
    method: str, cases: Sequence[Case], path: Path = RECORD
) -> dict[str, dict[str, float]]:
    """Judge what a search began with and what it found on cases that neither saw."""
    known = recorded(method, path)
    check = judged_both(method, known["start"], known["best"], cases)
    _write(path, method, known | {"check": check})
    return check


def recorded(method: str, path: Path = RECORD) -> dict[str, Any]:
    """Return what the file says of a method's search on all kinds of cases."""
    return dict(tomllib.loads(path.read_text(encoding="utf-8"))[method]["all_kinds"])


def record_ours(found: Path, count: int, path: Path = RECORD) -> None:
    """Write what ``qpavoid tune`` found of our guide, which does not drive with it.

    Args:
        found: Its ``tuning.json``.
        count: Training cases.
        path: The file.
    """
    told = json.loads(found.read_text(encoding="utf-8"))
    model = tomllib.loads(told["tuning"])
    losses = {(row.pop("settings"), row.pop("scenes")): row for row in told["table"]}
    names = {"before": "as they stand", "after": "best"}
    training, held_out = (
        {when: losses[name, scenes] for when, name in names.items()}
        for scenes in ("training", "held out")
    )
    tries = {"tried": model["trials"], "runs": count * model["trials"]}
    searched = {"seed": model.get("seed", 0), "space": model["search"]}
    searched["driven"] = "start"
    what = {"held_out": held_out, "best": told["best"]}
    _write(path, "guide", tries | searched | training | what)


def _write(path: Path, method: str, told: Mapping[str, Any]) -> None:
    known: dict[str, Any] = tomllib.loads(path.read_text()) if path.is_file() else {}
    known.setdefault(method, {})["all_kinds"] = {"cases": CASES.name, **told}
    path.write_text(tomli_w.dumps(known))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH", required=True)
    parser.add_argument("--method", choices=["alone", *SEARCH], default=None)
    parser.add_argument("--tries", type=int, default=16, metavar="N", help="settings")
    parser.add_argument("--record", action="store_true", help="into results/tuned.toml")
    told = "draw the settings that the recorded search left"
    parser.add_argument("--rest", action="store_true", help=told)
    told = "judge the best that was drawn on the cases held out, and record that"
    parser.add_argument("--held-out", action="store_true", help=told)
    told = "judge what was found and what it began with on the cases held out"
    parser.add_argument("--check", action="store_true", help=told)
    told = "record what qpavoid tune found of our guide, and search nothing"
    parser.add_argument("--ours", type=Path, metavar="TUNING.JSON", help=told)
    options = parser.parse_args()
    cases = cases_of(options.data)
    methods = [options.method] if options.method else SEARCH
    if options.ours:
        return record_ours(options.ours, len(cases))
    if options.held_out:
        cases = cases_of(options.data, "held out")
        chosen = [name for name in methods if gains(recorded(name))]
        return print({name: record_held_out(name, cases) for name in chosen})
    if options.check:
        cases = cases_of(options.data, "held out")
        changed = [x for x in methods if recorded(x)["start"] != recorded(x)["best"]]
        return print({name: record_check(name, cases) for name in changed})
    for method in methods:
        tried, known = [], recorded(method) if options.rest else {}
        searched = partial(rest, known=known) if known else search
        for settings, result in searched(method, cases, tries=options.tries):
            words = [f"{method:5}", *(f"{k} {v:.3f}" for k, v in result.items())]
            print(" | ".join([*words, str(settings)]), flush=True)
            tried.append((settings, result))
        if options.record and options.rest:
            record_rest(method, tried)
        elif options.record:
            record(method, len(cases), tried)


if __name__ == "__main__":
    main()
