"""Where the scenes of a study come from: strict items, and what they make."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union

from pydantic import Discriminator, Field, Tag

from qpavoid.errors import ConfigError
from qpavoid.files import below
from qpavoid.lab.scenario.config import (
    changed,
    config_folder,
    find_config,
    read_document,
)
from qpavoid.lab.scenario.keys import Natural, Place, Strict, tagged
from qpavoid.lab.scenario.plug_ins import load_object
from qpavoid.lab.scenario.scenario import make_scenario
from qpavoid.lab.worlds.barn import BarnWorlds
from qpavoid.lab.worlds.crowd import Crowd
from qpavoid.lab.worlds.dynabarn import DynaBarn
from qpavoid.lab.worlds.forest import Forest
from qpavoid.lab.worlds.maps import Maps
from qpavoid.lab.worlds.scenes import ScenarioFile, Sensed
from qpavoid.lab.worlds.source import Source, data_roots

MOST_SEEDS = 1_000_000

SPAN = Field(pattern=r"^\d{1,18}:\d{1,18}(:[1-9]\d{0,17})?$")
Seeds = Annotated[
    Annotated[str, SPAN, Tag("str")] | Annotated[list[Natural], Tag("list")],
    Discriminator(lambda told: "list" if isinstance(told, list) else "str"),
]


class Seeded(Strict):
    """Where scenes come from.

    Attributes:
        seeds: Instead of those of the study.
    """

    seeds: Seeds | None = None


class ScenarioItem(Seeded):
    """A scenario; one with random obstacles runs for every seed.

    Attributes:
        config: Scenario file, from the study's folder, or a shipped name.
    """

    config: str


SOURCES: dict[str, type[Any]] = {
    "forest": Forest,
    "barn": BarnWorlds,
    "crowd": Crowd,
    "map": Maps,
    "dynabarn": DynaBarn,
}
"""Sources by the kind of their item, whose keys are their settings."""


class SensedItem(Seeded):
    """Forests or strangers as a LiDAR sees them; the seeds draw scene and noise.

    Attributes:
        kind: By a LiDAR.
        scene: What is sensed.
        family: Seed of the family of forests.
        perception: Static and moving obstacles are made of the scans; else points.
    """

    kind: Literal["sensed"]
    scene: Literal["forest", "strangers"]
    family: Natural = 2
    perception: bool = True


class OwnItem(Seeded):
    """A source of one's own, ``module:Name``, called with the options.

    Attributes:
        kind: A source of one's own.
        source: What is called.
        options: With what.
    """

    kind: Literal["own"]
    source: Place
    options: dict[str, str | bool | int | float] = Field(default_factory=dict)


DRAWN = [tagged(kind, source, Seeded) for kind, source in SOURCES.items()]
AnyItem: Any = Union[(*DRAWN, SensedItem, OwnItem)]

GeneratorItem: Any = Annotated[AnyItem, Field(discriminator="kind")]


class SceneItems(Strict):
    """Where scenes come from.

    Attributes:
        title: What the report calls it.
        seeds: ``first:end:step`` (the end is not in it) or a list; of scenes that draw.
        scenarios: Scenario files.
        generators: What draws scenes.
    """

    title: str
    seeds: Seeds = "0:1"
    scenarios: list[ScenarioItem] = Field(default_factory=list)
    generators: list[GeneratorItem] = Field(default_factory=list)


def controllers_in(source: Source) -> list[str]:
    """Return the methods that a scenario file gives to robots of its own."""
    known = isinstance(source, ScenarioFile)
    robots = source.sample().get("robots", []) if known else []
    return [robot["controller"] for robot in robots if "controller" in robot]


def make_sources(
    model: SceneItems, path: Path, data: str | None
) -> list[tuple[Source, Sequence[int | None]]]:
    """Return where the scenes come from, each with its seeds."""
    if not model.scenarios and not model.generators:
        raise ConfigError([f"{path}: scenarios: there are none, and no generators"])
    files = [(i, scenario_file(i.config, path.parent)) for i in model.scenarios]
    for _, file in files:
        below(Path(file.path), path.parent, config_folder())
    made = [(item, _generator(item, path, data)) for item in model.generators]
    sources: list[tuple[Source, Sequence[int | None]]] = []
    for item, source in (*files, *made):
        told = model.seeds if item.seeds is None else item.seeds
        seeds: Sequence[int | None] = (
            range(*map(int, told.split(":"))) if isinstance(told, str) else told
        )
        fixed = isinstance(source, ScenarioFile) and not source.is_drawn
        if fixed and item.seeds is None:
            seeds = [None]
        if not 0 < len(seeds) <= MOST_SEEDS:
            many = f"{len(seeds):,} (at most {MOST_SEEDS:,})" if seeds else "none"
            raise ConfigError([f"{path}: seeds: there are {many} of {source.name}"])
        sources.append((source, seeds))
    return sources


def _generator(item: Any, path: Path, data: str | None) -> Source:
    if isinstance(item, OwnItem):
        try:
            own: Source = load_object(item.source)(**item.options)
        except TypeError as error:
            raise ConfigError([f"{item.source}: {error}"]) from None
        return own
    if isinstance(item, SensedItem):
        forest = item.scene == "forest"
        known = Forest(item.family) if forest else scenario_file("demo/strangers")
        return Sensed(known, item.perception)
    made: Source = item.make(data=data)
    if isinstance(made, Maps):
        below(Path(made.path), path.parent, *data_roots(data))
    return made


def check_scene(
    source: Source,
    changes: Mapping[str, Any],
    path: Path,
    data: str | None,
    seed: int | None = None,
) -> None:
    """Build the scenario with these settings, so that a mistake is said at once.

    Args:
        source: Of the scene.
        changes: Settings by dotted key.
        path: Of the study file.
        data: Folder of published data sets.
        seed: Of the scene.
    """
    file = Path(getattr(source, "path", path))
    try:
        make_scenario(changed(source.sample(seed), changes), source.name, file, data)
    except ConfigError as error:
        where = f"{path}: {source.name} with {json.dumps(changes)}"
        raise ConfigError(f"{where}: {line}" for line in error.problems) from None


def scenario_file(config: str, beside: Path = Path()) -> ScenarioFile:
    """Return a scenario: a file beside the study, any file, or a shipped name."""
    near = beside / config
    name, path = find_config(near if os.path.isfile(near) else config)
    document, _ = read_document(path)
    return ScenarioFile(name, str(path.resolve()), json.dumps(document, default=str))
