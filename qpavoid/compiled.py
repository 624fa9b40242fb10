"""How qpavoid compiles: the only module that knows numba.

A function under :func:`compiled` is an ordinary function of its module. numba turns
it into machine code at its first call and keeps that code in a cache on disk, so that
only the first start ever pays for it, and says so on standard error.

numba's own cache looks at the file of the function alone. A compiled function carries
the code of the functions that it calls, so here the cache is valid only for the very
sources of its module and of all below the studies: an upgrade can never leave old
mathematics behind.
"""

import hashlib
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numba
from numba.core import event
from numba.core.types import unliteral

P = ParamSpec("P")
R = TypeVar("R")


ABOVE = ("study", "cli.py", "__main__.py")
"""What orchestrates: no compiled function of another module calls into it."""


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return a hash of the sources of all that is compiled, and of what it rests on."""
    digest, package = hashlib.sha256(), Path(__file__).parent
    for path in sorted(package.rglob("*.py")):
        if path.relative_to(package).parts[0] not in ABOVE:
            digest.update(path.read_bytes())
    return digest.hexdigest()


@lru_cache
def file_stamp(path: Path) -> str:
    """Return a hash of a source file; empty for one that has none, as in a notebook."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


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


def _compile(function: Callable[P, R], **options: bool) -> Callable[P, R]:
    try:
        dispatcher = numba.njit(cache=True, nogil=True, **options)(function)
    except RuntimeError:  # numba: "no locator available"
        dispatcher = numba.njit(nogil=True, **options)(function)
        return dispatcher  # type: ignore[no-any-return]
    _for_all_values(dispatcher)
    own = Path(function.__code__.co_filename)
    dispatcher._cache._cache_file._source_stamp = source_stamp() + file_stamp(own)
    return dispatcher  # type: ignore[no-any-return]


def is_cached(function: Callable[..., Any]) -> bool:
    """Return whether the next start finds the machine code of a function on disk."""
    file = getattr(getattr(function, "_cache", None), "_cache_file", None)
    return file is not None and bool(file._load_index())


def _for_all_values(dispatcher: Any) -> None:
    """Let compiled callers that hand over constants share one machine code.

    numba compiles a function anew for every constant that a call names: half of the
    time of a first start or nearly, and no faster where it was measured.
    """
    template = dispatcher.get_call_template
    dispatcher.get_call_template = lambda args, keys: template(
        tuple(map(unliteral, args)), {k: unliteral(v) for k, v in keys.items()}
    )


class _Announcer(event.Listener):  # type: ignore[misc]
    """Says once, when the first function is really compiled, what is going on."""

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


event.register("numba:compile", _Announcer())
