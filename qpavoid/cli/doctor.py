"""The command that looks at the installation: doctor."""

import importlib.metadata
import os
import platform
import re
import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import NamedTuple

from qpavoid.cli.output import give, show_table
from qpavoid.errors import pip_install

STATES = WRONG, MISSING, FINE = "wrong", "not there", "fine"
"""First what matters most."""

LEAST_PYTHON = (3, 11)


class Finding(NamedTuple):
    """Result of one check.

    Attributes:
        thing: Subject of the check.
        state: ``fine``, ``not there`` (and needed for some things only) or ``wrong``.
        found: What there is.
        advice: What to do, if something is to be done.
    """

    thing: str
    state: str
    found: str
    advice: str = ""


REBUILD = (
    "with a compiler of C: pip install --force-reinstall --no-deps --no-cache-dir "
    "qpavoid, or from its source; else numba: " + pip_install("lab")
)


def doctor(options: Namespace) -> int:
    """Look at the installation and say what to do; exit code 1: something is wrong."""
    findings = sorted(examined(), key=lambda one: STATES.index(one.state))
    rows = [one._asdict() for one in findings]
    give(options, rows, lambda: show(findings, options.all))
    return int(any(one.state == WRONG for one in findings))


def show(findings: Sequence[Finding], every: bool) -> None:
    """Print what is wrong as a table, else three lines; or a table of everything."""
    wrong = [one for one in findings if one.state == WRONG]
    if every or wrong:
        show_table(Finding._fields, findings if every else wrong)
    if every:
        return
    of = {one.thing: one for one in findings}
    code, optional = (
        of["compiled code"],
        [one for one in findings if one.state == MISSING],
    )
    if not wrong:
        print(
            f"qpavoid {of['qpavoid'].found}, Python {of['Python'].found}: all is well"
        )
        print("compiled code:", "; ".join(filter(None, (code.found, code.advice))))
    many = sum(one is not code for one in optional)
    print(f"{many} optional parts are not installed: qpavoid doctor --all")


def examined() -> Iterator[Finding]:
    """Yield all that is found."""
    old = sys.version_info < LEAST_PYTHON
    advice = "needs 3.11 or later" if old else ""
    yield Finding("Python", WRONG if old else FINE, platform.python_version(), advice)
    yield Finding("qpavoid", FINE, importlib.metadata.version("qpavoid"))
    yield from packages()
    yield cache()
    folder = os.environ.get("QPAVOID_DATA")
    there = folder is not None and Path(folder).is_dir()
    advice = "" if there else "set QPAVOID_DATA; docs/studies.md says where from"
    state = FINE if there else WRONG if folder else MISSING
    yield Finding("published data", state, folder or "", advice)


def packages() -> Iterator[Finding]:
    """Yield what is wrong with packages: each that is needed, and each extra."""
    from packaging.requirements import Requirement

    lacking: dict[str, list[str]] = {"": []}
    for text in importlib.metadata.requires("qpavoid") or ():
        wanted = Requirement(text)
        extra = re.findall(r"extra == ['\"]([\w-]+)['\"]", text)
        if wanted.name == "qpavoid":
            continue
        missing = lacking.setdefault("".join(extra), [])
        try:
            version = importlib.metadata.version(wanted.name)
        except importlib.metadata.PackageNotFoundError:
            missing.append(wanted.name)
        else:
            if not wanted.specifier.contains(version, prereleases=True):
                missing.append(f"{wanted.name}{wanted.specifier}, not {version}")
    for name, names in lacking.items():
        bad = MISSING if name else WRONG
        thing = f"extra {name}" if name else "packages"
        found = f"lacks {', '.join(names)}" if names else "all there"
        advice = pip_install(name) if names else ""
        yield Finding(thing, bad if names else FINE, found, advice)


def cache() -> Finding:
    """Return whether compiled code can be kept, and is."""
    from qpavoid.avoidance.step import filter_step
    from qpavoid.compiled import is_cached, is_native, lacking

    without = lacking()
    if not without:
        return Finding("compiled code", FINE, "came with the package")
    compiles = find_spec("numba") is not None
    if is_native() or not compiles:
        state = MISSING if compiles else WRONG
        found = f"of the package, but not of {', '.join(without)}, which numba compiles"
        if not is_native():
            found = "none came with the package; numba compiles it"
        return Finding("compiled code", state, found, REBUILD)
    place = os.environ.get("NUMBA_CACHE_DIR") or str(Path(__file__).parents[1])
    if is_cached(filter_step):
        return Finding("compiled code", FINE, f"there: {place}")
    try:
        with TemporaryFile(dir=place):
            advice = "the first start compiles, once"
            return Finding("compiled code", MISSING, place, advice)
    except OSError:
        home = Path.home()
        if os.access(home, os.W_OK):
            return Finding("compiled code", MISSING, f"not yet, below {home}")
    advice = "set NUMBA_CACHE_DIR to a folder that can be written"
    return Finding("compiled code", WRONG, f"{place} cannot be written", advice)
