"""Runs of a study on all cores; a process that is killed loses no finished run."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import suppress
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from time import sleep
from typing import TypeAlias

from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import is_cached, lacking
from qpavoid.lab.study.sweep.job import Job, Row, run_job
from qpavoid.lab.study.sweep.store import Store
from qpavoid.lab.study.sweep.study import Study

SHARD_S = 1.0
"""s of the runs in a shard: the loss of a kill."""

TRIES = 2
"""Number of workers that a run may kill before it is given up."""

Result: TypeAlias = tuple[Row, bytes | None]


def sweep(
    study: Study,
    out: Path,
    workers: int | None = None,
    progress: Callable[[int, int], None] = lambda count, skipped: None,
) -> int:
    """Do every run of a study that is not done yet, and return how many these were.

    Rows are written after each second of runs. A run that raises becomes a row with
    outcome ``failed``; one that kills its worker twice, when it is alone, one with
    outcome ``died``.

    Args:
        study: The grid.
        out: Folder of its results, see :class:`qpavoid.lab.study.sweep.store.Store`.
        workers: Processes; all cores by default, and with 1 this process alone.
        progress: Called with the runs done by now, and those that were done before.

    Raises:
        DataError: Another sweep writes into the folder, or a shard is damaged or cannot
            be written; what is finished is kept.
    """
    store, count, many = Store(out, study.text), 0, workers or os.cpu_count() or 1
    with store.alone():
        done = store.done(with_logs=study.trajectories == "all")
        jobs = [job for job in study.jobs() if job.run not in done]
        results = _in_workers(jobs, many) if many > 1 else map(run_job, jobs)
        found, spent = list[Result](), 0.0
        for row, log in results:
            found.append((row, log))
            spent += float(row["wall_s"] or SHARD_S)
            if spent >= SHARD_S or count + len(found) == len(jobs):
                store.save(found)
                count, found, spent = count + len(found), [], 0.0
                progress(count, len(study) - len(jobs))
    return count


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


def _in_workers(jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Yield all results; after a worker's death those of its time alone, then more."""
    left = iter(jobs)
    if lacking() and not is_cached(filter_step):  # one compiles, the others read
        yield from _alone([*islice(left, 1)])
    while True:
        running: dict[Future[Result], Job] = {}
        pool = _pool(workers)
        try:
            while True:
                for job in islice(left, 2 * workers - len(running)):
                    running[pool.submit(run_job, job)] = job
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED)[0]:
                    yield future.result()
                    del running[future]
        except BrokenExecutor:
            # Nobody says whose run killed the worker: all that were out at the time are
            # done again one by one, each with a process to lose.
            yield from _alone([*running.values()])
        finally:
            pool.shutdown(cancel_futures=True)


def _alone(jobs: Sequence[Job]) -> Iterator[Result]:
    """Yield results of runs in a process of their own, to find the one that kills."""
    for job in jobs:
        result: Result = (job.row("died", f"killed its worker {TRIES} times"), None)
        for _ in range(TRIES):
            with suppress(BrokenExecutor), _pool(1) as pool:
                result = pool.submit(run_job, job).result()
                break
        yield result
