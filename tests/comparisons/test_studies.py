"""What the studies share: their rows, and the smallest of them."""

import csv
import importlib
import subprocess
import sys

import pytest

from places import COMPARISONS
from qpavoid.errors import DataError
from qpavoid.lab.worlds.scenes import ScenarioFile

studies = pytest.importorskip("studies", reason="needs qpavoid[study]")
from qpavoid.lab.study.sweep.job import run_job
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.sweep.store import Store


def row(success=False, contact=False, moving=0.0, time=None, error="", metric=None):
    return {
        "success": success,
        "contact": contact,
        "contacts_moving": moving,
        "arrived_s": time,
        "error": error,
        "metric": metric,
    }


def test_every_run_is_counted_once():
    rows = [
        row(success=True, time=10.0, metric=0.5),
        row(success=True, time=11.0, metric=0.25),
        row(contact=True, moving=1.0, metric=0.0),
        row(contact=True, moving=0.0, time=9.0),
        row(contact=True),
        row(),
        row(error="killed its worker"),
        row(contact=True, moving=1.0) | {"start_clearance_m": -0.1},
    ]
    assert studies.table_row("qp", rows=rows, setting="") == {
        "method": "qp",
        "runs": 8,
        "began": 1,
        "successes": 2,
        "contacts": 1,
        "contacts_standing": 2,
        "timeouts": 1,
        "failed": 1,
        "mean_time_s": 10.5,
        "metric": 0.25,
        "setting": "",
    }


def study(*options, seeds=range(2)):
    """A study of its own by the shared options."""
    parser = studies.make_parser("A study.", "stop", "out")
    given = parser.parse_args([*options, "--workers", "1"])
    scenes = [studies.Scenes(scenario_file("demo/strangers"), seeds)]
    studies.main_of(lambda: studies.run_study("t", scenes, given), parser)


def test_a_study_has_the_scenes_of_its_seeds(tmp_path):
    study("--methods", "eq5,stop", "--out", str(tmp_path), seeds=range(7, 9))
    with (tmp_path / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    runs = {(row["method"], row["seed"], row["scenario"]) for row in rows}
    scenes = [(name, seed) for name in ("eq5", "stop") for seed in "78"]
    assert runs == {(*scene, "demo/strangers") for scene in scenes}


def test_methods_of_ones_own_are_in_the_scripts(tmp_path, monkeypatch, capsys):
    """What stands before a colon was taken for the method's name."""
    (tmp_path / "mine_s.py").write_text(
        "def slow(v, omega, obstacles, context):\n    return 0.9 * v, omega\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    out = "--out", str(tmp_path / "out"), "--methods"
    study(*out, "stop,mine_s:slow", seeds=range(1))
    with (tmp_path / "out" / "table.csv").open() as file:
        assert [row["method"] for row in csv.DictReader(file)] == [
            "stop",
            "mine_s:slow",
        ]
    for wrong, said in (("mine_s:slo", "did you mean 'slow'"), ("eq6", "eq6")):
        with pytest.raises(SystemExit) as ended:
            study(*out, wrong)
        assert ended.value.code == 2 and said in capsys.readouterr().err


def test_a_failed_run_is_a_column_and_the_exit_status(tmp_path, monkeypatch, capsys):
    sample = ScenarioFile.sample

    def cut(source, seed=None):
        if seed == 1:
            raise DataError("a file was cut")
        return sample(source, seed)

    def alone(study, out, workers):
        Store(out, study.text).save([run_job(job) for job in study.jobs()])

    monkeypatch.setattr(ScenarioFile, "sample", cut)
    monkeypatch.setattr(studies, "sweep", alone)  # workers would not see what is cut
    with pytest.raises(SystemExit) as ended:
        study("--methods", "stop", "--out", str(tmp_path))
    assert ended.value.code == 1
    told = capsys.readouterr()
    assert "1 of 2 runs failed" in told.err and "a file was cut" in told.out
    with (tmp_path / "table.csv").open() as file:
        (line,) = csv.DictReader(file)
    assert (line["runs"], line["failed"]) == ("2", "1")


def test_a_failed_run_has_no_metric():
    def add(row):
        return {"metric": 0.0, "setting": "here"}

    failed = row(error="DataError: cut")
    assert studies.added(failed, add) == {"metric": None, "setting": "here"}
    assert studies.added(row(), add) == {"metric": 0.0, "setting": "here"}


@pytest.mark.parametrize(
    ("script", "options"),
    [
        ("crowdnav", ["--phase", "val", "--count", "1", "--people", "1"]),
    ],
)
def test_scripts_with_loops_of_their_own_take_them_too(
    script, options, tmp_path, monkeypatch
):
    if script == "crowdnav":
        pytest.importorskip("pyrvo", reason="needs qpavoid[baselines]")
    (tmp_path / "mine_t.py").write_text(
        "def still(v, omega, obstacles, context):\n    return 0.0, 0.0\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    command = [script, *options, "--methods", "mine_t:still", "--workers", "1"]
    command += ["--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    importlib.import_module(script).main()
    with (tmp_path / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["method"] for row in rows} == {"mine_t:still"}
    assert not any(int(row["success"] == "True") for row in rows)


WITHOUT = """
import runpy, sys

class Absent:
    def find_spec(self, name, *rest):
        if name.split(".")[0] in ("pyarrow", "joblib"):
            raise ImportError(name)

sys.meta_path.insert(0, Absent())
for script in sys.argv[1:]:
    sys.path.insert(0, script.rpartition("/")[0])
    sys.argv = [script, "--help"]
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as ended:
        print(ended)
"""


def test_a_script_names_the_extra_that_it_lacks():
    names = ("paper/paper.py", "paper/outlook.py", "crowdnav/crowdnav.py")
    scripts = [str(COMPARISONS / name) for name in names]
    command = [sys.executable, "-c", WITHOUT, *scripts]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    said = done.stdout.strip().splitlines()
    assert len(said) == len(names)
    assert all(line.endswith("pip install 'qpavoid[study]'") for line in said)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("flag", ["--methods", "--controllers"])
def test_methods_are_controllers_too(flag):
    parser = studies.make_parser("A study.", "qp", "out")
    options = parser.parse_args([flag, "eq5,qp:osqp"])
    assert studies.chosen_methods(options) == [("eq5", "exact"), ("qp", "osqp")]
