"""Loading of plug-ins, named ``module:Name``."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from qpavoid.errors import ConfigError, QPAvoidError, did_you_mean


def load_object(place: str) -> Any:
    """Return what ``module:Name`` names; a module of the working folder too.

    Raises:
        ConfigError: No such module, or nothing of that name in it.
    """
    module, _, name = place.partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    try:
        found: Any = import_module(module)
    except QPAvoidError:
        raise
    except (Exception, SystemExit) as error:  # of a module of the user's: any
        what = type(error).__name__
        raise ConfigError([f"{place}: {what}: {error}"]) from error
    for part in name.split("."):
        if not hasattr(found, part):
            hint = did_you_mean(part, [n for n in dir(found) if n[0] != "_"])
            raise ConfigError([f"{place}: {module} has no {part!r}{hint}"])
        found = getattr(found, part)
    return found


def search_too(folder: Path) -> None:
    """Let modules of a folder be named as well; those of other places come first."""
    if str(folder.resolve()) not in sys.path:
        sys.path.append(str(folder.resolve()))


def source_of(place: str) -> Path | None:
    """Return the file of the module of ``module:Name``; none where it has none."""
    load_object(place)
    file = getattr(sys.modules[place.partition(":")[0]], "__file__", None)
    return Path(file) if file else None
