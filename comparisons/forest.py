"""Forests: how many random static scenes does each method cross to the goal?

Scenes of discs and walls with a straight reference through them, each passable without
backing up (``qpavoid/lab/worlds/forest.py`` says how that is checked). A run succeeds
if the goal pose is reached within 3 × the time of the free reference, without contact.
``metric_time_ratio`` is the time taken over that of the free reference.

    python comparisons/forest.py --count 1000 --seed 5 --out out/forest
"""

from qpavoid.lab.worlds.forest import PATIENCE, Forest
from studies import Row, Scenes, main_of, make_parser, run_study

METHODS = "eq5,eq7,qp,qp-ahead,qp-ahead+guide"


def time_ratio(row: Row) -> Row:
    """Return the time of a success over that of the free reference."""
    if not row["success"]:
        return {"metric_time_ratio": None}
    return {"metric_time_ratio": PATIENCE * row["arrived_s"] / row["duration_s"]}


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/forest")
    parser.add_argument("--count", type=int, default=1000, metavar="N")
    parser.add_argument(
        "--waiting", action="store_true", help="the reference waits for the robot"
    )
    options = parser.parse_args()
    if options.count < 1 or options.seed < 0:
        parser.error("--count wants 1 or more, --seed 0 or more")

    def study() -> list[Row]:
        source, setting = Forest(options.seed), "waiting" if options.waiting else ""
        changes = {"tracking.waiting": options.waiting}
        scenes = [Scenes(source, range(options.count), setting, changes)]
        return run_study("Forests", scenes, options, time_ratio)

    main_of(study, parser)


if __name__ == "__main__":
    main()
