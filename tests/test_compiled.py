"""Compilation: the cache on disk, and the parts of numba that it does not document."""

import os
import subprocess
import sys
from importlib import util
from pathlib import Path

import numba
import pytest
from numba.core import caching, cpu, event, types

import qpavoid
from qpavoid import compiled


def twice(x):
    return 2.0 * x


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    compiled.say.cache_clear()
    return tmp_path


def start(value=1.0):
    """As at the start of a process; return how often the cache had the code."""
    function = compiled.compiled(twice)
    assert function(value) == 2.0 * value
    return sum(function.stats.cache_hits.values())


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("damaged", [b"", b"noise", None])
def test_a_damaged_file_is_compiled_again(damaged, ending, folder, capsys):
    assert [start(), start()] == [0, 1]
    (file,) = folder.rglob(f"*{ending}")
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2] if damaged is None else damaged)
    assert start() == 0
    assert "cached code cannot be used, compiling again" in capsys.readouterr().err
    assert start() == 1


def test_code_of_other_sources_is_not_read(folder, monkeypatch):
    assert start() == 0
    monkeypatch.setattr(compiled, "source_stamp", lambda path: "another")
    assert start() == 0
    assert start() == 1


def test_a_full_disk_costs_the_cache_alone(folder, monkeypatch, capsys):
    def full(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    assert [start(), start(3.0)] == [0, 0]
    assert capsys.readouterr().err.count("cannot be saved") == 1
    assert not [path for path in folder.rglob("*") if path.is_file()]


def test_where_nothing_can_be_written_every_start_compiles(monkeypatch, capsys):
    """No folder is left to numba for its cache."""
    compiled.say.cache_clear()
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert [start(), start()] == [0, 0]
    assert "each start compiles" in capsys.readouterr().err


def test_the_cache_is_valid_for_the_sources_that_a_function_rests_on(tmp_path):
    """An edit in a callee leaves no old code in a cache; one beside costs nothing."""
    package = tmp_path / "qpavoid"
    (package / "lab").mkdir(parents=True)
    (package / "__init__.py").touch()
    for name in ("compiled.py", "errors.py", "stamps.py"):
        (package / name).write_text(
            (Path(qpavoid.__file__).with_name(name)).read_text()
        )
    head, body = "from qpavoid.compiled import compiled\n", "@compiled\ndef {}(x): {}\n"
    callee = head + body.format("f", "return x + {}")
    (package / "lab" / "callee.py").write_text(callee.format(1))
    middle = "from qpavoid.lab import (\n    callee,\n)\nf = callee.f\n"
    (package / "middle.py").write_text(middle)
    caller = "from qpavoid.middle import f\n" + body.format("g", "return f(x)")
    (package / "caller.py").write_text(head + caller)
    (package / "beside.py").write_text("")

    def run():
        done = subprocess.run(
            [sys.executable, "-c", "from qpavoid.caller import g; print(g(1))"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip(), done.stderr.count("compiling for this machine")

    assert run()[0] == "2" and run() == ("2", 0)
    (package / "beside.py").write_text("a_page = 1")
    assert run() == ("2", 0)
    (package / "lab" / "callee.py").write_text(callee.format(2))
    assert run() == ("3", 1)


def lacks(part):
    return (
        f"numba {numba.__version__} has no {part}: qpavoid works, but compiles longer "
        "or at every start; see qpavoid/compiled.py"
    )


def test_numba_takes_a_cache_of_our_own():
    function = compiled.compiled(twice)
    assert function(1.0) == 2.0
    assert isinstance(function._cache, compiled._Cache), lacks("_cache_file")
    assert compiled.is_cached(function)


def test_numba_asks_for_a_template_of_every_call():
    """Two constants, one machine code."""
    callee = compiled.compiled(twice)
    both = numba.njit(lambda: callee(1.0) + callee(2.0))
    assert both() == 6.0
    n = numba.njit(lambda: callee(1) + callee(2))
    assert n() == 6.0
    part = "Dispatcher.get_call_template or types.unliteral"
    assert len(callee.inner.signatures) == 2, lacks(part)
    assert not callee.signatures, "wrapped for Python, which does not call it"


def without_options(monkeypatch):
    for base in cpu.CPUTargetOptions.__mro__:
        for name in {"_nrt", "forceinline"} & set(vars(base)):
            monkeypatch.delattr(base, name)


def without_names(monkeypatch):
    monkeypatch.delattr(caching.CacheImpl, "filename_base")


def without_unliteral(monkeypatch):
    monkeypatch.delattr(types, "unliteral")


def without_events(monkeypatch):
    monkeypatch.delattr(event, "Listener")


@pytest.mark.parametrize(
    "lacking", [without_options, without_names, without_unliteral, without_events]
)
def test_without_a_private_part_of_numba_it_works(lacking, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(event, "register", lambda kind, listener: None)
        lacking(patch)
        spec = util.spec_from_file_location("compiled_anew", compiled.__file__)
        anew = util.module_from_spec(spec)
        spec.loader.exec_module(anew)
        function = anew.compiled(twice)
        assert function.dispatcher
    assert function(3.0) == 6.0
    assert numba.njit(lambda: function(1.5))() == 3.0
    assert anew.is_cached(function) == (lacking is not without_names)
