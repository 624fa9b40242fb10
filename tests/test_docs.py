"""The documentation is true: it builds without a warning, and its snippets run."""

import re
import subprocess
import sys
import tomllib

import pytest

import qpavoid
from places import ROOT
from qpavoid.avoidance.decision import SENTENCES, Status
from qpavoid.cli import COMMANDS, main

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TEXTS = {page.stem: page.read_text() for page in PAGES}


def fenced(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("name", [n for n, t in TEXTS.items() if fenced(t, "python")])
def test_python_snippets_run_one_after_the_other(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in fenced(TEXTS[name], "python"):
        exec(compile(block, f"docs/{name}.md", "exec"), names)
    capsys.readouterr()


def test_toml_snippets_are_valid(tmp_path, capsys):
    found = [block for text in TEXTS.values() for block in fenced(text, "toml")]
    assert found
    for block in found:
        assert tomllib.loads(block)
        if "title" in block:
            path = tmp_path / "snippet.toml"
            path.write_text(block)
            assert main(["check", str(path)]) == 0, capsys.readouterr().err


def commands_in(text):
    """Lines that call qpavoid: of shell blocks, and in backticks."""
    lines = "\n".join(fenced(text, "sh")).splitlines()
    for line in [*lines, *re.findall(r"`(qpavoid [^`]+)`", text)]:
        if found := re.match(r"\s*(?:\S*/)?qpavoid (\w[\w-]*)(.*)", line):
            yield found[1], found[2].partition("#")[0].partition(" | ")[0]


def test_commands_and_options_exist(capsys):
    tried = 0
    for name, text in TEXTS.items():
        for command, rest in commands_in(text):
            if command == "COMMAND":
                continue
            assert command in COMMANDS, (name, command)
            with pytest.raises(SystemExit):
                main([command, "--help"])
            told = capsys.readouterr().out
            for option in re.findall(r"(?<= )--[a-z][\w-]+", rest.partition(" -- ")[0]):
                assert option in told, (name, command, option)
                tried += 1
    assert tried > 10


def test_paths_and_links_exist():
    for name, text in TEXTS.items():
        for path in re.findall(r"`((?:configs|comparisons|qpavoid)/[\w./*]+)`", text):
            assert list(ROOT.glob(path.rstrip("/"))), (name, path)
        for script in re.findall(r"python (comparisons/[\w/]+\.py)", text):
            assert (ROOT / script).is_file(), (name, script)
        for path in re.findall(r"\]\(([\w./-]+?)(?:#[\w-]+)?\)", text):
            made = path.startswith("generated/")
            assert made or (DOCS / path).exists(), (name, path)


def test_the_api_page_has_every_public_name():
    text = (DOCS / "api.rst").read_text()
    named = set(re.findall(r":: qpavoid\.(\w+)$", text, re.MULTILINE))
    errors = {name for name in qpavoid.__all__ if name.endswith("Error")}
    assert named - {"errors"} == set(qpavoid.__all__) - errors - {"__version__"}


def test_statuses_are_named():
    text = " ".join(TEXTS["filter"].split())
    assert set(re.findall(r"^\| `(\w+)` \|", TEXTS["filter"], re.M)) == {*Status}
    for status in Status:
        sentence = SENTENCES[status].removesuffix(".")
        assert sentence in text, status


def test_every_reference_is_resolved_once():
    places = ("qpavoid/**/*.py", "comparisons/**/*.py", "configs/**/*.toml")
    sources = [path for place in places for path in ROOT.glob(place)]
    key = r"\[[A-Z][A-Za-z]+\d{4}\]"
    keys = {word for path in sources for word in re.findall(key, path.read_text())}
    listed = re.findall(rf"^- ({key})", TEXTS["references"], re.MULTILINE)
    assert set(listed) == keys
    assert len(listed) == len(set(listed))


def test_equations_are_all_written_out():
    text = TEXTS["how-it-works"]
    assert all(f"Eq. {n}" in text for n in range(1, 9))


def test_it_builds_without_a_warning(tmp_path):
    for name in ("sphinx", "furo", "myst_parser"):
        pytest.importorskip(name, reason="needs qpavoid[docs]")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html"]
    done = subprocess.run(
        [*command, str(DOCS), str(tmp_path)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    keys = (tmp_path / "generated" / "keys.html").read_text()
    assert "gamma_per_s" in keys and "1/s" in keys
    assert "nearest" in (tmp_path / "api.html").read_text()
    pages = [path for path in tmp_path.rglob("*.html")]
    assert not [p for p in pages if re.search(r'src="https?://', p.read_text())]
