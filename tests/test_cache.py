"""The cache of compiled code: what it believes, what it says, what it refuses."""

import os
import pickle
import stat
from pathlib import Path

import numba
import numpy as np
import pytest

from qpavoid import cache, compiled
from qpavoid.cache import CacheFolder, digest


def twice(x):
    return 2.0 * x


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    cache.say.cache_clear()
    return tmp_path


def start(value=1.0):
    """As at the start of a process; return how often the cache had the code."""
    function = compiled.compiled(twice)
    assert function(value) == 2.0 * value
    return sum(function.stats.cache_hits.values())


def only_file(folder):
    (file,) = (path for path in folder.rglob("*") if path.is_file())
    return file


def cut(data):
    return data[: len(data) // 2]


def flipped(at):
    def flip(data):
        place = int(at * (len(data) - 1))
        return data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :]

    return flip


def of_another(data):
    body = pickle.dumps(("another key", 7))
    return digest(body).encode() + body


def no_pickle(data):
    return digest(b"?").encode() + b"?"


DAMAGES = {
    "empty": lambda data: b"",
    "cut": cut,
    "grown": lambda data: data + b"0",
    "noise": lambda data: np.random.default_rng(0).bytes(len(data)),
    "not ASCII": lambda data: b"\xff" * 64 + data[64:],
    "of another function": of_another,
    "no pickle": no_pickle,
}
DAMAGES |= {f"flipped at {at:.2f}": flipped(at) for at in np.linspace(0.0, 1.0, 12)}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_compiled_anew_and_said(damage, folder, capsys):
    assert [start(), start()] == [0, 1]
    file = only_file(folder)
    whole = file.read_bytes()
    file.write_bytes(DAMAGES[damage](whole))
    assert start() == 0
    assert f"damaged cache file, compiling again: {file}" in capsys.readouterr().err
    assert start() == 1 and only_file(folder) == file


def test_code_of_other_sources_is_not_read_and_goes(folder, monkeypatch):
    assert start() == 0
    old = only_file(folder)
    monkeypatch.setattr(compiled, "source_stamp", lambda path: "another")
    assert start() == 0
    assert only_file(folder) != old and start() == 1


def test_code_of_another_numba_is_not_read(folder, monkeypatch):
    assert start() == 0
    monkeypatch.setattr(compiled, "versions", lambda: "numba 9")
    assert start() == 0


def test_two_pythons_share_a_folder(tmp_path):
    one, other = (
        CacheFolder(tmp_path, f"f-1.py31{i}", "about", pickle.dumps) for i in (1, 2)
    )
    one.save("key", 1), other.save("key", 2)
    CacheFolder(tmp_path, "f-1.py311", "edited", pickle.dumps).save("key", 3)
    assert [one.load("key"), other.load("key")] == [None, 2]
    other.flush()
    assert not other.has_code() and len(os.listdir(tmp_path)) == 1


@pytest.mark.parametrize("call", ["write_bytes", "replace"])
def test_a_full_disk_costs_the_cache_alone(call, folder, monkeypatch, capsys):
    def full(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, call, full)
    assert [start(), start(3.0)] == [0, 0]
    assert capsys.readouterr().err.count("cannot be saved") == 1
    assert not [path for path in folder.rglob("*") if path.is_file()]


def test_a_folder_that_goes_meanwhile_costs_nothing(folder):
    function = compiled.compiled(twice)
    assert function.dispatcher and function(1.0) == 2.0
    for path in sorted(folder.rglob("*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()
    assert function(np.float32(1.0)) == 2.0


class Bomb:
    """What runs when it is read."""

    def __init__(self, place):
        self.place = str(place)

    def __reduce__(self):
        return os.mkdir, (self.place,)


posix = pytest.mark.skipif(os.name != "posix", reason="modes of POSIX")


def open_folder(file):
    file.parent.chmod(0o777)


def open_file(file):
    file.chmod(0o666)


def of_a_group(file):
    os.chown(file.parent, -1, 4711)
    file.parent.chmod(0o775)


def of_another_user(file):
    os.chown(file, 4711, -1)


@posix
@pytest.mark.parametrize(
    "opened", [open_folder, open_file, of_a_group, of_another_user]
)
def test_what_others_can_have_written_is_not_read(opened, folder, capsys, tmp_path):
    assert [start(), start()] == [0, 1]
    file = only_file(folder)
    body = pickle.dumps(Bomb(tmp_path / "bang"))
    file.write_bytes(digest(body).encode() + body)
    try:
        opened(file)
    except PermissionError:
        pytest.skip("only the superuser gives files away")
    assert start() == 0 and not (tmp_path / "bang").exists()
    assert "is writable by others" in capsys.readouterr().err


@posix
def test_a_file_is_for_its_owner_to_write(folder):
    assert start() == 0
    for path in (only_file(folder), only_file(folder).parent):
        assert not path.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def test_a_group_of_the_user_alone_may_write(tmp_path):
    mode = stat.S_IFREG | 0o664
    status = os.stat_result((mode, 0, 0, 0, os.geteuid(), os.geteuid(), 0, 0, 0, 0))
    assert cache.is_private(status)
