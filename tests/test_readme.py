"""The README is true and short: its snippets run, and what it names is there."""

import re

from places import ROOT
from qpavoid.avoidance.decision import Status
from qpavoid.cli import COMMANDS, LAWS
from qpavoid.lab.simulation.methods import OURS, REGISTRY

TEXT = (ROOT / "README.md").read_text()


def test_it_is_short():
    assert len(TEXT.splitlines()) <= 200


def test_python_snippets_run_one_after_the_other(capsys):
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(blocks) == 3
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "0.9" not in capsys.readouterr().out.split()[0]
    assert names["decision"].status is Status.FILTERED
    assert names["step"].v > 0.0


def test_its_figures_exist():
    film, figure = re.findall(r"!\[[^]]+\]\(([^)]+)\)", TEXT)
    assert (ROOT / film).read_bytes().startswith(b"GIF89a")
    assert (ROOT / figure).read_bytes().startswith(b"\x89PNG")


def test_the_methods_that_it_counts_are_there():
    of_the_paper = [name for name in REGISTRY if name.startswith(("eq5", "eq7"))]
    others = {*REGISTRY} - {*OURS} - {*of_the_paper}
    assert len(others - {"alone", "omni"}) == 12 and "twelve other methods" in " ".join(
        TEXT.split()
    )
    assert {"stop", "mppi", "nmpc"} <= others
    assert len(LAWS.split(",")) == 6 and "with six\ncontrollers" in TEXT


def test_what_it_names_exists():
    for path in re.findall(r"`((?:configs|comparisons)/[\w./*]*|\w+\.cff)`", TEXT):
        assert list(ROOT.glob(path.rstrip("/"))), path
    for script in re.findall(r"python (comparisons/\w+\.py)", TEXT):
        assert (ROOT / script).is_file()
    for path in re.findall(r"\]\(([\w./-]+?)(?:#\w+)?\)", TEXT):
        assert (ROOT / path).exists(), path


def test_its_commands_exist():
    named = set(re.findall(r"`qpavoid ([a-z-]+)", TEXT))
    assert {"doctor", "init", "run", "play"} <= named <= {*COMMANDS}


def test_it_leads_to_every_page():
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    linked = set(re.findall(r"\]\(docs/([\w-]+\.md)\)", TEXT))
    apart = {"index.md", "comparisons.md", "all-comparisons.md", "paper-statements.md"}
    assert pages - linked == apart


def stretches(text, length=3):
    """Every so many lines on end of its blocks of Python and shell commands."""
    for block in re.findall(r"```(?:python|sh)\n(.*?)```", text, re.DOTALL):
        lines = [line.strip() for line in block.splitlines() if line.strip()]
        for k in range(len(lines) - length + 1):
            yield tuple(lines[k : k + length])


def test_no_snippet_is_said_twice():
    again = {
        page.name
        for page in [ROOT / "docs/start.md", ROOT / "docs/index.md"]
        if {*stretches(TEXT)} & {*stretches(page.read_text())}
    }
    assert {*stretches(TEXT)} and not again
