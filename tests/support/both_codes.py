"""Machine code that came with the package beside numba's: the same to the last bit."""

import numpy as np

from qpavoid.export.entries import shape_of


def copied(given):
    """Copies of all arrays of some arguments."""
    if isinstance(given, np.ndarray):
        made = given.copy()
        made.flags.writeable = given.flags.writeable  # else numba compiles another
        return made
    if not isinstance(given, tuple):
        return given
    parts = [copied(part) for part in given]
    return type(given)(*parts) if hasattr(given, "_fields") else tuple(parts)


def bits(given):
    """Kind and bits of all that arguments or results are made of."""
    if isinstance(given, np.ndarray):
        return given.tobytes()
    if isinstance(given, tuple):
        return type(given).__name__, *map(bits, given)
    if given is None or isinstance(given, bool | int):
        return type(given), given
    return type(given), "nan" if given != given else np.float64(given).tobytes()


def told(function, given):
    """Arguments that are only read, by their annotations."""
    from inspect import signature
    from typing import get_type_hints

    hints = get_type_hints(function, include_extras=True)
    shapes = [shape_of(hints[name], name) for name in signature(function).parameters]

    def read(shape, one):
        if not shape.kind:
            parts = zip(shape.parts, one, strict=True)
            return tuple(x for part, value in parts for x in read(part, value))
        return () if shape.written else (bits(one),)

    return [x for pair in zip(shapes, given, strict=False) for x in read(*pair)]


class Both:
    """Calls both codes of an entry, and compares what they return and write.

    Attributes:
        calls: How many so far.
        results: First parts of the results: of a filter's step its statuses.
    """

    def __init__(self, entry, native):
        self.entry, self.native = entry, native
        self.calls, self.results = 0, set()

    def __call__(self, *given):
        other, before = copied(given), told(self.entry.py_func, given)
        result = self.native(*given)
        right = self.entry.dispatcher(*other)
        assert bits(result) == bits(right), (self.entry.__name__, result, right)
        assert bits(given) == bits(other), self.entry.__name__
        assert told(self.entry.py_func, given) == before, self.entry.__name__
        self.calls += 1
        self.results.add(result[0] if isinstance(result, tuple) else result)
        return result
