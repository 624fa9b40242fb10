"""State of the guide's stage, an array: clock, mark, and the path it follows.

All poses are in the robot frame, m, m, rad, and move with the robot.
"""

import math
from enum import StrEnum

from qpavoid.compiled import compiled, compiled_once
from qpavoid.guide.room import AMPLE, Field, pose_room
from qpavoid.guide.way import ACTIONS, ARC_LENGTH, MOST_ACTIONS, TURN
from qpavoid.model.kinematics import arc
from qpavoid.tracking.kanayama import kanayama, tracking_error
from qpavoid.types import Array, Twist


class Progress(StrEnum):
    """Mode of the stage."""

    CLEAR = "clear"
    SEARCHING = "searching"
    DETOUR = "detour"
    BACKING = "backing"
    BLOCKED = "blocked"

    @property
    def sentence(self) -> str:
        """Description of the mode, one sentence."""
        return SENTENCES[self]


SENTENCES = {
    Progress.CLEAR: "The robot makes progress; the desired twist is unchanged.",
    Progress.SEARCHING: "The robot is stalled and holds; no path has been found yet.",
    Progress.DETOUR: "A path around the obstacles is followed.",
    Progress.BACKING: "The robot is wedged in and backs out.",
    Progress.BLOCKED: "No path was found; the robot holds and needs a new plan.",
}
PROGRESS = tuple(Progress)
"""All modes, by the number that :func:`qpavoid.guide.stage.guide_step` returns."""

CLEAR, SEARCHING, DETOUR, BACKING, NO_PATH = range(5)

(
    STAGE_MODE,  # CLEAR, SEARCHING, DETOUR or BACKING
    STILL,  # s since the robot was last ``progress`` away from the mark
    MARK,  # x, y, turn of the mark in the robot frame, m, m, rad
    LOOKED,  # s since the obstacles were last checked
    LEAD,  # x, y, turn of the pose that the robot follows, m, m, rad
    ACTION,  # action of the path that this pose is in
    ACTION_SHARE,  # of that action done, 0 to 1
    COUNT,  # of actions
    FAILURES,  # paths on which the robot got stuck since a search last failed
    BACKED,  # s of backing out
    BACKS,  # number of times backed out since last clear
    BEGUN,  # s since the first search, or the last path that failed
    CHOICE_DUE,  # control steps until the candidates are scored again
    CHOSEN,  # the candidate that is driven
    WAY,  # the first action
) = (0, 1, 2, 5, 6, 9, 10, 11, 12, 13, 14, 15, 16, 17, 22)
STATE_SIZE = WAY + MOST_ACTIONS

BACK_TIME, MOST_BACKS = 3.0, 2
"""s of backing out, and number of times."""

TURNED = 0.5
"""rad; turn on a detour that counts as progress."""

LEASH, LEASH_TURN = 0.3, 0.5
"""m and rad; lag of the robot behind the followed pose at which that stops."""

DONE = 1.0 - 1e-9
"""Share of an action from which on it is done; tolerates rounding of steps."""

GAINS = 1.5, 6.0, 3.0
"""k_x, k_y, k_γ of Eq. 6 on a detour."""


@compiled
def set_mark(state: Array) -> None:
    """Set the mark to the robot's pose."""
    state[MARK], state[MARK + 1], state[MARK + 2] = 0.0, 0.0, 0.0


@compiled_once
def note_motion(state: Array, progress: float, driven: Twist, dt: float) -> None:
    """Update clocks and poses after a step in which a twist was driven."""
    pose = arc(0.0, 0.0, 0.0, driven[0], driven[1], dt)
    for k in (MARK, LEAD):
        known = (state[k], state[k + 1], state[k + 2])
        state[k], state[k + 1], state[k + 2] = tracking_error(pose, known)
    state[STILL] += dt
    state[LOOKED] += dt
    state[BEGUN] += dt
    far = state[MARK] ** 2 + state[MARK + 1] ** 2 > progress**2
    if far or (state[STAGE_MODE] == DETOUR and abs(state[MARK + 2]) > TURNED):
        state[STILL] = 0.0
        set_mark(state)


@compiled_once
def clear(state: Array) -> None:
    """Resume tracking, with the clock at zero and the mark at the robot's pose."""
    state[STAGE_MODE], state[STILL] = CLEAR, 0.0
    set_mark(state)


@compiled_once
def has_way(state: Array) -> bool:
    """Return whether the remaining actions are valid."""
    place, count = state[ACTION], state[COUNT]
    if not (0.0 <= place and 0.0 <= count <= MOST_ACTIONS):
        return False
    for k in range(int(count)):
        if not 0.0 <= state[WAY + k] < len(ACTIONS):
            return False
    return True


@compiled_once
def is_done(state: Array) -> bool:
    """Return whether the path has been followed to its end."""
    return bool(state[ACTION] >= state[COUNT])


@compiled_once
def back_out(state: Array, speed: float) -> bool:
    """Begin to back out unless done too often; return whether it begins."""
    if state[BACKS] >= MOST_BACKS or speed == 0.0:
        return False
    state[STAGE_MODE], state[BACKED] = BACKING, 0.0
    state[BACKS] += 1.0
    return True


@compiled_once
def way_room(state: Array, field: Field) -> float:
    """Return the least margin on the rest of the path, m."""
    x, y, turn = state[LEAD], state[LEAD + 1], state[LEAD + 2]
    least, share = AMPLE, 1.0 - state[ACTION_SHARE]
    for k in range(int(state[ACTION]), int(state[COUNT])):
        drive, bend = ACTIONS[int(state[WAY + k])]
        x, y, turn = arc(x, y, turn, drive * ARC_LENGTH, bend * TURN, share)
        least = min(least, pose_room(field, x, y, turn))
        share = 1.0
    return least


@compiled_once
def follow(state: Array, speed: float, turn_rate: float, dt: float) -> Twist:
    """Return the twist that follows the path; the followed pose waits for the robot."""
    drive, bend = ACTIONS[int(state[WAY + int(state[ACTION])])]
    time = max(abs(drive) * ARC_LENGTH / speed, abs(bend) * TURN / turn_rate)
    v, omega = drive * ARC_LENGTH / time, bend * TURN / time
    away = math.sqrt(state[LEAD] ** 2 + state[LEAD + 1] ** 2) / LEASH
    away = max(away, abs(state[LEAD + 2]) / LEASH_TURN)
    pace = min(max(2.0 - 2.0 * away, 0.0), 1.0)
    step = min(pace * dt, time * (1.0 - state[ACTION_SHARE]))
    x, y, turn = arc(state[LEAD], state[LEAD + 1], state[LEAD + 2], v, omega, step)
    state[LEAD], state[LEAD + 1], state[LEAD + 2] = x, y, turn
    state[ACTION_SHARE] += step / time
    if state[ACTION_SHARE] >= DONE:
        state[ACTION_SHARE] = 0.0
        state[ACTION] += 1.0
    return kanayama((x, y, turn), (pace * v, pace * omega), GAINS)
