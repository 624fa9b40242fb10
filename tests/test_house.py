"""The architecture and the public face, held by tests."""

import ast
import re
import subprocess
import sys
import tomllib
from functools import cache

import pytest

import qpavoid
from places import COMPARISONS, ROOT

PACKAGE = ROOT / "qpavoid"
ROBOT = (
    {"errors", "types", "cache", "stamps"},
    {"compiled", "settings", "files"},
    {"model", "qp"},
    {"tracking"},
    {"avoidance"},
    {"guide", "export"},
    {"ros"},
)
LAB = (
    {"lab.load", "lab.planning", "lab.baselines"},
    {"lab.worlds"},
    {"lab.sensing"},
    {"lab.simulation"},
    {"lab.study"},
    {"lab.play", "lab.gym"},
    {"cli", "gym"},
    {"__main__"},
)
FLOORS = ROBOT + LAB
"""From the ground up: a room imports from itself or from below. What goes onto a robot
lies below the laboratory that tests it, and knows nothing of it."""

MOST_ARROWS = 69
"""Between rooms; those to the lowest two floors are not counted. Nine of the
environments for learning, one of their front door, three of the whole body, four of the
ROS 2 node, five of the page that drives by the package's own machine code."""

CEILINGS = {"robot": 17_930, "lab": 19_320, "comparisons": 12_930, "tests": 34_250}
"""Lines of Python. They only fall: a new feature is paid for by what is removed."""

MOST_PARAMETERS, MOST_FUNCTION_LINES, MOST_RETURNED, TOLD_FROM = 8, 60, 3, 5
"""Of a function: parameters without self, lines with the docstring, elements of a tuple
that it returns, and the parameters from which on each is explained under Args."""

BORDERS = {
    "avoidance.step.filter_step": "where Python enters compiled code, once a step: "
    "records cost 3 µs there, eleven arrays and numbers and nine back under 1",
    "avoidance.filter.SafetyFilter.filter": "a user's call, who names what is near",
    "avoidance.filter.SafetyFilter.problem": "takes what filter takes, explained there",
}
"""Exceptions of parameters, and why."""

RETURN_BORDERS = {
    "avoidance.step.filter_step": "see above",
    "lab.gym.env.ScenarioEnv.step": "Gymnasium's five",
    "lab.gym.env.ScenarioVectorEnv.step": "Gymnasium's five",
}
"""Exceptions of what is returned, and why."""


def room(module):
    """The folder of a module: of the laboratory, its own."""
    parts = module.split(".")[1:]
    return ".".join(parts[: 2 if parts[:1] == ["lab"] else 1])


def floor(module):
    return next((i for i, rooms in enumerate(FLOORS) if room(module) in rooms), None)


def imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: {ast.unparse(node)}: its full name, please"
            if not node.module.startswith("qpavoid"):
                continue
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


def arrows():
    for module, path in modules():
        if module == "qpavoid.lab":
            continue
        for target, name in imports(path):
            if target in ("qpavoid", "qpavoid.lab"):
                target = f"{target}.{name}"
            yield module, target


def test_arrows_between_rooms_point_down():
    for module, target in arrows():
        here, there = floor(module), floor(target)
        assert here is not None, f"{module} has no floor"
        assert there is not None, f"{module} imports {target}"
        assert there < here or room(module) == room(target), f"{module} -> {target}"


def hidden_imports(text):
    """Imports by a name that is put together, where a module cannot be read off."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func).split(".")[-1]
            told = [node.args[:1], *([k.value] for k in node.keywords)]
            literal = all(isinstance(x, ast.Constant) for one in told for x in one)
            if name in ("import_module", "__import__") and not literal:
                yield ast.unparse(node)


def test_the_robot_tier_does_not_name_the_laboratory():
    """Not even as a string, from which a module may be imported."""
    for module, path in modules():
        if room(module).split(".")[0] in set.union(*ROBOT):
            texts = [
                node.value
                for node in ast.walk(ast.parse(path.read_text()))
                if isinstance(node, ast.Constant) and isinstance(node.value, str)
            ]
            named = [text for text in texts if text.startswith("qpavoid.lab")]
            assert not [*named, *hidden_imports(path.read_text())], module


def test_a_hidden_import_is_found():
    hidden = "f(); importlib.import_module(f'qpavoid.{part}'), __import__(name='a' + b)"
    assert len([*hidden_imports(hidden)]) == 2
    assert not [*hidden_imports("import_module('plotly.offline')")]


def test_few_arrows():
    between = {(room(a), room(b)) for a, b in arrows()}
    ground = FLOORS[0] | FLOORS[1]
    between = {(a, b) for a, b in between if a != b and b not in ground}
    assert len(between) <= MOST_ARROWS, sorted(between)


def test_lines_keep_below_their_ceilings():
    lines = dict.fromkeys(CEILINGS, 0)
    for module, path in modules():
        tier = "robot" if floor(module) in range(len(ROBOT)) else "lab"
        lines[tier] += len(path.read_text().splitlines())
    for tier in ("comparisons", "tests"):
        files = (ROOT / tier).rglob("*.py")
        lines[tier] = sum(len(path.read_text().splitlines()) for path in files)
    for tier, count in lines.items():
        assert count <= CEILINGS[tier], (tier, count)


def test_shared_types_are_defined_once():
    pattern = re.compile(r"^(?:class )?(\w+)(?:: TypeAlias = |\(NamedTuple\))", re.M)
    shared = set(pattern.findall((PACKAGE / "types.py").read_text()))
    assert {"Array", "Pose", "Box"} <= shared
    for module, path in modules():
        if module != "qpavoid.types":
            assert not shared & set(pattern.findall(path.read_text())), module


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


FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef
BLOCK = ast.ExceptHandler | ast.match_case

SOURCES = (ROOT, COMPARISONS, ROOT / "tests" / "support")
"""Where a module of ours may lie."""


@cache
def source_file(module):
    """The file of a module; none: it is not one of ours."""
    for folder in SOURCES:
        path = folder.joinpath(*module.split("."))
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file
    return None


@cache
def names_of(path):
    """All that a module defines or imports outside its functions and classes."""

    def within(node):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, FUNCTION | ast.ClassDef):
                yield child.name
                continue
            if isinstance(child, ast.alias):
                yield (child.asname or child.name).split(".")[0]
            if isinstance(child, ast.Name) and isinstance(child.ctx, ast.Store):
                yield child.id
            yield from within(child)

    return set(within(ast.parse(path.read_text())))


def lost_names(text):
    """Imports of ours, wherever they stand, of what is not in the file imported."""
    for node in ast.walk(ast.parse(text)):
        named = isinstance(node, ast.ImportFrom) and node.module
        modules = [named] if named else []
        if isinstance(node, ast.Import):
            modules = [name.name for name in node.names]
        for module in modules:
            path = source_file(module)
            if path is None:
                if module.startswith("qpavoid."):
                    yield module
            elif named:
                for name in {alias.name for alias in node.names} - names_of(path):
                    if not source_file(f"{module}.{name}"):
                        yield f"{module}.{name}"


@pytest.mark.parametrize(
    "line, lost",
    [
        ("from qpavoid.errors import ConfigError, Gone", ["qpavoid.errors.Gone"]),
        ("def f():\n    from studies import gone", ["studies.gone"]),
        ("import qpavoid.gone", ["qpavoid.gone"]),
        ("from qpavoid import Robot, lab, gone", ["qpavoid.gone"]),
        ("from numpy import gone", []),
    ],
)
def test_a_lost_name_is_found(line, lost):
    assert [*lost_names(line)] == lost


def test_imported_names_exist():
    """Also those of scripts and tests that no check of types and no test reads."""
    for folder in (PACKAGE, COMPARISONS, ROOT / "tests"):
        for path in sorted(folder.rglob("*.py")):
            assert not [*lost_names(path.read_text())], path


@cache
def trees():
    """Name and syntax tree of every module, of the comparisons too."""
    known = [(module.removeprefix("qpavoid."), path) for module, path in modules()]
    for path in sorted(COMPARISONS.rglob("*.py")):
        known.append((".".join(path.relative_to(ROOT).with_suffix("").parts), path))
    return [(name, ast.parse(path.read_text())) for name, path in known]


@cache
def functions():
    """Name, node, and whether it can be called from outside, of every function."""

    def within(node, name, public):
        for child in ast.iter_child_nodes(node):
            if not isinstance(child, FUNCTION | ast.ClassDef):
                yield from within(child, name, public)
                continue
            full, seen = f"{name}.{child.name}", public and child.name[0] != "_"
            if isinstance(child, FUNCTION):
                yield full, child, seen
            yield from within(child, full, seen and isinstance(child, ast.ClassDef))

    return [found for name, tree in trees() for found in within(tree, name, True)]


def parameters(node):
    given = node.args
    named = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg]
    return [p.arg for p in [*named, given.kwarg] if p and p.arg not in ("self", "cls")]


def is_long_tuple(node):
    named = isinstance(node, ast.Subscript) and ast.unparse(node.value) == "tuple"
    parts = node.slice.elts if named and isinstance(node.slice, ast.Tuple) else []
    return len(parts) > MOST_RETURNED


def long_aliases():
    """Names that stand for a tuple of too many elements, wherever they are defined."""
    for _, tree in trees():
        for node in tree.body:
            if isinstance(node, ast.AnnAssign | ast.Assign) and is_long_tuple(
                node.value
            ):
                yield ast.unparse(getattr(node, "target", None) or node.targets[0])


def offenders(rule):
    return [name for name, *rest in functions() if rule(*rest) and name not in BORDERS]


def test_no_function_has_many_parameters():
    many = offenders(lambda node, public: len(parameters(node)) > MOST_PARAMETERS)
    assert not many


def test_no_function_is_long():
    def is_long(node, public):
        return node.end_lineno - node.lineno + 1 > MOST_FUNCTION_LINES

    assert not offenders(is_long)


def is_annotated_long(told, aliases):
    if isinstance(told, ast.Constant) and told.value:
        told = ast.parse(told.value)
    parts = list(ast.walk(told)) if told else []
    return any(
        is_long_tuple(part) or (isinstance(part, ast.Name) and part.id in aliases)
        for part in parts
    )


def returned(node):
    """What a function itself returns, not those in it; of a choice each branch."""
    left = [*node.body]
    while left:
        part = left.pop()
        if isinstance(part, ast.Return | ast.IfExp):
            ends = [part.value] if isinstance(part, ast.Return) else []
            ends = ends or [part.body, part.orelse]
            yield from (end for end in ends if end and not isinstance(end, ast.IfExp))
            left += [end for end in ends if isinstance(end, ast.IfExp)]
        elif not isinstance(part, FUNCTION | ast.ClassDef):
            left += [x for x in ast.iter_child_nodes(part) if isinstance(x, ast.stmt)]
            left += [x for x in ast.iter_child_nodes(part) if isinstance(x, BLOCK)]


def returns_long(node, aliases=()):
    tuples = [end.elts for end in returned(node) if isinstance(end, ast.Tuple)]
    long = any(len(parts) > MOST_RETURNED for parts in tuples)
    return long or is_annotated_long(node.returns, aliases)


def test_no_function_returns_a_long_tuple():
    aliases = set(long_aliases())
    long = {name for name, node, _ in functions() if returns_long(node, aliases)}
    assert long == set(RETURN_BORDERS)


@pytest.mark.parametrize(
    "text, long",
    [
        ("def f():\n  return 1, 2, 3, 4", True),
        ("def f() -> 'tuple[int, int, int, int]': ...", True),
        ("def f() -> tuple:\n  for i in x:\n    return (1, 2, 3, 4)", True),
        ("def f():\n  try: g()\n  except E: return 1, 2, 3, 4", True),
        ("def f():\n  match x:\n    case 1: return 1, 2, 3, 4", True),
        ("def f():\n  return None if x else (1, 2, 3, 4)", True),
        ("def f():\n  return 1, 2, 3", False),
        ("def f():\n  x = 1, 2, 3, 4\n  return g((1, 2, 3, 4))", False),
        ("def f():\n  def g():\n    return 1, 2, 3, 4\n  return 1", False),
        ("def f() -> 'tuple[int, ...]': ...", False),
    ],
)
def test_a_long_tuple_is_found(text, long):
    assert returns_long(ast.parse(text).body[0]) == long


def test_many_parameters_are_explained():
    def is_mute(node, public):
        names = parameters(node)
        if not public or len(names) < TOLD_FROM:
            return False
        told = (ast.get_docstring(node) or "").partition("Args:\n")[2]
        return not all(re.search(rf"^    \*{{0,2}}{n}: ", told, re.M) for n in names)

    assert not offenders(is_mute)


def test_the_exceptions_are_needed():
    needed = {
        name for name, node, _ in functions() if len(parameters(node)) > MOST_PARAMETERS
    }
    assert needed == set(BORDERS)


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
        "Freshness",
        "Guide",
        "GuideSettings",
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
        "Stamps",
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
    lines = [node for node in block.body if isinstance(node, ast.ImportFrom)]
    names = {alias.name for node in lines for alias in node.names}
    assert names == set(qpavoid.__all__) - {"__version__"}


def loaded(code):
    """Return the top-level modules that a fresh interpreter has after some code."""
    code += "; import sys; print(*{name.split('.')[0] for name in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


HEAVY = {"casadi", "osqp", "qpsolvers", "matplotlib", "pydantic", "rich"}
HEAVY |= {"gymnasium", "pink", "mink", "pinocchio", "mujoco"}
"""And not scipy, which numba itself imports where it is installed."""


def test_packages_are_imported_only_when_used():
    assert not loaded("import qpavoid") & {*HEAVY, "numpy", "numba"}
    filtering = "import qpavoid as qp; qp.SafetyFilter(qp.Robot.mir100())"
    assert not loaded(filtering) & HEAVY
    osqp = filtering.replace("100()", "100(), solver='osqp'")
    assert loaded(osqp) & HEAVY == {"osqp"}


def test_versions_agree():
    """The package has the installed one; an old installation is not of this tree."""
    text = (ROOT / "pyproject.toml").read_text()
    version = re.search(r'^version = "(.+)"$', text, re.MULTILINE).group(1)
    assert qpavoid.__version__ == version
    assert f"version: {version}" in (ROOT / "CITATION.cff").read_text()
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text()


def test_python_is_tested_in_the_versions_that_are_promised():
    text = tomllib.loads((ROOT / "pyproject.toml").read_text())
    promised = re.findall(r":: (3\.\d+)", " ".join(text["project"]["classifiers"]))
    environments = text["tool"]["hatch"]["envs"]
    assert environments["newest"]["matrix"] == [{"python": promised}]
    assert text["project"]["requires-python"] == f">={promised[0]}"
    assert environments["oldest"]["python"] == promised[0]


def test_the_files_that_contributors_are_sent_to_exist():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    named = re.findall(r"`([\w.]+/[\w./]*|[\w-]+\.(?:py|toml|md))`", text)
    assert len(named) > 10
    for path in named:
        assert any(ROOT.glob(path.replace("NAME", "*"))), path


def test_every_extra_of_the_registry_exists():
    from qpavoid.qp.solve import BACK_ENDS

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {entry.extra for entry in BACK_ENDS.values() if entry.extra}
    assert extras <= set(project["optional-dependencies"])
    assert not any("quadprog" in package for package in project["dependencies"])


def test_the_cache_is_valid_for_the_sources_that_a_function_rests_on(tmp_path):
    """An edit in a callee leaves no old code in a cache; one beside costs nothing."""
    package = tmp_path / "qpavoid"
    (package / "lab").mkdir(parents=True)
    (package / "__init__.py").touch()
    for name in ("cache.py", "compiled.py", "errors.py", "stamps.py"):
        (package / name).write_text((PACKAGE / name).read_text())
    head, body = "from qpavoid.compiled import compiled\n", "@compiled\ndef {}(x): {}\n"
    callee = head + body.format("f", "return x + {}")
    (package / "lab" / "callee.py").write_text(callee.format(1))
    middle = "from qpavoid.lab import (\n    callee,\n)\nf = callee.f\n"
    (package / "middle.py").write_text(middle)
    caller = "from qpavoid.middle import f\n" + body.format("g", "return f(x)")
    (package / "caller.py").write_text(head + caller)
    (package / "beside.py").write_text("")

    def run():
        done = subprocess.run(
            [sys.executable, "-c", "from qpavoid.caller import g; print(g(1))"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip(), done.stderr.count("compiling for this machine")

    assert run()[0] == "2" and run() == ("2", 0)
    (package / "beside.py").write_text("a_page = 1")
    assert run() == ("2", 0)
    (package / "lab" / "callee.py").write_text(callee.format(2))
    assert run() == ("3", 1)
