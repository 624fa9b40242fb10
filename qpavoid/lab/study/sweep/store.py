"""Results on disk: Parquet shards that are whole or not there, one row a run."""

import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from uuid import uuid4

from qpavoid.errors import DataError, MissingExtraError
from qpavoid.lab.simulation.log import provenance
from qpavoid.lab.study.sweep.job import CLOCK, NUMBERS, Row

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError:
    raise MissingExtraError("pyarrow", "study") from None

TEXT, NUMBER = pa.string(), pa.float64()
SCHEMA = pa.schema(
    [
        *(("run", TEXT), ("scenario", TEXT), ("seed", pa.int64()), ("settings", TEXT)),
        *(("controller", TEXT), ("solver", TEXT), ("outcome", TEXT)),
        *(("success", pa.bool_()), ("contact", pa.bool_())),
        *((name, NUMBER) for name in ("duration_s", *NUMBERS)),
        *(("error", TEXT), *((name, NUMBER) for name in CLOCK)),
    ]
)
"""Columns of a shard; what does not apply is null, ``settings`` is JSON."""

ORDER = ("scenario", "seed", "settings", "controller", "solver")


class Store:
    """The folder of one study: ``runs/*.parquet`` and ``logs/<run>.npz``.

    Args:
        folder: Made if it is not there.
        text: The study file, to stand beside the rows.

    Raises:
        DataError: A shard that is there is damaged; nothing is changed.
    """

    def __init__(self, folder: Path, text: str = "") -> None:
        self.folder = folder
        (folder / "runs").mkdir(parents=True, exist_ok=True)
        (folder / "logs").mkdir(exist_ok=True)
        self._text = text
        self._origin: dict[bytes, bytes] | None = None

    def done(self, with_logs: bool = False) -> set[str]:
        """Return the runs that are finished."""
        tables = (_read(path, ["run"]) for path in shards(self.folder))
        runs = {run for table in tables for run in table["run"].to_pylist()}
        return {r for r in runs if self._log(r).exists()} if with_logs else runs

    def save(self, results: Sequence[tuple[Row, bytes | None]]) -> None:
        """Write rows as a shard, logs first; all of them or none.

        Raises:
            DataError: They cannot be written; what is there stays as it is.
        """
        # A row says that its run is finished, so the log has to be on disk before it.
        for row, log in results:
            if log is not None:
                _write(self._log(str(row["run"])), log)
        table = pa.Table.from_pylist([row for row, _ in results], SCHEMA)
        table = table.replace_schema_metadata(self._provenance())
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        # Shards never change and are never appended to: two sweeps may write into one
        # folder, and a copy of it taken at any time is whole.
        name = f"{uuid4().hex}.parquet"
        _write(self.folder / "runs" / name, sink.getvalue().to_pybytes())

    def merge(self, other: Path) -> None:
        """Take over all finished runs of another folder.

        Raises:
            DataError: It has none, or a damaged one; nothing is taken then.
        """
        found = shards(other)
        if not found:
            raise DataError(f"{other}: no results of a sweep")
        for path in found:
            _read(path, ["run"])
        for path in sorted((other / "logs").glob("*.npz")):
            _write(self.folder / "logs" / path.name, path.read_bytes())
        for path in found:
            _write(self.folder / "runs" / path.name, path.read_bytes())

    def _log(self, run: str) -> Path:
        return self.folder / "logs" / f"{run}.npz"

    def _provenance(self) -> dict[bytes, bytes]:
        if self._origin is None:
            origin = provenance() | {"commit": commit(), "study": self._text}
            self._origin = {b"qpavoid": json.dumps(origin).encode()}
        return self._origin


def shards(folder: Path) -> list[Path]:
    """Return the shards of a folder; unfinished ones have another name."""
    return sorted((folder / "runs").glob("*.parquet"))


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """Return one row a run in the order of the grid, a column for every setting.

    Raises:
        DataError: There are none, or a shard is damaged.
    """
    paths = shards(folder)
    if not paths:
        raise DataError(f"{folder}: no results of a sweep")
    # By run, for a merge or two sweeps at once may have done one twice.
    rows: dict[str, dict[str, Any]] = {}
    for path in paths:
        for row in _read(path).to_pylist():
            rows[row["run"]] = row

    def place(row: dict[str, Any]) -> list[Any]:
        # None has no order among numbers; it comes first.
        return [(row[name] is not None, row[name]) for name in ORDER]

    ordered = sorted(rows.values(), key=place)
    return [row | json.loads(row.pop("settings")) for row in ordered]


def read_provenance(folder: Path) -> dict[str, Any]:
    """Return versions, machine, commit and study of the latest shard.

    ``others``: how many other origins the rows have.
    """
    latest = sorted(shards(folder), key=lambda path: path.stat().st_mtime)
    texts = [pq.read_schema(path).metadata.get(b"qpavoid", b"{}") for path in latest]
    if not texts:
        raise DataError(f"{folder}: no results of a sweep")
    origin: dict[str, Any] = json.loads(texts[-1])
    return origin | {"others": len(set(texts)) - 1}


def commit() -> str:
    """Return the commit of the code that runs; empty where it is no checkout."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=12"],
            cwd=Path(__file__).parent,
            capture_output=True,
            text=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def _read(path: Path, columns: list[str] | None = None) -> pa.Table:
    try:
        return pq.read_table(path, columns=columns)
    except (pa.ArrowException, OSError, KeyError) as error:
        raise DataError(
            f"{path}: this shard is damaged ({error}). All others are whole; move it "
            "away, and the sweep does its runs again"
        ) from None


def _write(path: Path, content: bytes) -> None:
    """Write a file that is whole or not there, even if the machine stops."""
    # Beside the file, since a rename is atomic only within one file system; synced
    # before, or after a loss of power there may be a name without content.
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        free = shutil.disk_usage(path.parent).free
        raise DataError(
            f"{path}: cannot be written ({error.strerror}; {free / 1e6:.0f} MB free). "
            "Every run that was finished is kept; start the same sweep again to go on"
        ) from None
