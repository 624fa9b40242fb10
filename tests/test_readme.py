"""The README is true and short: its snippets run, and what it names is there."""

import csv
import re
import subprocess
import sys
from importlib import metadata

import pytest

import station
from places import ROOT
from qpavoid.avoidance.decision import Status

TEXT = (ROOT / "README.md").read_text()


def test_it_is_short():
    assert len(TEXT.splitlines()) <= 150


def test_python_snippets_run_one_after_the_other(capsys):
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(blocks) == 2
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "0.9" not in capsys.readouterr().out.split()[0]
    assert names["decision"].status is Status.FILTERED
    assert names["step"].v > 0.0


def test_its_people_are_those_of_the_station_study():
    with (ROOT / "comparisons/results/station.csv").open() as file:
        found = station.totals(list(csv.DictReader(file)), "method")
    ours, still = (
        round(found[x]["by_robot"] + found[x]["by_person"]) for x in ("ours", "nothing")
    )
    text, visits = " ".join(TEXT.split()), round(found["ours"]["visits"])
    assert f"{ours} of {visits} people of nine kinds touch it" in text
    assert f"{still} touch a robot that stands still" in text


@pytest.mark.parametrize(("more", "count"), [((), 1), (("scipy",), 2)])
def test_numpy_is_enough_on_a_robot(more, count):
    """Its snippets run where none of the other dependencies can be imported."""
    names = set(metadata.requires("qpavoid") or ())
    base = {re.split(r"[<>=; ]", name)[0] for name in names if "extra" not in name}
    lacking = {*base, "yaml", "numba"} - {"numpy", "pyyaml", *more}
    assert "casadi" in lacking
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    hide = f"import sys; sys.modules.update(dict.fromkeys({sorted(lacking)}))\n"
    code = hide + "".join(blocks[:count])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_it_leads_to_every_page():
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    linked = set(re.findall(r"\]\(docs/([\w-]+\.md)[#)]", TEXT))
    apart = {"index.md", "all-comparisons.md", "paper-statements.md"}
    assert pages - linked == apart
