"""Where the scenes of an environment come from."""

import os
from collections.abc import Sequence
from typing import TypeAlias

from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.lab.study.sweep.job import find_scene
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.worlds.scenes import ScenarioFile
from qpavoid.lab.worlds.source import Source

Place: TypeAlias = str | os.PathLike[str] | Source
"""A scenario's file or shipped name, as ``"demo/strangers"``; or a generator of
:mod:`qpavoid.lab.worlds`, as ``Forest(2)``. Published data: ``QPAVOID_DATA``."""


class Scenes(dict[int | None, Scenario]):
    """Scenes by their seeds; another seed is an InvalidInputError."""

    def __missing__(self, seed: int | None) -> Scenario:
        raise InvalidInputError(f"scene {seed!r} is none of the seeds")


def find_scenes(source: Place, seeds: Sequence[int] | None) -> Scenes:
    """Return the scenes of these seeds; else the first 100, or all there is by a file.

    Raises:
        QPAvoidError: No such scenario, or something in it is wrong.
        InvalidInputError: No seeds, no such scene, several robots, other robots in
            other scenes, a plant or a localisation.
    """
    if isinstance(source, str | os.PathLike):
        source = scenario_file(os.fspath(source))
    fixed = isinstance(source, ScenarioFile) and not source.is_drawn
    scenes = Scenes()
    for seed in seeds if seeds is not None else [None] if fixed else range(100):
        try:
            scene = find_scene(source, seed, "{}", None)
        except IndexError:
            raise InvalidInputError(
                f"{source.name}: there is no scene {seed}"
            ) from None
        scenes[seed] = scene
        if scene.robots:
            raise InvalidInputError(f"{source.name} has several robots")
        if scene.plant or scene.localisation:
            raise InvalidInputError(f"{source.name}: no [plant] or [localisation] here")
    if len({*map(_kind, scenes.values())}) != 1:
        what = "robots or settings differ from scene to scene" if scenes else "no seeds"
        raise InvalidInputError(f"{source.name}: {what}")
    return scenes


def _kind(one: Scenario) -> bytes:
    arrays = one.robot.footprint.edges, one.robot.limit_vector, one.settings.record()
    return b"".join(array.tobytes() for array in arrays)
