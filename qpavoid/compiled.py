"""How qpavoid compiles: the only module that knows numba.

A function under :func:`compiled` is an ordinary function of its module. Where it is an
:func:`entry`, and the package was built with a compiler of C, Python calls the machine
code that came with the package: :mod:`qpavoid.export.extension`. It counts only for the
very sources that it was made from. All else, and what compiled functions of others
call, numba turns into machine code at the first call and keeps in a cache on disk, so
that only the first start ever pays for it, and says so on standard error.

numba's own cache looks at the file of the function alone. A compiled function carries
the code of the functions that it calls, so here the cache is valid only for the very
sources of its module and of all that this imports, directly or not: an upgrade can
never leave old mathematics behind, and a change of a page recompiles nothing.
"""

import inspect
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from qpavoid.cache import CacheFolder, say
from qpavoid.errors import MissingExtraError
from qpavoid.stamps import PACKAGE, source_stamp

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of scalars and arrays to machine code at its first call.

    No fast-math: NaN, signs, errors and the order of operations are those of Python.
    Other threads run meanwhile, so that a batch takes as many cores as it has threads.
    Where no cache directory can be written every process compiles for itself.

    It only borrows the arrays that it is given and counts no references to them; one
    that would allocate is refused by the compiler. Compiled callers hold it in place
    of the call: handing on a dozen arrays costs as much as most of these formulas.
    """
    return _compile(function, _nrt=False, forceinline=True)


def compiled_once(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as :func:`compiled` does what is long and called from several places."""
    return _compile(function, _nrt=False)


def allocating(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as :func:`compiled_once` does a function that makes or returns arrays."""
    return _compile(function, _nrt=True)  # else it inherits its caller's choice


class Compiled:
    """A function that runs as machine code; compiled functions call it directly.

    What it does not have itself, such as ``signatures``, numba's dispatcher has.

    Attributes:
        py_func: The function itself.
        is_entry: Whether it is an :func:`entry`.
        asks: Name of the entry that is asked before: :func:`entry_if`; empty: none is.
    """

    def __init__(self, function: Callable[..., Any], **options: bool) -> None:
        update_wrapper(self, function)
        self.py_func, self.is_entry, self._options = function, False, options
        self.asks = ""

    def __call__(self, *given: Any, **named: Any) -> Any:
        """Call it."""
        if named:
            bound = inspect.signature(self.py_func).bind(*given, **named)
            bound.apply_defaults()
            given = bound.args
        return self.call(*given)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __reduce__(self) -> str:
        return self.py_func.__qualname__

    @cached_property
    def call(self) -> Callable[..., Any]:
        """What Python calls: machine code that came with the package, or numba's."""
        made = native_code(self.py_func) if self.is_entry else None
        return with_defaults(made, self.py_func) if made else self.dispatcher

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of the function."""
        return _dispatcher(self.py_func, **self._options)

    @cached_property
    def inner(self) -> Any:
        """The same for compiled callers alone: their code has it, and Python no way."""
        return _dispatcher(self.py_func, kept=False, **UNWRAPPED, **self._options)

    def compile_alone(self, *given: Any) -> None:
        """Let numba compile it in this process for such arguments, before its callers.

        Code from the cache is no help to a caller: what is inlined is compiled with it.
        """
        self.inner.compile(tuple(map(import_module("numba").typeof, given)))

    @property
    def _numba_type_(self) -> Any:
        """What numba takes it for in the compiled functions that call it."""
        return import_module("numba").types.Dispatcher(self.inner)


def with_defaults(
    made: Callable[..., Any], function: Callable[..., Any]
) -> Callable[..., Any]:
    """Return machine code, which wants all arguments, with a function's defaults."""
    defaults = function.__defaults__
    if not defaults:
        return made
    count = function.__code__.co_argcount

    def call(*given: Any) -> Any:
        lacking = count - len(given)
        return made(*given, *(defaults[-lacking:] if lacking > 0 else ()))

    return call


def native_code(function: Callable[..., Any]) -> Callable[..., Any] | None:
    """Return the machine code of a function, if it was made from its very sources."""
    native = _native()
    if native is None:
        return None
    stamps = dict(line.split() for line in native.STAMPS.splitlines())
    stamp = source_stamp(Path(function.__code__.co_filename))
    if stamps.get(function.__module__) != stamp:
        return None
    found: Callable[..., Any] | None = getattr(native, function.__name__, None)
    return found


def lacking() -> list[str]:
    """Return the modules with entries that machine code is not there for, or is old."""
    native = _native()
    told = "" if native is None else native.STAMPS
    stamps = dict(line.split() for line in told.splitlines())
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        if "\n@entry" in path.read_text(encoding="utf-8"):
            parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
            if stamps.get(".".join(parts)) != source_stamp(path):
                found.append(".".join(parts))
    return found


def is_native() -> bool:
    """Return whether machine code came with the package, and is wanted."""
    return _native() is not None


def bound(function: Callable[..., Any], *told: Any) -> Callable[..., Any] | None:
    """Return the call of an entry of which most is known; None without machine code.

    ``told``: all arguments; what comes with a call; of what the answer is made. See
    ``bind`` in ``qpavoid/export/templates/extension.c``.
    """
    native, name = _native(), function.__name__
    called, bind = getattr(native, name, None), getattr(native, "bind", None)
    if bind is None or function.call is not called:  # type: ignore[attr-defined]
        return None
    made: Callable[..., Any] = bind(name, *told)
    return made


@cache
def _native() -> Any:
    """Return the extension module; None: there is none, or it is not wanted."""
    if os.environ.get("QPAVOID_NATIVE") == "0":
        return None
    try:
        return import_module("qpavoid._native")
    except ImportError:
        return None


def _compile(function: Callable[P, R], **options: bool) -> Callable[P, R]:
    return Compiled(function, **options)


STANDS_IN = (
    ". It stands in for machine code that the package lacks, as where it was built "
    "without a compiler of C; qpavoid doctor says more"
)

UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def _dispatcher(
    function: Callable[..., Any], kept: bool = True, **options: bool
) -> Any:
    try:
        import numba
    except ImportError:
        unbuilt = function.__name__ in ENTRIES or not is_native()
        raise MissingExtraError("numba", "lab", STANDS_IN * unbuilt) from None
    _announce_compiling()
    options = {name: value for name, value in options.items() if _is_option(name)}
    try:
        dispatcher = numba.njit(cache=kept, nogil=True, **options)(function)
        stamp = source_stamp(Path(function.__code__.co_filename))
        if kept:
            dispatcher._cache = _Cache(dispatcher._cache, stamp)
    except (AttributeError, RuntimeError) as why:  # numba: "no locator available"
        say(f"compiled code is not kept, and each start compiles: {why}")
        dispatcher = numba.njit(nogil=True, **options)(function)
    with suppress(AttributeError, ImportError):
        _for_all_values(dispatcher)
    return dispatcher


ENTRIES: dict[str, Callable[..., Any]] = {}
"""The functions of the modules loaded that are called from outside, by name."""


def entry(function: Callable[P, R]) -> Callable[P, R]:
    """Say of a compiled function that it is called from outside: from Python, C, wasm.

    Its annotations then say all that machine code has to know of its arguments:
    numbers, the arrays and records of :mod:`qpavoid.types`, and tuples of them.
    """
    if ENTRIES.setdefault(function.__name__, function) is not function:
        raise ValueError(f"two entries of the name {function.__name__}")
    function.is_entry = True  # type: ignore[attr-defined]
    return function


def entry_if(check: Callable[..., bool]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Say so of one that machine code calls only where a check of its arguments holds.

    The check is an entry itself, of the first of the arguments: whether they fit
    together, so that nothing is read or written beyond an array.
    """

    def asking(function: Callable[P, R]) -> Callable[P, R]:
        function.asks = check.__name__  # type: ignore[attr-defined]
        return entry(function)

    return asking


def is_cached(function: Callable[..., Any]) -> bool:
    """Return whether the next start finds the machine code of a function on disk."""
    with suppress(MissingExtraError):
        return _is_cached(function)
    return False


def _is_cached(function: Callable[..., Any]) -> bool:
    kept = getattr(function, "_cache", None)
    return isinstance(kept, _Cache) and kept.folder.has_code()


# What follows leans on private parts of numba, one each. Where a version lacks one,
# compiling is slower or each start compiles anew, and tests/test_compiled.py names it.


@cache
def _is_option(name: str) -> bool:
    numba = import_module("numba")
    description = getattr(numba.njit(lambda: None), "targetdescr", None)
    return hasattr(getattr(description, "options", None), name)


class _Cache:
    """numba's cache of a function, with files of our own: :mod:`qpavoid.cache`."""

    def __init__(self, cache: Any, stamp: str) -> None:
        self._cache, name = cache, cache._impl.filename_base
        about = f"{stamp} {versions()}"
        self.folder = CacheFolder(Path(cache.cache_path), name, about, _dumps)
        if not hasattr(cache, "_cache_file"):
            raise AttributeError("numba has no _cache_file")
        cache._cache_file = self.folder

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, sig: Any, context: Any) -> Any:
        try:
            return self._cache.load_overload(sig, context)
        except Exception as error:  # of numba and LLVM: any
            say(f"cached code cannot be used, and is compiled anew: {error}")
            return None

    def save_overload(self, sig: Any, code: Any) -> None:
        try:
            self._cache.save_overload(sig, code)
        except OSError as error:
            say(f"compiled code cannot be kept, and each start compiles: {error}")


@cache
def versions() -> str:
    """Return the versions of what compiles."""
    numba, llvmlite = import_module("numba"), import_module("llvmlite")
    return f"numba {numba.__version__} llvmlite {llvmlite.__version__}"


def _dumps(data: Any) -> bytes:
    pickled: bytes = import_module("numba.core.serialize").dumps(data)
    return pickled


def _for_all_values(dispatcher: Any) -> None:
    """Let compiled callers that hand over constants share one machine code.

    numba compiles a function anew for every constant that a call names: half of the
    time of a first start or nearly, and no faster where it was measured.
    """
    from numba.core.types import unliteral

    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, keys: template(
        tuple(map(unliteral, args)), {k: unliteral(v) for k, v in keys.items()}
    )


@cache
def _announce_compiling() -> None:
    """Say once, when the first function is really compiled, what is going on."""
    with suppress(AttributeError, ImportError):
        _register_announcer()


def _register_announcer() -> None:
    from numba.core import event

    class Announcer(event.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            if not self.said and function.__module__.startswith("qpavoid."):
                self.said = True
                print(
                    "qpavoid: compiling for this machine (once, a minute or two; "
                    "later starts read it from the cache) ...",
                    file=sys.stderr,
                    flush=True,
                )

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Announcer())
