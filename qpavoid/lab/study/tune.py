"""Tuning: settings of a controller searched on training seeds, judged on others."""

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from qpavoid.errors import ConfigError, MissingExtraError
from qpavoid.lab.load import search_too
from qpavoid.lab.simulation.config import find_config, read_document, validated
from qpavoid.lab.simulation.schema_base import Finite, Strict
from qpavoid.lab.study.sweep.engine import sweep
from qpavoid.lab.study.sweep.sources import SceneItems, Seeds, check_scene, make_sources
from qpavoid.lab.study.sweep.store import read_rows
from qpavoid.lab.study.sweep.study import Study, find_controller
from qpavoid.lab.study.tables import markdown_table
from qpavoid.lab.worlds.source import Source

try:
    import optuna
except ImportError:
    raise MissingExtraError("optuna", "tune") from None

Metric = Literal["failure", "contact", "below_r_min", "time"]


class Range(Strict):
    """A number between two bounds, both included.

    Attributes:
        low: Least value.
        high: Greatest value.
        log: Searched on a logarithmic scale.
    """

    low: Finite
    high: Finite
    log: bool = False

    @model_validator(mode="after")
    def _ordered(self) -> "Range":
        if not self.low < self.high or (self.log and self.low <= 0.0):
            raise ValueError("a range needs low < high, and low > 0 for log")
        return self


class Choice(Strict):
    """One of several values.

    Attributes:
        choices: The values.
    """

    choices: Annotated[list[float | bool | str], Field(min_length=1)]


class TuningModel(SceneItems):
    """A whole tuning file.

    Attributes:
        controller: Whose settings are searched.
        train: Seeds to search on.
        test: Seeds to judge on, others than those.
        trials: How many settings are tried.
        seed: Of the search.
        loss: Weight of each metric's mean; less is better.
        search: What is tried, by dotted key of scenarios.
    """

    controller: str
    train: Seeds = "0:0"
    test: Seeds = "0:0"
    trials: Annotated[int, Field(ge=1, le=1_000_000)] = 40
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    loss: Annotated[dict[Metric, Finite], Field(min_length=1)]
    search: Annotated[dict[str, Range | Choice], Field(min_length=1)]


@dataclass(frozen=True)
class Tuning:
    """What is searched, and how.

    Attributes:
        model: The file.
        text: Its text.
        scenes: Those of the search, ``training``, and others, ``held out``.
        weights: As how many runs one of each source counts.
        data: Folder of published data sets.
    """

    model: TuningModel
    text: str
    scenes: Mapping[str, Sequence[tuple[Source, Sequence[int | None]]]]
    weights: Mapping[Source, float]
    data: str | None


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        best: The best settings, by dotted key.
        table: Metrics and loss of the settings as they were and of the best ones, each
            on the training and on the held-out scenes.
    """

    best: Mapping[str, Any]
    table: Sequence[Mapping[str, float | str]]


def read_tuning(
    path: str | os.PathLike[str], data: str | os.PathLike[str] | None = None
) -> Tuning:
    """Read a tuning file; the ends of every range are tried on every scenario.

    Modules of one's own may lie beside it.

    Raises:
        ConfigError: Something in the file or in a scenario is wrong.
        UnknownNameError: No such controller, back end or scenario.
    """
    _, path = find_config(os.fspath(path), study=True)
    search_too(path.parent)
    document, content = read_document(path)
    model = validated(TuningModel, document, path)
    find_controller(model.controller)
    folder = None if data is None else os.fspath(data)
    train, test = (make_sources(model, key, path, folder) for key in ("train", "test"))
    # Sources compare by value, so the same world under another item counts as well.
    seen = {(source, seed) for source, seeds in train for seed in seeds}
    for source, seeds in test:
        if any((source, seed) in seen for seed in seeds if seed is not None):
            raise ConfigError([f"{path}: test: seeds of {source.name} are trained on"])
    for source, _ in train:
        for key, space in model.search.items():
            for value in _ends(space):
                check_scene(source, {key: value}, path, folder)
    scenes = {"training": train, "held out": test}
    items = [*model.scenarios, *model.generators]
    weights = {s: item.weight for (s, _), item in zip(train, items, strict=True)}
    return Tuning(model, content.decode("utf-8"), scenes, weights, folder)


def tune(
    tuning: Tuning,
    out: Path,
    workers: int | None = None,
    progress: Callable[[str], None] = lambda line: None,
) -> Found:
    """Search, and judge what was found on scenes that the search has not seen.

    Tree-structured Parzen estimator of Optuna. Runs are kept as a sweep keeps them: a
    search started again goes on. Writes ``tuning.json``.
    """
    optuna.logging.set_verbosity(optuna.logging.ERROR)  # an interrupt is none
    model = tuning.model

    def loss_of(trial: Any) -> float:
        changes = dict(_suggested(trial, model.search))
        result = _judged(tuning, changes, "training", out, workers)
        progress(
            f"trial {trial.number}: loss {result['loss']:.4g} {json.dumps(changes)}"
        )
        return float(result["loss"])

    # Kept in memory: with the same seed a search that goes on asks for the same
    # settings again, whose runs are on disk already.
    search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=model.seed))
    search.optimize(loss_of, n_trials=model.trials)
    best = search.best_params
    table = [
        {"settings": name, "scenes": scenes}
        | _judged(tuning, changes, scenes, out, workers)
        for name, changes in (("as they stand", {}), ("best", best))
        for scenes in tuning.scenes
    ]
    found = Found(best, table)
    text = json.dumps({"best": best, "table": table, "tuning": tuning.text}, indent=1)
    (out / "tuning.json").write_text(text + "\n", encoding="utf-8")
    return found


def result_table(tuning: Tuning, found: Found) -> str:
    """Return the result as Markdown."""
    columns = ["settings", "scenes", *tuning.model.loss, "loss"]
    lines = [
        [x if isinstance(x, str) else f"{x:.4g}" for x in map(row.get, columns)]
        for row in found.table
    ]
    return f"{markdown_table(columns, lines)}best: {json.dumps(dict(found.best))}"


def _judged(
    tuning: Tuning,
    changes: Mapping[str, Any],
    scenes: str,
    out: Path,
    workers: int | None,
) -> dict[str, float]:
    """Return metrics and loss of settings; runs that are there are not done again."""
    controllers = [find_controller(tuning.model.controller)]
    sources, folder = tuning.scenes[scenes], out / scenes.replace(" ", "_")
    what = tuning.model.title, tuning.text, controllers, sources, [changes]
    study = Study(*what, trajectories="none", data=tuning.data)
    sweep(study, folder, workers)
    # The folder has the runs of all trials, each under a name that its settings make.
    wanted = {job.run: tuning.weights[job.source] for job in study.jobs()}
    rows = [row for row in read_rows(folder) if row["run"] in wanted]
    metrics = _metrics(rows, [wanted[row["run"]] for row in rows])
    weights = tuning.model.loss
    return metrics | {"loss": sum(w * metrics[name] for name, w in weights.items())}


def _metrics(
    rows: Sequence[Mapping[str, Any]], weights: Sequence[float]
) -> dict[str, float]:
    """Return the means of what a loss weighs; a run that fails takes all its time."""
    room = [row["min_room_m"] for row in rows]
    values = {
        "failure": [not row["success"] for row in rows],
        "contact": [row["contact"] for row in rows],
        "below_r_min": [x is not None and x < -1e-3 for x in room],
        "time": [
            row["arrived_s"] / row["duration_s"] if row["success"] else 1.0
            for row in rows
        ],
    }
    return {name: fmean(each, weights) for name, each in values.items()}


def _suggested(trial: Any, search: Mapping[str, Range | Choice]) -> Iterator[Any]:
    for key, space in search.items():
        if isinstance(space, Choice):
            yield key, trial.suggest_categorical(key, space.choices)
        else:
            yield key, trial.suggest_float(key, space.low, space.high, log=space.log)


def _ends(space: Range | Choice) -> Sequence[float | bool | str]:
    return space.choices if isinstance(space, Choice) else (space.low, space.high)
