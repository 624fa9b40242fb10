"""What has been compiled, kept on disk: a file each, believed only if it is whole.

A file that is cut, changed or of other sources counts as absent, and so does all that
somebody else could have written: what is read is run. Each says so on standard error,
once, and is compiled anew.
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

OTHERS, GROUP = 0o002, 0o020
"""Who may write, of a file's mode."""


class CacheFolder:
    """The compiled code of one function, a file for each kind of its arguments.

    Args:
        folder: Where they lie.
        name: Of the function, with the version of Python.
        about: All that the code rests on beside the arguments: sources and versions.
        dumps: Pickles it.
    """

    def __init__(
        self, folder: Path, name: str, about: str, dumps: Callable[[Any], bytes]
    ) -> None:
        self.folder, self._name, self._dumps = folder, name, dumps
        self._present = f"{name}.{digest(about.encode())[:16]}."

    def path(self, key: Any) -> Path:
        """Return the file of some kinds of arguments."""
        return (
            self.folder / f"{self._present}{digest(repr(key).encode())[:16]}.{ENDING}"
        )

    def load(self, key: Any) -> Any:
        """Return what was saved; None: nothing, or nothing to be trusted."""
        path = self.path(key)
        try:
            with path.open("rb") as file:
                private = is_private(os.fstat(file.fileno()))
                whole = file.read()
            private = private and is_private(self.folder.stat())
        except OSError:
            return None
        if not private:
            say(f"others can write to the cache {self.folder}, which is not read")
            return None
        mark, body = whole[:64], whole[64:]
        if mark.decode("ascii", "replace") == digest(body):
            with suppress(Exception):  # of pickle: any
                saved, data = pickle.loads(body)
                if saved == key:
                    return data
        say(f"damaged, and compiled anew: {path}")
        with suppress(OSError):
            path.unlink()
        return None

    def save(self, key: Any, data: Any) -> None:
        """Keep compiled code where only the user can write; old code goes.

        On a full disk it is not kept, and that is said.
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
            say(f"compiled code cannot be kept, and each start compiles: {error}")
            with suppress(OSError):
                part.unlink()

    def flush(self) -> None:
        """Forget all."""
        with suppress(OSError):
            self._forget(stale=False)

    def _forget(self, stale: bool) -> None:
        for path in self.folder.iterdir():
            ours = path.name.startswith(f"{self._name}.") and path.suffix[1:] == ENDING
            if ours and not (stale and path.name.startswith(self._present)):
                path.unlink(missing_ok=True)

    def has_code(self) -> bool:
        """Return whether there is some that may be read."""
        with suppress(OSError):
            if is_private(self.folder.stat()):
                names = os.listdir(self.folder)
                return any(name.startswith(self._present) for name in names)
        return False


def is_private(status: os.stat_result) -> bool:
    """Return whether nobody else, but the superuser, can have written.

    The group may where it is that of the user alone, of the same number.
    """
    if os.name != "posix":
        return True
    others = OTHERS if status.st_gid == status.st_uid else OTHERS | GROUP
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & others


def digest(data: bytes) -> str:
    """Return the hash of something."""
    return hashlib.sha256(data).hexdigest()


@cache
def say(text: str) -> None:
    """Say something once."""
    print(f"qpavoid: {text}", file=sys.stderr, flush=True)
