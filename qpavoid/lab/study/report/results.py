"""What a study left in its folder: rows, provenance, and where the logs are."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from qpavoid.errors import DataError
from qpavoid.lab.study.compare import run_name

Row: TypeAlias = dict[str, Any]


class Results(NamedTuple):
    """What a study left.

    Attributes:
        rows: One a run, with the keys of a sweep; ``run`` names it.
        provenance: Versions and machine.
        logs: Paths of the logs that were kept, by the name of the run.
    """

    rows: list[Row]
    provenance: Mapping[str, Any]
    logs: Mapping[str, Path]


def read_results(folder: Path) -> Results:
    """Read a folder made by ``qpavoid sweep`` or ``qpavoid compare``.

    Raises:
        DataError: It is neither, is damaged, or holds no runs.
    """
    if (folder / "runs").is_dir():
        from qpavoid.lab.study.sweep.store import read_provenance, read_rows

        rows, provenance = read_rows(folder), read_provenance(folder)
    elif (folder / "summary.json").is_file():
        rows = [_as_swept(row) for row in _read(folder / "summary.json", list)]
        kept = folder / "provenance.json"
        provenance = _read(kept, dict) if kept.is_file() else {}
    else:
        raise DataError(
            f"{folder}: no results of qpavoid sweep (runs/*.parquet) or of qpavoid "
            "compare (summary.json)"
        )
    if not rows:
        raise DataError(f"{folder}: no runs yet")
    logs = {path.stem: path for path in sorted((folder / "logs").glob("*.npz"))}
    return Results(rows, provenance, logs)


def _read(path: Path, kind: type) -> Any:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: not readable ({error})") from None
    if not isinstance(content, kind):
        raise DataError(f"{path}: not a {kind.__name__}")
    return content


def _as_swept(row: Row) -> Row:
    """Return the metrics of one compared run under the names that a sweep uses."""
    try:
        stem = run_name(row["scenario"], row["controller"])
        arrived, touched = (row["outcome"] == word for word in ("arrived", "touched"))
    except (KeyError, TypeError) as error:
        raise DataError(f"summary.json: a row without {error}") from None
    return row | {"run": stem, "success": arrived, "contact": touched}
