"""Compilation: the only module that imports numba.

A function under :func:`compiled` is an ordinary function of its module. If it is an
:func:`entry`, and the package was built with a C compiler, Python calls the machine
code that came with the package (:mod:`qpavoid.export.extension`), provided that it was
made from the present sources. All other functions are compiled by numba at their first
call and cached on disk, so that only the first start is slow; it says so on standard
error.

numba's own cache checks the file of the function alone. A compiled function contains
the code of the functions that it calls, so here the cache is valid only for the present
sources of its module and of all modules that this imports, directly or not.
"""

import inspect
import operator
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from qpavoid.errors import MissingExtraError
from qpavoid.stamps import PACKAGE, source_stamp

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of scalars and arrays to machine code at its first call.

    No fast-math: NaN, signs, errors and the order of operations are those of Python.
    The GIL is released. A function that allocates is refused by the compiler. Calls
    from compiled functions are inlined, since passing a dozen arrays costs as much as
    most of these formulas.
    """
    return Compiled(function, _nrt=False, forceinline=True)


def compiled_once(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as :func:`compiled`, not inlined: for long functions called often."""
    return Compiled(function, _nrt=False)


class Compiled:
    """A function that runs as machine code; compiled functions call it directly.

    Other attributes, such as ``signatures``, are those of numba's dispatcher.

    Attributes:
        py_func: The Python function.
        options: Of numba.
        is_entry: Whether it is an :func:`entry`.
        asks: Name of the entry that checks arguments (:func:`entry_if`), or empty.
    """

    def __init__(self, function: Callable[..., Any], **options: bool) -> None:
        update_wrapper(self, function)
        self.py_func, self.is_entry, self.options = function, False, options
        self.asks = ""

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call the machine code."""
        if named:
            bound = inspect.signature(self.py_func).bind(*arguments, **named)
            bound.apply_defaults()
            arguments = bound.args
        return self.call(*arguments)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @cached_property
    def call(self) -> Callable[..., Any]:
        """Callable for Python: the package's machine code, or numba's dispatcher."""
        made = native_code(self.py_func) if self.is_entry else None
        return with_defaults(made, self.py_func) if made else self.dispatcher

    @cached_property
    def dispatcher(self) -> Any:
        """Dispatcher that numba makes of the function."""
        return _dispatcher(self.py_func, **self.options)

    @cached_property
    def inner(self) -> Any:
        """Dispatcher for compiled callers only: uncached, without a Python wrapper."""
        return _dispatcher(self.py_func, cached=False, **UNWRAPPED, **self.options)

    @property
    def _numba_type_(self) -> Any:
        """Type of the function in compiled functions that call it."""
        return import_module("numba").types.Dispatcher(self.inner)


def with_defaults(
    made: Callable[..., Any], function: Callable[..., Any]
) -> Callable[..., Any]:
    """Return machine code, which takes all arguments, with a function's defaults."""
    defaults = function.__defaults__
    if not defaults:
        return made
    count = function.__code__.co_argcount

    def call(*arguments: Any) -> Any:
        lacking = count - len(arguments)
        return made(*arguments, *(defaults[-lacking:] if lacking > 0 else ()))

    return call


def native_code(function: Callable[..., Any]) -> Callable[..., Any] | None:
    """Return the machine code of a function if it was made from the present sources."""
    stamp = source_stamp(Path(function.__code__.co_filename))
    if _native_stamps().get(function.__module__) != stamp:
        return None
    found: Callable[..., Any] | None = getattr(_native(), function.__name__, None)
    return found


def lacking() -> list[str]:
    """Return the modules with entries whose machine code is missing or out of date."""
    stamps, found = _native_stamps(), []
    for path in sorted(PACKAGE.rglob("*.py")):
        if "\n@entry" in path.read_text(encoding="utf-8"):
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            if stamps.get(".".join(parts)) != source_stamp(path):
                found.append(".".join(parts))
    return found


def is_native() -> bool:
    """Return whether the package's machine code exists and is enabled."""
    return _native() is not None


def bound(function: Callable[..., Any], *layout: Any) -> Callable[..., Any] | None:
    """Return the call of an entry with most arguments fixed; None without machine code.

    ``layout``: all arguments; those that vary per call; parts of the result. See
    ``bind`` in ``qpavoid/export/templates/extension.c``.
    """
    native, name = _native(), function.__name__
    called, bind = getattr(native, name, None), getattr(native, "bind", None)
    if bind is None or function.call is not called:  # type: ignore[attr-defined]
        return None
    made: Callable[..., Any] = bind(name, *layout)
    return made


def _native_stamps() -> dict[str, str]:
    """Return the stamps of the sources of the extension module, by module."""
    stamps = getattr(_native(), "STAMPS", "")
    return dict(line.split() for line in stamps.splitlines())


@cache
def _native() -> Any:
    """Return the extension module; None if it is missing or disabled."""
    if os.environ.get("QPAVOID_NATIVE") == "0":
        return None
    try:
        return import_module("qpavoid._native")
    except ImportError:
        return None


STANDS_IN = (
    ". It replaces machine code that the package lacks, for example because it was "
    "built without a C compiler; see qpavoid doctor"
)

UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _dispatcher(
    function: Callable[..., Any], cached: bool = True, **options: bool
) -> Any:
    try:
        import numba
    except ImportError:
        unbuilt = function.__name__ in ENTRIES or not is_native()
        raise MissingExtraError("numba", "lab", STANDS_IN * unbuilt) from None
    _announce_compiling()
    _store_records()
    options = {name: value for name, value in options.items() if _is_option(name)}
    try:
        dispatcher = numba.njit(cache=cached, nogil=True, **options)(function)
        stamp = source_stamp(Path(function.__code__.co_filename))
        if cached:
            dispatcher._cache = _Cache(dispatcher._cache, stamp)
    except (AttributeError, RuntimeError) as why:  # numba: "no locator available"
        say(f"compiled code is not cached; each start compiles: {why}")
        dispatcher = numba.njit(nogil=True, **options)(function)
    with suppress(AttributeError, ImportError):
        _for_all_values(dispatcher)
    return dispatcher


ENTRIES: dict[str, Callable[..., Any]] = {}
"""Functions of the loaded modules that are called from outside, by name."""


def entry(function: Callable[P, R]) -> Callable[P, R]:
    """Mark a compiled function as called from outside: from Python, C or WebAssembly.

    Its annotations then declare all argument types for machine code: numbers, the
    arrays and records of :mod:`qpavoid.types`, and tuples of them.
    """
    if ENTRIES.setdefault(function.__name__, function) is not function:
        raise ValueError(f"two entries of the name {function.__name__}")
    function.is_entry = True  # type: ignore[attr-defined]
    return function


def entry_if(check: Callable[..., bool]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Mark an entry whose machine code runs only if a check of its arguments holds.

    The check is itself an entry and takes the first arguments; it tests whether their
    sizes fit together, so that nothing is read or written beyond an array.
    """

    def asking(function: Callable[P, R]) -> Callable[P, R]:
        function.asks = check.__name__  # type: ignore[attr-defined]
        return entry(function)

    return asking


def is_cached(function: Callable[..., Any]) -> bool:
    """Return whether a function's machine code is on disk for the next start."""
    with suppress(Exception):  # no numba, no folder, a damaged file
        return bool(function._cache._cache_file._load_index())  # type: ignore[attr-defined]
    return False


@cache
def say(text: str) -> None:
    """Print a message on standard error, once."""
    print(f"qpavoid: {text}", file=sys.stderr, flush=True)


# Each of the following uses a private part of numba. Where a version lacks one,
# compiling is slower or uncached, and tests/test_compiled.py fails.


@cache
def _is_option(name: str) -> bool:
    numba = import_module("numba")
    description = getattr(numba.njit(lambda: None), "targetdescr", None)
    return hasattr(getattr(description, "options", None), name)


class _Cache:
    """numba's cache of a function, valid for the sources with a stamp alone."""

    def __init__(self, cache: Any, stamp: str) -> None:
        self.cache = cache
        if not hasattr(cache._cache_file, "_source_stamp"):
            raise AttributeError("numba has no _source_stamp")
        cache._cache_file._source_stamp = stamp

    def __getattr__(self, name: str) -> Any:
        return getattr(self.cache, name)

    def load_overload(self, sig: Any, context: Any) -> Any:
        try:
            return self.cache.load_overload(sig, context)
        except Exception as error:  # of pickle, numba and LLVM: any
            say(f"cached code cannot be used, compiling again: {error}")
            with suppress(OSError):
                self.cache.flush()
            return None

    def save_overload(self, sig: Any, code: Any) -> None:
        try:
            self.cache.save_overload(sig, code)
        except OSError as error:
            say(f"compiled code cannot be saved; each start compiles: {error}")


def _for_all_values(dispatcher: Any) -> None:
    """Share one machine code among compiled callers that pass constants.

    By default numba specialises a function for every constant argument, which takes
    about half of the time of a first start and measured no faster.
    """
    from numba.core.types import unliteral

    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, keys: template(
        tuple(map(unliteral, args)), {k: unliteral(v) for k, v in keys.items()}
    )


@cache
def _store_records() -> None:
    """Let compiled code store a named tuple as a row of a table of records."""
    from numba.core.types import Array, BaseNamedTuple, Record
    from numba.extending import overload

    @overload(operator.setitem)
    def store(table, row, record):  # type: ignore[no-untyped-def]
        rows = isinstance(table, Array) and isinstance(table.dtype, Record)
        if not (rows and isinstance(record, BaseNamedTuple)):
            return None
        fields = "; ".join(f"at.{name} = record.{name}" for name in record.fields)
        made: dict[str, Any] = {"__name__": __name__}
        exec(f"def store(table, row, record): at = table[row]; {fields}", made)
        return made["store"]


@cache
def _announce_compiling() -> None:
    """Announce the first real compilation, once."""
    with suppress(AttributeError, ImportError):
        _register_announcer()


def _register_announcer() -> None:
    from numba.core import event

    class Announcer(event.Listener):  # type: ignore[misc]
        count = 0

        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            if not function.__module__.startswith("qpavoid."):
                return
            self.count += 1
            if self.count == 1:
                print(
                    "qpavoid: compiling for this machine (once, a minute or two; "
                    "later starts read it from the cache) ...",
                    file=sys.stderr,
                    flush=True,
                )
            elif sys.stderr.isatty():
                text = f"qpavoid: compiling function {self.count}"
                print(text, end="\r", file=sys.stderr, flush=True)

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Announcer())
