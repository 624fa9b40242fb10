"""Which published data sets qpavoid reads, which are there, and where the rest is."""

import gzip
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple


class Dataset(NamedTuple):
    """A data set that others publish.

    Attributes:
        name: Short name.
        what: What it holds.
        reader: Module of :mod:`qpavoid.lab.worlds` that reads it.
        pattern: Names of its files.
        source: Project and repository that publish it.
        licence: What may be done with it.
    """

    name: str
    what: str
    reader: str
    pattern: str
    source: str
    licence: str


DATASETS = (
    Dataset(
        "BARN",
        "300 static worlds (Gazebo SDF) with reference paths",
        "barn",
        "world_*.world",
        "The BARN Challenge, GitHub repository Daffan/the-barn-challenge",
        "MIT",
    ),
    Dataset(
        "DynaBARN",
        "60 worlds of moving cylinders (JSON made from its Gazebo plug-ins)",
        "dynabarn",
        "dynabarn.json",
        "The BARN Challenge, GitHub repository Daffan/the-barn-challenge",
        "MIT",
    ),
    Dataset(
        "OpenTraj",
        "pedestrian tracks of ETH and UCY",
        "obsmat",
        "obsmat.txt",
        "OpenTraj, GitHub repository crowdbotp/OpenTraj",
        "MIT; UCY free with credit, ETH: cite Pellegrini 2009",
    ),
    Dataset(
        "CARMEN logs",
        "laser scans of real robots with poses, such as Freiburg-079",
        "carmen",
        "*.log*",
        "Radish, the Robotics Data Set Repository; Freiburg-079 by C. Stachniss, "
        "also in GitHub repository acschaefer/ple",
        "acknowledge the authors",
    ),
    Dataset(
        "Nav2 maps",
        "occupancy maps of map_server (YAML with PGM or PNG)",
        "map_server",
        "*.yaml",
        "Nav2, GitHub repository ros-navigation/navigation2",
        "Apache-2.0",
    ),
)

MARKS = {"CARMEN logs": ("# message formats", "FLASER"), "Nav2 maps": ("image:",)}
"""What is near the beginning of a file whose name alone says too little."""


def found(dataset: Dataset, folder: Path) -> list[Path]:
    """Return the files of a data set in a folder and below, sorted."""
    marks = MARKS.get(dataset.name, ("",))
    files = sorted(x for x in folder.rglob(dataset.pattern) if x.is_file())
    return [x for x in files if any(mark in _beginning(x) for mark in marks)]


def lines(folder: str | os.PathLike[str] | None = None) -> Iterator[str]:
    """Yield what to print: each data set, what of it is there, and where to get it.

    Args:
        folder: Where to look; without one, the environment's ``QPAVOID_DATA``.
    """
    root = folder if folder is not None else os.environ.get("QPAVOID_DATA")
    if root is None:
        yield "No data folder: name one with --data PATH or in QPAVOID_DATA."
    elif not Path(root).is_dir():
        yield f"{root} is no folder."
    else:
        yield f"In {root}:"
    for dataset in DATASETS:
        files = found(dataset, Path(root)) if root and Path(root).is_dir() else []
        yield ""
        yield f"{dataset.name}: {dataset.what} (qpavoid.lab.worlds.{dataset.reader})"
        yield f"  {_places(files, Path(root)) if root and files else 'not found'}"
        yield f"  from: {dataset.source} ({dataset.licence})"


def rows(folder: str | os.PathLike[str] | None) -> list[dict[str, object]]:
    """Return a row for each data set, with how many of its files are in a folder."""
    there = folder is not None and Path(folder).is_dir()
    return [
        each._asdict() | {"files": len(found(each, Path(folder or ""))) if there else 0}
        for each in DATASETS
    ]


def _places(files: list[Path], root: Path) -> str:
    folders = sorted({str(file.parent.relative_to(root)) for file in files})
    count = f"{len(files)} file{'s' if len(files) > 1 else ''}"
    return f"found: {count} in {', '.join(folders)}"


def _beginning(file: Path) -> str:
    try:
        with gzip.open(file) if file.suffix == ".gz" else file.open("rb") as data:
            return data.read(4096).decode("utf-8", "replace")
    except (OSError, EOFError, zlib.error):
        return ""
