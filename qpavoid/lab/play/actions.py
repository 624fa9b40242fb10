"""What the messages of clients do to a session, and what clients are told of it."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.errors import InvalidInputError
from qpavoid.lab.play import messages
from qpavoid.lab.play.hand import Disc
from qpavoid.lab.play.session import Session
from qpavoid.lab.simulation.methods import OURS, REGISTRY
from qpavoid.model.contacts import clearance_of
from qpavoid.model.obstacles import Obstacles
from qpavoid.settings import declared

SECTIONS = ("radius", "filter", "ahead", "margins", "repulsion")
"""Of a scenario file: what can be set while the robot drives."""

MOST_DISCS = 100
"""More cannot be added."""


def act(session: Session, message: messages.Message) -> bool:
    """Do what a message says; return whether clients need a new :func:`description`.

    Raises:
        QPAvoidError: It cannot be done; the session goes on as it was.
    """
    match message:
        case messages.Drag():
            place = message.x_m, message.y_m
            _find(session, message.disc).pull(place, session.time)
            return False
        case messages.Release():
            _find(session, message.disc).let_go()
            return False
        case messages.Add():
            _add(session, message)
        case messages.Remove():
            _not_recorded(session, "a disc can be removed")
            session.remove(_find(session, message.disc))
        case messages.Choose():
            session.change(controller=message.name)
        case messages.Set():
            _set(session, message)
        case messages.Run():
            session.running = message.on
        case messages.Restart():
            session.end_recording()
            session.restart()
        case messages.FollowReference():
            _not_recorded(session, "the robot can be parked or sent on its way")
            (session.drive if message.on else session.park)()
        case messages.Record():
            (session.record if message.on else session.end_recording)()
    return True


def _find(session: Session, number: int) -> Disc:
    for disc in session.discs:
        if disc.number == number:
            return disc
    raise InvalidInputError(f"there is no disc {number}")


def _not_recorded(session: Session, what: str) -> None:
    if session.recording:
        raise InvalidInputError(f"{what} when the recording is over")


def _add(session: Session, message: messages.Add) -> None:
    """Put a new disc into the world, not onto the robot."""
    _not_recorded(session, "a disc can be added")
    if len(session.discs) >= MOST_DISCS:
        raise InvalidInputError(f"there are {len(session.discs)} discs; no more fit")
    place, footprint = (message.x_m, message.y_m), session.scenario.robot.footprint
    disc = np.array([[*place, message.radius_m]])
    alone = Obstacles(discs=disc).seen_from(session.pose)
    if clearance_of(footprint, alone.arrays) <= 0.0:
        raise InvalidInputError("a disc cannot be put onto the robot")
    session.add(place, message.radius_m)


def _set(session: Session, message: messages.Set) -> None:
    """Change a setting; see :data:`SECTIONS`."""
    if message.section not in SECTIONS:
        raise InvalidInputError(f"{message.section} cannot be set while driving")
    value = math.inf if message.value == "inf" else message.value
    session.change(settings={f"{message.section}.{message.key}": value})


def description(session: Session) -> dict[str, Any]:
    """Return what changes seldom: world, path, limits, controllers and settings."""
    scenario = session.scenario
    limits = scenario.robot.limits
    times = np.linspace(0.0, session.duration, 400)
    path = scenario.path.sample(times)[:, :2]
    return {
        "kind": "world",
        "title": scenario.title,
        "robot": scenario.robot.name,
        "world": {
            "vertices": scenario.robot.footprint.vertices.tolist(),
            "points": scenario.world.points.tolist(),
            "walls": scenario.world.walls.tolist(),
            "path": np.round(path, 3).tolist(),
        },
        "limits": {
            "v": [limits.v_min, limits.v_max],
            "w": [limits.omega_min, limits.omega_max],
        },
        "controllers": {name: REGISTRY[name].description for name in OURS},
        "controller": session.controller,
        "settings": [
            {"section": section, "key": key, "value": value, "choices": choices}
            for section in SECTIONS
            for key, value, choices in _fields(scenario.settings, section)
        ],
        "running": session.running,
        "driving": session.driving,
        "recording": session.recording,
        "recorded": session.recorded,
        "dt": scenario.dt,
    }


def _fields(
    settings: AvoidanceSettings, section: str
) -> Iterator[tuple[str, Any, tuple[str, ...]]]:
    """Yield key, value and choices, if it has any, of everything that can be set."""
    part = getattr(settings, section, settings)
    for setting in declared(type(part)):
        values = setting.of(getattr(part, setting.name))
        for key, value in zip(setting.keys, values, strict=False):
            yield key, None if value == math.inf else value, setting.choices
