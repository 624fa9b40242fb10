"""Computing time of fresh processes, with and without compiled code on disk.

python comparisons/timing/cold_start.py
"""

import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import qpavoid
from timing.tables import table_text
from timing.trials import Row

NOTHING = ("-c", "")
NUMPY = ("-c", "import numpy")
NUMBA = ("-c", "import numba")
IMPORT = ("-c", "import qpavoid")
LOAD = ("-c", "import qpavoid; qpavoid.SafetyFilter")
FILTER = (
    "-c",
    "import qpavoid as qp\n"
    "safety = qp.SafetyFilter(qp.Robot.mir100())\n"
    "safety.filter(v=0.6, omega=0.0, points=[(0.9, 0.1)])",
)
COMPILED = ("-c", "import os\nos.environ['QPAVOID_NATIVE'] = '0'\n" + FILTER[1])
RUN = ("-m", "qpavoid", "run", "paper/test_case_2", "--out", "out")

STARTS = (
    ("an empty interpreter", NOTHING),
    ("import numpy", NUMPY),
    ("import numba", NUMBA),
    ("import qpavoid", IMPORT),
    ("import qpavoid, and its filter", LOAD),
    ("first filtered twist", FILTER),
    ("qpavoid run: closed loop, Matplotlib, figures", RUN),
    ("first filtered twist ever, without the machine code: compiles", COMPILED),
    ("the same, second start", COMPILED),
)
"""Names of the processes, and arguments of Python."""


def cold_starts(progress: Callable[[str], None] = lambda what: None) -> list[Row]:
    """Time whole processes, from their start to their end.

    What numba compiles is kept in a temporary folder, which is empty at first; the
    package's own cache is not touched.

    Args:
        progress: Called with what is started next.

    Returns:
        ``start``, ``seconds`` (None: it failed), those of the processor, which depend
        less on other load, and ``error``.
    """
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        for what, arguments in STARTS:
            progress(what)
            before = processor_time()
            seconds, error = _timed(arguments, Path(folder) / "cache", folder)
            took = None if seconds is None else processor_time() - before
            row = {"start": what, "seconds": seconds, "processor_s": took}
            rows.append(row | {"error": error})
    return rows


def processor_time() -> float:
    """Return what the processes that have ended took of the processor, s."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _timed(
    arguments: tuple[str, ...], cache: Path, folder: str
) -> tuple[float | None, str]:
    package = str(Path(qpavoid.__file__).parents[1])
    paths = [package, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(cache),
        "PYTHONPATH": os.pathsep.join(paths),
    }
    started = perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    seconds = perf_counter() - started
    if done.returncode:
        return None, (done.stderr.strip().splitlines() or ["no message"])[-1]
    return seconds, ""


def main() -> None:
    heads = {
        "start": "fresh process",
        "seconds": "s",
        "processor_s": "of the processor",
    }
    print(table_text(heads | {"error": "error"}, cold_starts(print)))


if __name__ == "__main__":
    main()
