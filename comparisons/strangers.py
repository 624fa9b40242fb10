"""Among strangers: six discs at random velocities, a goal behind them, 30 s.

The scenes of ``configs/demo/strangers.toml``, drawn from the seeds S to S + N − 1. A
run succeeds if the goal pose is reached in time, without contact. Whoever stands still
may be run into: contacts while standing are counted apart. ``--plant mujoco`` has
wheels, those of a MiR100, see ``plants.py``.

    python comparisons/strangers.py --scenes 150 --out out/strangers
"""

from plants import add_plant, changes_of
from qpavoid.lab.study.sweep.sources import scenario_file
from studies import Row, Scenes, main_of, make_parser, run_study

METHODS = "eq5,eq7,qp,qp-ahead,qp-ahead+guide"


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/strangers")
    parser.add_argument("--scenes", type=int, default=150, metavar="N")
    add_plant(parser)
    options = parser.parse_args()
    if options.scenes < 1 or options.seed < 0:
        parser.error("--scenes wants 1 or more, --seed 0 or more")
    seeds = range(options.seed, options.seed + options.scenes)

    def study() -> list[Row]:
        changes = changes_of(options.plant, "differential")
        setting = options.plant if changes else ""
        scenes = [Scenes(scenario_file("demo/strangers"), seeds, setting, changes)]
        return run_study("Among strangers", scenes, options)

    main_of(study, parser)


if __name__ == "__main__":
    main()
