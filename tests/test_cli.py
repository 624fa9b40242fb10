"""The command line as a user meets it: output, files, exit codes, errors, JSON."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from qpavoid.cli import doctor, main
from qpavoid.lab.scenario.config import builtin_configs
from qpavoid.lab.scenario.methods import OURS
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.simulation.log import Log
from scenario_files import MINIMAL

SCENARIO = MINIMAL.replace('"t"', '"short"').replace("1.0", "0.5", 1)
SCENARIO += """
[[obstacles]]
kind = "disc"
position_m = [0.95, 0.0]
velocity_mps = [-0.1, 0.0]
"""


@pytest.fixture
def config(tmp_path):
    path = tmp_path / "short.toml"
    path.write_text(SCENARIO)
    return path


def test_compare_writes_tables_figures_and_logs(config, tmp_path, capsys):
    out = tmp_path / "results"
    assert main(["compare", str(config), "--out", str(out)]) == 0
    printed = capsys.readouterr()
    assert "short" in printed.out and "eq7" in printed.out and str(out) in printed.out
    assert "steps" not in printed.err
    summary = json.loads((out / "summary.json").read_text())
    assert [run["controller"] for run in summary] == [*OURS, "qp-ahead+guide"]
    assert summary[0]["solve_median_us"] is None
    assert summary[2]["solve_median_us"] > 0
    assert [run["solver"] for run in summary[1:3]] == ["closed form", "exact"]
    with (out / "summary.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["controller"] for row in rows] == [*OURS, "qp-ahead+guide"]
    assert float(rows[0]["min_clearance_m"]) == summary[0]["min_clearance_m"]
    versions = json.loads((out / "provenance.json").read_text())["versions"]
    assert versions["numpy"] == np.__version__
    log = Log.load(out / "logs" / "short-eq5.npz")
    assert len(log) == 50
    figures = list(out.rglob("*.png"))
    assert figures and all(figure.stat().st_size > 5000 for figure in figures)


@pytest.mark.usefixtures("undrawn")
def test_controllers_and_back_end_can_be_chosen(config, tmp_path, capsys):
    arguments = ["--controllers", "qp", "--backend", "osqp", "--out", str(tmp_path)]
    assert main(["compare", str(config), *arguments]) == 0
    (run,) = json.loads((tmp_path / "summary.json").read_text())
    assert (run["controller"], run["solver"]) == ("qp", "osqp")
    assert "eq5" not in capsys.readouterr().out


@pytest.mark.usefixtures("undrawn")
def test_run_and_compare_keep_what_the_other_left(config, tmp_path):
    out = ["--out", str(tmp_path)]
    assert main(["compare", str(config), "--controllers", "eq5,eq7", *out]) == 0
    before = {path.name for path in tmp_path.glob("*.png")}
    for name, flag in (("qp", "--controller"), ("eq5", "--controllers")):
        assert main(["run", str(config), flag, name, *out]) == 0
    (row,) = csv.DictReader((tmp_path / "summary.csv").read_text().splitlines())
    assert row["controller"] == "eq5"
    assert len(list((tmp_path / "logs").iterdir())) == 3
    figures = {path.name for path in tmp_path.glob("*.png")}
    for start in ("short-", "short-qp-", "short-eq5-"):
        assert f"{start}twists.png" in figures and len(before) == 4


def test_lists(capsys, monkeypatch):
    assert main(["list", "controllers"]) == 0
    printed = capsys.readouterr().out
    assert printed.split()[0] == "eq5" and "NAME+guide" in printed
    monkeypatch.setattr("qpavoid.lab.scenario.methods.find_spec", lambda name: None)
    assert main(["list", "controllers"]) == 0
    lines = capsys.readouterr().out.splitlines()
    lacking = [line.split()[0] for line in lines if "pip install 'qpavoid[" in line]
    assert lacking == ["orca", "astar", "dijkstra"]
    assert main(["list", "robots"]) == 0
    assert "jackal               Jackal: 0.508 x 0.430 m" in capsys.readouterr().out
    assert main(["list", "studies"]) == 0
    assert "studies/smoke" in capsys.readouterr().out.split()
    assert main(["list", "backends"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "exact"
    assert any(line.split()[0] == "qpsolvers:daqp" for line in lines)
    for line in lines:
        assert len(line.split()) == 1 or "pip install 'qpavoid[" in line
    assert main(["list", "configs"]) == 0
    assert "paper/test_case_1" in capsys.readouterr().out.split()


def test_check(config, capsys):
    assert main(["check", str(config)]) == 0
    assert (
        "valid. short: MiR100 with tip, obstacles: 1, 0.5 s in 50 steps"
        in capsys.readouterr().out
    )
    config.write_text(SCENARIO.replace("duration_s", "duration") + "seed = 'x'\n")
    assert main(["check", str(config)]) == 1
    error = capsys.readouterr().err
    assert "duration_s: field required" in error
    assert "duration: unknown key; did you mean 'duration_s'?" in error
    assert "Traceback" not in error


def test_check_says_what_is_wrong_as_json(config, capsys):
    text = SCENARIO.replace("duration_s", "duration") + "seed = 'x'\n"
    for written, count in ((text, 3), ("[[[", 1)):
        config.write_text(written)
        assert main(["check", str(config), "--json"]) == 1
        told, error = capsys.readouterr()
        found = json.loads(told)
        assert not found["valid"] and len(found["problems"]) == count, found
        assert all("short.toml" in problem for problem in found["problems"])
        assert not error


def test_every_shipped_file_passes_the_check(capsys):
    for name in builtin_configs():
        if not name.startswith("barn/"):
            assert main(["check", name]) == 0, capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["compare", "nothing.toml"], 1, "nothing.toml: no such file"),
        (["check", "paper/test_case_7"], 2, "unknown scenario 'paper/test_case_7'"),
        (["sweep", "none.toml", "--out", "x"], 1, "none.toml: no such file"),
        (["compare", "--controllers", "eq6"], 2, "unknown controller 'eq6'"),
        (["compare", "--backend", "ospq"], 2, "did you mean 'osqp'"),
        (["run", "paper/test_case_2", "--controller", "eq77"], 2, "did you mean 'eq7'"),
        (["compare", "--controllers", "qp-ahed+guid"], 2, "mean 'qp-ahead+guide'"),
        (["compare", "--controllers", "asta+eq5"], 2, "did you mean 'astar+eq5'"),
        (["export-c", "c", "--robot", "mir10"], 2, "did you mean 'mir100'"),
        (["check", "barn/world_0", "--data", "/nowhere"], 1, "is in none of"),
        (["compare", "--controllers", ","], 2, "unknown controller ''"),
        (["run", "paper/test_case_2", "--controller", "nomod:Foo"], 2, "No module"),
        (["sweep", "studies/smoke", "--out", "x", "--controllers", "json:F"], 2, "no"),
        (["export-c", "c", "--obstacles", "-1"], 2, "--obstacles"),
        (["export-c", "c", "--polygons", "-1"], 2, "--obstacles"),
        (["replay", ".", "--robot", "1,x"], 2, "--robot: '1,x' is neither"),
        (["replay", ".", "--params", "gone"], 2, "unknown parameter file 'gone'"),
        (["replay", "."], 1, ".: no bag of ROS 2; its metadata.yaml is not there"),
        (["replay", "gone"], 1, "gone: no such file or folder"),
        (["check", "/"], 1, "/: a folder, not a file"),
        (["init", "gone/a.toml"], 2, "gone/a.toml: there is no folder gone"),
        (["compare", *["paper/test_case_2"] * 2], 1, "the same name"),
    ],
)
def test_errors_are_one_readable_paragraph(
    arguments, code, message, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == code
    said = capsys.readouterr().err.splitlines()
    (error,) = (line for line in said if "compiling for this machine" not in line)
    assert message in error
    assert not list(tmp_path.iterdir()), "nothing is written for a bad command"


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        (["fly"], ""),
        (["list", "all"], ""),
        (["run"], ""),
        (["comapre"], "did you mean 'compare'?"),
        (["list", "robts"], "did you mean 'robots'?"),
        (["run", "demo/play", "--controllers", "eq5,eq7"], "'eq5,eq7' is several"),
        (["sweep", "x", "--out", "x", "--workers", "0"], "'0' is no number of"),
    ],
)
def test_wrong_usage_is_2(arguments, hint, capsys):
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    said = capsys.readouterr().err
    assert caught.value.code == 2
    assert "usage: qpavoid" in said and hint in said
    assert hint or "did you mean" not in said


def test_help_waits_for_nothing_heavy():
    code = "import sys; from qpavoid.cli import main; main([]); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True
    )
    loaded = done.stdout.splitlines()[-1].split()
    assert not {"numba", "numpy", "rich", "pydantic"} & set(loaded)


def test_a_terminal_without_greek_letters(config, tmp_path):
    command = [sys.executable, "-P", "-m", "qpavoid", "compare", str(config)]
    done = subprocess.run(
        [*command, "--controllers", "eq5", "--out", str(tmp_path / "out")],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0, done.stderr
    assert "? max rad/s" in done.stdout and "Traceback" not in done.stderr


def test_interrupted_keeps_what_is_finished(tmp_path):
    config = tmp_path / "long.toml"
    config.write_text(SCENARIO.replace("duration_s = 0.5", "duration_s = 3000.0"))
    (tmp_path / "short.toml").write_text(SCENARIO)
    command = [
        sys.executable,
        "-P",
        "-m",
        "qpavoid",
        "compare",
        "short.toml",
        "long.toml",
    ]
    process = subprocess.Popen(
        [*command, "--controllers", "eq5", "--out", "out"],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ},
    )
    saved = tmp_path / "out" / "summary.json"
    deadline = time.monotonic() + 120
    while not saved.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130, error
    assert "interrupted; finished runs are kept" in error
    assert "Traceback" not in error
    (run,) = json.loads(saved.read_text())
    assert run["scenario"] == "short"
    assert len(Log.load(tmp_path / "out" / "logs" / "short-eq5.npz")) == 50


@pytest.mark.skipif(sys.platform == "win32", reason="wants a shell with pipes")
@pytest.mark.parametrize("command", [["list", "configs"], ["schema"]], ids=str)
def test_nobody_reads_on(command):
    reads, writes = os.pipe()
    os.close(reads)
    whole = [sys.executable, "-P", "-m", "qpavoid", *command]
    done = subprocess.run(whole, stdout=writes, stderr=subprocess.PIPE, text=True)
    os.close(writes)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("told", [[], ["--v-min=0", "--footprint", "0.5,0.4"]], ids=str)
def test_init_writes_what_runs(told, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", "my_robot.toml", *told]) == 0
    assert "qpavoid run my_robot.toml" in capsys.readouterr().out
    assert main(["check", "my_robot.toml"]) == 0
    scenario = load_scenario("my_robot.toml")
    assert (scenario.robot.limits.v_min < 0.0) == ("--v-min=0" not in told)
    before = (tmp_path / "my_robot.toml").read_bytes()
    capsys.readouterr()
    assert main(["init", "my_robot.toml"]) == 1
    assert "--force writes over it" in capsys.readouterr().err
    assert main(["init", "my_robot.toml", "--v-max", "0.3", "--force"]) == 0
    assert (tmp_path / "my_robot.toml").read_bytes() != before


@pytest.mark.parametrize("told", [[], ["--v-max", "0.3"], ["--v-max", "5"]], ids=str)
def test_a_first_scenario_is_driven_to_its_end(told, tmp_path):
    import qpavoid as qp

    path = tmp_path / "first.toml"
    assert main(["init", str(path), *told]) == 0
    log = qp.run(load_scenario(str(path)), "qp-ahead+guide")
    found = qp.metrics(log)
    assert found["outcome"] == "arrived" and found["min_clearance_m"] > 0.05


def test_the_lidar_of_a_first_scenario_is_commented_out(tmp_path):
    path = tmp_path / "first.toml"
    assert main(["init", str(path)]) == 0
    text = path.read_text()
    for line in ("[margins]", "error_m", "[lidar]", "beams", "noise_m", "perception"):
        text = text.replace(f"# {line}", line)
    path.write_text(text)
    scenario = load_scenario(str(path))
    assert not scenario.lidar.perception and scenario.settings.margins.error == 0.02


@pytest.mark.parametrize("told", ["--v-max", "--acceleration"])
def test_init_warns_of_a_slow_robot(told, tmp_path, capsys):
    path = str(tmp_path / "slow.toml")
    assert main(["init", path, told, "0.1"]) == 0
    assert "may not arrive" in capsys.readouterr().err
    assert main(["init", path, told, "0.2", "--force"]) == 0
    assert not capsys.readouterr().err


@pytest.mark.parametrize("name", ["--footprint", "--corners"])
def test_init_takes_corners_in_either_order(name, tmp_path):
    path = str(tmp_path / "mine.toml")
    corners = ["-0.3,0.2", "0.5,0.2", "0.5,-0.2", "-0.3,-0.2"]
    assert main(["init", path, name, *corners]) == 0
    scenario = load_scenario(path)
    assert scenario.robot.footprint.vertices.min(axis=0) == pytest.approx([-0.3, -0.2])
    assert scenario.robot.limits.angular_acceleration == 3.0


@pytest.mark.parametrize(
    ("told", "message"),
    [
        (["x.toml", "--footprint", "0,0 1,1 0,1 1,0"], "footprint"),
        (["x.toml", "--footprint", "-1,0.5"], "LENGTH,WIDTH are above 0"),
        (["x.toml", "--footprint", "-1,0", "1,x"], "no corners x,y x,y"),
        (["x.toml", "--footprint", "1e400,1"], "must be finite"),
        (["x.toml", "--v-max", "-1"], "v_max"),
        (["x.toml", "--acceleration", "inf"], "must be finite"),
        (["x.toml", "--v-min", "0.1"], "v_min"),
        (["x.txt"], "ends in .toml"),
    ],
)
def test_init_refuses_and_leaves_nothing(told, message, tmp_path, capsys):
    path = str(tmp_path / told[0])
    assert main(["init", path, *told[1:]]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_doctor_finds_what_is_there(capsys):
    assert main(["doctor", "--json"]) == 0
    found = {row["thing"]: row for row in json.loads(capsys.readouterr().out)}
    assert found["Python"]["found"].startswith("3.") and found["packages"]["state"]
    assert all(row["advice"] for row in found.values() if row["state"] != "fine")


def test_doctor_says_what_is_wrong(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("QPAVOID_DATA", str(tmp_path / "gone"))
    wanted = ["numpy>=999", "nothing-like-it; extra == 'odd'"]
    monkeypatch.setattr(doctor.importlib.metadata, "requires", lambda name: wanted)
    assert main(["doctor"]) == 1
    printed = capsys.readouterr().out
    assert "lacks numpy>=999, not" in printed and "extra odd" not in printed
    assert re.search(r"^\d optional parts are not installed: .* --all$", printed, re.M)
    assert main(["doctor", "--all"]) == 1
    printed = capsys.readouterr().out
    assert (
        printed.index("numpy>=999") < printed.index("not there") < printed.index("fine")
    )
    assert "extra odd" in printed and "pip install 'qpavoid[odd]'" in printed


@pytest.mark.usefixtures("undrawn")
def test_json_is_all_that_is_printed_and_quiet_prints_errors_alone(config, capsys):
    out = config.with_name("out")
    told = ["--controllers", "eq5,qp", "--out", str(out)]
    assert main(["compare", str(config), *told, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["controller"] for row in rows] == ["eq5", "qp"]
    assert rows == json.loads((out / "summary.json").read_text())
    for command in (["list", "robots"], ["check", str(config)]):
        assert main([*command, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)
    (out / "summary.csv").unlink()
    assert main(["compare", str(config), *told, "--quiet"]) == 0
    assert capsys.readouterr().out == "" and (out / "summary.csv").is_file()
    assert main(["check", "nothing.toml", "--quiet"]) == 1
    assert "no such file" in capsys.readouterr().err
