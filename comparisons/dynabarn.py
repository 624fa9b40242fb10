"""DynaBARN: moving cylinders, up to faster than the robot, across its whole way.

The Jackal's footprint (0.508 × 0.430 m, |ω| ≤ 1.57 rad/s, no limits of acceleration,
r_min 0.1 m) drives straight from the published start to within 1 m of the goal, 20 m
on. Cylinders and their velocities are known. 438 of the 469 tracks jump when their loop
restarts, where no method can be safe: they are sent back (``--jumps reverse``; over at
the published 100 s), or the episode is over at the first jump of any (``end``; at 1 m/s
there is time to arrive in few worlds). Three phases (``--phases``): the robot starts at
0, 1/3 and 2/3 of the time to the world's first jump. Settings are terciles of the
cylinders' number times their mean speed; they are the published easy, medium and hard
worlds.

``crossing.py`` says which episodes can be crossed with the motion known in advance.
Where that is not all, the share of them with success is ``metric_possible``. The start
lies outside the field; how often waiting there would have touched nothing is printed.
A kinematic simulation, not Gazebo.

    python comparisons/dynabarn.py --data PATH --worlds 0:60 --out out/dynabarn
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from crossing import KINDS, judge
from qpavoid.errors import DataError
from qpavoid.lab.planning.search import length
from qpavoid.lab.simulation.parts import make_robot
from qpavoid.lab.simulation.schema import RobotModel
from qpavoid.lab.worlds.dynabarn import (
    PHASES,
    DynaBarn,
    DynaBarnWorld,
    find_worlds,
    read_world,
    world_numbers,
)
from studies import (
    Row,
    Scenes,
    chosen_methods,
    count,
    main_of,
    make_parser,
    numbers,
    run_study,
)

METHODS = "alone,stop,eq5,eq7,qp,qp-ahead,qp-ahead+guide,vfh,dwa,orca,c3bf,mppi"


def motion_measure(world: DynaBarnWorld) -> float:
    """Return the sum of the cylinders' mean speeds, m/s: their number times their pace.

    The world is one whose jumps are reversed, so that all are seen equally long.
    """
    lengths = [
        length(cylinder.positions) / cylinder.times[-1] for cylinder in world.cylinders
    ]
    return float(np.sum(lengths))


def terciles(worlds: Sequence[int], data: str | None) -> dict[str, list[int]]:
    """Return worlds by difficulty; a tercile is one of all published worlds."""
    file = find_worlds(data)
    measures = {
        n: motion_measure(read_world(file, n, "reverse")) for n in world_numbers(file)
    }
    missing = sorted(set(worlds) - measures.keys())
    if missing:
        raise DataError(f"{file} has no world {', '.join(map(str, missing))}")
    low, high = np.quantile(list(measures.values()), [1 / 3, 2 / 3]).tolist()
    names = (f"below {low:.0f} m/s", f"to {high:.0f} m/s", f"above {high:.0f} m/s")
    groups: dict[str, list[int]] = {name: [] for name in names}
    for n in worlds:
        groups[names[(measures[n] > low) + (measures[n] > high)]].append(n)
    return {name: group for name, group in groups.items() if group}


def verdict(source: DynaBarn, seed: int) -> Row:
    """Return what :func:`crossing.judge` says of one episode."""
    robot = make_robot(RobotModel.model_validate(source.sample(seed)["robot"]))
    kind, found, safe = judge(*source.episode(seed), robot)
    return {"crossing": kind, "crossing_s": found, "waiting_safe": safe}


def summary(setting: str, verdicts: Sequence[Row]) -> str:
    """Return how many episodes of a setting can be crossed, in a line."""
    kinds = Counter(row["crossing"] for row in verdicts)
    counts = (f"{kinds[kind]} {kind}" for kind in KINDS)
    safe = sum(row["waiting_safe"] for row in verdicts)
    return f"{setting}: crossing {', '.join(counts)}; waiting safe in {safe}"


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/dynabarn")
    parser.add_argument("--worlds", type=numbers, default="0:60", metavar="A:B:STEP")
    parser.add_argument("--speed", type=float, default=1.0, metavar="MPS")
    parser.add_argument("--jumps", choices=("reverse", "end"), default="reverse")
    parser.add_argument("--phases", type=count, default=PHASES, metavar="N")
    options = parser.parse_args()
    if not options.speed > 0.0:
        parser.error("--speed wants more than 0")

    def study() -> list[Row]:
        chosen_methods(options)  # a wrong one is said before minutes of search
        data = None if options.data is None else str(options.data)
        phases = options.phases
        source = DynaBarn(options.jumps, options.speed, data, phases)
        groups = terciles(options.worlds, data)
        settings = {
            seed: name
            for name, group in groups.items()
            for world in group
            for seed in range(phases * world, phases * (world + 1))
        }
        seeds = {
            name: [seed for seed in settings if settings[seed] == name]
            for name in dict.fromkeys(settings.values())
        }
        from joblib import Parallel, delayed  # of the extra study

        judged = Parallel(options.workers or -1)(
            delayed(verdict)(source, seed) for seed in settings
        )
        verdicts = dict(zip(settings, judged, strict=True))
        kinds = {known["crossing"] for known in verdicts.values()}

        def add(row: Row) -> Row:
            known: Row = verdicts[row["seed"]]
            if kinds == {"possible"}:
                return known
            possible = known["crossing"] == "possible"
            won = float(row["success"]) if possible else None
            return {"metric_possible": won, **known}

        rows = run_study(
            "DynaBARN worlds, kinematic unicycle",
            [Scenes(source, some, name) for name, some in seeds.items()],
            options,
            add,
        )
        for name, some in seeds.items():
            print(summary(name, [verdicts[seed] for seed in some]))
        return rows

    main_of(study, parser)


if __name__ == "__main__":
    main()
