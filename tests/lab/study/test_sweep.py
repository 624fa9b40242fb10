"""Sweeps: the same table whoever is killed, whenever it is stopped, whoever works."""

import subprocess
import sys
from pathlib import Path
from shutil import copytree

import pytest

from qpavoid.cli import main
from qpavoid.errors import ConfigError, DataError, UnknownNameError
from sweep_sources import DOCUMENT, Harmless, KillsAlways, KillsOnce, Raises

pytest.importorskip("pyarrow", reason="needs qpavoid[study]")

from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.sweep.engine import sweep
from qpavoid.lab.study.sweep.store import read_provenance, read_rows, shards
from qpavoid.lab.study.sweep.study import Study, read_study
from sweep_sources import table_hash, toml, write_study

OURS = "eq5", "qp", "qp:osqp"
SETTINGS = '[settings]\n"radius.r_min_slow_m" = [0.17, 0.2]'


def small(source=None, seeds=8, controllers=("eq5", "qp"), keep="none"):
    return Study(
        title="small",
        text="",
        controllers=[(name, "exact") for name in controllers],
        sources=[(source or Harmless(), range(seeds))],
        variations=[{}],
        trajectories=keep,
        data=None,
    )


@pytest.fixture
def files(tmp_path):
    """Write a study of three methods in two settings."""
    return lambda seeds: write_study(tmp_path, f"0:{seeds}", OURS, settings=SETTINGS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    sweep(small(), folder, workers=1)
    return read_rows(folder)


def test_one_row_a_run_whoever_works(whole, tmp_path):
    assert len(whole) == 16 == len({row["run"] for row in whole})
    assert {row["outcome"] for row in whole} <= {"arrived", "touched", "off goal"}
    assert sweep(small(), tmp_path, workers=2) == 16
    assert table_hash(read_rows(tmp_path)) == table_hash(whole)


def test_a_worker_that_is_killed_costs_nothing(whole, tmp_path):
    source = KillsOnce(mark=str(tmp_path / "mark"))
    assert sweep(small(source), tmp_path / "out", workers=2) == 16
    assert (tmp_path / "mark").exists()
    assert table_hash(read_rows(tmp_path / "out")) == table_hash(whole)


def test_a_run_that_always_kills_is_named_and_stops_nobody(whole, tmp_path):
    study = small(KillsAlways(), seeds=4, controllers=["qp"])
    assert sweep(study, tmp_path, workers=2) == 4
    rows = read_rows(tmp_path)
    died = [row for row in rows if row["outcome"] == "died"]
    assert [row["seed"] for row in died] == [3]
    assert "killed its worker 2 times" in died[0]["error"]
    others = [x for x in whole if x["seed"] < 3 and x["controller"] == "qp"]
    assert table_hash(row for row in rows if row["seed"] != 3) == table_hash(others)
    assert sweep(study, tmp_path, workers=2) == 0


def test_a_run_that_raises_is_a_row(tmp_path):
    sweep(small(Raises()), tmp_path, workers=1)
    failed = [row for row in read_rows(tmp_path) if row["outcome"] == "failed"]
    assert [row["error"] for row in failed] == ["ValueError: no such scene"] * 2
    assert not any(row["success"] for row in failed)


def test_a_study_is_extended_and_a_copy_of_another_counts(whole, tmp_path):
    first, second, both = (tmp_path / name for name in ("a", "b", "c"))
    assert sweep(small(seeds=3), first, workers=1) == 6
    assert sweep(small(), first, workers=1) == 10
    assert table_hash(read_rows(first)) == table_hash(whole)
    assert sweep(small(controllers=["qp"]), second, workers=1) == 8
    copytree(second, both)
    done = []
    count = sweep(
        small(),
        both,
        workers=1,
        progress=lambda *numbers: done.append(numbers),
    )
    assert count == 8 and done[-1] == (8, 8)
    assert table_hash(read_rows(both)) == table_hash(whole)


def test_trajectories_are_kept_on_request(tmp_path):
    def logs(folder):
        return {path.stem for path in (folder / "logs").glob("*.npz")}

    sweep(small(seeds=4), tmp_path, workers=1)
    assert not logs(tmp_path)
    assert sweep(small(seeds=4, keep="all"), tmp_path, workers=1) == 8
    rows = read_rows(tmp_path)
    assert len(rows) == 8 and logs(tmp_path) == {row["run"] for row in rows}
    log = Log.load(tmp_path / "logs" / f"{rows[0]['run']}.npz")
    assert log["least_clearance_m"].min() == pytest.approx(rows[0]["min_clearance_m"])
    sweep(small(seeds=4, keep="failures"), tmp_path / "some", workers=1)
    rows = read_rows(tmp_path / "some")
    assert logs(tmp_path / "some") == {r["run"] for r in rows if not r["success"]}


def test_a_torn_shard_is_an_error_and_the_rest_is_kept(whole, tmp_path):
    sweep(small(seeds=3), tmp_path, workers=1)
    sweep(small(), tmp_path, workers=1)
    torn, *others = shards(tmp_path)
    content = torn.read_bytes()
    torn.write_bytes(content[: len(content) // 2])
    for call in (lambda: sweep(small(), tmp_path), lambda: read_rows(tmp_path)):
        with pytest.raises(DataError, match=f"{torn.name}.*damaged.*others are whole"):
            call()
    assert shards(tmp_path) == [torn, *others]
    torn.unlink()
    assert 0 < sweep(small(), tmp_path, workers=1) < 16
    assert table_hash(read_rows(tmp_path)) == table_hash(whole)


METHODS = """
from .parts import HALF


def slow(v, omega, obstacles, context):
    return HALF * v, HALF * omega
"""
OWN = """
title = "Own"
controllers = ["qp", "loose:slow", "astar+kept.methods:slow"]
seeds = "0:1"
scenarios = [{ config = "past.toml" }]
"""


@pytest.fixture
def own_methods(tmp_path, monkeypatch):
    """A folder with a study, a module and a package; commands start in another one."""
    work, elsewhere = tmp_path / "work", tmp_path / "elsewhere"
    (work / "kept").mkdir(parents=True)
    elsewhere.mkdir()
    (work / "kept" / "__init__.py").touch()
    (work / "kept" / "parts.py").write_text("HALF = 0.5")
    (work / "kept" / "methods.py").write_text(METHODS)
    loose = METHODS.replace("from .parts import HALF", "HALF = 0.2")
    (work / "loose.py").write_text(loose)
    (work / "study.toml").write_text(OWN)
    (work / "past.toml").write_text(toml(DOCUMENT))
    monkeypatch.chdir(elsewhere)
    return work


@pytest.mark.long
def test_methods_of_ones_own_are_known_to_all_workers(own_methods):
    study = str(own_methods / "study.toml")
    command = [sys.executable, "-P", "-m", "qpavoid", "sweep", study, "--out"]

    def rows(name, *options):
        out = str(own_methods / name)
        subprocess.run([*command, out, *options], check=True)
        return read_rows(Path(out))

    alone = rows("alone", "--workers", "1")
    assert len(alone) == 3 and not any(row["error"] for row in alone)
    assert table_hash(rows("two", "--workers", "2")) == table_hash(alone)
    loose = own_methods / "loose.py"
    loose.write_text(loose.read_text().replace("0.2", "0.9"))
    changed = rows("changed", "--workers", "2")
    differ = {
        before["controller"]
        for before, now in zip(alone, changed, strict=True)
        if before["length_m"] != now["length_m"]
    }
    assert differ == {"loose:slow"}


def test_the_command_says_what_was_done(files, tmp_path, capsys):
    command = ["sweep", str(files(seeds=2)), "--out", str(tmp_path / "out")]
    assert main([*command, "--workers", "1"]) == 0
    printed = capsys.readouterr().out
    assert "12 runs done, 12 in" in printed and 'trajectories = "all"' in printed
    rows = read_rows(tmp_path / "out")
    assert {row["solver"] for row in rows} == {"closed form", "exact", "osqp"}
    assert {row["radius.r_min_slow_m"] for row in rows} == {0.17, 0.2}
    origin = read_provenance(tmp_path / "out")
    assert origin["study"].startswith('\ntitle = "Small"')
    assert origin["versions"]["qpavoid"] and origin["cpu"] and origin["others"] == 0
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--workers", "0"])
    assert "'0' is no number of processes" in capsys.readouterr().err


VARIANT = """
[variants.eq5-wide]
controller = "eq5"
settings = { "radius.r_min_slow_m" = 0.2, "repulsion.damping_m" = 0.1 }
"""


def test_a_variant_is_a_method_with_settings_of_its_own(files, tmp_path):
    def rows(name, text):
        path = files(seeds=2)
        path.write_text(text)
        sweep(read_study(path), tmp_path / name, workers=1)
        return read_rows(tmp_path / name)

    text = files(seeds=2).read_text().replace('"qp", "qp:osqp"', '"eq5-wide"')
    found = rows("variant", text.replace("[[scen", f"{VARIANT}[[scen"))
    own = [row for row in found if row["controller"] == "eq5-wide"]
    assert len(found) == 8 and len(own) == 4
    grid = '"repulsion.damping_m" = [0.1]\n[[scen'
    expected = rows("grid", text.replace(', "eq5-wide"', "").replace("[[scen", grid))
    expected = {r["seed"]: r for r in expected if r["radius.r_min_slow_m"] == 0.2}
    for row in own:
        assert row["radius.r_min_slow_m"] in (0.17, 0.2), "that of the grid"
        assert row["length_m"] == expected[row["seed"]]["length_m"]
    default = {r["seed"]: r["length_m"] for r in found if r["controller"] == "eq5"}
    assert any(row["length_m"] != default[row["seed"]] for row in own)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (('"eq5"', '"eq6"'), "eq6"),
        (("slow_m", "slowm"), "r_min_slowm: unknown key"),
        (("= 0.2", "= -0.2"), "greater than or equal to 0"),
        (("variants.eq5-wide", "variants.eq5"), "variants.eq5: a name of its own"),
        (("controller =", "solver ="), "variants.eq5-wide.controller: field required"),
    ],
)
def test_mistakes_in_a_variant_are_named(files, change, match):
    path = files(seeds=1)
    text = path.read_text().replace("[[scen", f"{VARIANT.replace(*change)}[[scen")
    path.write_text(text)
    with pytest.raises((ConfigError, UnknownNameError), match=match):
        read_study(path)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (("title", "titel"), "titel: unknown key; did you mean 'title'"),
        (
            ('"radius.r_min_slow_m"', '"radius.r_min_slowm"'),
            "radius.r_min_slowm: unknown key.*r_min_slow_m",
        ),
        (("[0.17, 0.2]", "[0.17, 0.9]"), "r_min_slow_m.: 0.9.*safety radius needs"),
        (("[0.17, 0.2]", "[]"), "at least 1 item"),
        (('"0:2"', '"2"'), "seeds"),
        (('"0:2"', '"0:1000000000000000000"'), "1,000,000,000,000,000,000|seeds"),
        (('"0:2"', '"0:100000000000000000"'), r"at most 1,000,000\)"),
        (('"0:2"', "[9223372036854775808]"), "seeds"),
        (("[[scenarios]]", "[[generators]]"), "generators"),
        (('config = "past.toml"', ""), "config: field required"),
        (('"eq5"', '"eq5:osqp"'), "eq5 has no QP"),
        (("past.toml", "x.toml"), "x.toml: no such file"),
        (('"0:2"', '"2:2"'), "seeds: there are none of .*past"),
        (('"eq5"', '"eq6"'), "unknown controller 'eq6'"),
        (("qp:osqp", "qp:osq"), "osq"),
        (("past.toml", "x"), "unknown scenario 'x'"),
    ],
)
def test_mistakes_in_a_study_are_named(files, change, match):
    path = files(seeds=2)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises((ConfigError, UnknownNameError), match=match):
        read_study(path)


def test_controllers_of_the_command_line_are_the_study(files, tmp_path, capsys):
    path, out = files(seeds=2), tmp_path / "out"
    command = ["sweep", str(path), "--out", str(out), "--workers", "1"]
    assert main([*command, "--controllers", "alone, qp:osqp,alone"]) == 0
    rows = read_rows(out)
    assert {(r["controller"], r["solver"]) for r in rows} == {
        ("alone", "its own"),
        ("qp", "osqp"),
    }
    study = read_provenance(out)["study"]
    assert study.startswith("# --controllers alone,qp:osqp\n")
    again = read_study(path, controllers=["alone", "qp:osqp"])
    assert {r["run"] for r in rows} == {job.run for job in again.jobs()}
    assert {r["run"] for r in rows} - {job.run for job in read_study(path).jobs()}
    assert main([*command, "--controllers", "eq6"]) == 2
    assert "unknown controller 'eq6'" in capsys.readouterr().err


def test_a_run_is_known_by_all_that_determines_it(files):
    path = files(seeds=1)
    before = {job.run for job in read_study(path).jobs()}
    assert before == {job.run for job in read_study(path).jobs()}
    scenario = Path(path).with_name("past.toml")
    scenario.write_text(scenario.read_text().replace("3.0", "3.5"))
    assert not before & {job.run for job in read_study(path).jobs()}


def test_a_run_is_known_by_the_code_of_a_source_of_ones_own(
    files, tmp_path, monkeypatch
):
    monkeypatch.syspath_prepend(tmp_path)
    runs, path = [], files(seeds=1)
    for name, base in (("mine_a", 0), ("mine_b", 0), ("mine_c", 1)):
        code = "from sweep_sources import Harmless\nclass Mine(Harmless):\n    pass\n"
        (tmp_path / f"{name}.py").write_text(code + f"base = {base}\n")
        item = f'[[generators]]\nkind = "own"\nsource = "{name}:Mine"\n'
        study = tmp_path / f"{name}.toml"
        study.write_text(path.read_text() + item)
        runs.append({job.run for job in read_study(study).jobs()})
    assert runs[0] == runs[1] and len(runs[0] - runs[2]) == len(runs[0]) // 2
