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

FOREVER = 1e9
"""s, or m"""


@compiled
def extreme(wish: Wish, number: int) -> tuple[float, float]:
    """Return one of the nine twists of which either part is least, 0 or greatest."""
    v = (wish[0], 0.0, wish[1])[number // 3]
    return v, (wish[2], 0.0, wish[3])[number % 3]


@compiled
def plan_room(
    scene: Scene, middle: int, v: float, omega: float, wanted: float, where: int
) -> tuple[float, int, int]:
    """Return the room of a plan that has been driven up to tick ``middle``.

    Exact where it is above ``wanted``, else ``wanted``; the group that keeps it from
    more, and a body, −1 where it is above.
    """
    edges, robot, settings, bodies, groups, poses = scene
    tick, n = settings[0].tick, poses.shape[0] - 1
    drive(robot, tick, middle, n, v, omega, poses)
    _, where, body, _ = least_room(
        edges, robot, tick, bodies, groups, poses, middle, n, wanted, True, where
    )
    if body >= 0:
        return wanted, where, body
    room, where, _, _ = least_room(
        edges, robot, tick, bodies, groups, poses, 0, middle, FOREVER, False, where
    )
    room, where, _, _ = least_room(
        edges, robot, tick, bodies, groups, poses, middle, n, room, False, where
    )
    return room, where, -1


@compiled
def best_plan(scene: Scene, wish: Wish, plan: Array, turn: int) -> float:
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
    most, where, _ = plan_room(scene, middle, plan[3], plan[4], -FOREVER, 0)
    wanted = most + BETTER
    for i in range(9):
        v, omega = extreme(wish, i)
        room, where, body = plan_room(scene, 0, v, omega, wanted, where)
        if body < 0:
            plan[0], plan[1], plan[2], plan[3], plan[4] = v, omega, FOREVER, v, omega
            most, wanted = room, room + BETTER
    for i in range(3 * turn - 3 if turn > 0 else 0, 3 * turn if turn > 0 else 9):
        v, omega = extreme(wish, i)
        drive(robot, tick, 0, n, v, omega, poses)
        broken = n + 1
        for switch in SWITCHES:
            middle = min(round(switch / tick), n)
            if middle >= broken:
                continue
            _, where, body, broken = least_room(
                edges, robot, tick, bodies, groups, poses, 0, middle, wanted, True, where
            )
            if body >= 0:
                continue
            broken = n + 1
            for j in range(9):
                if i == j:
                    continue
                v2, omega2 = extreme(wish, j)
                room, where, body = plan_room(scene, middle, v2, omega2, wanted, where)
                if body < 0:
                    plan[0], plan[1], plan[2] = v, omega, switch
                    plan[3], plan[4] = v2, omega2
                    most, wanted = room, room + BETTER
    return most
