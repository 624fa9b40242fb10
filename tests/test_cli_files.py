"""Commands for files and the installation: schema, init, doctor, JSON."""

import json
import re

import pytest

from qpavoid.cli import doctor, main
from qpavoid.lab.scenario.scenario import load_scenario
from scenario_files import MINIMAL


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
def test_json_is_all_that_is_printed(tmp_path, capsys):
    path = tmp_path / "short.toml"
    path.write_text(MINIMAL)
    told = ["--controllers", "eq5,qp", "--out", str(tmp_path / "out"), "--json"]
    assert main(["compare", str(path), *told]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["controller"] for row in rows] == ["eq5", "qp"]
    assert rows == json.loads((tmp_path / "out" / "summary.json").read_text())
    for command in (["list", "robots"], ["check", str(path)]):
        assert main([*command, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)


@pytest.mark.usefixtures("undrawn")
def test_quiet_prints_errors_alone(tmp_path, capsys):
    path = tmp_path / "short.toml"
    path.write_text(MINIMAL)
    told = ["--controllers", "eq5", "--out", str(tmp_path / "out"), "--quiet"]
    assert main(["compare", str(path), *told]) == 0
    assert capsys.readouterr().out == "" and (tmp_path / "out/summary.csv").is_file()
    assert main(["check", "nothing.toml", "--quiet"]) == 1
    assert "no such file" in capsys.readouterr().err
