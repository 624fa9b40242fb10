"""Output of commands: tables for people, or JSON for programs."""

import json
import signal
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

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


def make_console() -> "Console":
    """Return where tables are printed; in a file they are wide."""
    from rich.console import Console

    class Piped(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    console = Piped()
    return console if console.is_terminal else Piped(width=FILE_WIDTH)


def give(options: Namespace, data: Any, show: Callable[[], None]) -> None:
    """Print data as JSON where that is asked for, else show them."""
    if not options.json:
        show()
        return
    from qpavoid.lab.study.tables import plain

    print(json.dumps(plain(data), indent=1, ensure_ascii=False, allow_nan=False))


def show_table(heads: Sequence[str], lines: Iterable[Sequence[object]]) -> None:
    """Print a table as those of runs are."""
    from rich.table import Table
    from rich.text import Text

    table = Table(*heads)
    for line in lines:
        table.add_row(*(Text(str(cell)) for cell in line))
    make_console().print(table)


Progress: TypeAlias = Callable[[int, int], None]
"""Called with how much is done, and how much need not be done."""

SHOWN_S = 3.0
"""s; shorter tasks have no progress bar."""


@contextmanager
def progress(
    total: int, title: str, unit: str, quiet: bool = False
) -> Iterator[Progress]:
    """Show a bar with rate and remaining time, on a terminal alone."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (*Bar.get_default_columns()[:2], MofNCompleteColumn())
    console = Console(stderr=True)
    bar = Bar(*columns, "{task.fields[rate]}", TimeRemainingColumn(), console=console)
    bar.disable = quiet or not console.is_terminal
    started = perf_counter()

    def show(count: int, skipped: int) -> None:
        passed = perf_counter() - started
        rate = f"{count / passed:.1f} {unit}/s"
        bar.update(task, completed=count + skipped, rate=rate)
        if passed > SHOWN_S:
            bar.start()

    task = bar.add_task(title, total=total, rate="")
    try:
        yield show
    finally:
        bar.stop()


@contextmanager
def between_steps(show: Progress) -> Iterator[Progress]:
    """Let an interrupt wait for the next step; a second one does not.

    Raised inside a compiled call it would become an error of the interpreter.
    """
    before = signal.getsignal(signal.SIGINT)
    pending: list[object] = []

    def call(count: int, skipped: int) -> None:
        if pending:
            raise KeyboardInterrupt
        show(count, skipped)

    def wait(*_: object) -> None:
        pending.append(signal.signal(signal.SIGINT, before))

    signal.signal(signal.SIGINT, wait)
    try:
        yield call
    finally:
        signal.signal(signal.SIGINT, before)
