"""Closed loop of a guide: noisy poses, motors that stick, tasks that are sent again."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import qpavoid as qp
from qpavoid.model.kinematics import arc

FREE = qp.Obstacles()
HOME = (0.0, 0.0, 0.0)
LIMITS = qp.Limits(-0.3, 0.6, -1.2, 1.2, 1.0, 2.5)


def cart(**limits):
    outline = qp.Footprint.rectangle(0.6, 0.45)
    return qp.Robot("cart", outline, replace(LIMITS, **limits))


class Row(NamedTuple):
    """One step: time, true pose after it, decision, twist driven."""

    time: float
    pose: tuple
    step: tuple
    moved: tuple

    @property
    def command(self):
        return self.step[:2]

    @property
    def blocked(self):
        return self.step.status is qp.Status.BLOCKED


def loop(guide, seconds, world=FREE, *, start=HOME, until=lambda pose: False, **how):
    """Rows of a loop among obstacles, of a time if ``world`` is a function.

    Before a step ``send(guide, k, poses)`` is called. ``noise(k)`` is added to the
    pose, ``motors(twist)`` is driven, and told ``late`` steps later.
    """
    dt, poses, rows = guide.settings.dt, [start], []
    send, motors = how.get("send"), how.get("motors", lambda twist: twist)
    late = [(0.0, 0.0)] * how.get("late", 0)
    for k in range(round(seconds / dt)):
        if send:
            send(guide, k, poses)
        at = tuple(np.add(poses[-1], how["noise"](k))) if "noise" in how else poses[-1]
        seen = world(k * dt) if callable(world) else world
        told = {"driven": late[0]} if late else {}
        step = guide.step(at, seen.seen_from(poses[-1]), **told)
        assert step.status is not qp.Status.INVALID, step.problem
        moved = motors(step[:2])
        late = [*late[1:], moved] if late else []
        poses.append(arc(*poses[-1], *moved, dt))
        rows.append(Row(k * dt, poses[-1], step, moved))
        if until(poses[-1]):
            break
    return rows
