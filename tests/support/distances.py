"""Counts the distances that calls of the filter ask for, in plain Python.

Run as a script, since nothing may be compiled in its process. Prints, for every case,
its name, the most distances a body and the most plans of any call.
"""

import math

import numpy as np

import qpavoid.compiled


def plain(function):
    """Leave a function as it is, but for what the compiled ones are asked for."""
    function.py_func = function.call = function
    return function


for kind in ("compiled", "compiled_once", "allocating"):
    setattr(qpavoid.compiled, kind, plain)

from qpavoid.avoidance import (
    advancement,
    judge,
    linearisation,
    lookahead,
    prediction,
    step,
)
from qpavoid.avoidance import plans as plans_of_two
from qpavoid.avoidance.filter import SafetyFilter
from qpavoid.avoidance.settings import AvoidanceSettings, LookAhead
from qpavoid.model.footprint import Footprint
from qpavoid.model.robot import Limits, Robot

made, plans, bodies = [0], [0], [0]
contact, reach = advancement.line_contact, step.bodies_in_reach
roll_out = prediction.roll_out
written = AvoidanceSettings.record
BAR = Footprint.rectangle(0.9, 0.5)
FREE = (-math.inf, math.inf, -math.inf, math.inf)


def counted(*given):
    made[0] += 1
    return contact(*given)


def rolled(*given):
    plans[0] += 1
    return roll_out(*given)


def reached(*given):
    bodies[0] = reach(*given)
    return bodies[0]


def ring(count, radius):
    """Points all round."""
    angle = np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def limits(v, omega, acceleration, angular):
    return Limits(-v, v, -omega, omega, acceleration, angular)


def cases():
    """What was slow or endless once."""
    slow = Robot("slow", BAR, limits(1.0, 1.5, 0.5, 0.02))
    quick = Robot("quick", BAR, limits(1.0, 1.5, 2.0, 2.5))
    yield "turning in a ring", slow, {}, (0.3, 1.5), ring(60, 0.72), {}
    yield "driven at 10,000 rad/s", quick, {"driven": (0.0, 1e4)}, (1.0, 0.0), (), {}
    yield "10 Mrad/s wanted", Robot("free", BAR, Limits(*FREE)), {}, (1.0, 1e7), (), {}
    far = {"discs": [[1.5, 0.0, 0.2]], "disc_velocities": [[-3e7, 0.0]]}
    yield "a disc at 3e7 m/s", quick, far, (1.0, 0.0), ring(8, 0.8), {"passive": True}
    pace = {"discs": [[1.1, 0.0, 0.3]], "disc_velocities": [[0.5, 0.0]]}
    yield "a disc that keeps pace", quick, pace, (0.5, 0.0), (), {}
    wall = {"walls": [[-3.0, 0.4205, 3.0, 0.4205], [-3.0, -0.4205, 3.0, -0.4205]]}
    yield "along walls, grazing", quick, wall, (1.0, 0.0), (), {}


def main():
    advancement.line_contact = linearisation.line_contact = counted
    step.bodies_in_reach = reached
    for module in (judge, lookahead, plans_of_two):
        module.roll_out = rolled
    AvoidanceSettings.record = lambda self: written(self).view(np.recarray)
    ahead = LookAhead(tick=0.1)
    for name, robot, given, wish, points, more in cases():
        safety = SafetyFilter(robot, AvoidanceSettings(dt=0.05, ahead=ahead, **more))
        distances = rollouts = 0
        for _ in range(6):
            made[0] = plans[0] = bodies[0] = 0
            safety.filter(*wish, points=np.reshape(points, (-1, 2)), **given)
            distances = max(distances, round(made[0] / max(bodies[0], 1)))
            rollouts = max(rollouts, plans[0])
        print(f"{name}; {distances}; {rollouts}", flush=True)


main()
