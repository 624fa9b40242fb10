"""First starts: many at once, read-only installations, caches nobody can write."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import qpavoid

CALL = (
    "from qpavoid.model.kinematics import arc;"
    "print(arc(0.0, 0.0, 0.0, 0.5, 0.0, 2.0)[0])"
)
COMPILING = "compiling for this machine"


@pytest.fixture
def install(tmp_path):
    """A copy of the package, with nothing compiled, to run a first start from."""
    home = Path(qpavoid.__file__).parent
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(home, tmp_path / "site" / "qpavoid", ignore=ignored)
    return tmp_path / "site"


def start(install, cache=None, home=None):
    """A fresh interpreter that makes one compiled call."""
    environment = {**os.environ, "PYTHONPATH": str(install), "QPAVOID_NATIVE": "0"}
    environment.pop("NUMBA_CACHE_DIR", None)
    if cache is not None:
        environment["NUMBA_CACHE_DIR"] = str(cache)
    if home is not None:
        environment |= {"HOME": str(home), "XDG_CACHE_HOME": str(home)}
    return subprocess.Popen(
        [sys.executable, "-P", "-c", CALL],
        env=environment,
        cwd=install,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(process):
    out, errors = process.communicate(timeout=120)
    assert process.returncode == 0, errors
    assert float(out) == 1.0
    return errors


def bar(folder):
    """Let no folder be made here, for the superuser either: a file is in its place."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.write_text("not a folder")


def test_first_starts_at_the_same_time_share_a_cache(install, tmp_path):
    for process in [start(install, tmp_path / "cache") for _ in range(3)]:
        finish(process)
    assert COMPILING not in finish(start(install, tmp_path / "cache"))


def test_a_read_only_installation_keeps_its_cache_with_the_user(install, tmp_path):
    for folder in [p for p in (install / "qpavoid").rglob("*") if p.is_dir()]:
        bar(folder / "__pycache__")
    bar(install / "qpavoid" / "__pycache__")
    home = tmp_path / "home"
    home.mkdir()
    assert COMPILING in finish(start(install, home=home))
    assert COMPILING not in finish(start(install, home=home))
    assert list(home.rglob("*.code"))


def test_a_cache_folder_that_cannot_be_made_is_passed_over(install, tmp_path):
    bar(tmp_path / "barred")
    finish(start(install, cache=tmp_path / "barred" / "cache"))
    assert COMPILING not in finish(start(install, tmp_path / "barred" / "cache"))


def test_where_nothing_can_be_written_every_start_compiles(install, tmp_path):
    for folder in [p for p in (install / "qpavoid").rglob("*") if p.is_dir()]:
        bar(folder / "__pycache__")
    bar(install / "qpavoid" / "__pycache__")
    bar(tmp_path / "home")
    for _ in range(2):
        said = finish(start(install, home=tmp_path / "home"))
        assert COMPILING in said and "each start compiles" in said
