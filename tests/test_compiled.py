"""The one module that knows numba, and the parts that numba does not document."""

from importlib import import_module, util

import numba
import numpy as np
import pytest
from numba.core import caching, cpu, event, types

from qpavoid import compiled


def lacks(part):
    return (
        f"numba {numba.__version__} has no {part}: qpavoid works, but compiles longer "
        "or at every start; see qpavoid/compiled.py"
    )


def twice(x):
    return 2.0 * x


def copied(x):
    return x.copy()


@pytest.mark.parametrize("option", ["_nrt", "forceinline"])
def test_numba_has_the_option(option):
    assert compiled._is_option(option), lacks(f"option {option!r}")


def test_numba_has_a_cache_file_with_a_stamp():
    function = compiled.compiled(twice)
    assert function(1.0) == 2.0
    file = function._cache._cache_file
    assert isinstance(file, compiled._CacheFile), lacks("_cache_file._source_stamp")
    assert hasattr(file._file, "_load_index"), lacks("_cache_file._load_index")
    assert compiled.is_cached(function)


def test_numba_asks_for_a_template_of_every_call():
    """Two constants, one machine code."""
    callee = compiled.compiled(twice)
    both = numba.njit(lambda: callee(1.0) + callee(2.0))
    assert both() == 6.0
    n = numba.njit(lambda: callee(1) + callee(2))
    assert n() == 6.0
    part = "Dispatcher.get_call_template or types.unliteral"
    assert len(callee.signatures) == 2, lacks(part)


@pytest.mark.parametrize("name", ["Listener", "register"])
def test_numba_tells_of_its_compiling(name):
    assert hasattr(import_module("numba.core.event"), name), lacks(f"event.{name}")


class CacheFileOfAnotherNumba:
    def __init__(self, cache_path, filename_base, source_stamp):
        self.stamp = source_stamp

    def load(self, key):
        raise AssertionError("old mathematics")


def without_options(monkeypatch):
    for base in cpu.CPUTargetOptions.__mro__:
        for name in {"_nrt", "forceinline"} & set(vars(base)):
            monkeypatch.delattr(base, name)


def without_stamp(monkeypatch):
    monkeypatch.setattr(caching, "IndexDataCacheFile", CacheFileOfAnotherNumba)


def without_unliteral(monkeypatch):
    monkeypatch.delattr(types, "unliteral")


def without_events(monkeypatch):
    monkeypatch.delattr(event, "Listener")


@pytest.mark.parametrize(
    "lacking", [without_options, without_stamp, without_unliteral, without_events]
)
def test_without_a_private_part_of_numba_it_works(lacking, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(event, "register", lambda kind, listener: None)
        lacking(patch)
        spec = util.spec_from_file_location("compiled_anew", compiled.__file__)
        anew = util.module_from_spec(spec)
        spec.loader.exec_module(anew)
        function, allocates = anew.compiled(twice), anew.allocating(copied)
        assert function.dispatcher and allocates.dispatcher
    assert function(3.0) == 6.0
    assert numba.njit(lambda: function(1.5))() == 3.0
    assert list(allocates(np.ones(2))) == [1.0, 1.0]
    assert anew.is_cached(function) == (lacking is not without_stamp)


def test_a_full_disk_costs_the_cache_alone(monkeypatch):
    def save(self, key, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(caching.IndexDataCacheFile, "save", save)
    monkeypatch.setattr(caching.IndexDataCacheFile, "load", lambda self, key: None)
    assert compiled.compiled(twice)(4.0) == 8.0


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("part", [0.0, 0.5])
def test_a_cut_cache_file_counts_as_absent(ending, part, monkeypatch, tmp_path):
    """As after a loss of power, which made every later start fail."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    assert compiled.compiled(twice)(1.0) == 2.0
    (file,) = tmp_path.rglob(f"*.{ending}")
    file.write_bytes(file.read_bytes()[: int(part * file.stat().st_size)])
    for hits in (0, 1):
        function = compiled.compiled(twice)
        assert compiled.is_cached(function) == (hits or ending == "nbc")
        assert function(1.0) == 2.0
        assert sum(function.stats.cache_hits.values()) == hits
