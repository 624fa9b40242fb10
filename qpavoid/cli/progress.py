"""One bar for all that takes long; without a terminal, a line now and then."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with how much is done, and how much need not be done."""

SAID_S, DRAWN_S = 10.0, 0.1
"""s between two lines where there is no terminal, and between two looks of the bar."""


@contextmanager
def progress(total: int, title: str, unit: str) -> Iterator[Progress]:
    """Show a bar with rate and remaining time."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    bar = Bar(
        *Bar.get_default_columns()[:2],
        MofNCompleteColumn(),
        "{task.fields[rate]}",
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    started = said = perf_counter()

    def show(count: int, skipped: int) -> None:
        nonlocal said
        now, done = perf_counter(), count + skipped
        if done < total and now - said < (SAID_S if bar.disable else DRAWN_S):
            return
        said, rate = now, count / (now - started)
        bar.update(task, completed=done, rate=f"{rate:.1f} {unit}/s")
        if bar.disable:
            left = (total - done) / rate if rate else float("inf")
            print(
                f"{done} of {total} {unit}, {rate:.1f} a second, {left:.0f} s to go",
                file=sys.stderr,
                flush=True,
            )

    with bar:
        task = bar.add_task(title, total=total, rate="")
        yield show


@contextmanager
def stops_between_calls(progress: Progress) -> Iterator[Progress]:
    """Let an interrupt wait for the next call of a progress; a second one does not.

    Raised inside a compiled call it would become an error of the interpreter.
    """
    interrupted = False

    def note(*_: object) -> None:
        nonlocal interrupted
        interrupted = True
        signal.signal(signal.SIGINT, before)

    def call(count: int, skipped: int) -> None:
        if interrupted:
            raise KeyboardInterrupt
        progress(count, skipped)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield call
    finally:
        signal.signal(signal.SIGINT, before)
