"""The study files: each has the scenes of the committed rows, and runs."""

import re

import pytest

from places import COMPARISONS, ROOT

rows = pytest.importorskip("rows", reason="needs qpavoid[study]")
import tables
from qpavoid.lab.study.sweep.job import run_job
from qpavoid.lab.study.sweep.study import read_study

FILES = sorted((COMPARISONS / "studies").rglob("*.toml"))
DATA = {"barn", "barn_lidar", "barn_wheels", "crowd", "crowd_lidar", "dynabarn", "maps"}
METRICS = "astar", "qp-ahead+guide"
METHOD = {"maps": "astar", "noise": "vfh", "latency_tracks": "vfh"}
"""Whose first run is compared, if not ``alone``; other levels ran no such method."""


def told(path):
    """Study and level to which the head of a file adds its runs."""
    add = re.search(r'rows\.py \S+ (\w+)(?: --level "?([^"\n]+))?', path.read_text())
    return add[1], f": {add[2]}" if add[2] else ""


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_study_file_has_the_scenes_of_the_rows(path, request, monkeypatch):
    data = None
    if path.stem in DATA:
        data = str(request.getfixturevalue("data_folder"))
        monkeypatch.setenv("QPAVOID_DATA", data)
    study, (name, level) = read_study(path, data), told(path)
    kept = [place for place, _ in rows.read_cells(name)]
    mine = [(source, seed) for source, seeds in study.sources for seed in seeds]
    places = {(x.name + level, "" if k is None else str(k)) for x, k in mine}
    settings = {setting for setting, _ in places}
    assert places == {place for place in kept if place[0] in settings}
    assert str(path.relative_to(ROOT)) in path.read_text()


@pytest.mark.parametrize("name", ["discs", "discs_wheels", "fleet", "base", "noise"])
def test_its_first_run_is_that_of_the_rows(name):
    (path,) = (x for x in FILES if x.stem == name)
    if name == "discs_wheels":
        pytest.importorskip("mujoco", reason="needs qpavoid[mujoco]")
    study, level = told(path)
    method = METHOD.get(name, "alone")
    job = next(job for job in read_study(path).jobs() if job.controller == method)
    kept = dict(rows.read_cells(study))[job.source.name + level, str(job.seed)]
    row, _ = run_job(job)
    end = rows.cell_of(row).partition("/")[0]
    assert end == dict(kept)[method].partition("/")[0]


def test_the_runs_of_a_script_are_added(tmp_path, monkeypatch):
    monkeypatch.setattr(rows, "RESULTS", tmp_path / "results")
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "costs.csv").write_text("study,setting,method,solve_us\n")
    rows.read_costs.cache_clear()
    columns = "method,setting,seed,outcome,success,contact," + ",".join(rows.NUMBERS)
    (tmp_path / "runs.csv").write_text(
        f"{columns}\nqp,5 people,0,arrived,True,False,9.50,0.2,0.3,0,8,12\n"
        "qp,5 people,1,touched,False,True,,-0.0123,0.3,1,10,14\n"
        "eq5,5 people,1,off goal,False,False,,,0.3,0,,\n"
    )
    rows.add(tmp_path, "people", "far")
    text = (tmp_path / "results" / "people.csv").read_text()
    assert text == "setting,scene,qp,eq5\n5 people: far,0,9.5\n,1,c/13,l\n"
    costs = (tmp_path / "results" / "costs.csv").read_text().splitlines()
    assert costs[1] == "people,5 people: far,qp,9,13"
    rows.read_costs.cache_clear()


def test_other_numbers_of_the_page_are_those_of_the_rows():
    page = (COMPARISONS / "README.md").read_text(encoding="utf-8")
    costs = rows.read_costs()
    metric = [costs["barn", "BARN, v <= 0.5 m/s: known", x][2] for x in METRICS]
    assert "metric of {:.3f}, ours {:.3f};".format(*metric) in page
    people = rows.chosen(next(x for x in rows.RANKINGS if "10 people" in x.title))
    ran = [len(people[x]) for x in ("nmpc", "teb", "mpc-cbf")]
    assert "NMPC ran {} of the 500 scenes, TEB and MPC-CBF {}.".format(*ran) in page
    discs = rows.read_runs("discs")
    won = {k for some in discs.values() for k, run in some.items() if not run.end}
    assert len({k for some in discs.values() for k in some} - won) == 2
    short = rows.chosen(next(x for x in rows.RANKINGS if "short" in x.title))
    ends = {k for some in short.values() for k in some}
    won = {k for some in short.values() for k, run in some.items() if not run.end}
    said = f"in {len(ends - won)} of its {len(ends)} episodes no method succeeds"
    assert said in page
    ours = [tables.costs(x, x.before + METRICS[1])[1] for x in rows.RANKINGS]
    assert f"{min(ours):.2f} to {max(ours):.0f} ms" in page
    assert max(x[1] for k, x in costs.items() if k[2] == "eq5" and x[1] == x[1]) < 40
