"""The one module that knows numba, and the parts that numba does not document."""

from importlib import util

import numba
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
