"""A study file: controllers, settings, scenarios and seeds, as strict TOML."""

import hashlib
import json
import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from qpavoid.errors import ConfigError
from qpavoid.lab.scenario.config import find_config, read_document, validated
from qpavoid.lab.scenario.keys import Strict
from qpavoid.lab.scenario.methods import REGISTRY, own_file, parsed, with_back_end
from qpavoid.lab.scenario.plug_ins import search_too
from qpavoid.lab.study.sweep.job import Job
from qpavoid.lab.study.sweep.sources import (
    SceneItems,
    check_scene,
    controllers_in,
    make_sources,
)
from qpavoid.lab.worlds.source import Source
from qpavoid.stamps import PACKAGE, file_stamp, source_stamp

Values = Annotated[list[Any], Field(min_length=1)]

MOST_VARIATIONS = 10_000
"""Combinations of settings; each is tried on every scenario before anything runs."""

Keep = Literal["none", "failures", "all"]


class VariantModel(Strict):
    """A method with settings of its own.

    Attributes:
        controller: The method, as ``eq5``, ``qp:osqp``.
        settings: Values by dotted key of scenarios; they override all others.
    """

    controller: str
    settings: Annotated[dict[str, Any], Field(min_length=1)]


class StudyModel(SceneItems):
    """A whole study file.

    Attributes:
        controllers: Methods, as ``qp``, ``qp:osqp``, ``module:Name``, and names of
            variants.
        variants: Methods with settings of their own, by the name in tables.
        trajectories: Whose logs are kept, for figures in a report.
        settings: Values by dotted key of scenarios; the grid has all combinations.
    """

    controllers: Annotated[list[str], Field(min_length=1)]
    trajectories: Keep = "none"
    settings: dict[str, Values] = Field(default_factory=dict)
    variants: dict[str, VariantModel] = Field(default_factory=dict)


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
        variants: Methods with settings of their own, by name.
    """

    title: str
    text: str
    controllers: Sequence[tuple[str, str]]
    sources: Sequence[tuple[Source, Sequence[int | None]]]
    variations: Sequence[Mapping[str, Any]]
    trajectories: Keep
    data: str | None
    variants: Mapping[str, VariantModel] = field(default_factory=dict)

    def __len__(self) -> int:
        scenes = sum(len(seeds) for _, seeds in self.sources)
        return scenes * len(self.variations) * len(self.controllers)

    def jobs(self) -> Iterator[Job]:
        """Yield every run of the grid; controllers vary fastest, so share a scene."""
        variants = [(*self.variant(name), name, s) for name, s in self.controllers]
        stamps = {name: own_stamp(name) for name, *_ in variants}
        for source, seeds in self.sources:
            # All that a row depends on goes into its name: content, code, settings. A
            # run is then done again exactly if something of that has changed.
            code = getattr(sys.modules[type(source).__module__], "__file__", "")
            place = source.identity(self.data) + code_stamp() + source_stamp(Path(code))
            place += "".join(map(own_stamp, controllers_in(source)))
            for seed, changes in product(seeds, self.variations):
                for controller, own, label, solver in variants:
                    known = place + stamps[controller]
                    what = [known, seed, changes, controller, solver, own, label]
                    text = json.dumps(what, sort_keys=True)
                    run = hashlib.sha256(text.encode()).hexdigest()[:16]
                    scene = source, seed, json.dumps(changes), self.data
                    how = controller, solver, self.trajectories, label, json.dumps(own)
                    yield Job(run, *scene, *how)

    def variant(self, name: str) -> tuple[str, Mapping[str, Any]]:
        """Return the method of a name and its own settings: of a method itself none."""
        own = self.variants.get(name)
        if own is None:
            return name, {}
        return with_back_end(own.controller)[0], own.settings


def own_stamp(controller: str) -> str:
    """Return a hash of the code of a method of one's own; of others it is empty.

    With that of the modules beside it that it imports.
    """
    file = own_file(controller)
    return source_stamp(file) if file else ""


@lru_cache(maxsize=1)
def code_stamp() -> str:
    """Return a hash of all code that a row depends on: no pages, figures, commands."""
    sweep = Path(__file__).parent
    pages = {sweep.parent, PACKAGE / "lab" / "play", PACKAGE / "cli"}
    own = [p for p in sorted(PACKAGE.rglob("*.py")) if not pages & {*p.parents}]
    return "".join(map(file_stamp, [*own, *sorted(sweep.glob("*.py"))]))


def read_study(
    path: str | os.PathLike[str],
    data: str | os.PathLike[str] | None = None,
    controllers: Sequence[str] = (),
) -> Study:
    """Read a study file; every scenario, with every setting, is checked at once.

    Modules of one's own may lie beside it. Controllers that are given are those of the
    study instead.

    Raises:
        ConfigError: Something in the file or in a scenario is wrong.
        UnknownNameError: No such controller, back end or scenario.
        DataError: A data file that a scenario names is missing or damaged.
    """
    _, path = find_config(os.fspath(path), study=True)
    search_too(path.parent)
    document, content = read_document(path)
    text = content.decode("utf-8")
    if controllers:
        document["controllers"] = list(controllers)
        text = f"# --controllers {','.join(controllers)}\n{text}"
    model = validated(StudyModel, document, path)
    folder = None if data is None else os.fspath(data)
    keys, many = list(model.settings), math.prod(map(len, model.settings.values()))
    if many > MOST_VARIATIONS:
        most = f"{MOST_VARIATIONS:,} are most"
        raise ConfigError([f"{path}: settings: {many:,} combinations, where {most}"])
    variations = [
        dict(zip(keys, values, strict=True))
        for values in product(*model.settings.values())
    ]
    sources = make_sources(model, path, folder)
    solvers = {}
    for name, variant in model.variants.items():
        _, solvers[name] = with_back_end(variant.controller)
        if parsed(name).controller in REGISTRY or ":" in name:
            raise ConfigError([f"{path}: variants.{name}: a name of its own is needed"])
    found = [
        (name, solvers[name]) if name in solvers else with_back_end(name)
        for name in dict.fromkeys(model.controllers)
    ]
    own = [{}, *(variant.settings for variant in model.variants.values())]
    for (source, seeds), changes, more in product(sources, variations, own):
        check_scene(source, changes | more, path, folder, next(iter(seeds), None))
    return Study(
        model.title,
        text,
        found,
        sources,
        variations,
        model.trajectories,
        folder,
        model.variants,
    )
