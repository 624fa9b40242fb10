"""Every reader among damaged files: our own errors alone, in a second, in 500 MB.

A whole file of each kind is damaged at random: bits flipped, numbers made extreme,
pieces cut, doubled, moved or nested; half of those with checksums get new ones, so that
what lies behind is reached too. Each reader runs in a process that may not take more
than 500 MB of addresses beyond what it had before; the time is that of the processor.

    python -m reliability.damage COUNT [READER …]
"""

import gzip
import io
import json
import os
import random
import re
import resource
import signal
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from qpavoid.errors import QPAvoidError
from reliability.data import add_row

MOST_S, MOST_MB = 1.0, 500

EXTREME = (
    *(b"0", b"-1", b"1e999", b"-1e308", b"1e-308", b"nan", b"inf", b"1e9", b"1e12"),
    *(b"1000000000", b"9223372036854775808", 5000 * b"9", b"0x" + 5000 * b"f", b"1.5"),
    *(b'""', b"true", b"[]", b"{}", b"null", b'"x"', b"2020-01-01", b"1_0", b"0:1e18"),
)
"""What a number in a text becomes."""

HOSTILE = (
    *(3000 * b"[", 3000 * b"{", 500 * b"a." + b"b = 1\n", 3000 * b'{"a":', b"\0"),
    *(b"\xff\xfe", b"../" * 20 + b"etc/passwd", b"/dev/zero", b"&a [*a]", b"<!DOCTYPE"),
    *(b"\n", b'"', b"'''", b"#", b"\r", "é".encode("utf-16"), 100_000 * b"a"),
)
"""What is put into a text."""

WORDS = [b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f"]
WORDS += [struct.pack("<Q", x) for x in (0, 1, 2**31, 2**40, 2**62, 2**64 - 1)]
WORDS += [struct.pack("<d", x) for x in (np.nan, np.inf, -1e308, 1e12)]
"""What is put into bytes."""

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
        make: Writes whole files into a folder; returns those that are damaged.
        read: What is tried with a damaged one.
        text: Whether it is damaged as a text too.
        mend: Gives damaged content new checksums.
    """

    make: Callable[[Path], list[Path]]
    read: Callable[[Path], Any]
    text: bool = True
    mend: Callable[[bytes, random.Random], bytes] | None = None


def damaged(content: bytes, text: bool, rng: random.Random) -> bytes:
    """Return content with one to four damages."""
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        content = rng.choice((*ANY, *(TEXT if text else BINARY)))(content, rng)
    return content


def flip(content: bytes, rng: random.Random) -> bytes:
    """Turn a bit over."""
    if not content:
        return content
    found = bytearray(content)
    found[rng.randrange(len(found))] ^= 1 << rng.randrange(8)
    return bytes(found)


def cut(content: bytes, rng: random.Random) -> bytes:
    """Leave out a piece, or all that follows."""
    low, high = sorted(rng.randrange(len(content) + 1) for _ in range(2))
    return content[:low] + (content[high:] if rng.random() < 0.7 else b"")


def double(content: bytes, rng: random.Random) -> bytes:
    """Repeat a piece somewhere."""
    low = rng.randrange(len(content) + 1)
    at, piece = rng.randrange(len(content) + 1), content[low : low + rng.randrange(500)]
    return content[:at] + piece * rng.choice((1, 2, 50)) + content[at:]


def overwrite(content: bytes, rng: random.Random) -> bytes:
    """Put an extreme word over some bytes, mostly near the beginning or the end."""
    word, size = rng.choice(WORDS), len(content)
    at = rng.choice((rng.randrange(size + 1), rng.randrange(200), size - 60))
    at = min(max(at, 0), size)
    return content[:at] + word + content[at + len(word) :]


def renumber(content: bytes, rng: random.Random) -> bytes:
    """Make a number an extreme one."""
    found = [*NUMBER.finditer(content)]
    if not found:
        return content
    one = rng.choice(found)
    return content[: one.start()] + rng.choice(EXTREME) + content[one.end() :]


def intrude(content: bytes, rng: random.Random) -> bytes:
    """Put something hostile somewhere."""
    at = rng.randrange(len(content) + 1)
    return content[:at] + rng.choice(HOSTILE) + content[at:]


def reorder(content: bytes, rng: random.Random) -> bytes:
    """Leave out, repeat or move a line."""
    lines = content.split(b"\n")
    line = lines.pop(rng.randrange(len(lines)))
    for _ in range(rng.choice((0, 1, 2))):
        lines.insert(rng.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


def exchange(content: bytes, rng: random.Random) -> bytes:
    """Put a word of the text in another's place."""
    found = [*re.finditer(rb"[\w.\"-]+", content)]
    if not found:
        return content
    one, other = rng.choice(found), rng.choice(found)
    return content[: one.start()] + other[0] + content[one.end() :]


ANY = (flip, cut, double)
BINARY = (flip, overwrite, overwrite)
TEXT = (renumber, renumber, intrude, reorder, exchange)


def rezipped(content: bytes, rng: random.Random) -> bytes:
    """Return an archive of the same parts, one of them damaged, all sums right."""
    made = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as parts,
        zipfile.ZipFile(made, "w") as to,
    ):
        chosen = rng.choice(parts.namelist())
        for name in parts.namelist():
            part = parts.read(name)
            to.writestr(name, damaged(part, False, rng) if name == chosen else part)
    return made.getvalue()


def rechunked(content: bytes, rng: random.Random) -> bytes:
    """Return a PNG one of whose chunks is damaged, all sums right."""
    found, at = [content[:8]], 8
    hit = rng.randrange(4)
    for k in range(100):
        if at + 8 > len(content):
            break
        (size,) = struct.unpack(">I", content[at : at + 4])
        kind, body = content[at + 4 : at + 8], content[at + 8 : at + 8 + size]
        if k == hit:
            body = damaged(body, False, rng)
        sums = struct.pack(">I", zlib.crc32(kind + body))
        found.append(struct.pack(">I", len(body)) + kind + body + sums)
        at += 12 + size
    return b"".join(found)


def regzipped(content: bytes, rng: random.Random) -> bytes:
    """Return a compressed text that is damaged before it is compressed."""
    return gzip.compress(damaged(gzip.decompress(content), True, rng), 1)


def spoiled(kind: Kind, content: bytes, rng: random.Random) -> bytes:
    """Return damaged content of a kind."""
    if kind.mend is not None and rng.random() < 0.5:
        return kind.mend(content, rng)
    return damaged(content, kind.text, rng)


class Slow(BaseException):
    """A reader took its second."""


def _ring(*_: object) -> None:
    raise Slow


def fuzz(name: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Read so many damaged files of a kind in this process; return what came of it."""
    from reliability.kinds import KINDS

    kind, rng = KINDS[name], random.Random(f"{name} {seed}")
    found = {"reader": name, "mutations": count, "read": 0, "refused": 0}
    foreign: list[str] = []
    slowest = 0.0
    with TemporaryDirectory() as folder:
        files = kind.make(Path(folder))
        whole = [file.read_bytes() for file in files]
        for file in files:
            kind.read(file)
        before = _addresses()
        most = before + MOST_MB * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        signal.signal(signal.SIGPROF, _ring)
        grown = _resident()
        for _ in range(count):
            k = rng.randrange(len(files))
            files[k].write_bytes(spoiled(kind, whole[k], rng))
            begun = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, MOST_S)
            try:
                kind.read(files[k])
                found["read"] += 1
            except QPAvoidError as error:
                found["refused"] += 1
                str(error)
            except (Slow, Exception) as error:
                foreign.append(f"{type(error).__name__}: {error}"[:200])
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0.0)
            slowest = max(slowest, time.process_time() - begun)
            files[k].write_bytes(whole[k])
    return found | {
        "foreign": len(foreign),
        "worst_s": round(slowest, 3),
        "most_mb": round((_resident() - grown) / 2**20),
        "what": sorted(set(foreign))[:10],
    }


def _addresses() -> int:
    """Return how much address space this process has, bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    return pages * resource.getpagesize()


def _resident() -> int:
    """Return the greatest memory that this process has held, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def fuzz_apart(name: str, count: int, seed: int = 0) -> dict[str, Any]:
    """Do the same in a process of its own.

    Raises:
        RuntimeError: It died, of a signal for example.
    """
    command = [sys.executable, "-m", "reliability.damage", "--one", name]
    where = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [*command, str(count), str(seed)], capture_output=True, text=True, env=where
    )
    if done.returncode:
        raise RuntimeError(f"{name}: exit {done.returncode}: {done.stderr[-500:]}")
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> None:
    """Fuzz every reader, or some, and keep what came of it beside the page."""
    from reliability.kinds import KINDS

    if sys.argv[1] == "--one":
        name, count, seed = sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
        print(json.dumps(fuzz(name, count, seed)))
        return
    for name in sys.argv[2:] or KINDS:
        found = fuzz_apart(name, int(sys.argv[1]))
        print(found, flush=True)
        found.pop("what")
        add_row("files", "reader", found)


if __name__ == "__main__":
    main()
