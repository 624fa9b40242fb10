"""Results on disk: Parquet shards that are whole or not there, one row a run.

A shard is named after the hash of its content, so that a bit that has turned over is
noticed wherever it is, and never changes.
"""

import fcntl
import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from qpavoid.errors import DataError, MissingExtraError
from qpavoid.files import read_bytes, reading
from qpavoid.lab.simulation.log import provenance
from qpavoid.lab.simulation.outcome import MEASURES
from qpavoid.lab.study.sweep.job import CLOCK, Row

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ImportError:
    raise MissingExtraError("pyarrow", "study") from None

MOST_SHARD = 32_000_000
"""Bytes of a shard before what repeats is written out."""

TEXT, NUMBER = pa.string(), pa.float64()
SCHEMA = pa.schema(
    [
        *(("run", TEXT), ("scenario", TEXT), ("seed", pa.int64()), ("settings", TEXT)),
        *(("controller", TEXT), ("solver", TEXT), ("outcome", TEXT)),
        *(("success", pa.bool_()), ("contact", pa.bool_())),
        *((name, NUMBER) for name in ("duration_s", *MEASURES)),
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
        origin = provenance() | {"commit": commit(), "study": text}
        self._origin = {b"qpavoid": json.dumps(origin).encode()}

    def done(self, with_logs: bool = False) -> set[str]:
        """Return the runs that are finished."""
        tables = (_read(path, ["run"]) for path in shards(self.folder))
        with reading(self.folder, "not a table of runs"):
            runs = {run for table in tables for run in table["run"].to_pylist()}
        return {r for r in runs if self._log(r).exists()} if with_logs else runs

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keep other sweeps out, on this machine or, where locks are shared, any.

        The system opens the lock of who is killed. What such a one had not finished to
        write is removed.

        Raises:
            DataError: Another sweep is at work.
        """
        with (self.folder / ".lock").open("a") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise DataError(
                    f"{self.folder}: another sweep is writing into it; wait for it, or "
                    "take another folder and copy its files into this one"
                ) from None
            except OSError:  # of a file system without locks
                pass
            for part in self.folder.glob("*/.*.part"):
                part.unlink(missing_ok=True)
            yield

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
        table = table.replace_schema_metadata(self._origin)
        sink = pa.BufferOutputStream()
        pq.write_table(table, sink, compression="zstd")
        content = sink.getvalue().to_pybytes()
        # Never appended to, so that a copy of the folder taken at any time is whole.
        name = f"{hashlib.sha256(content).hexdigest()}.parquet"
        _write(self.folder / "runs" / name, content)

    def _log(self, run: str) -> Path:
        return self.folder / "logs" / f"{run}.npz"


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
        with reading(path, "not a table of runs"):
            for row in _read(path).to_pylist():
                rows[row["run"]] = row

    def place(row: dict[str, Any]) -> list[Any]:
        # None has no order among numbers; it comes first.
        return [(row[name] is not None, row[name]) for name in ORDER]

    with reading(folder, "not a table of runs"):
        ordered = sorted(rows.values(), key=place)
        return [row | json.loads(row.pop("settings")) for row in ordered]


def read_provenance(folder: Path) -> dict[str, Any]:
    """Return versions, machine, commit and study of the latest shard.

    ``others``: how many other origins the rows have.
    """
    latest = sorted(shards(folder), key=lambda path: path.stat().st_mtime)
    heads = [_read(path, ["run"]).schema.metadata or {} for path in latest]
    texts = [head.get(b"qpavoid", b"{}") for head in heads]
    if not texts:
        raise DataError(f"{folder}: no results of a sweep")
    with reading(latest[-1], "of unknown origin"):
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
    """Return a shard, if it is what was written."""
    try:
        with reading(path):
            content = read_bytes(path)
            if path.stem != hashlib.sha256(content).hexdigest():
                raise DataError(f"{path}: its content is not that of its name")
            with pq.ParquetFile(pa.BufferReader(content)) as file:
                heads = map(file.metadata.row_group, range(file.num_row_groups))
                if sum(head.total_byte_size for head in heads) > MOST_SHARD:
                    raise DataError(f"{path}: too many bytes unpacked")
                # A thread that still holds our bytes at exit aborts the process.
                table = file.read(columns, use_threads=False)
            known = [SCHEMA.field(name) for name in columns or ("run", *ORDER)]
            if [table.schema.field(field.name) for field in known] != known:
                raise DataError(f"{path}: columns of other kinds")
            return table
    except DataError as error:
        raise DataError(
            f"{error}; this shard is damaged. All others are whole; move it away, and "
            "the sweep does its runs again"
        ) from None


def _write(path: Path, content: bytes) -> None:
    """Write a file that is whole or not there, even if the machine stops."""
    part = path.with_name(f".{path.name}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            # Synced before it has its name, or after a loss of power there may be a
            # name without content.
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        free = shutil.disk_usage(path.parent).free
        raise DataError(
            f"{path}: cannot be written ({error.strerror}; {free / 1e6:.0f} MB free). "
            "Every run that was finished is kept; start the same sweep again to go on"
        ) from None
