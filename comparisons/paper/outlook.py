"""The paper's outlook: a safety radius by closing speed, and variable coefficients.

The paper proposes both and tries neither. ``outlook_laws.py`` has the formulas of
``closing-radius`` and ``variable-coefficients``; ``closing-time`` is the package's own
``closing_gain_s``: r_min and r grow by T·v_c, with v_c of the *desired* twist.

What helps may be another value and not that it varies. Controls: ``fixed-radius``, one
r_min for all speeds; ``fixed-coefficients``, ẋ_0·s and k_x, k_y, k_γ times 1 − κ.
``--tune`` tries the eight values in :data:`SPACE` of each on strangers of seeds 10000
on, and writes ``tuned.csv``; the best are in
:data:`outlook_laws.CHOSEN`. Room, the metric, is the least distance less 0.17 m, the
same for all.

    python comparisons/paper/outlook.py --tune --scenes 16 --out out/outlook
    python comparisons/paper/outlook.py --scenes 60 --out out/outlook
    python comparisons/paper/outlook.py --paper --out out/outlook_paper
"""

import argparse
import json
import math
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import Any

from outlook_laws import CHOSEN, law_of, method_of
from qpavoid.avoidance.settings import SafetyRadius
from qpavoid.lab.simulation.batch import as_loop
from qpavoid.lab.simulation.outcome import outcome_of
from qpavoid.lab.simulation.run import run
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.study.sweep.job import find_scene
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.tables import write_csv
from qpavoid.lab.worlds.scenes import ScenarioFile

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # for studies.py
from studies import Row, Scenes, main_of, make_parser, run_study, write_tables

STRANGERS, FIRST = "demo/strangers", 10_000
"""Where; seed of the first training scene."""

R_LOW = SafetyRadius.r_min_slow
"""m; the paper's r_min of slow obstacles."""

SHARES = tuple(x for x in product((1.0, 0.3, 0.1), (0.0, 0.4, 0.8)) if x != (1.0, 0.0))
SPACE: dict[str, tuple[tuple[float, ...], ...]] = {
    "closing-radius": tuple(product((0.23, 0.35, 0.5, 0.8), (0.5, 1.0))),
    "closing-time": tuple((x,) for x in (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8)),
    "fixed-radius": tuple((x,) for x in (0.1, 0.14, 0.2, 0.25, 0.3, 0.4, 0.6, 0.8)),
    "variable-coefficients": SHARES,
    "fixed-coefficients": SHARES,
}
"""Values of :data:`outlook_laws.CHOSEN`."""


def changes_of(
    arm: str, constants: tuple[float, ...], source: ScenarioFile
) -> dict[str, float]:
    """Return the settings of an arm by dotted key; none where a law says it."""
    document = source.sample()
    match arm, constants:
        case "closing-time", (time,):
            return {"radius.closing_gain_s": time}
        case "fixed-radius", (r_min,):
            return {"radius.r_min_slow_m": r_min, "radius.r_min_fast_m": r_min}
        case "fixed-coefficients", (s, kappa):
            usual = {"k_x_per_s": 1.0, "k_y_rad_per_m2": 1.0, "k_gamma_radps": 2.0}
            gains = {k: document["tracking"].get(k, x) for k, x in usual.items()}
            speed = document.get("repulsion", {}).get("speed_mps", 10.0)
            changed = {f"tracking.{k}": x * (1.0 - kappa) for k, x in gains.items()}
            return changed | {"repulsion.speed_mps": s * speed}
    return {}


def loss(scenario: Scenario, method: Any) -> float:
    """Return the loss of a run."""
    form = as_loop(scenario) if isinstance(method, str) else None
    if form is None:
        end = outcome_of(run(scenario, method))[0]
    else:
        end = form[0].run(method, [form[1]], 1, "exact")[0]
    if end["clearance"] < 0.0 or not math.isfinite(end["arrived"]):
        return 1.5 + 10.0 * bool(end["clearance"] < 0.0)
    return 0.5 * float(end["arrived"]) / scenario.duration


def tune(options: argparse.Namespace) -> None:
    """Try every value of every arm on the training scenes, and write the losses."""
    source, lines = scenario_file(STRANGERS), []
    for law, (arm, values) in product(CHOSEN, {"plain": ((),), **SPACE}.items()):
        for constants in values:
            changes = json.dumps(changes_of(arm, constants, source))
            method = law_of(law, arm, constants) or f"eq{law}"
            seeds = range(FIRST, FIRST + options.scenes)
            scenes = (find_scene(source, seed, changes, None) for seed in seeds)
            mean = round(fmean(loss(scene, method) for scene in scenes), 4)
            words = " ".join(map(str, constants))
            lines.append({"law": law, "arm": arm, "constants": words, "loss": mean})
            print(lines[-1], flush=True)
    write_csv(options.out / "tuned.csv", lines)


def study(options: argparse.Namespace) -> list[Row]:
    """Run both laws as they are, and every arm of both with its chosen values."""
    seeds: list[Any] = [None] if options.paper else [*range(options.scenes)]
    cases = [f"paper/test_case_{k}" for k in (1, 2)] if options.paper else [STRANGERS]
    rows = []
    for case, law, arm in product(cases, CHOSEN, ("plain", *SPACE)):
        source, constants = scenario_file(case), CHOSEN[law].get(arm, ())
        setting = f"Eq. {law}" + f", {case[6:].replace('_', ' ')}" * options.paper
        changes = changes_of(arm, constants, source)
        options.methods = method_of(law, arm)
        label = f"eq{law} {arm}".removesuffix(" plain")
        scenes = [Scenes(source, seeds, setting, changes)]
        rows += run_study("The outlook of the paper", scenes, options, told(label))
    write_tables(rows, options.out)
    return rows


def told(label: str) -> Callable[[Row], Row]:
    """Return what the study knows of a row of a method: its name, and the room."""

    def add(row: Row) -> Row:
        least = row["min_clearance_m"]
        room = None if least is None else least - R_LOW
        return {"method": label, "metric": room, "min_room_m": room}

    return add


def main() -> None:
    parser = make_parser(__doc__, "", "out/outlook")
    parser.add_argument("--scenes", type=int, default=60, metavar="N")
    parser.add_argument("--paper", action="store_true", help="the paper's test cases")
    parser.add_argument("--tune", action="store_true", help="on training scenes")
    options = parser.parse_args()
    if options.scenes < 1:
        parser.error("--scenes wants 1 or more")
    main_of(lambda: tune(options) if options.tune else study(options), parser)


if __name__ == "__main__":
    main()
