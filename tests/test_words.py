"""Docstrings are definitions, and a constant's name has one value in the package."""

import ast
import re
from collections import defaultdict

import pytest

from places import ROOT

PACKAGE = sorted((ROOT / "qpavoid").rglob("*.py"))
OTHERS = sorted(x for y in ("comparisons", "tests") for x in (ROOT / y).rglob("*.py"))
VAGUE = re.compile(r"(What|Who|The same|It)\b")
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def is_text(node):
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def docstrings(text):
    """Docstrings of modules, classes and functions, and those after assignments."""
    for node in ast.walk(ast.parse(text)):
        body = node.body if isinstance(getattr(node, "body", None), list) else []
        for before, here in zip([None, *body], body, strict=False):
            first = before is None and isinstance(node, DOCUMENTED)
            after = isinstance(before, ast.Assign | ast.AnnAssign)
            if is_text(here) and (first or after):
                yield str(here.value.value).strip()


def vague(text):
    return [said.splitlines()[0] for said in docstrings(text) if VAGUE.match(said)]


def literals(text):
    """Values of the module's constants that are literals, or a range unpacked."""
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign):
            continue
        for target in node.targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            try:
                value = eval(ast.unparse(node.value), {"range": range})
            except (NameError, AttributeError):
                continue
            values = value if isinstance(target, ast.Tuple) else [value]
            for name, one in zip(names, values, strict=True):
                if ast.unparse(name).isupper():
                    yield ast.unparse(name), one


@pytest.mark.parametrize(
    "path", PACKAGE + OTHERS, ids=lambda x: str(x.relative_to(ROOT))
)
def test_docstrings_begin_with_a_noun_or_a_verb(path):
    assert not vague(path.read_text())


def test_a_constants_name_has_one_value():
    found = defaultdict(lambda: defaultdict(list))
    for path in PACKAGE:
        for name, value in literals(path.read_text()):
            found[name][repr(value)].append(str(path.relative_to(ROOT)))
    assert not {name: dict(values) for name, values in found.items() if len(values) > 1}


def test_vague_words_and_values_are_found():
    text = '"""It is."""\nA, B = range(2)\n"""What it is."""\nC = [0.5]\nD = A\n'
    text += 'class E:\n    """The same."""\ndef f():\n    """Whole; itself."""\n'
    assert vague(text) == ["It is.", "What it is.", "The same."]
    assert dict(literals(text)) == {"A": 0, "B": 1, "C": [0.5]}
