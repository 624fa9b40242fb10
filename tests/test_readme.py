"""The README is true: its snippets run, and what it names is there."""

import re

import pytest

from places import ROOT
from qpavoid.avoidance.decision import SENTENCES, Status
from qpavoid.cli import main

TEXT = (ROOT / "README.md").read_text()


def test_python_snippets_run_one_after_the_other(capsys):
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(blocks) >= 3
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "0.9" not in capsys.readouterr().out.split()[0]
    assert names["decision"].status is Status.FILTERED
    assert names["solution"].solver == "osqp"


def test_statuses_are_explained_in_their_own_words():
    text = " ".join(TEXT.split())
    for status in (
        Status.TRACKING,
        Status.FILTERED,
        Status.BRAKING,
        Status.HOLDING,
        Status.STOPPED,
    ):
        assert f"| `{status}` | {SENTENCES[status]} |" in text


def test_figures_exist():
    figures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", TEXT)
    assert len(figures) >= 3
    for figure in figures:
        assert (ROOT / figure).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "command",
    [
        "compare",
        "run",
        "list",
        "check",
        "bench",
        "sweep",
        "tune",
        "report",
        "play",
        "datasets",
        "ros",
        "replay",
        "identify",
    ],
)
def test_commands_and_options_exist(command, capsys):
    section = TEXT.split("## Command")[1].split("\n## ")[0]
    (usage,) = re.findall(rf"^    qpavoid {command} .*$", section, re.M)
    with pytest.raises(SystemExit):
        main([command, "--help"])
    help_text = capsys.readouterr().out
    for option in re.findall(r"--\w+", usage):
        assert option in help_text


def test_paths_exist():
    for path in re.findall(r"`(configs/[\w./*]+|comparisons/[\w./]+)`", TEXT):
        assert list(ROOT.glob(path.rstrip("/"))), path
    for script in re.findall(r"python (comparisons/\w+\.py)", TEXT):
        assert (ROOT / script).is_file()


def test_every_reference_is_resolved_once():
    places = ("qpavoid/**/*.py", "comparisons/**/*.py", "configs/**/*.toml")
    sources = [path for place in places for path in ROOT.glob(place)]
    keys = set()
    for path in sources:
        keys |= set(re.findall(r"\[[A-Z][a-z]+\d{4}\]", path.read_text()))
    listed = re.findall(r"^- (\[[A-Z][a-z]+\d{4}\])", TEXT, re.MULTILINE)
    assert set(listed) == keys
    assert len(listed) == len(set(listed))
