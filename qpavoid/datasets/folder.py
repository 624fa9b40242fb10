"""Where published data lie: in a folder that is given, or named by the environment."""

import os
from collections.abc import Sequence
from pathlib import Path

from qpavoid.errors import DataError


def find_file(
    what: str, name: str, data: str | os.PathLike[str] | None, folders: Sequence[str]
) -> Path:
    """Return the path of a published file.

    Args:
        what: Of which data set, for the message.
        name: Of the file.
        data: The data folder; without one, the environment's ``QPAVOID_DATA``.
        folders: Where it may lie in it.

    Raises:
        DataError: No data folder, or no such file; says where it was looked for.
    """
    root = data if data is not None else os.environ.get("QPAVOID_DATA")
    if root is None:
        raise DataError(
            f"{what} are not part of qpavoid: give their folder with --data PATH or in "
            "the environment variable QPAVOID_DATA"
        )
    paths = [Path(root) / folder / name for folder in folders]
    for path in paths:
        if path.is_file():
            return path
    raise DataError(f"{name} is in none of {', '.join(str(p.parent) for p in paths)}")
