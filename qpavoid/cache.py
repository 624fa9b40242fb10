"""Disk cache of compiled code: one file per signature, with a checksum.

A file that is truncated, changed or of other sources counts as absent, and so does one
that another user could have written, since its content is executed. Each such case is
reported once on standard error, and the code is compiled again.
"""

import hashlib
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any
from uuid import uuid4

ENDING = "code"

OTHERS, GROUP_BIT = 0o002, 0o020
"""Bits of a file's mode: writable by others, writable by the group."""


class CacheFolder:
    """The compiled code of one function, one file per tuple of argument types.

    Args:
        folder: Folder of the files.
        name: Of the function, with the version of Python.
        about: All else that the code depends on: sources and versions.
        dumps: Pickles the code.
    """

    def __init__(
        self, folder: Path, name: str, about: str, dumps: Callable[[Any], bytes]
    ) -> None:
        self.folder, self._name, self._dumps = folder, name, dumps
        self._present = f"{name}.{digest(about.encode())[:16]}."

    def path(self, key: Any) -> Path:
        """Return the file for a tuple of argument types."""
        return (
            self.folder / f"{self._present}{digest(repr(key).encode())[:16]}.{ENDING}"
        )

    def load(self, key: Any) -> Any:
        """Return saved code; None if there is none, or it cannot be trusted."""
        path = self.path(key)
        try:
            with path.open("rb") as file:
                private = is_private(os.fstat(file.fileno()))
                whole = file.read()
            private = private and is_private(self.folder.stat())
        except OSError:
            return None
        if not private:
            say(f"the cache {self.folder} is writable by others and not used")
            return None
        mark, body = whole[:64], whole[64:]
        if mark.decode("ascii", "replace") == digest(body):
            with suppress(Exception):  # of pickle: any
                saved, data = pickle.loads(body)
                if saved == key:
                    return data
        say(f"damaged cache file, compiling again: {path}")
        with suppress(OSError):
            path.unlink()
        return None

    def save(self, key: Any, data: Any) -> None:
        """Save compiled code if only the user can write there; delete older code.

        A failure, such as a full disk, is reported on standard error.
        """
        if not is_private(self.folder.stat()):
            return
        body = self._dumps((key, data))
        path = self.path(key)
        part = path.with_name(f"{path.name}.{uuid4().hex[:16]}.part")
        try:
            part.write_bytes(digest(body).encode() + body)
            part.replace(path)
            self._forget(stale=True)
        except OSError as error:
            say(f"compiled code cannot be saved; each start compiles: {error}")
            with suppress(OSError):
                part.unlink()

    def flush(self) -> None:
        """Delete all cached code of the function."""
        with suppress(OSError):
            self._forget(stale=False)

    def _forget(self, stale: bool) -> None:
        for path in self.folder.iterdir():
            ours = path.name.startswith(f"{self._name}.") and path.suffix[1:] == ENDING
            if ours and not (stale and path.name.startswith(self._present)):
                path.unlink(missing_ok=True)

    def has_code(self) -> bool:
        """Return whether there is cached code that may be read."""
        with suppress(OSError):
            if is_private(self.folder.stat()):
                names = os.listdir(self.folder)
                return any(name.startswith(self._present) for name in names)
        return False


def is_private(status: os.stat_result) -> bool:
    """Return whether only the user or the superuser can have written a file.

    The user's own group, of the same number as the user, may have write access too.
    """
    if os.name != "posix":
        return True
    others = OTHERS if status.st_gid == status.st_uid else OTHERS | GROUP_BIT
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & others


def digest(data: bytes) -> str:
    """Return the SHA-256 of data, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


@cache
def say(text: str) -> None:
    """Print a message on standard error, once."""
    print(f"qpavoid: {text}", file=sys.stderr, flush=True)
