"""The public names, what an import loads, and what a release is made of."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.util import find_spec

import pytest
import yaml

import qpavoid
from places import ROOT

FILE = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT = FILE["project"]
CONDA = {"matplotlib": "matplotlib-base"}
CONDA_BUILD = {"hatchling", "numpy"}
"""Of what builds the package; the compiler is conda's own."""


def test_type_checkers_see_the_public_names():
    tree = ast.parse((ROOT / "qpavoid" / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    lines = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    names = {alias.name for node in lines for alias in node.names}
    assert names == set(qpavoid.__all__) - {"__version__"} and len(names) == 39
    assert all(getattr(qpavoid, name) is not None for name in dir(qpavoid))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        qpavoid.nothing  # noqa: B018


def loaded(code):
    """Return the top-level modules that a fresh interpreter has after some code."""
    code += "; import sys; print(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


HEAVY = {"casadi", "osqp", "qpsolvers", "matplotlib", "pydantic", "rich"}
HEAVY |= {"gymnasium", "pettingzoo", "pink", "mink", "pinocchio", "mujoco"}
"""And not scipy, which numba itself imports where it is installed."""


def test_packages_are_imported_only_when_used():
    assert not loaded("import qpavoid") & {*HEAVY, "numpy", "numba"}
    filtering = "import qpavoid as qp; qp.SafetyFilter(qp.Robot.mir100())"
    assert not loaded(filtering) & HEAVY
    osqp = filtering.replace("100()", "100(), solver='osqp'")
    assert loaded(osqp) & HEAVY == {"osqp"}


def test_versions_agree():
    """That of the package is the installed one: an old installation is found."""
    version = PROJECT["version"]
    assert qpavoid.__version__ == version
    assert f"version: {version}" in (ROOT / "CITATION.cff").read_text()
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()


def test_python_is_tested_in_the_versions_that_are_promised():
    promised = re.findall(r":: (3\.\d+)", " ".join(PROJECT["classifiers"]))
    environments = FILE["tool"]["hatch"]["envs"]
    assert environments["newest"]["matrix"] == [{"python": promised}]
    assert PROJECT["requires-python"] == f">={promised[0]}"
    assert environments["oldest"]["python"] == promised[0]


def test_the_files_that_contributors_are_sent_to_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    for path in re.findall(r"`([\w.]+/[\w./]*|[\w-]+\.(?:py|toml|md))`", text):
        assert any(ROOT.glob(path.replace("NAME", "*"))), path


def test_the_conda_recipe_wants_what_the_package_wants():
    recipe = yaml.safe_load((ROOT / ".ci/conda/recipe.yaml").read_text())
    assert recipe["context"]["version"] == PROJECT["version"]
    names = [
        re.match(r"([\w-]+)(.*)", text).groups() for text in PROJECT["dependencies"]
    ]
    wanted = {f"{CONDA.get(name, name)} {least}" for name, least in names}
    wanted.add(f"python {PROJECT['requires-python']}")
    assert set(recipe["requirements"]["run"]) == wanted
    built = FILE["build-system"]
    host = {text.replace(" ", "") for text in recipe["requirements"]["host"]}
    host -= {"python", "pip"}
    plain = {text for text in built["requires"] if text.split(">")[0] in CONDA_BUILD}
    assert host == plain


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


def test_the_wheel_is_built_with_numpy_alone():
    """The hook imports its modules where no other dependency is installed."""
    hook = FILE["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]["custom"]
    others = [re.split("[>=<]", name)[0] for name in PROJECT["dependencies"]]
    blocked = dict.fromkeys({*others, "yaml", "numba"} - {"numpy"})
    code = f"import sys; sys.modules.update({blocked})"
    code += "".join(f"; import {module}" for module in hook["modules"])
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
