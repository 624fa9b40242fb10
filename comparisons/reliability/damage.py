"""Damaged files of every kind, read in a process with limits of time and memory.

A file of each kind is damaged at random: bits flipped, numbers made extreme, pieces
cut or inserted. Each reader runs in a process that may allocate 500 MB. Errors of
the package count as refused; other errors, and reads of more than a second of processor
time, as foreign.

    python comparisons/reliability/damage.py COUNT [READER …]
"""

import random
import re
import resource
import shutil
import signal
import struct
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from qpavoid.errors import QPAvoidError
from qpavoid.lab.scenario.config import builtin_configs, config_folder
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.bags import BagWriter, bag_drive
from qpavoid.lab.study.replay import read_parameters
from qpavoid.lab.study.sweep.study import read_study
from qpavoid.lab.worlds import barn, crowd
from qpavoid.lab.worlds.map_server import read_image, read_map
from qpavoid.lab.worlds.source import read_points

MOST_S, MOST_MB = 1.0, 500
EXTREME = b'0 -1 1e999 -1e308 nan inf 1e12 9223372036854775808 1.5 "" true [] {} null'
NUMBERS = (*EXTREME.split(), 5000 * b"9", b"0x" + 5000 * b"f")
PIECES = (
    *(3000 * b"[", 3000 * b'{"a":', 500 * b"a." + b"b = 1\n", b"\0", b"\xff\xfe"),
    *(b"../" * 20 + b"etc/passwd", b"/dev/zero", b"&a [*a]", b"<!DOCTYPE", b'"', b"\n"),
    *(100_000 * b"a", *(struct.pack("<Q", x) for x in (0, 2**31, 2**62, 2**64 - 1))),
)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """Return content with one to four damages."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice((flip, cut, insert, overwrite, renumber))(content, rng)
    return content


def flip(content: bytes, rng: random.Random) -> bytes:
    """Flip a bit."""
    found = bytearray(content or b"\0")
    found[rng.randrange(len(found))] ^= 1 << rng.randrange(8)
    return bytes(found)


def cut(content: bytes, rng: random.Random) -> bytes:
    """Remove a piece, or all that follows."""
    low, high = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    return content[:low] + (content[high:] if rng.random() < 0.7 else b"")


def insert(content: bytes, rng: random.Random) -> bytes:
    """Insert a hostile piece, or a piece of the content."""
    low, at = (rng.randrange(len(content) + 1) for _ in range(2))
    own = content[low : low + rng.randrange(500)] * rng.choice((1, 2, 50))
    return content[:at] + rng.choice((own, rng.choice(PIECES))) + content[at:]


def overwrite(content: bytes, rng: random.Random) -> bytes:
    """Overwrite eight bytes, mostly near the beginning or the end."""
    size, word = len(content), rng.choice(PIECES)[:8]
    at = rng.choice((rng.randrange(size + 1), rng.randrange(200), size - 60))
    at = min(max(at, 0), size)
    return content[:at] + word + content[at + len(word) :]


def renumber(content: bytes, rng: random.Random) -> bytes:
    """Replace a number by an extreme one."""
    found = [*re.finditer(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?", content)]
    if not found:
        return content
    low, high = rng.choice(found).span()
    return content[:low] + rng.choice(NUMBERS) + content[high:]


# ------------------------------------------------------------------ files and readers
PIXELS = np.random.default_rng(0).choice([0, 128, 254], (12, 20)).astype(np.uint8)
TEXTS = {
    "points.csv": "x,y\n1.5,-1.5\n1.6,-1.5\n",
    "study.toml": 'title = "Small"\ncontrollers = ["eq5", "qp:osqp"]\nseeds = "0:8:2"\n'
    '[settings]\n"radius.r_min_slow_m" = [0.05, 0.1]\n'
    '[[scenarios]]\nconfig = "trap.toml"\n'
    '[[generators]]\nkind = "forest"\nfamily = 2\nseeds = [1, 2]\n',
    "map.yaml": "image: a.pgm\nresolution: 0.1\norigin: [-5.0, 5.0, 0.0]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
    "w.world": '<sdf version="1.6"><world name="w"><model name="c"><pose>1 5 0 0 0 0'
    "</pose><link><collision><geometry><cylinder><radius>0.075</radius><length>1"
    "</length></cylinder></geometry></collision></link></model></world></sdf>\n",
    "obsmat.txt": "\n".join(f"{6 * k} 1 {k} 0 0.5 0.1 0 0.2" for k in range(12)),
}
"""Contents of text files by name."""


def write_files(folder: Path) -> None:
    """Write a whole file of every kind."""
    for name, content in TEXTS.items():
        (folder / name).write_text(content)
    (folder / "a.pgm").write_bytes(b"P5\n20 12\n255\n" + PIXELS.tobytes())
    shutil.copy(builtin_configs()["demo/trap"], folder / "trap.toml")
    shutil.copy(config_folder() / "ros" / "mir.yaml", folder)
    run(load_scenario("demo/trap"), "alone").save(folder / "log.npz")
    np.save(folder / "points.npy", np.ones((4, 2)))
    with BagWriter(folder / "bag") as bag:
        for k in range(10):
            for topic, kind in BAG.items():
                message = bag.stamped(kind, 1e9 + 0.1 * k, "base")
                bag.write(topic, kind, 1e9 + 0.1 * k, message)


BAG = {
    "/scan": "sensor_msgs/msg/LaserScan",
    "/odom": "nav_msgs/msg/Odometry",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
}


KINDS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "scenario": ("trap.toml", load_scenario),
    "study": ("study.toml", read_study),
    "log": ("log.npz", Log.load),
    "npy": ("points.npy", read_points),
    "csv": ("points.csv", read_points),
    "map": ("map.yaml", read_map),
    "parameters": ("mir.yaml", read_parameters),
    "pgm": ("a.pgm", read_image),
    "sdf": ("w.world", barn.read_world),
    "obsmat": ("obsmat.txt", lambda path: crowd.read_tracks(path, 15.0)),
    "bag, mcap": ("bag/bag.mcap", lambda path: bag_drive(path.parent, None, "")),
}
"""Files of :func:`write_files`, and their readers."""


class Slow(BaseException):
    """Raised in a reader after :data:`MOST_S` of processor time."""


def ring(*_: object) -> None:
    raise Slow


def pages(column: int) -> int:
    """Return a number of ``/proc/self/statm``, bytes: 0 addresses, 1 resident."""
    words = Path("/proc/self/statm").read_text().split()
    return int(words[column]) * resource.getpagesize()


def fuzz(name: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Return the counts of some damaged files of a kind, read in this process."""
    (file, read), rng = KINDS[name], random.Random(f"{name} {seed}")
    found = {"reader": name, "mutations": count, "read": 0, "refused": 0, "foreign": 0}
    errors, slowest = set[str](), 0.0
    with TemporaryDirectory() as folder:
        write_files(Path(folder))
        path = Path(folder) / file
        whole = path.read_bytes()
        read(path)
        most, resident = pages(0) + MOST_MB * 2**20, pages(1)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        signal.signal(signal.SIGPROF, ring)
        for _ in range(count):
            path.write_bytes(damaged(whole, rng))
            begun = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, MOST_S)
            try:
                read(path)
                found["read"] += 1
            except QPAvoidError as error:
                found["refused"] += len(str(error)) > 0
            except (Slow, Exception) as error:
                found["foreign"] += 1
                errors.add(f"{type(error).__name__}: {error}"[:200])
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            slowest = max(slowest, time.process_time() - begun)
        grown = round((pages(1) - resident) / 2**20)
    more = {"worst_s": round(slowest, 3), "most_mb": grown, "what": sorted(errors)[:10]}
    return found | more


def fuzz_apart(name: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Return the same from a process of its own; BrokenProcessPool: it died."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(fuzz, name, count, seed).result()


def main() -> None:
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    from reliability.page import add_row  # its plots are not for a process with limits

    for name in sys.argv[2:] or KINDS:
        found = fuzz_apart(name, int(sys.argv[1]))
        print(found, flush=True)
        del found["what"]
        add_row("files", found)


if __name__ == "__main__":
    main()
