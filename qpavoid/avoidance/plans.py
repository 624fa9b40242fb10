"""Plans of two twists, by search: for where no constant twist keeps its distance."""

import math

from qpavoid.avoidance.prediction import Scene, drive, least_room
from qpavoid.avoidance.ways import Wish
from qpavoid.compiled import compiled
from qpavoid.model.footprint import Array

SWITCHES = (1.6, 1.1, 0.7, 0.4, 0.2, 0.1)
"""s; when a plan of two twists may go over to its second."""

BETTER = 3e-3
"""m by which another plan must be better to be taken up."""

FINER = 1e-4
"""m by which a plan must be better than another of the same search."""

FOREVER = 1e9
"""s"""


@compiled
def extreme(wish: Wish, number: int) -> tuple[float, float]:
    """Return one of the nine twists of which either part is least, 0 or greatest."""
    v = (wish[0], 0.0, wish[1])[number // 3]
    return v, (wish[2], 0.0, wish[3])[number % 3]


@compiled
def best_plan(scene: Scene, wish: Wish, plan: Array) -> float:
    """Put the plan of two extreme twists with the most room in ``plan``; return its room.

    A plan is v, ω, its time in s, and v, ω after. The one last followed is kept unless
    another is better by :data:`BETTER`. Room in m.
    """
    edges, robot, settings, bodies, groups, poses = scene
    tick, n = settings[0].tick, poses.shape[0] - 1
    for g in range(groups.shape[0]):
        groups[g, 6] = n
    middle = n if plan[2] >= n * tick else math.ceil(plan[2] / tick - 1e-6)
    drive(robot, tick, 0, middle, plan[0], plan[1], poses)
    drive(robot, tick, middle, n, plan[3], plan[4], poses)
    room, _, _ = least_room(
        edges, robot, tick, bodies, groups, poses, 0, middle, FOREVER, False, 0
    )
    most, where, _ = least_room(
        edges, robot, tick, bodies, groups, poses, middle, n, room, False, 0
    )
    wanted = most + BETTER
    for i in range(9):
        v, omega = extreme(wish, i)
        drive(robot, tick, 0, n, v, omega, poses)
        for switch in SWITCHES:
            middle = min(round(switch / tick), n)
            _, where, body = least_room(
                edges, robot, tick, bodies, groups, poses, 0, middle, wanted, True, where
            )
            if body >= 0:
                continue
            for j in range(9):
                if i == j and switch < SWITCHES[0]:
                    continue
                v2, omega2 = extreme(wish, j)
                drive(robot, tick, middle, n, v2, omega2, poses)
                _, where, body = least_room(
                    edges, robot, tick, bodies, groups, poses, middle, n, wanted, True, where
                )
                if body < 0:
                    room, _, _ = least_room(
                        edges, robot, tick, bodies, groups, poses, 0, middle, FOREVER, False, where
                    )
                    most, where, _ = least_room(
                        edges, robot, tick, bodies, groups, poses, middle, n, room, False, where
                    )
                    plan[0], plan[1], plan[2] = v, omega, switch
                    plan[3], plan[4] = v2, omega2
                    wanted = most + FINER
    return most
