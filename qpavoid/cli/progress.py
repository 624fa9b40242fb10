"""One bar for all that takes long, where there is a terminal."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeAlias

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
def waiting(quiet: bool = False) -> Iterator[Callable[[str], None]]:
    """Print on stderr what is being done; on a terminal with a sign of life."""
    from rich.console import Console

    console = Console(stderr=True, quiet=quiet)
    alive = console.status("…")

    def say(step: str) -> None:
        console.print(step, soft_wrap=True)
        alive.start()

    try:
        yield say
    finally:
        alive.stop()


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
