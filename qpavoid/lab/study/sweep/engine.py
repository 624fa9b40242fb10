"""Runs of a study on all cores; a process that is killed loses no finished run."""

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from time import perf_counter, sleep

from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import is_cached, lacking
from qpavoid.lab.study.sweep.job import Job, Row, run_job
from qpavoid.lab.study.sweep.store import Store
from qpavoid.lab.study.sweep.study import Study

CHUNK_S = 1.0
"""s that a worker is busy between two reports: the loss of a kill."""

MOST_RUNS = 500
"""Greatest number of runs in a chunk."""

TRIES = 2
"""Number of workers that a run may kill before it is given up."""

Results = list[tuple[Row, bytes | None]]


def sweep(
    study: Study,
    out: Path,
    workers: int | None = None,
    progress: Callable[[int, int], None] = lambda count, skipped: None,
) -> int:
    """Do every run of a study that is not done yet, and return how many these were.

    Rows are written as soon as a chunk of about a second comes back. A run that raises
    becomes a row with outcome ``failed``; one that kills its worker twice, when it is
    alone, one with outcome ``died``.

    Args:
        study: The grid.
        out: Folder of its results, see :class:`qpavoid.lab.study.sweep.store.Store`.
        workers: Processes; all cores by default, and with 1 this process alone.
        progress: Called with the runs done by now, and those that were done before.

    Raises:
        DataError: Another sweep writes into the folder, or a shard is damaged or cannot
            be written; what is finished is kept.
    """
    store, count, skipped = Store(out, study.text), 0, 0

    def pending() -> Iterator[Job]:
        nonlocal skipped
        for job in study.jobs():
            if job.run in done:
                skipped += 1
            else:
                yield job

    def keep(results: Results) -> None:
        nonlocal count
        store.save(results)
        count += len(results)
        progress(count, skipped)

    with store.alone():
        done = store.done(with_logs=study.trajectories == "all")
        chunks, many = _Chunks(pending()), workers or os.cpu_count() or 1
        if many > 1:
            _run_all(chunks, many, keep)
        else:
            for number, chunk in chunks:
                _, results, seconds = work(number, chunk)
                keep(results)
                chunks.back(number, seconds)
    return count


def work(number: int, chunk: list[Job]) -> tuple[int, Results, float]:
    """Do some runs; return them with the chunk's number and its time, s."""
    started = perf_counter()
    results = [run_job(job) for job in chunk]
    return number, results, perf_counter() - started


def _begin(parent: int) -> None:
    """Make a worker end with its parent, which alone handles interrupts."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)

    Thread(target=watch, daemon=True).start()


def _pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(
        workers, get_context("spawn"), initializer=_begin, initargs=(os.getpid(),)
    )


class _Chunks:
    """Pending jobs in chunks of about a second, by number.

    Attributes:
        out: The chunks that have not come back.
    """

    def __init__(self, pending: Iterator[Job]) -> None:
        self.out: dict[int, list[Job]] = {}
        self._pending, self._number, self._size = pending, 0, 1

    def __iter__(self) -> Iterator[tuple[int, list[Job]]]:
        while chunk := list(islice(self._pending, self._size)):
            self._number += 1
            self.out[self._number] = chunk
            yield self._number, chunk

    def back(self, number: int, seconds: float) -> None:
        """Take note of a chunk that came back."""
        n = len(self.out.pop(number))
        # At most doubled, for the first chunks may be quick by chance, and a chunk that
        # is too long costs more in a kill than a short one in messages.
        most = max(1, round(CHUNK_S * n / max(seconds, 1e-6)))
        self._size = min(most, 2 * self._size, MOST_RUNS)


def _run_all(chunks: _Chunks, workers: int, keep: Callable[[Results], None]) -> None:
    """Run all chunks; after a worker's death its chunks alone, then the rest."""
    if lacking() and not is_cached(filter_step):  # one compiles, the others read
        _run_alone([job for _, chunk in islice(chunks, 1) for job in chunk], keep)
        chunks.out.clear()
    while True:
        pool = _pool(workers)
        try:
            _run_in(pool, chunks, 2 * workers, keep)
            return
        except BrokenExecutor:
            # Nobody says whose run killed the worker: all that were out at the time are
            # done again one by one, each with a process to lose.
            suspects = [job for chunk in chunks.out.values() for job in chunk]
            chunks.out.clear()
            _run_alone(suspects, keep)
        finally:
            pool.shutdown(cancel_futures=True)


def _run_in(
    pool: ProcessPoolExecutor,
    chunks: _Chunks,
    most: int,
    keep: Callable[[Results], None],
) -> None:
    """Run chunks in a pool, at most so many at a time."""
    running: set[Future[tuple[int, Results, float]]] = set()
    while True:
        for chunk in islice(chunks, most - len(running)):
            running.add(pool.submit(work, *chunk))
        if not running:
            return
        ended, running = wait(running, return_when=FIRST_COMPLETED)
        for future in ended:
            number, results, seconds = future.result()
            keep(results)
            chunks.back(number, seconds)


def _run_alone(suspects: list[Job], keep: Callable[[Results], None]) -> None:
    """Do runs one at a time in a process of their own, to find the one that kills."""
    tries = dict.fromkeys(suspects, 0)
    while tries:
        with _pool(1) as pool:
            for job in list(tries):
                tries[job] += 1
                try:
                    _, (result,), _ = pool.submit(work, 0, [job]).result()
                except BrokenExecutor:
                    if tries[job] < TRIES:
                        break
                    what = f"killed its worker {TRIES} times"
                    result = job.row("died", what), None
                keep([result])
                del tries[job]
                if result[0]["outcome"] == "died":
                    break
