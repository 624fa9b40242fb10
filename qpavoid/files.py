"""Reading of files from others: regular files, of limited size and nesting.

All readers get their bytes here and run foreign parsers under :func:`reading`, which
turns any exception into an error of qpavoid. Sizes are checked before allocation.
"""

import io
import json
import math
import os
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeAlias

from qpavoid.errors import DataError, QPAvoidError

if TYPE_CHECKING:
    import numpy.typing as npt

Name: TypeAlias = str | os.PathLike[str]

MOST_BYTES, MOST_TEXT, MOST_TABLE = 256_000_000, 8_000_000, 64_000
"""Greatest size, bytes: of a file, of a text file, of a YAML file."""

MOST_UNPACKED = 1_000_000_000
"""Greatest size, bytes, of unpacked messages."""

MOST_ARRAYS = 300_000_000
"""Greatest size, bytes, of all arrays of a file."""

MOST_DEPTH = 32
"""Greatest depth of nested tables and lists."""

MOST_MESSAGE = 300
"""Characters of a parser's message that an error repeats."""

TRUST = "QPAVOID_TRUST_PATHS"
"""Environment variable; if it is 1, files may name paths outside their folder."""


@contextmanager
def reading(path: object, fault: str = "not readable") -> Iterator[None]:
    """Turn any exception of a foreign parser into a DataError.

    Raises:
        DataError: With the path and the fault.
    """
    try:
        yield
    except QPAvoidError:
        raise
    except RecursionError:
        raise DataError(f"{path}: {fault} (nested too deeply)") from None
    except MemoryError:
        raise DataError(f"{path}: {fault} (too large for the memory)") from None
    except Exception as error:
        message = f"{error or type(error).__name__}"[:MOST_MESSAGE]
        raise DataError(f"{path}: {fault} ({message})") from None


def open_file(path: Name, most: int = MOST_BYTES) -> BinaryIO:
    """Open a regular file of at most ``most`` bytes for reading.

    Raises:
        DataError: It is a folder, a pipe, a device, or larger.
        OSError: It does not exist or may not be read.
    """
    # The open file itself is checked; without O_NONBLOCK a pipe would block here.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    status = os.fstat(handle)
    regular = stat.S_ISREG(status.st_mode)
    if regular and status.st_size <= most:
        return os.fdopen(handle, "rb")
    os.close(handle)
    large = f"{status.st_size:,} bytes, more than {most:,}"
    raise DataError(f"{path}: {large if regular else 'not a regular file'}")


def read_bytes(path: Name, most: int = MOST_BYTES) -> bytes:
    """Return a file's content; errors as :func:`open_file`."""
    with open_file(path, most) as file:
        return file.read(most)


def read_text(path: Name, most: int = MOST_TEXT) -> str:
    """Return the text of a UTF-8 file, without its byte order mark.

    Raises:
        UnicodeDecodeError: It is not UTF-8. Other errors as :func:`open_file`.
    """
    return read_bytes(path, most).decode("utf-8-sig")


def read_json(path: Name) -> Any:
    """Return the content of a JSON file.

    Raises:
        DataError: It cannot be read.
    """
    with reading(path, "not readable JSON"):
        return shallow(json.loads(read_text(path)))


def read_yaml(path: Name) -> Any:
    """Return the content of a YAML file without aliases and repeated keys.

    A few bytes of aliases may expand beyond any memory; of a repeated key one value
    would be ignored.

    Raises:
        DataError: It cannot be read.
    """
    import yaml

    class Plain(yaml.SafeLoader):  # type: ignore[misc]
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise DataError(f"{path}: aliases (*) are not supported")
            return super().compose_node(parent, index)

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            keys = [str(key.value) for key, _ in node.value]
            if len({*keys}) < len(keys):
                raise DataError(
                    f"{path}: {max(keys, key=keys.count)} is a repeated key"
                )
            return super().construct_mapping(node, deep)

    with reading(path, "not readable YAML"):
        return shallow(yaml.load(read_text(path, MOST_TABLE), Plain))


def shallow(document: Any, left: int = MOST_DEPTH) -> Any:
    """Return a document after checking its depth of nesting.

    Raises:
        DataError: It exceeds :data:`MOST_DEPTH`.
    """
    if left == 0:
        raise DataError(f"nested more than {MOST_DEPTH} deep")
    inner = document.values() if isinstance(document, dict) else document
    for value in inner if isinstance(document, dict | list) else ():
        shallow(value, left - 1)
    return document


def read_array(path: Name) -> "npt.NDArray[Any]":
    """Return the array of an ``.npy`` file: numbers or text, no objects.

    Raises:
        DataError: It cannot be read.
    """
    with reading(path, "not a readable array"):
        return _array(read_bytes(path))


def read_arrays(path: Name) -> "dict[str, npt.NDArray[Any]]":
    """Return the arrays of an ``.npz`` file by name.

    Raises:
        DataError: It cannot be read.
    """
    with (
        reading(path, "not readable arrays"),
        open_file(path) as file,
        zipfile.ZipFile(file) as parts,
    ):
        size = sum(part.file_size for part in parts.infolist())
        if size > MOST_ARRAYS:
            raise DataError(f"{path}: {size:,} bytes unpacked, too many")
        names = parts.namelist()
        return {name.removesuffix(".npy"): _array(parts.read(name)) for name in names}


def _array(content: bytes) -> "npt.NDArray[Any]":
    """Return an array in numpy's format, if its size agrees with its header."""
    import numpy as np  # deferred: --help imports this module

    file = io.BytesIO(content)
    version = np.lib.format.read_magic(file)
    heads = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    shape, by_column, kind = heads[version](file)
    if kind.kind not in "biufU" or min(shape, default=0) < 0:
        raise ValueError(f"holds {kind}, shape {shape}: neither numbers nor text")
    size, left = math.prod(shape) * kind.itemsize, len(content) - file.tell()
    if size != left:
        raise ValueError(f"shape {shape} needs {size} bytes, where {left} are left")
    if not size:
        return np.zeros(shape, kind)
    array = np.frombuffer(content, kind, offset=file.tell())
    return array.reshape(shape, order="F" if by_column else "C")


def below(path: Path, *folders: Path) -> Path:
    """Return a path that a file names, if it leads into one of the folders.

    ``..`` and links are resolved first. With :data:`TRUST` it may lie anywhere.

    Raises:
        DataError: It lies elsewhere.
    """
    if is_trusted():
        return path
    with reading(path, "no path"):
        real = path.resolve()
        if any(real.is_relative_to(folder.resolve()) for folder in folders):
            return path
    where = " or ".join(str(folder) for folder in folders)
    raise DataError(
        f"{path}: leads out of {where}; --trust-paths, or {TRUST}=1, reads it"
    )


@contextmanager
def trusting(trusted: bool) -> Iterator[None]:
    """Let files name paths outside their folder for a while, in new processes too."""
    before = os.environ.get(TRUST, "")
    os.environ[TRUST] = "1" if trusted else before
    try:
        yield
    finally:
        os.environ[TRUST] = before


def is_trusted() -> bool:
    """Return whether files may name paths outside their folder."""
    return os.environ.get(TRUST) == "1"
