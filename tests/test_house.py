"""The architecture and the public face, held by tests."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import qpavoid

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "qpavoid"
LAYERS = (
    {"errors", "compiled"},
    {"model"},
    {"qp", "motion", "datasets"},
    {"avoidance"},
    {"detour", "export", "baselines", "sensing", "planning"},
    {"simulation"},
    {"study"},
    {"cli"},
    {"__main__"},
)
"""From the ground up: a module imports from its own layer's package or from below."""


def layer(module):
    head = module.split(".")[1] if "." in module else ""
    return next((i for i, names in enumerate(LAYERS) if head in names), None)


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
            "qpavoid"
        ):
            for name in node.names:
                yield node.module, name.name
        elif isinstance(node, ast.Import):
            for name in node.names:
                if name.name.startswith("qpavoid"):
                    yield name.name, None


def modules():
    for path in sorted(PACKAGE.rglob("*.py")):
        if path != PACKAGE / "__init__.py":
            parts = path.relative_to(ROOT).with_suffix("").parts
            yield ".".join(parts).removesuffix(".__init__"), path


def test_arrows_between_folders_point_down():
    for module, path in modules():
        here = layer(module)
        assert here is not None, f"{module} has no layer"
        for target, _ in imports(path):
            there = layer(target)
            if there is None:
                assert target == "qpavoid"  # the version
                continue
            same = module.split(".")[1] == target.split(".")[1]
            assert there < here or same, f"{module} imports {target}"


def test_no_circle_between_modules():
    known = {module for module, _ in modules()}
    graph = {}
    for module, path in modules():
        targets = set()
        for target, name in imports(path):
            deeper = f"{target}.{name}"
            targets.add(deeper if deeper in known else target)
        graph[module] = targets & known

    done = set()

    def visit(module, trail):
        assert module not in trail, f"circle: {' -> '.join([*trail, module])}"
        for target in graph[module] - done:
            visit(target, [*trail, module])
        done.add(module)

    for module in graph:
        visit(module, [])


def test_only_one_module_knows_numba():
    for module, path in modules():
        assert module == "qpavoid.compiled" or "numba" not in re.findall(
            r"^\s*(?:import|from) (\w+)", path.read_text(), re.MULTILINE
        )


def test_public_names():
    assert qpavoid.__all__ == [
        "Actuation",
        "AvoidanceSettings",
        "ConfigError",
        "Contacts",
        "DataError",
        "Decision",
        "FilterProblem",
        "Footprint",
        "InvalidInputError",
        "Limits",
        "Log",
        "LookAhead",
        "Margins",
        "MissingExtraError",
        "Obstacles",
        "QPAvoidError",
        "Repulsion",
        "Robot",
        "SafetyFilter",
        "SafetyRadius",
        "Scenario",
        "Solution",
        "SolveStatus",
        "Status",
        "UnknownNameError",
        "VelocityEstimator",
        "back_end_names",
        "load_scenario",
        "make_controller",
        "metrics",
        "run",
        "show",
        "solve",
        "__version__",
    ]
    for name in qpavoid.__all__:
        assert getattr(qpavoid, name) is not None
        assert name in dir(qpavoid)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        qpavoid.nothing  # noqa: B018


def test_type_checkers_see_the_same_names():
    tree = ast.parse((PACKAGE / "__init__.py").read_text())
    block = next(node for node in tree.body if isinstance(node, ast.If))
    names = {alias.name for node in block.body for alias in node.names}
    assert names == set(qpavoid.__all__) - {"__version__"}


def loaded(code):
    """Return the top-level modules that a fresh interpreter has after some code."""
    code += "; import sys; print(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


HEAVY = {"casadi", "osqp", "qpsolvers", "matplotlib", "pydantic", "rich"}
"""And not scipy, which numba itself imports where it is installed."""


def test_packages_are_imported_only_when_used():
    assert not loaded("import qpavoid") & {*HEAVY, "numpy", "numba"}
    filtering = "import qpavoid as qp; qp.SafetyFilter(qp.Robot.mir100())"
    assert not loaded(filtering) & HEAVY
    osqp = filtering.replace("100()", "100(), solver='osqp'")
    assert loaded(osqp) & HEAVY == {"osqp"}


def test_version_is_said_once():
    text = (ROOT / "pyproject.toml").read_text()
    assert f'version = "{qpavoid.__version__}"' in text
    assert f"version: {qpavoid.__version__}" in (ROOT / "CITATION.cff").read_text()
    assert f"## [{qpavoid.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_every_extra_of_the_registry_exists():
    import tomllib

    from qpavoid.qp.solve import BACK_ENDS

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {entry.extra for entry in BACK_ENDS.values() if entry.extra}
    assert extras <= set(project["optional-dependencies"])
    assert not any("quadprog" in package for package in project["dependencies"])


def test_the_cache_is_valid_for_the_sources_of_the_whole_package(tmp_path):
    """An edit in a callee must not leave its old code in a caller's cache."""
    package = tmp_path / "qpavoid"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "compiled.py").write_text((PACKAGE / "compiled.py").read_text())
    callee = (
        "from qpavoid.compiled import compiled\n@compiled\ndef f(x): return x + {}\n"
    )
    (package / "callee.py").write_text(callee.format(1))
    (package / "caller.py").write_text(
        "from qpavoid.compiled import compiled\nfrom qpavoid.callee import f\n"
        "@compiled\ndef g(x): return f(x)\n"
    )

    def run():
        done = subprocess.run(
            [sys.executable, "-c", "from qpavoid.caller import g; print(g(1))"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip(), done.stderr

    assert run()[0] == "2" and "compiling" not in run()[1]
    (package / "callee.py").write_text(callee.format(2))
    value, said = run()
    assert value == "3"
    assert said.count("compiling for this machine") == 1
