"""Steps a second of the environments for learning, of one process and one thread.

One robot among six discs with 36 rays (``demo/strangers``), many of them in one
compiled loop, and both behind the shield; a new random twist each step. ``wall`` is by
the clock on the wall, ``processor`` by the time that the process had: on a machine that
others use, only the latter says what the code takes. The best of some repeats.

    python comparisons/gym_timing.py --steps 4000 --envs 64
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from qpavoid.errors import MissingExtraError
from qpavoid.lab.study.tables import write_csv

try:
    import qpavoid.gym as qgym
except MissingExtraError as error:
    sys.exit(str(error))

SCENE, SEEDS, REPEATS = "demo/strangers", range(10), 5

REACH = {("one", False): 5_000, ("many", False): 50_000}
"""Steps a second."""


def one(shield: bool, steps: int) -> Callable[[], int]:
    """Return what drives one robot for so many steps."""
    env: Any = qgym.ScenarioEnv(SCENE, seeds=SEEDS)
    env = qgym.ShieldedEnv(env) if shield else env
    rng, space = np.random.default_rng(0), env.action_space
    actions = rng.uniform(space.low, space.high, (steps, 2)).astype(np.float32)
    env.reset(seed=0)

    def run() -> int:
        for action in actions:
            *_, over, late, _ = env.step(action)
            if over or late:
                env.reset()
        return steps

    return run


def many(shield: bool, steps: int, envs: int) -> Callable[[], int]:
    """Return what drives many robots for so many steps altogether, about."""
    env = qgym.ScenarioVectorEnv(SCENE, envs, seeds=SEEDS, shield=shield)
    rng, space, rounds = np.random.default_rng(0), env.action_space, -(-steps // envs)
    actions = rng.uniform(space.low, space.high, (rounds, envs, 2))
    env.reset(seed=0)

    def run() -> int:
        for action in actions:
            env.step(action)
        return rounds * envs

    return run


def speeds(run: Callable[[], int]) -> tuple[float, float]:
    """Return the most steps in a second by the wall, and by the processor."""
    run()
    wall, processor = 0.0, 0.0
    for _ in range(REPEATS):
        began, spent = perf_counter(), process_time()
        steps = run()
        wall = max(wall, steps / (perf_counter() - began))
        processor = max(processor, steps / (process_time() - spent))
    return wall, processor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=4000, metavar="N")
    parser.add_argument("--envs", type=int, default=64, metavar="N")
    parser.add_argument("--out", type=Path, default=Path("out/gym"), metavar="DIR")
    options = parser.parse_args()
    rows = []
    for shield in (False, True):
        runs = {"one": one(shield, options.steps)}
        runs["many"] = many(shield, options.steps, options.envs)
        for name, run in runs.items():
            wall, processor = speeds(run)
            row = {"environments": 1 if name == "one" else options.envs}
            row |= {"shield": shield, "wall_per_s": round(wall)}
            row |= {"processor_per_s": round(processor)}
            rows.append(row | {"reach_per_s": REACH.get((name, shield), "")})
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*map(str, row.values()))
    Console().print(table)
    write_csv(options.out / "gym_timing.csv", rows)


if __name__ == "__main__":
    main()
