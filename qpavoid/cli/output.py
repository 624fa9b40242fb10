"""Output of commands: tables for people, or JSON for programs."""

import json
import math
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qpavoid.errors import QPAvoidError

if TYPE_CHECKING:
    from rich.console import Console

FILE_WIDTH = 200
"""Columns of a table in a file."""


class UsageError(QPAvoidError):
    """The command itself is wrong: an option or argument that it cannot take."""


@contextmanager
def told_by(option: str, *wrong: type[QPAvoidError]) -> Iterator[None]:
    """Blame an option for such an error of what is made of it.

    Raises:
        UsageError: With the option's name.
    """
    try:
        yield
    except wrong as error:
        raise UsageError(f"{option}: {error}") from None


def make_console(quiet: bool = False) -> "Console":
    """Return where tables are printed; in a file they are wide."""
    from rich.console import Console

    class Piped(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    console = Piped(quiet=quiet)
    return console if console.is_terminal else Piped(width=FILE_WIDTH, quiet=quiet)


def give(options: Namespace, data: Any, show: Callable[[], None]) -> None:
    """Print data as JSON where that is asked for, else show them."""
    if not options.json:
        show()
        return
    print(json.dumps(_plain(data), indent=1, ensure_ascii=False, allow_nan=False))


def _plain(value: Any) -> Any:
    """Return what JSON can say: of numbers that are not finite it is null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(value[key]) for key in value}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value


def show_table(heads: Sequence[str], lines: Iterable[Sequence[object]]) -> None:
    """Print a table as those of runs are."""
    from rich.table import Table
    from rich.text import Text

    table = Table(*heads)
    for line in lines:
        table.add_row(*(Text(str(cell)) for cell in line))
    make_console().print(table)
