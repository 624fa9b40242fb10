"""One bar for all that takes long; without a terminal, a line now and then."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with how much is done, and how much need not be done."""

SAID_S = 10.0
"""s between two lines where there is no terminal."""


@contextmanager
def progress(total: int, title: str, unit: str) -> Iterator[Progress]:
    """Show a bar with rate and remaining time."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (*Bar.get_default_columns()[:2], MofNCompleteColumn())
    console = Console(stderr=True)
    bar = Bar(*columns, "{task.fields[rate]}", TimeRemainingColumn(), console=console)
    bar.disable = not console.is_terminal
    started = said = perf_counter()

    def show(count: int, skipped: int) -> None:
        nonlocal said
        done, now = count + skipped, perf_counter()
        rate = f"{count / (now - started):.1f} {unit}/s"
        bar.update(task, completed=done, rate=rate)
        if bar.disable and (done == total or now - said > SAID_S):
            said = now
            print(f"{done} of {total} {unit}, {rate}", file=sys.stderr, flush=True)

    with bar:
        task = bar.add_task(title, total=total, rate="")
        yield show


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
