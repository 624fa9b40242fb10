"""A study file: controllers, settings, scenarios and seeds, as strict TOML."""

import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from qpavoid.compiled import PACKAGE, file_stamp, source_stamp
from qpavoid.errors import ConfigError, UnknownNameError
from qpavoid.lab.load import load_object
from qpavoid.lab.simulation.config import (
    changed,
    find_config,
    read_document,
    validated,
)
from qpavoid.lab.simulation.methods import (
    check_methods,
    find_method,
    own_file,
    solver_of,
)
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.simulation.schema_base import Place, Positive, Strict
from qpavoid.lab.study.sweep.job import Job
from qpavoid.lab.worlds.barn import BarnWorlds
from qpavoid.lab.worlds.crowd import Crowd
from qpavoid.lab.worlds.dynabarn import DynaBarn, Restart
from qpavoid.lab.worlds.forest import Forest
from qpavoid.lab.worlds.maps import Maps
from qpavoid.lab.worlds.scenes import ScenarioFile, Sensed
from qpavoid.lab.worlds.source import Source
from qpavoid.qp.solve import find_back_end

Natural = Annotated[int, Field(ge=0)]
Seeds = Annotated[str, Field(pattern=r"^\d+:\d+(:[1-9]\d*)?$")] | list[Natural]
Values = Annotated[list[Any], Field(min_length=1)]
Keep = Literal["none", "failures", "all"]


class Seeded(Strict):
    """Where scenes come from, with seeds of its own or those of the file.

    A study has ``seeds``; a tuning has ``train`` and ``test``, and counts every run as
    ``weight`` runs.
    """

    seeds: Seeds | None = None
    train: Seeds | None = None
    test: Seeds | None = None
    weight: Positive = 1.0


class ScenarioItem(Seeded):
    """A scenario; one with random obstacles runs for every seed."""

    config: str


class ForestItem(Seeded):
    """Forests of discs and walls; the seeds are their numbers."""

    kind: Literal["forest"]
    family: Natural = 2


class BarnItem(Seeded):
    """BARN worlds and rule; the seeds are their numbers."""

    kind: Literal["barn"]
    speed_mps: Positive = 0.5


class CrowdItem(Seeded):
    """Recorded pedestrians, one replaced; the seeds are the numbers of the tasks."""

    kind: Literal["crowd"]
    scene: Literal["eth", "hotel", "zara01", "students03"]


class MapItem(Seeded):
    """Ways through a map; the seeds are the numbers of the tasks."""

    kind: Literal["map"]
    place: str


class DynaBarnItem(Seeded):
    """DynaBARN worlds at three times; the seeds are 3 · world + phase."""

    kind: Literal["dynabarn"]
    jumps: Restart = "reverse"
    speed_mps: Positive = 1.0


class SensedItem(Seeded):
    """Forests or strangers as a LiDAR sees them; the seeds draw scene and noise."""

    kind: Literal["sensed"]
    scene: Literal["forest", "strangers"]
    family: Natural = 2
    tracks: bool = False


class OwnItem(Seeded):
    """A source of one's own, ``module:Name``, called with the options."""

    kind: Literal["own"]
    source: Place
    options: dict[str, str | bool | int | float] = Field(default_factory=dict)


AnyItem = (
    ForestItem | BarnItem | CrowdItem | DynaBarnItem | SensedItem | MapItem | OwnItem
)
GeneratorItem = Annotated[AnyItem, Field(discriminator="kind")]


class SceneItems(Strict):
    """Where scenes come from."""

    title: str
    scenarios: list[ScenarioItem] = Field(default_factory=list)
    generators: list[GeneratorItem] = Field(default_factory=list)


class StudyModel(SceneItems):
    """A whole study file."""

    controllers: Annotated[list[str], Field(min_length=1)]
    seeds: Seeds = "0:1"
    trajectories: Keep = "none"
    settings: dict[str, Values] = Field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """A grid of runs.

    Attributes:
        title: What the report calls it.
        text: The study file.
        controllers: Name and back end of each.
        sources: Where scenarios come from, each with its seeds.
        variations: Settings by dotted key, one mapping for each point of their grid.
        trajectories: Whose logs are kept: of no run, of failures, or of all.
        data: Folder of published data sets.
    """

    title: str
    text: str
    controllers: Sequence[tuple[str, str]]
    sources: Sequence[tuple[Source, Sequence[int | None]]]
    variations: Sequence[Mapping[str, Any]]
    trajectories: Keep
    data: str | None

    def __len__(self) -> int:
        scenes = sum(len(seeds) for _, seeds in self.sources)
        return scenes * len(self.variations) * len(self.controllers)

    def own(self) -> set[str]:
        """Return every ``module:Name`` of one's own: methods, parts of scenarios."""
        names, places = {name for name, _ in self.controllers}, set()
        for source, _ in self.sources:
            document = document_of(source)
            names |= {*controllers_in(document)}
            places |= {*document.get("own", {}).values()}
        places |= {find_method(name).controller for name in names}
        return {place for place in places if ":" in place}

    def jobs(self) -> Iterator[Job]:
        """Yield every run of the grid; controllers vary fastest, so share a scene."""
        stamps = {name: own_stamp(name) for name, _ in self.controllers}
        for source, seeds in self.sources:
            code = getattr(sys.modules[type(source).__module__], "__file__", "")
            place = source.identity(self.data) + code_stamp() + source_stamp(Path(code))
            place += "".join(map(own_stamp, controllers_in(document_of(source))))
            for seed, changes in product(seeds, self.variations):
                for controller, solver in self.controllers:
                    known = place + stamps[controller]
                    what = [known, seed, changes, controller, solver]
                    text = json.dumps(what, sort_keys=True)
                    run = hashlib.sha256(text.encode()).hexdigest()[:16]
                    scene = source, seed, json.dumps(changes), self.data
                    yield Job(run, *scene, controller, solver, self.trajectories)


def document_of(source: Source) -> dict[str, Any]:
    """Return what a scenario file says; of other sources nothing, they draw scenes."""
    return source.sample() if isinstance(source, ScenarioFile) else {}


def controllers_in(document: Mapping[str, Any]) -> list[str]:
    """Return the methods that a scenario file gives to robots of its own."""
    robots = document.get("robots", [])
    return [robot["controller"] for robot in robots if "controller" in robot]


def own_stamp(controller: str) -> str:
    """Return a hash of the code of a method of one's own; of others it is empty."""
    file = own_file(controller)
    return file_stamp(file) if file else ""


@lru_cache(maxsize=1)
def code_stamp() -> str:
    """Return a hash of all code that a row depends on: no pages, figures, commands."""
    sweep = Path(__file__).parent
    pages = {sweep.parent, PACKAGE / "lab" / "play", PACKAGE / "cli"}
    own = [p for p in sorted(PACKAGE.rglob("*.py")) if not pages & {*p.parents}]
    return "".join(map(file_stamp, [*own, *sorted(sweep.glob("*.py"))]))


def read_study(
    path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None
) -> Study:
    """Read a study file; every scenario, with every setting, is checked at once.

    Raises:
        ConfigError: Something in the file or in a scenario is wrong.
        UnknownNameError: No such controller, back end or scenario.
        DataError: A data file that a scenario names is missing or damaged.
    """
    _, path = find_config(os.fspath(path), study=True)
    document, content = read_document(path)
    model = validated(StudyModel, document, path)
    folder = None if data is None else os.fspath(data)
    keys = list(model.settings)
    variations = [
        dict(zip(keys, values, strict=True))
        for values in product(*model.settings.values())
    ]
    sources = make_sources(model, "seeds", path, folder)
    controllers = [find_controller(name) for name in dict.fromkeys(model.controllers)]
    for (source, seeds), changes in product(sources, variations):
        check_scene(source, changes, path, folder, next(iter(seeds), None))
    return Study(
        model.title,
        content.decode("utf-8"),
        controllers,
        sources,
        variations,
        model.trajectories,
        folder,
    )


def make_sources(
    model: SceneItems, key: str, path: Path, data: str | None
) -> list[tuple[Source, Sequence[int | None]]]:
    """Return where the scenes come from, each with the seeds that it calls ``key``."""
    if not model.scenarios and not model.generators:
        raise ConfigError([f"{path}: scenarios: there are none, and no generators"])
    files = [(i, scenario_file(i.config, path.parent)) for i in model.scenarios]
    made = [(item, _generator(item, data)) for item in model.generators]
    foreign = {"train", "test", "weight"} if key == "seeds" else {"seeds"}
    sources: list[tuple[Source, Sequence[int | None]]] = []
    for item, source in (*files, *made):
        if wrong := sorted(foreign & item.model_fields_set):
            raise ConfigError([f"{path}: {source.name}: no place for {wrong[0]}"])
        seeds = _seeds(model, item, key)
        fixed = isinstance(source, ScenarioFile) and not source.is_drawn
        if fixed and getattr(item, key) is None:
            seeds = [None]
        if not seeds:
            raise ConfigError([f"{path}: {key}: there are none of {source.name}"])
        sources.append((source, seeds))
    return sources


def _generator(item: AnyItem, data: str | None) -> Source:
    match item:
        case MapItem():
            return Maps(item.place, data)
        case BarnItem():
            return BarnWorlds(item.speed_mps)
        case CrowdItem():
            return Crowd(item.scene, data)
        case DynaBarnItem():
            return DynaBarn(item.jumps, item.speed_mps, data)
        case ForestItem():
            return Forest(item.family)
        case OwnItem():
            try:
                made: Source = load_object(item.source)(**item.options)
            except TypeError as error:
                raise ConfigError([f"{item.source}: {error}"]) from None
            return made
        case SensedItem():
            forest = item.scene == "forest"
            known = Forest(item.family) if forest else scenario_file("demo/strangers")
            return Sensed(known, item.tracks)


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
    file = Path(source.path) if isinstance(source, ScenarioFile) else path
    try:
        make_scenario(changed(source.sample(seed), changes), source.name, file, data)
    except ConfigError as error:
        where = f"{path}: {source.name} with {json.dumps(changes)}"
        raise ConfigError(f"{where}: {line}" for line in error.problems) from None


def scenario_file(config: str, beside: Path = Path()) -> ScenarioFile:
    """Return a scenario: a file beside the study, any file, or a shipped name."""
    near = beside / config
    name, path = find_config(near if near.is_file() else config)
    document, _ = read_document(path)
    return ScenarioFile(name, str(path.resolve()), json.dumps(document, default=str))


def _seeds(model: SceneItems, item: Seeded, key: str) -> Sequence[int | None]:
    """Return the seeds of an item, its own or the file's."""
    seeds: Any = getattr(item, key)
    seeds = getattr(model, key) if seeds is None else seeds
    return range(*map(int, seeds.split(":"))) if isinstance(seeds, str) else seeds


def find_controller(name: str) -> tuple[str, str]:
    """Return controller and back end of ``qp``, ``qp:casadi:daqp``, ``module:Name``."""
    controller, _, solver = name.partition(":")
    try:
        check_methods([controller])
    except UnknownNameError:
        if not solver:
            raise
        check_methods([name])
        return name, "exact"
    if solver and solver_of(controller, solver) != solver:
        raise ConfigError([f"{name}: {controller} has no QP, so no back end"])
    find_back_end(solver or "exact")
    return controller, solver or "exact"
