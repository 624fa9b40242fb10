"""Maps of buildings: A* before every local method, past what no map shows.

Nav2's depot, warehouse and sandbox maps, or any of map_server (``--map FILE``). A
Jackal (v ≤ 0.8 m/s; where it finds no way, a TurtleBot3 Waffle, v ≤ 0.26 m/s) knows the
walls and sees 6 m far; two discs lie near its way, three elsewhere, and three people
walk there who do not yield, so that a contact may be their doing: those while it stands
are counted apart. A run succeeds if it is within 0.3 m of the goal in 4 times the time
that the way takes at full speed, without contact. Which tasks a map has hangs on the
name of its file.

    python comparisons/maps.py --data PATH --maps depot,warehouse --tasks 0:20
    python comparisons/maps.py --map office.yaml --tasks 0:20
"""

import sys
from pathlib import Path

from qpavoid.errors import DataError, QPAvoidError
from qpavoid.lab.worlds.map_server import unknown_keys
from qpavoid.lab.worlds.maps import Maps
from studies import Row, Scenes, main_of, make_parser, numbers, run_study

METHODS = (
    "astar,dijkstra,astar+stop,astar+eq5,astar+eq7,astar+qp,astar+qp-ahead,"
    "astar+qp-ahead+guide"
)


def check_map(scene: Scenes) -> None:
    """Raise DataError, with its name, if a map has not even the first task."""
    try:
        scene.source.sample(scene.seeds[0])
    except QPAvoidError as error:
        raise DataError(f"{scene.setting}: {error}") from None


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/maps")
    parser.add_argument("--maps", metavar="A,B", help="of the data folder")
    parser.add_argument("--map", type=Path, nargs="+", default=[], metavar="FILE.yaml")
    parser.add_argument("--tasks", type=numbers, default="0:20", metavar="A:B:STEP")
    options = parser.parse_args()
    data = None if options.data is None else str(options.data)
    tasks = [1000 * options.seed + k for k in options.tasks]
    named = options.maps or ("" if options.map else "depot,warehouse,tb3_sandbox")
    places = {name: name for name in filter(None, named.split(","))}
    places |= {str(file): str(file.resolve()) for file in options.map}

    def study() -> list[Row]:
        for file in options.map:
            for key in unknown_keys(file):
                print(f"{file}: the key {key} is not understood", file=sys.stderr)
        scenes = [Scenes(Maps(to, data), tasks, name) for name, to in places.items()]
        for scene in scenes:
            check_map(scene)
        return run_study("Maps: A* before every local method", scenes, options)

    main_of(study, parser)


if __name__ == "__main__":
    main()
