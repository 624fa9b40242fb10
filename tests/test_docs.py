"""README and documentation are true: snippets run, links lead somewhere, it builds."""

import json
import re
import runpy
import subprocess
import sys
from importlib import metadata
from pathlib import PurePosixPath

import numpy as np
import pytest

import qpavoid
import station
from places import ROOT, table
from qpavoid.avoidance.decision import Status
from qpavoid.avoidance.inputs import Fault
from qpavoid.cli import COMMANDS, main

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TEXTS = {page.stem: page.read_text() for page in PAGES}
README = (ROOT / "README.md").read_text()


def fenced(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def cells(text):
    """Code that a tutorial runs when it is built."""
    return fenced(text, r"\{code-cell\} ipython3")


@pytest.mark.parametrize("name", [n for n, t in TEXTS.items() if fenced(t, "python")])
def test_python_snippets_run_one_after_the_other(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in fenced(TEXTS[name], "python"):
        exec(compile(block, f"docs/{name}.md", "exec"), names)
    shown = capsys.readouterr().out.splitlines()
    for told in re.findall(r"^print\(.*\)\n# (.+)", TEXTS[name], re.MULTILINE):
        beginning = told.removesuffix(" ...")
        assert any(line.startswith(beginning) for line in shown), told


@pytest.mark.long
def test_the_example_of_another_simulator_arrives():
    pytest.importorskip("irsim")
    way, goal, hit = runpy.run_path(str(DOCS / "irsim_scene.py"))["drive"]("trap")
    assert not hit and np.hypot(*(way[-1, :2] - goal)) <= 0.2


def commands_in(text):
    """Lines that call qpavoid: of shell blocks, and in backticks."""
    shells = [cell for cell in cells(text) if cell.startswith("%%sh")]
    lines = "\n".join([*fenced(text, "sh"), *shells]).splitlines()
    for line in [*lines, *re.findall(r"`(qpavoid [^`]+)`", text)]:
        if found := re.match(r"\s*(?:\S*/)?qpavoid (\w[\w-]*)(.*)", line):
            yield found[1], found[2].partition("#")[0].partition(" | ")[0]


def test_commands_and_options_exist(capsys):
    tried = 0
    for name, text in {**TEXTS, "README": README}.items():
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


def test_paths_exist():
    for name, text in {**TEXTS, "README": README}.items():
        for path in re.findall(r"`((?:configs|comparisons|qpavoid)/[\w./*]+)`", text):
            assert list(ROOT.glob(path.rstrip("/"))), (name, path)
        for script in re.findall(r"python (comparisons/[\w/]+\.py)", text):
            assert (ROOT / script).is_file(), (name, script)


def test_the_api_pages_have_every_name_that_is_public_or_used():
    pages = "".join(path.read_text() for path in DOCS.glob("api/*.rst"))
    named = set(re.findall(r":: (qpavoid[\w.]+)$", pages, re.MULTILINE))
    errors = {name for name in qpavoid.__all__ if name.endswith("Error")}
    public = {f"qpavoid.{name}" for name in {*qpavoid.__all__} - errors}
    imports = r"^from (qpavoid[\w.]*) import (.+)$"
    used = {
        f"{module}.{name}"
        for text in TEXTS.values()
        for module, names in re.findall(imports, text, re.MULTILINE)
        for name in names.split(", ")
    }
    assert (public | used) - named == {"qpavoid.__version__"}


def test_statuses_and_faults_are_named():
    table = TEXTS["filter"].partition("## Status")[2].partition("## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)) == {*Status}
    faults = re.findall(r"^\| ([a-z ]+) \| [^-]", TEXTS["reliability"], re.MULTILINE)
    assert faults[1:] == [*map(str, Fault)]


def test_every_reference_is_resolved_once():
    places = ("qpavoid/**/*.py", "comparisons/**/*.py", "configs/**/*.toml")
    sources = [path for place in places for path in ROOT.glob(place)]
    key = r"\[[A-Z][A-Za-z]+\d{4}\]"
    keys = {word for path in sources for word in re.findall(key, path.read_text())}
    listed = re.findall(rf"^- ({key})", TEXTS["references"], re.MULTILINE)
    assert set(listed) == keys
    assert len(listed) == len(set(listed))


def test_every_formula_is_where_the_table_says():
    lines = [line.split(" | ") for line in TEXTS["formulas"].splitlines()]
    places = [cells for cells in lines if len(cells) == 5 and "`" in cells[3]]
    for _, _, _, place, _ in places:
        path, name = re.findall(r"`([^`]+)`", place)
        source = (ROOT / "qpavoid" / path).read_text()
        assert re.search(rf"^\s*(def |class |){name}\b", source, re.MULTILINE), place
    equations = {cells[4].strip(" |") for cells in places}
    assert {f"Eq. {n}" for n in range(1, 9)} <= equations


TUTORIALS = [name for name, text in TEXTS.items() if cells(text)]


def built(folder, *options):
    """Build the documentation; return its pages."""
    for name in ("sphinx", "furo", "myst_nb", "ipykernel", "rosbags"):
        pytest.importorskip(name, reason="needs qpavoid[docs]")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", *options]
    done = subprocess.run(
        [*command, str(DOCS), str(folder)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    files = sorted(folder.rglob("*.html"), key=lambda path: -len(path.parts))
    return {path.stem: path.read_text() for path in files}  # the top folder's count


UNQUIET = "myst.xref_missing,myst.header,myst-nb.lexer"  # of conf.py, and cells
UNRUN = ("-D", "nb_execution_mode=off", "-D", f"suppress_warnings={UNQUIET}")


@pytest.mark.long
def test_it_builds_without_a_warning(tmp_path):
    """The tutorials are not run, so their cells have no language."""
    pages = built(tmp_path, *UNRUN)
    assert "gamma_per_s" in pages["keys"] and "1/s" in pages["keys"]
    assert "nearest" in pages["avoidance"] and set(TUTORIALS) < set(pages)
    index = (tmp_path / "searchindex.js").read_text()
    found = json.loads(index[index.index("(") + 1 : -1])
    for word, page in (
        ("nav2", "nav2"),
        ("costmap", "ros2"),
        ("tracker", "ros2"),
        ("veloc", "filter"),
    ):
        hits = np.atleast_1d(found["titleterms"][word])
        assert found["docnames"].index(page) in hits
    assert not [name for name in pages if re.search(r'src="https?://', pages[name])]


@pytest.mark.slow
def test_the_tutorials_run_when_it_is_built(tmp_path):
    pages = built(tmp_path)
    for name in TUTORIALS:
        assert "cell_output" in pages[name] and "Traceback" not in pages[name], name
    assert "9.5 s, least clearance" in pages["lidar-loop"]
    assert len(re.findall(r'src="_images/\w+\.svg"', pages["own-robot"])) == 2


UNLOOKED = {"out", "build", "dist", "node_modules"}
MARKDOWN = sorted(
    path
    for path in [*ROOT.rglob("*.md"), *(ROOT / ".github").rglob("*.md")]
    if not UNLOOKED & set(path.relative_to(ROOT).parts)
    and not any(part.startswith(".venv") for part in path.parts)
)
FENCE = re.compile(r"^ *(```+|~~~+|:::+).*?^ *\1 *$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")


def slug(heading):
    """Anchor that GitHub makes of a heading."""
    shown = LINK.sub(r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", shown.strip().lower()).replace(" ", "-")


def anchors(text):
    text, found = (
        FENCE.sub("", text),
        set(re.findall(r'<a (?:id|name)=["\x27]([^"\x27]+)', text)),
    )
    for heading in re.findall(r"^#{1,6} +(.+?)#*$", text, re.MULTILINE):
        name, number = slug(heading), 0
        while (one := f"{name}-{number}" if number else name) in found:
            number += 1
        found.add(one)
    return found


def dead(path):
    """Yield the links of a file that lead nowhere, or that have no words."""
    text = re.sub(r"`[^`]*`", "code", FENCE.sub("", path.read_text()))
    for words, link in LINK.findall(text):
        target, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        file = path.parent / PurePosixPath(target) if target else path
        there = file.exists() and (not anchor or anchor in anchors(file.read_text()))
        if not there or not words.strip():
            yield link


@pytest.mark.parametrize("path", MARKDOWN, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    assert not [*dead(path)]


def test_a_dead_link_is_found(tmp_path):
    (tmp_path / "b.md").write_text("# A `b` (c), d\n# Twice\n# Twice\n<a id='x'></a>\n")
    good = (
        "[a](b.md) [b](b.md#a-b-c-d) [c](b.md#twice-1) [d](b.md#x) [e](https://e.org)"
    )
    bad = "[a](c.md) [b](b.md#twice-2) [c](#nothing) [](b.md)"
    (tmp_path / "a.md").write_text(f"{good}\n```\n[a](gone.md)\n```\n{bad}\n")
    found = ["c.md", "b.md#twice-2", "#nothing", "b.md"]
    assert [*dead(tmp_path / "a.md")] == found


def test_the_people_of_the_readme_are_those_of_the_station_study():
    found = station.totals(table("station.csv"), "method")
    ours, still = (
        round(found[x]["by_robot"] + found[x]["by_person"]) for x in ("ours", "nothing")
    )
    text, visits = " ".join(README.split()), round(found["ours"]["visits"])
    assert f"{ours} of {visits} people of nine kinds touch it" in text
    assert f"{still} touch a robot that stands still" in text


FILTERED = "assert decision.status == 'filtered' and decision.v < 0.9"
STEPS = "assert step.v > 0.0"


@pytest.mark.parametrize(
    ("more", "told"), [((), (FILTERED,)), (("scipy",), (FILTERED, STEPS))]
)
def test_the_snippets_of_the_readme_run_with_numpy_on_a_robot(more, told):
    """None of the other dependencies can be imported; a guide takes scipy as well."""
    names = set(metadata.requires("qpavoid") or ())
    base = {re.split(r"[<>=; ]", name)[0] for name in names if "extra" not in name}
    lacking = {*base, "yaml", "numba"} - {"numpy", "pyyaml", *more}
    assert "casadi" in lacking
    code = [f"import sys; sys.modules.update(dict.fromkeys({sorted(lacking)}))"]
    for block, check in zip(fenced(README, "python"), told, strict=False):
        code += [block, check]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join(code)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_readme_leads_to_every_page():
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    linked = set(re.findall(r"\]\(docs/([\w-]+\.md)[#)]", README))
    apart = {"index.md", "all-comparisons.md", "paper-statements.md"}
    assert pages - linked == apart
