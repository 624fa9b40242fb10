"""Tasks on a map: drawn as they say."""

import json
import math

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.scenario.scenario import load_scenario, make_scenario
from qpavoid.lab.worlds import map_server
from qpavoid.model.contacts import Contacts

pytest.importorskip("tcod", reason="needs qpavoid[baselines]")
from qpavoid.lab.worlds.maps import Maps
from qpavoid.lab.worlds.scenes import ScenarioFile

YAML = """image: {name}.pgm
resolution: {resolution}
origin: [-2.0, 1.0, {yaw}]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def draw(folder, name="hall", width=18.0, height=12.0, resolution=0.1, yaw=0.0):
    """Write a hall with a wall across and a pillar; none of these in coarse ones."""
    rows, columns = round(height / resolution), round(width / resolution)
    image = np.full((rows, columns), 254, dtype=np.uint8)
    image[[0, -1], :], image[:, [0, -1]] = 0, 0
    if resolution == 0.1:
        image[: int(7 * height), int(5 * width)] = 0
        image[60:64, 30:34] = 0  # beyond small halls
    header = f"P5\n{image.shape[1]} {image.shape[0]}\n255\n".encode()
    (folder / f"{name}.pgm").write_bytes(header + image.tobytes())
    (folder / f"{name}.yaml").write_text(
        YAML.format(name=name, resolution=resolution, yaw=yaw)
    )
    return folder


def test_a_map_is_walls_of_a_scenario(tmp_path):
    draw(tmp_path)
    (tmp_path / "one.toml").write_text(
        'title = "one"\nduration_s = 1.0\nreference = {kind = "station", pose = '
        '{x_m = 0.0, y_m = 3.0}}\nobstacles = [{kind = "map", file = "hall.yaml"}]\n'
    )
    scenario = load_scenario(tmp_path / "one.toml")
    seen = scenario.world.at(0.0).seen_from(scenario.start)
    distance = Contacts.of(scenario.robot.footprint, seen).distance.min()
    left = -0.5 * 0.89 - (-2.0 + 0.1)  # rear of the robot to the wall on its left
    assert distance == pytest.approx(min(left, 3.0 - 0.29 - 1.1), abs=0.02)
    (tmp_path / "hall.yaml").unlink()
    with pytest.raises(DataError, match=r"hall\.yaml"):
        load_scenario(tmp_path / "one.toml", tmp_path / "nowhere")


@pytest.mark.parametrize("seed", range(3))
def test_tasks_are_as_described(tmp_path, seed):
    source = Maps("hall", str(draw(tmp_path)))
    document = source.sample(seed)
    assert document == Maps("hall", str(tmp_path)).sample(seed)
    assert document != source.sample(seed + 1)
    scenario = make_scenario(document, "hall", tmp_path / "x.toml", tmp_path)
    goal = np.array(scenario.path.sample(np.array([0.0]))[0, :2])
    for place in (scenario.start[:2], goal):
        walls = scenario.world.walls.reshape(-1, 2)
        assert np.hypot(*(walls - place).T).min() > 0.5
        assert np.hypot(*(scenario.world.discs[:, :2] - place).T).min() > 1.2
    assert len(scenario.world.discs) == 5 and len(scenario.world.tracks) == 3
    for track in scenario.world.tracks:
        steps = np.diff(track.positions, axis=0) / np.diff(track.times)[:, None]
        speed = np.hypot(*steps.T)
        assert np.ptp(speed) < 1e-6 and 0.4 <= speed[0] <= 1.0
        assert track.times[0] <= 0.0 and track.times[-1] >= scenario.duration
        assert math.dist(track.at(0.0)[0], scenario.start[:2]) > 0.8


def test_a_small_map_gets_a_small_robot_or_none(tmp_path):
    document = Maps("den", str(draw(tmp_path, "den", 5.4, 6.0))).sample(0)
    assert document["robot"]["v_max_mps"] == 0.26
    with pytest.raises(DataError, match="no way"):
        Maps("cell", str(draw(tmp_path, "cell", 1.8, 1.8))).sample(0)


def test_what_a_map_shows_is_part_of_its_identity(tmp_path):
    source = Maps("hall", str(draw(tmp_path)))
    thing = {"obstacles": [{"kind": "map", "file": "hall.yaml"}]}
    file = ScenarioFile("one", str(tmp_path / "one.toml"), json.dumps(thing))
    before = source.identity(None), file.identity(None)
    image = bytearray((tmp_path / "hall.pgm").read_bytes())
    image[-2000] = 0
    (tmp_path / "hall.pgm").write_bytes(image)
    after = source.identity(None), file.identity(None)
    assert all(x != y for x, y in zip(before, after, strict=True))


def test_a_damaged_map_is_refused(tmp_path):
    cut = draw(tmp_path, "cut") / "cut.pgm"
    cut.write_bytes(cut.read_bytes()[:-1])
    with pytest.raises(DataError, match=r"cut\.pgm: not a readable image"):
        Maps("cut", str(tmp_path)).sample(0)


def everything(document):
    yield document["start"]["x_m"], document["start"]["y_m"]
    goal = document["reference"]["pose"]
    yield goal["x_m"], goal["y_m"]
    for thing in document["obstacles"][1:]:
        yield from thing.get("positions_m", [thing.get("position_m")])


@pytest.mark.parametrize(("yaw", "resolution"), [(math.pi / 4, 0.05), (0.0, 1.0)])
def test_tasks_lie_on_free_ground_of_turned_and_coarse_maps(tmp_path, yaw, resolution):
    draw(tmp_path, resolution=resolution, yaw=yaw)
    chart = map_server.read_map(tmp_path / "hall.yaml")
    c, s = math.cos(yaw), math.sin(yaw)
    for seed in range(6):
        document = Maps("hall", str(tmp_path)).sample(seed)
        places = np.array(list(everything(document))) - (-2.0, 1.0)
        cells = (places @ np.array([[c, -s], [s, c]]) / resolution).astype(int)
        assert chart.free[cells[:, 1], cells[:, 0]].all()


def test_a_large_map_has_tasks(tmp_path):
    """Its millions of cells of 0.1 m are more than obstacles may have points."""
    draw(tmp_path, "large", 120.0, 100.0, resolution=0.5)
    document = Maps("large", str(tmp_path)).sample(0)
    places = np.array(list(everything(document))) - (-2.0, 1.0)
    assert (places > 0.0).all() and (places < (120.0, 100.0)).all()
