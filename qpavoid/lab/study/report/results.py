"""Results of a study in its folder: rows, provenance, and paths of the logs."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from qpavoid.errors import DataError
from qpavoid.files import read_json
from qpavoid.lab.study.compare import read_summary

Row: TypeAlias = dict[str, Any]


class Results(NamedTuple):
    """Results of a study.

    Attributes:
        rows: One a run, with the keys of a sweep; ``run`` names it.
        provenance: Versions and machine.
        logs: Paths of the logs that were kept, by the name of the run.
    """

    rows: list[Row]
    provenance: Mapping[str, Any]
    logs: Mapping[str, Path]


def read_results(folder: Path) -> Results:
    """Read a folder made by ``qpavoid sweep``, or ``compare`` or ``run``.

    Raises:
        DataError: It is neither, is damaged, or holds no runs.
    """
    if (folder / "runs").is_dir():
        from qpavoid.lab.study.sweep.store import read_provenance, read_rows

        rows, provenance = read_rows(folder), read_provenance(folder)
    elif (folder / "summary.json").is_file():
        rows = [
            {"run": name, "success": word == "arrived", "contact": word == "touched"}
            | row
            for name, row in read_summary(folder).items()
            for word in [row.get("outcome")]
        ]
        origin = folder / "provenance.json"
        provenance = read_json(origin) if origin.exists() else {}
    else:
        raise DataError(
            f"{folder}: no results of qpavoid sweep (runs/*.parquet) or of qpavoid "
            "compare (summary.json)"
        )
    if not rows:
        raise DataError(f"{folder}: no runs yet")
    logs = {path.stem: path for path in sorted((folder / "logs").glob("*.npz"))}
    return Results(rows, provenance, logs)
