"""Maps of buildings: A* before every local method, past what no map shows.

Nav2's depot, warehouse and sandbox maps (or any of map_server in the data folder). A
Jackal (v ≤ 0.8 m/s; where it finds no way, a TurtleBot3 Waffle, v ≤ 0.26 m/s) knows the
walls and sees 6 m far; two discs lie near its way, three elsewhere, and three people
walk there who do not yield, so that a contact may be their doing: those while it stands
are counted apart. A run succeeds if it is within 0.3 m of the goal in 4 times the time
that the way takes at full speed, without contact.

    python comparisons/maps.py --data PATH --maps depot,warehouse --tasks 0:20
"""

from qpavoid.lab.worlds.maps import Maps
from studies import Scenes, main_of, make_parser, numbers, run_study

METHODS = (
    "astar,dijkstra,astar+stop,astar+eq5,astar+eq7,astar+qp,astar+qp-ahead,"
    "astar+qp-ahead+guide"
)


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/maps")
    parser.add_argument("--maps", default="depot,warehouse,tb3_sandbox", metavar="A,B")
    parser.add_argument("--tasks", type=numbers, default="0:20", metavar="A:B:STEP")
    options = parser.parse_args()
    data = None if options.data is None else str(options.data)
    tasks = [1000 * options.seed + k for k in options.tasks]

    def study() -> None:
        places = options.maps.split(",")
        scenes = [Scenes(Maps(place, data), tasks, place) for place in places]
        run_study("Maps: A* before every local method", scenes, options)

    main_of(study, parser)


if __name__ == "__main__":
    main()
