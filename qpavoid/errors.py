"""Exceptions that qpavoid raises."""

from collections.abc import Iterable
from difflib import get_close_matches


class QPAvoidError(Exception):
    """Base of all errors that qpavoid raises on purpose."""


class InvalidInputError(QPAvoidError, ValueError):
    """An argument has a wrong shape, type, sign, or is not finite."""


class ThreadError(QPAvoidError, RuntimeError):
    """A filter was called from another thread than the one that first used it."""


class ConfigError(QPAvoidError, ValueError):
    """A scenario file is not valid.

    Attributes:
        problems: One line for every problem found, with file and key.
    """

    def __init__(self, problems: Iterable[str]):
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


class DataError(QPAvoidError, ValueError):
    """A data file is missing, damaged or not in its published format."""


class UnknownNameError(QPAvoidError, LookupError):
    """A name that is not in a registry.

    Attributes:
        name: The unknown name.
        known: All known names.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str]):
        self.name = name
        self.known = tuple(known)
        super().__init__(
            f"unknown {kind} {name!r}{did_you_mean(name, self.known)} "
            f"Known: {', '.join(self.known)}."
        )


class MissingExtraError(QPAvoidError, ImportError):
    """A required package is not installed.

    Attributes:
        extra: The extra that installs it, as in ``pip install qpavoid[extra]``; empty
            for dependencies of every installation.
    """

    def __init__(self, what: str, extra: str, otherwise: str = ""):
        self.extra = extra
        super().__init__(
            f"{what} is not installed. Install it with: {pip_install(extra)}{otherwise}"
        )


def pip_install(extra: str) -> str:
    """Return the command that installs qpavoid, with an extra if one is named."""
    return f"pip install 'qpavoid[{extra}]'" if extra else "pip install qpavoid"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the nearest known name, else ``"."``.

    A name that only lacks its ending, such as a unit, counts as nearest. The parts of a
    name such as ``astar+eq5`` are compared one by one.
    """
    known = list(known)
    near = [other for other in known if other.startswith(f"{name}_")]
    parts = [part for other in known for part in other.split("+")]
    each = [(get_close_matches(x, parts) or [x])[0] for x in name.split("+")]
    near += ["+".join(each)] if "+" in name and "+".join(each) != name else []
    near += get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]!r}?" if near else "."
