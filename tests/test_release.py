"""What a release is made of agrees with itself."""

import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec

import pytest
import yaml

from places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
CONDA = {"matplotlib": "matplotlib-base"}
CONDA_BUILD = {"hatchling", "numpy"}
"""Of what builds the package; the compiler is conda's own."""


def test_the_conda_recipe_wants_what_the_package_wants():
    recipe = yaml.safe_load((ROOT / ".ci/conda/recipe.yaml").read_text())
    assert recipe["context"]["version"] == PROJECT["version"]
    names = [
        re.match(r"([\w-]+)(.*)", text).groups() for text in PROJECT["dependencies"]
    ]
    wanted = {f"{CONDA.get(name, name)} {least}" for name, least in names}
    wanted.add(f"python {PROJECT['requires-python']}")
    assert set(recipe["requirements"]["run"]) == wanted
    built = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]
    host = {text.replace(" ", "") for text in recipe["requirements"]["host"]}
    host -= {"python", "pip"}
    plain = {text for text in built["requires"] if text.split(">")[0] in CONDA_BUILD}
    assert host == plain


@pytest.mark.parametrize("path", sorted((ROOT / ".github").rglob("*.yml")), ids=str)
def test_files_of_the_repository_can_be_read(path):
    assert isinstance(yaml.safe_load(path.read_text()), dict)


def test_publishing_needs_no_secret():
    text = (ROOT / ".github/workflows/publish.yml").read_text()
    assert "id-token: write" in text and "secrets." not in text


def test_wheels_that_are_published_have_the_live_page():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    assert settings["cibuildwheel"]["environment"] == {"QPAVOID_WASM": "1"}
    assert "QPAVOID_WASM" in (ROOT / ".ci/build_hook.py").read_text()


def test_the_citation_says_whom_it_cites():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert str(cited["version"]) == PROJECT["version"]
    for reference in cited["references"]:
        assert reference["title"] and reference["authors"] and reference["type"]
        unknown = {"name": "unknown to us"} in reference["authors"]
        assert not unknown or "names neither authors" in reference["notes"]


def test_the_paper_resolves_its_references_and_figures():
    folder = ROOT / "docs" / "paper"
    text, known = ((folder / name).read_text() for name in ("paper.md", "paper.bib"))
    keys = set(re.findall(r"^@\w+\{(\w+),", known, re.MULTILINE))
    assert set(re.findall(r"@(\w+)", text)) == keys
    for figure in re.findall(r"!\[[^]]*\]\(([^)]+)\)", text):
        assert (folder / figure).is_file()


NATIVE = """
import numpy as np
from qpavoid import Robot, SafetyFilter
from qpavoid.avoidance.step import filter_step
from qpavoid.compiled import native_code
assert "site" in filter_step.py_func.__code__.co_filename
safety = SafetyFilter(Robot.mir100())
assert safety.filter(0.5, 0.1, np.array([[0.9, 0.1]])).status == "filtered"
print(native_code(filter_step.py_func) is not None)
"""


@pytest.mark.slow
@pytest.mark.skipif(not find_spec("hatchling"), reason="no hatchling")
def test_the_sdist_builds_offline(tmp_path):
    """With a compiler; without one it says so, and is installed all the same."""
    made, site = tmp_path / "made", tmp_path / "site"
    build = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(made)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (sdist,) = made.iterdir()
    install = [sys.executable, "-m", "pip", "install", "--verbose", "--no-index"]
    install += ["--no-build-isolation", "--no-deps", "--target", str(site), str(sdist)]
    done = subprocess.run(install, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "extension module made by" in done.stdout + done.stderr
    command = [sys.executable, "-P", "-c", NATIVE]
    told = subprocess.run(
        command, cwd=site, env={"PYTHONPATH": str(site)}, capture_output=True, text=True
    )
    assert told.stdout.strip() == "True", told.stderr
