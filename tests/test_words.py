"""Docstrings are definitions, and a constant's name has one value in the package."""

import ast
import re
from collections import defaultdict

import pytest

from places import ROOT

PACKAGE = sorted((ROOT / "qpavoid").rglob("*.py"))
OTHERS = sorted(x for y in ("comparisons", "tests") for x in (ROOT / y).rglob("*.py"))
VAGUE = re.compile(r'^\s*"""(What|Who|The same|It)\b', re.MULTILINE)


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
    assert not VAGUE.findall(path.read_text())


def test_a_constants_name_has_one_value():
    found = defaultdict(lambda: defaultdict(list))
    for path in PACKAGE:
        for name, value in literals(path.read_text()):
            found[name][repr(value)].append(str(path.relative_to(ROOT)))
    assert not {name: dict(values) for name, values in found.items() if len(values) > 1}
