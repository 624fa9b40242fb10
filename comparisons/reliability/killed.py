"""Sweeps that are killed, and bits of their files that are flipped.

python comparisons/reliability/killed.py [KILLS]
"""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.errors import DataError
from qpavoid.lab.study.sweep.job import CLOCK
from qpavoid.lab.study.sweep.store import read_rows, shards
from reliability.data import add_row

SCENE = """title = "Past"
duration_s = 3.0
dt_s = 0.05
reference = { kind = "spline", points_m = [[0.0, 0.0], [2.0, 0.5]], speed_mps = 0.7 }
[[obstacles]]
kind = "random"
count = 3
low_m = [1.0, -1.0]
high_m = [3.0, 1.0]
"""

STUDY = """title = "Long"
controllers = ["eq5", "qp"]
seeds = "0:1000"
scenarios = [{ config = "past.toml" }]
"""

AFTER = 2.0
"""Time after a kill in which all of its processes must end, s."""


def killed(folder: Path, kills: int) -> dict[str, Any]:
    """Return what remains of a sweep that is killed, and rows that differ."""
    (folder / "past.toml").write_text(SCENE)
    (folder / "study.toml").write_text(STUDY)
    rng, left, parts = random.Random(0), 0, 0
    out, mark = folder / "out", f"{folder.name}-{os.getpid()}"
    for _ in range(kills):
        before = len(shards(out))
        process = start(folder, out, mark)
        while len(shards(out)) == before:
            time.sleep(0.05)
        time.sleep(rng.uniform(0.0, 1.5))
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        time.sleep(AFTER)
        left += len(marked(mark))
        parts += len([*out.glob("*/.*")])
    done = start(folder, out, mark).wait()
    whole = start(folder, folder / "whole", mark).wait()
    rows, others = bare(out), bare(folder / "whole")
    return {
        "kills": kills,
        "rows": len(rows),
        "processes left": left,
        "files left": parts,
        "rows that differ": sum(rows[run] != others.get(run) for run in rows),
        "exit status": max(done, whole),
    }


def start(folder: Path, out: Path, mark: str) -> "subprocess.Popen[bytes]":
    """Start the sweep with a mark in the environment of its processes."""
    command = [sys.executable, "-m", "qpavoid", "sweep", str(folder / "study.toml")]
    return subprocess.Popen(
        [*command, "--out", str(out), "--workers", "2"],
        env={**os.environ, "MARK": mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def marked(mark: str) -> list[Path]:
    """Return the living processes with a mark in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            if f"MARK={mark}".encode() in path.read_bytes().split(b"\0"):
                found.append(path)
        except OSError:
            continue
    return found


def bare(out: Path) -> dict[str, dict[str, Any]]:
    """Return rows by run, without times."""
    return {
        row["run"]: {k: v for k, v in row.items() if k not in CLOCK}
        for row in read_rows(out)
    }


def unnoticed(folder: Path, count: int) -> tuple[int, int]:
    """Flip bits of shards; return their number, and how many were not noticed."""
    rng, passed = random.Random(1), 0
    for _ in range(count):
        path = rng.choice(shards(folder))
        whole = path.read_bytes()
        flipped = bytearray(whole)
        flipped[rng.randrange(len(whole))] ^= 1 << rng.randrange(8)
        path.write_bytes(flipped)
        try:
            read_rows(folder)
            passed += 1
        except DataError:
            pass
        path.write_bytes(whole)
    return count, passed


def main() -> None:
    with TemporaryDirectory() as place:
        folder = Path(place)
        row = killed(folder, int(sys.argv[1]) if len(sys.argv) > 1 else 10)
        row["bits"], row["bits not noticed"] = unnoticed(folder / "out", 300)
    print(row)
    add_row("sweeps", "kills", row)


if __name__ == "__main__":
    main()
