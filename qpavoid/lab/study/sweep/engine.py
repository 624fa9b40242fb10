"""Runs of a study on all cores or a cluster; whoever is killed, nothing is lost."""

import os
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from signal import SIGKILL
from tempfile import TemporaryDirectory
from threading import Thread
from time import perf_counter, sleep

from qpavoid.compiled import is_cached
from qpavoid.errors import MissingExtraError
from qpavoid.files import TRUST, is_trusted
from qpavoid.lab.load import packed
from qpavoid.lab.simulation.loop import close_loop
from qpavoid.lab.simulation.methods import find_entry
from qpavoid.lab.study.sweep.job import Job, Row, find_scene, run_job
from qpavoid.lab.study.sweep.store import Store
from qpavoid.lab.study.sweep.study import Study

try:
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky import get_reusable_executor
except ImportError:
    raise MissingExtraError("joblib", "study") from None

CHUNK_S = 1.0
"""s that a worker is busy between two reports; what a kill can cost."""

MOST_RUNS = 500
"""Runs in a chunk at most."""

TRIES = 2
"""How often a run may take its worker with it before it is given up."""

Results = list[tuple[Row, bytes | None]]


def sweep(
    study: Study,
    out: Path,
    workers: int | None = None,
    dask: str | None = None,
    progress: Callable[[int, int], None] = lambda count, skipped: None,
    merge: Iterable[Path] = (),
) -> int:
    """Do every run of a study that is not done yet, and return how many these were.

    Rows are written as soon as a chunk of about a second comes back. A run that raises
    becomes a row with outcome ``failed``; one that kills its worker twice, when it is
    alone, one with outcome ``died``.

    Args:
        study: The grid.
        out: Folder of its results, see :class:`qpavoid.lab.study.sweep.store.Store`.
        workers: Processes here; all cores by default.
        dask: Address of a Dask scheduler whose workers run instead. They are sent the
            modules and packages of one's own, and have all that these import.
        progress: Called with the runs done by now, and those that were done before.
        merge: Folders of results to take over first.

    Raises:
        DataError: Another sweep writes into the folder, or a shard is damaged or cannot
            be written; what is finished is kept.
        MissingExtraError: Dask is asked for and not installed.
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
        for folder in merge:
            store.merge(folder)
        done = store.done(with_logs=study.trajectories == "all")
        jobs = pending()
        if dask is None and not is_cached(close_loop):  # one compiles, the others read
            _run_alone(list(islice(jobs, 1)), keep)
        with _crew(dask, study) as killed, warnings.catch_warnings():
            # joblib replaces a worker that has grown: no leak, but the machine code
            # that it read
            warnings.filterwarnings("ignore", "A worker stopped", UserWarning)
            chunks = _Chunks(jobs, 0 if dask else os.getpid())
            _run_all(chunks, workers or os.cpu_count() or 1, keep, killed)
    return count


def work(chunk: list[Job], number: int, parent: int) -> tuple[int, Results, float]:
    """Do some runs in a worker; return them with the chunk's number and its time, s.

    Args:
        chunk: The runs.
        number: Of the chunk.
        parent: The process without which it ends; 0: it goes on.
    """
    if parent not in (0, os.getpid()):
        _end_with(parent)
    started = perf_counter()
    results = [run_job(job) for job in chunk]
    return number, results, perf_counter() - started


@lru_cache(maxsize=1)
def _end_with(parent: int) -> None:
    """End this process, whatever it does, when its parent has: looked at twice a s."""

    def watch() -> None:
        while os.getppid() == parent:
            sleep(0.5)
        os.kill(os.getpid(), SIGKILL)

    Thread(target=watch, daemon=True).start()


class _Chunks:
    """Hands out pending jobs in chunks of about a second, and knows who has which."""

    def __init__(self, pending: Iterator[Job], parent: int) -> None:
        self.out: dict[int, list[Job]] = {}
        self._pending, self._number, self._size = pending, 0, 1
        self._parent = parent

    def __iter__(self) -> Iterator[tuple[list[Job], int, int]]:
        while chunk := list(islice(self._pending, self._size)):
            self._number += 1
            self.out[self._number] = chunk
            yield chunk, self._number, self._parent

    def back(self, number: int, seconds: float) -> None:
        """Take note of a chunk that came back."""
        n = len(self.out.pop(number))
        # At most doubled, for the first chunks may be quick by chance, and a chunk that
        # is too long costs more in a kill than a short one in messages.
        most = max(1, round(CHUNK_S * n / max(seconds, 1e-6)))
        self._size = min(most, 2 * self._size, MOST_RUNS)


def _run_all(
    chunks: _Chunks,
    workers: int,
    keep: Callable[[Results], None],
    killed: tuple[type[BaseException], ...],
) -> None:
    """Run all chunks; after a worker's death its chunks alone, then the rest."""
    while True:
        parallel = Parallel(n_jobs=workers, return_as="generator_unordered")
        try:
            for number, results, seconds in parallel(
                delayed(work)(*chunk) for chunk in chunks
            ):
                keep(results)
                chunks.back(number, seconds)
            return
        except killed:
            # Nobody says whose run it was that took the worker along; all that were out
            # at the time are done again one by one, each with a process to lose.
            suspects = [job for chunk in chunks.out.values() for job in chunk]
            chunks.out.clear()
            _run_alone(suspects, keep)


def _run_alone(suspects: list[Job], keep: Callable[[Results], None]) -> None:
    """Do runs one at a time in a process of their own, to find the one that kills."""
    # A spawned pool of one is broken by the job that kills it, and by no other.
    tries = dict.fromkeys(suspects, 0)
    while tries:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            for job in list(tries):
                tries[job] += 1
                try:
                    _, (result,), _ = pool.submit(work, [job], 0, os.getpid()).result()
                except BrokenExecutor:
                    if tries[job] < TRIES:
                        break
                    what = f"killed its worker {TRIES} times"
                    result = job.row("died", what), None
                keep([result])
                del tries[job]
                if result[0]["outcome"] == "died":
                    break


@contextmanager
def _crew(dask: str | None, study: Study) -> Iterator[tuple[type[BaseException], ...]]:
    """Let joblib find its workers, here or at a scheduler; give their deaths."""
    if dask is None:
        _end_workers_of_another(tuple(sys.path), is_trusted())
        yield (BrokenExecutor,)
        return
    try:
        from dask.distributed import Client, KilledWorker
    except ImportError:
        raise MissingExtraError("dask.distributed", "dask") from None
    with Client(dask) as client, parallel_config(backend="dask"):
        with TemporaryDirectory() as folder:
            for file in {packed(place, Path(folder)) for place in study.own()} - {None}:
                client.upload_file(str(file))
        client.run(os.environ.update, {TRUST: str(int(is_trusted()))})
        for memory in (find_entry, find_scene):  # of workers that had another version
            client.run(memory.cache_clear)
        yield (KilledWorker,)


@lru_cache(maxsize=1)
def _end_workers_of_another(path: tuple[str, ...], trusted: bool) -> None:
    """End joblib's workers, which look for files where the last sweep had them."""
    get_reusable_executor().shutdown(wait=True)
