"""The structure of the code: tiers, arrows between rooms, ceilings, functions."""

import ast
import re
from functools import cache

from places import COMPARISONS, ROOT

ROBOT = (
    {"errors", "types", "stamps"},
    {"compiled", "settings", "files"},
    {"model", "qp"},
    {"tracking", "perception"},
    {"avoidance"},
    {"guide", "export"},
    {"ros"},
)
LAB = (
    {"lab.planning", "lab.baselines"},
    {"lab.worlds"},
    {"lab.sensing"},
    {"lab.scenario"},
    {"lab.simulation"},
    {"lab.study"},
    {"lab.play", "lab.gym"},
    {"cli", "gym"},
    {"__main__"},
)
FLOORS = ROBOT + LAB
"""From the ground up: a room imports from itself or from below."""

MOST_ARROWS = 78
"""Pairs of rooms one of which imports the other; the lowest two floors do not count."""

CEILINGS = {
    "robot": 20_918,
    "cli": 1_119,
    "lab": 12_836,
    "comparisons": 6_923,
    "tests": 23_181,
}
"""Lines of Python; ``cli`` holds all of the package but robot and lab. These numbers
and those of FOLDERS fall; new features raise them only with less elsewhere."""

MOST_FILES = 14
FOLDERS = {
    "tests": 11,
    "tests/avoidance": 22,
    "tests/support": 19,
}
"""Folders of more modules than that, without ``__init__``."""

MOST_PARAMETERS, MOST_LINES, MOST_RETURNED = 8, 60, 3
"""Of a function: parameters without self, lines with the docstring, elements of a
returned tuple."""

BORDERS = {
    "avoidance.step.filter_step",  # the call of compiled code: records cost 3 µs there
}
"""Functions with more parameters."""

RETURN_BORDERS = {
    "avoidance.step.filter_step",
    "lab.gym.env.ScenarioEnv.step",  # Gymnasium's five
}
"""Functions that return longer tuples."""

FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef


def sources(folder):
    """Name and syntax tree of every module below a folder of the repository."""
    for path in sorted((ROOT / folder).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        yield ".".join(parts).removesuffix(".__init__"), ast.parse(path.read_text())


@cache
def package():
    return [
        one for one in sources("qpavoid") if one[0] not in ("qpavoid", "qpavoid.lab")
    ]


def room(module):
    """The folder of a module: of the laboratory, its own."""
    parts = module.split(".")[1:]
    return ".".join(parts[: 2 if parts[:1] == ["lab"] else 1])


def floor(module):
    return next((i for i, rooms in enumerate(FLOORS) if room(module) in rooms), None)


@cache
def arrows():
    """Pairs of a module and one that it imports."""
    found = []
    for module, tree in package():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                whole = node.module in ("qpavoid", "qpavoid.lab")
                names = [f"{node.module}.{name.name}" for name in node.names]
                found += [(module, x) for x in (names if whole else [node.module])]
            elif isinstance(node, ast.Import):
                found += [(module, name.name) for name in node.names]
    return [(one, other) for one, other in found if f"{other}.".startswith("qpavoid.")]


def test_arrows_between_rooms_point_down():
    for module, target in arrows():
        here, there = floor(module), floor(target)
        assert here is not None, f"{module} has no floor"
        assert there is not None, f"{module} imports {target}"
        assert there < here or room(module) == room(target), f"{module} -> {target}"


def test_few_arrows():
    ground = FLOORS[0] | FLOORS[1]
    between = {(room(a), room(b)) for a, b in arrows() if room(b) not in ground}
    assert len({(a, b) for a, b in between if a != b}) <= MOST_ARROWS


def test_the_robot_tier_does_not_name_the_laboratory():
    """Not in a text either, from which a module may be imported."""
    for module, tree in package():
        if floor(module) < len(ROBOT):
            for node in ast.walk(tree):
                text = node.value if isinstance(node, ast.Constant) else ""
                assert not str(text).startswith("qpavoid.lab"), module
                called = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
                if called.endswith(("import_module", "__import__")):
                    name = ast.unparse(node.args[0])
                    below = re.match(r"f'qpavoid\.(\w+)\.", name)  # in the tier
                    inside = below and below[1] in set().union(*ROBOT)
                    assert inside or isinstance(node.args[0], ast.Constant), module


def test_lines_keep_below_their_ceilings():
    lines, robot = dict.fromkeys(CEILINGS, 0), set().union(*ROBOT)
    for tier in ("qpavoid", "comparisons", "tests"):
        for path in (ROOT / tier).rglob("*.py"):
            part = path.relative_to(ROOT / tier).parts[0].removesuffix(".py")
            inside = "robot" if part in robot else part if part == "lab" else "cli"
            count = 0 if part == "__init__" else len(path.read_text().splitlines())
            lines[inside if tier == "qpavoid" else tier] += count
    for tier, count in lines.items():
        assert count <= CEILINGS[tier], (tier, count)


def test_few_files_in_a_folder():
    for top in ("qpavoid", "comparisons", "tests"):
        for folder in [ROOT / top, *(x for x in (ROOT / top).rglob("*") if x.is_dir())]:
            files = [x for x in folder.glob("*.py") if x.name != "__init__.py"]
            name = folder.relative_to(ROOT).as_posix()
            assert len(files) <= FOLDERS.get(name, MOST_FILES), name


@cache
def functions():
    """Name and node of every function of the package and the comparisons."""

    def within(node, name):
        for child in ast.iter_child_nodes(node):
            named = isinstance(child, FUNCTION | ast.ClassDef)
            full = f"{name}.{child.name}" if named else name
            if isinstance(child, FUNCTION):
                yield full, child
            yield from within(child, full)

    modules = [*package(), *sources(COMPARISONS.name)]
    return [x for n, tree in modules for x in within(tree, n.removeprefix("qpavoid."))]


def test_no_function_is_long():
    for name, node in functions():
        assert node.end_lineno - node.lineno < MOST_LINES, name


def test_no_function_has_many_parameters():
    many = set()
    for name, node in functions():
        given = node.args
        named = [*given.posonlyargs, *given.args, *given.kwonlyargs]
        named += [x for x in (given.vararg, given.kwarg) if x]
        count = sum(x.arg not in ("self", "cls") for x in named)
        many |= {name} if count > MOST_PARAMETERS else set()
    assert many == BORDERS


def test_no_function_returns_a_long_tuple():
    long = set()
    for name, node in functions():
        ends = [x.value for x in ast.walk(node) if isinstance(x, ast.Return)]
        sizes = [len(x.elts) for x in ends if isinstance(x, ast.Tuple)]
        told = re.fullmatch(r"tuple\[(.*)\]", ast.unparse(node.returns or node.args))
        parts = ast.parse(told[1]).body[0].value if told else None
        sizes += [len(parts.elts)] if isinstance(parts, ast.Tuple) else []
        long |= {name} if max(sizes, default=0) > MOST_RETURNED else set()
    assert long == RETURN_BORDERS
