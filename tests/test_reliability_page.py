"""The page of what fails is true: its snippets run, and what it promises is set."""

import re

from places import ROOT
from qpavoid.avoidance.inputs import Fault, Freshness

TEXT = (ROOT / "docs" / "reliability.md").read_text()


def test_its_snippets_run_one_after_the_other(capsys):
    names = {"__name__": "page"}
    for block in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL):
        exec(compile(block, "reliability.md", "exec"), names)
    shown = capsys.readouterr().out.splitlines()
    told = re.findall(r"print\(.*?\)\n# (.+)", TEXT)
    assert len(told) == len(shown) >= 2
    for line, beginning in zip(shown, told, strict=True):
        assert line.startswith(beginning.removesuffix(" ..."))


def test_every_fault_is_in_its_table():
    assert re.findall(r"^\| ([a-z ]+) \| [^-]", TEXT, re.M)[1:] == [*map(str, Fault)]
    assert Freshness().good == 0.5
