"""Sweeps that are killed, shared, damaged: nothing is left over or believed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("pyarrow", reason="needs qpavoid[study]")

from qpavoid.cli import main
from qpavoid.errors import DataError
from qpavoid.lab.study.sweep import engine, store
from qpavoid.lab.study.sweep.store import Store, read_provenance, read_rows, shards
from sweep_sources import DOCUMENT, toml, write_study


def until(holds, seconds=900.0):
    """Wait for something; an upper limit, not a measurement."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.05)


def processes_of(mark):
    """The processes whose environment has a mark."""
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        try:
            held = f"MARK={mark}".encode() in path.read_bytes().split(b"\0")
            dead = path.with_name("stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if held and dead != "Z":
            found.append(int(path.parent.name))
    return found


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    "kills", [1, pytest.param(10, marks=pytest.mark.slow)], ids="{} kills".format
)
def test_who_is_killed_leaves_no_children(tmp_path, kills):
    out = tmp_path / "out"
    command = [
        sys.executable,
        "-P",
        "-m",
        "qpavoid",
        "sweep",
        str(write_study(tmp_path, "0:2000")),
        "--out",
        str(out),
    ]
    mark = f"{tmp_path.name}-{os.getpid()}"
    for _ in range(kills):
        before = len(shards(out))
        process = subprocess.Popen(
            [*command, "--workers", "2"],
            env={**os.environ, "MARK": mark},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        until(lambda: len(shards(out)) > before)  # noqa: B023
        assert len(processes_of(mark)) > 2
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        until(lambda: not processes_of(mark))
    assert len(read_rows(out)) > 0
    with Store(out).alone():
        assert not list(out.glob("*/.*")) and not list(out.glob("*/*.part"))


def test_two_sweeps_into_one_folder(tmp_path, capsys):
    """The second says that there is a first; who is killed has no lock."""
    out = tmp_path / "out"
    command = [
        "sweep",
        str(write_study(tmp_path, "0:1")),
        "--out",
        str(out),
        "--workers",
        "1",
    ]
    with Store(out).alone():
        assert main(command) == 1
        said = capsys.readouterr().err
        assert "another sweep is writing into it" in said and "copy its files" in said
        assert not shards(out)
    assert main(command) == 0
    holder = (
        "import os, signal, sys; from pathlib import Path\n"
        "from qpavoid.lab.study.sweep.store import Store\n"
        "with Store(Path(sys.argv[1])).alone(): os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", holder, str(out)])
    assert done.returncode == -signal.SIGKILL
    assert main(command) == 0


def test_parts_of_who_was_killed_are_removed(tmp_path):
    kept = Store(tmp_path)
    part = tmp_path / "runs" / ".x.parquet.part"
    part.write_bytes(b"half")
    with kept.alone():
        assert not part.exists()
        kept.save([({"run": "a" * 16, "settings": "{}"}, b"log")])
    assert [path.name for path in tmp_path.glob("*/.*")] == []
    assert (tmp_path / "logs" / f"{'a' * 16}.npz").read_bytes() == b"log"
    kept.save([({"run": "a" * 16, "settings": "{}"}, b"another")])
    assert (tmp_path / "logs" / f"{'a' * 16}.npz").read_bytes() == b"another"
    assert len(read_rows(tmp_path)) == 1


@pytest.fixture(scope="module")
def one_shard(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shard")
    row = {"run": "a" * 16, "scenario": "s", "settings": "{}", "min_clearance_m": 0.5}
    Store(folder, "a study").save([(row, None)])
    return folder


def test_a_flipped_bit_is_noticed_wherever_it_is(one_shard):
    (path,) = shards(one_shard)
    whole = path.read_bytes()
    try:
        for k in range(0, len(whole), 29):
            flipped = bytearray(whole)
            flipped[k] ^= 1 << (k % 8)
            path.write_bytes(flipped)
            for read in (read_rows, read_provenance):
                with pytest.raises(DataError, match="damaged"):
                    read(one_shard)
    finally:
        path.write_bytes(whole)
    assert read_rows(one_shard)[0]["min_clearance_m"] == 0.5


def test_a_full_disk_in_the_middle_of_a_sweep(tmp_path, capsys, monkeypatch):
    out, write, left = tmp_path / "out", store.os.fsync, [1]

    def full(handle):
        if not left:
            raise OSError(28, "No space left on device")
        left.pop()
        write(handle)

    command = [
        "sweep",
        str(write_study(tmp_path, "0:8")),
        "--out",
        str(out),
        "--workers",
        "1",
    ]
    monkeypatch.setattr(engine, "SHARD_S", 0.0)
    monkeypatch.setattr(store.os, "fsync", full)
    assert main(command) == 1
    assert "No space left" in capsys.readouterr().err
    assert len(shards(out)) == 1 and not list(out.glob("*/.*"))
    monkeypatch.setattr(store.os, "fsync", write)
    assert main(command) == 0
    assert len(read_rows(out)) == 16


def test_a_changed_study_in_the_same_folder(tmp_path, capsys):
    """Nothing old is taken for new; what is of another study is said."""
    out = tmp_path / "out"
    command = [
        "sweep",
        str(write_study(tmp_path, "0:2")),
        "--out",
        str(out),
        "--workers",
        "1",
    ]
    assert main(command) == 0 and "another study" not in capsys.readouterr().out
    path = tmp_path / "past.toml"
    path.write_text(path.read_text().replace("duration_s = 3.0", "duration_s = 0.0", 1))
    assert main(command) == 1
    capsys.readouterr()
    text = toml(DOCUMENT | {"duration_s": 2.0})
    path.write_text(text)
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "4 runs done, 8 in" in said and "4 of them are of another study" in said
    assert {row["duration_s"] for row in read_rows(out)} == {2.0, 3.0}


def test_a_run_that_fails_makes_the_exit_status_1(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "breaks.py").write_text(
        "def half(v, omega, obstacles, context):\n    raise ValueError('no way')\n"
    )
    command = [
        "sweep",
        str(write_study(tmp_path, "0:2", ("eq5", "breaks:half"))),
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*command, "--workers", "1"]) == 1
    found = capsys.readouterr()
    assert "2 failed" in found.out and "no way" in found.err
    command[1] = str(write_study(tmp_path, "0:2"))
    assert main([*command, "--workers", "1"]) == 0, "runs of another study do not count"
