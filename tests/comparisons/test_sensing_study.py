"""One factor of sensing at a time: the scenes, the tables and the figures."""

import csv
import math
import sys
from pathlib import Path

import pytest

sensing = pytest.importorskip("sensing", reason="needs qpavoid[study]")

from qpavoid.errors import UnknownNameError
from qpavoid.lab.simulation.config import changed
from qpavoid.lab.simulation.scenario import make_scenario
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.sweep.study import read_study
from qpavoid.lab.worlds.forest import Forest


def test_every_level_is_a_scenario_that_differs_from_the_base_in_one_thing():
    scenes = sensing.make_scenes(range(3), range(2), 0)
    assert (
        len(scenes) == 3 * 21
    )  # base, 3 + 3 + 3 + 3 + 2 + 2 + 3 + 1; three kinds of scene
    assert len({scene.setting for scene in scenes}) == len(scenes)
    points, tracks, forest = dict.fromkeys(scene.source for scene in scenes)
    assert points.name == "strangers as points" and forest.name == "forest as points"
    strangers = [scene for scene in scenes if scene.source == points]
    made = {
        scene.setting.partition(": ")[2]: make_scenario(
            changed(points.sample(5), scene.changes), "x", Path("x"), None
        )
        for scene in strangers
    }
    base = made["base"]
    assert base.lidar.noise == 0.01 and base.lidar.beams == 180 and base.lidar.seed == 5
    assert not base.lidar.tracks and base.localisation is None and base.plant is None
    assert made["noise (m) 0.1"].lidar.noise == 0.1
    assert made["latency (s) 0.4"].lidar.latency == 0.4
    assert made["dropout 0.6"].lidar.dropout == 0.6
    assert made["localisation UWB"].localisation.sigma == 0.1
    assert made["plant slip"].plant.slip == 0.05
    assert made["plant lag"].plant.lag == (0.1, 0.1)
    assert made["rate (Hz) 2"].lidar.rate == 2.0
    assert made["view (°) 180"].lidar.field_of_view == pytest.approx(math.pi)
    together = made["together all"]
    assert together.lidar.dropout > 0.0 and together.lidar.latency > 0.0
    assert together.localisation.sigma == 0.1
    assert made["plant wheels"].plant == together.plant != base.plant
    assert make_scenario(tracks.sample(5), "x", Path("x"), None).lidar.tracks


def test_factors_are_chosen_by_their_first_word():
    found = sensing.chosen_factors("together,noise")
    assert [*found] == ["together", "noise (m)"]
    assert found["together"] == sensing.FACTORS["together"]
    assert sensing.chosen_factors("") == sensing.FACTORS
    scenes = sensing.make_scenes(range(1), range(0), 0, found)
    levels = ["base", "together all", *(f"noise (m) {x}" for x in ("0", "0.03", "0.1"))]
    kinds = "points", "tracks"
    named = {f"strangers as {kind}: {level}" for kind in kinds for level in levels}
    assert {scene.setting for scene in scenes} == named
    with pytest.raises(UnknownNameError, match="did you mean 'plant'"):
        sensing.chosen_factors("plan")


def test_a_study_file_takes_sensed_scenes(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(
        'title = "t"\ncontrollers = ["qp"]\nseeds = "0:2"\n'
        '[settings]\n"lidar.noise_m" = [0.0, 0.1]\n'
        '[[generators]]\nkind = "sensed"\nscene = "strangers"\ntracks = true\n'
        '[[generators]]\nkind = "sensed"\nscene = "forest"\nfamily = 4\n'
    )
    study = read_study(file)
    assert len(study) == 8
    strangers, forest = (source for source, _ in study.sources)
    assert strangers == sensing.Sensed(scenario_file("demo/strangers"), True)
    assert forest == sensing.Sensed(Forest(4), False)


def test_a_level_without_successes_has_intervals_too():
    rows = [{"success": k == 0, "min_clearance_m": 0.1 * k} for k in range(5)]
    found = sensing.spread([*rows, {"success": False, "min_clearance_m": None}])
    assert found["runs"] == 6 and found["success"] == pytest.approx(1 / 6)
    assert found["clearance_m"] == pytest.approx(0.2)
    assert 0.0 <= found["clearance_m_low"] <= 0.2 <= found["clearance_m_high"] <= 0.4
    blind = sensing.spread([{"success": False, "min_clearance_m": None}])
    assert blind["success_high"] > 0.5 and blind["clearance_m"] == ""


def test_the_study(tmp_path, monkeypatch, capsys):
    noise = sensing.levels("lidar.noise_m", (0.01, 0.1), 0.01)
    monkeypatch.setattr(sensing, "FACTORS", {"noise (m)": noise})
    command = ["sensing.py", "--strangers", "1", "--forests", "0", "--workers", "1"]
    command += ["--methods", "eq7,qp", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", command)
    sensing.main()
    assert "setting=strangers as tracks: noise (m) 0.1" in capsys.readouterr().out
    with open(tmp_path / "factors.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 2 * 2 and {row["runs"] for row in rows} == {"1"}
    exact = [row["clearance_m"] for row in rows if row["level"] == "0.01"]
    rough = [row["clearance_m"] for row in rows if row["level"] == "0.1"]
    assert exact != rough
    for name in ("strangers-as-points.png", "strangers-as-tracks.png", "table.csv"):
        assert (tmp_path / name).stat().st_size > 500


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--strangers", "-1"], "want 0 or more"),
        (["--strangers", "0", "--forests", "0"], "no scenes"),
    ],
)
def test_bad_arguments(arguments, said, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["sensing.py", *arguments])
    with pytest.raises(SystemExit):
        sensing.main()
    assert said in capsys.readouterr().err
