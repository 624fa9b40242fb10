"""Fleets: every robot runs the same method, and sees the others as they move.

The scenarios of ``configs/fleet``; the seed draws or shifts the starts. A run succeeds
if all robots arrive and none touches anything. Its row has the worst of its robots:
when the last arrived, the least room, the greatest jerk; a contact counts as begun in
motion if one of them began it so. Solve times are of all.

    python comparisons/fleet.py --scenes swap,circle_16 --seeds 0:10
"""

from qpavoid.lab.simulation.config import builtin_configs
from qpavoid.lab.study.sweep.sources import scenario_file
from studies import Row, Scenes, main_of, make_parser, numbers, run_study

METHODS = "qp-ahead+guide,qp-ahead,qp,eq5,orca"

SCENES = [name[6:] for name in builtin_configs() if name.startswith("fleet/")]


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/fleet")
    parser.add_argument("--scenes", default=",".join(SCENES), metavar="A,B,…")
    parser.add_argument("--seeds", type=numbers, default=range(10), metavar="A:B")
    options = parser.parse_args()
    names = options.scenes.split(",")
    if unknown := set(names) - set(SCENES):
        parser.error(f"unknown scenes: {', '.join(sorted(unknown))}")

    def study() -> list[Row]:
        scenes = [
            Scenes(scenario_file(f"fleet/{name}"), options.seeds, name)
            for name in names
        ]
        return run_study("Fleets", scenes, options)

    main_of(study, parser)


if __name__ == "__main__":
    main()
