"""Data of others in the studies: lawful but odd worlds and maps."""

import math

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.scenario.world import ABSENT, Track
from qpavoid.lab.worlds import barn, map_server

pytest.importorskip("pyarrow", reason="needs qpavoid[study]")
from qpavoid.lab.study.sweep.study import own_stamp

CYLINDER = (
    "<model name='{name}'><pose>{pose}</pose><link name='link'>{link}<collision>{inner}"
    "<geometry>{shape}</geometry></collision></link></model>"
)
ROUND = "<cylinder><radius>0.1</radius><length>1</length></cylinder>"
BOX = "<box><size>3 0.5 1</size></box>"


def model(name="a", pose="1 2 0.5 0 0 0.7", shape=ROUND, link="", inner=""):
    return CYLINDER.format(name=name, pose=pose, shape=shape, link=link, inner=inner)


def world(folder, *models):
    path = folder / "world_0.world"
    path.write_text(f"<sdf><world>{''.join(models)}</world></sdf>")
    return path


def test_a_world_is_planes_and_upright_cylinders(tmp_path):
    plane = "<plane><normal>0 0 1</normal></plane>"
    seen = "<model name='lamp'><link name='l'><visual/></link></model>"
    path = world(tmp_path, model("ground", shape=plane), seen, model())
    assert barn.read_world(path).tolist() == [[1.0, 2.0, 0.1]]


@pytest.mark.parametrize(
    ("models", "said"),
    [
        ([model(shape=BOX)], "'a' is to be one cylinder, not box"),
        ([model(shape=ROUND + ROUND)], "not cylinder, cylinder"),
        ([model(link="<pose>1 0 0 0 0 0</pose>")], "leans, or is not where"),
        ([model(inner="<pose>0 0.2 0 0 0 0</pose>")], "leans, or is not where"),
        ([model(pose="1 2 0 1.57 0 0")], "leans, or is not where"),
        ([model(pose="1 2 5 0 0 0")], "does not reach the floor"),
        ([model(pose="1 2 -nan 0 0 0")], "does not reach the floor"),
        ([model(pose="1 1e300 0 0 0 0")], "not finite or has no radius"),
        ([model(pose="1 2")], "damaged pose or radius"),
        ([model(shape=ROUND.replace("0.1", "zero"))], "damaged pose or radius"),
        ([model(shape=ROUND.replace("0.1", "-0.1"))], "has no radius"),
        ([], "no cylinder"),
        ([model(pose="1 2 0")], "damaged pose or radius"),
        (["<include><uri>model://wall</uri></include>", model()], "includes are not"),
        ([model(inner="<include/>")], "includes are not"),
        ([f"<model name='b'>{model()}</model>"], "models within models are not"),
        ([model().replace("<pose>", "<pose relative_to='b'>")], "poses relative to"),
    ],
)
def test_what_a_world_cannot_say_is_said(tmp_path, models, said):
    with pytest.raises(DataError, match=said):
        barn.read_world(world(tmp_path, *models))


def hall(folder, yaw=0.0, resolution=0.05, border=205):
    """Write a room of 12 × 9 m with unknown ground about it."""
    rows, columns = round(9 / resolution), round(12 / resolution)
    image = np.full((rows, columns), 254, dtype=np.uint8)
    image[[0, -1], :] = image[:, [0, -1]] = border
    header = f"P5\n{columns} {rows}\n255\n".encode()
    (folder / "hall.pgm").write_bytes(header + image.tobytes() + b"\n")
    (folder / "hall.yaml").write_text(
        f"image: hall.pgm\nresolution: {resolution}\norigin: [-3.0, 2.0, {yaw}]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    return folder / "hall.yaml"


def everything(document):
    yield document["start"]["x_m"], document["start"]["y_m"]
    goal = document["reference"]["pose"]
    yield goal["x_m"], goal["y_m"]
    for thing in document["obstacles"][1:]:
        yield from thing.get("positions_m", [thing.get("position_m")])


@pytest.mark.parametrize(("yaw", "resolution"), [(math.pi / 4, 0.05), (0.0, 1.0)])
def test_tasks_lie_on_free_ground_of_turned_and_coarse_maps(tmp_path, yaw, resolution):
    pytest.importorskip("tcod", reason="needs qpavoid[baselines]")
    from qpavoid.lab.worlds.maps import Maps

    chart = map_server.read_map(hall(tmp_path, yaw, resolution))
    c, s = math.cos(yaw), math.sin(yaw)
    for seed in range(6):
        document = Maps("hall", str(tmp_path)).sample(seed)
        places = np.array(list(everything(document))) - (-3.0, 2.0)
        cells = (places @ np.array([[c, -s], [s, c]]) / resolution).astype(int)
        assert chart.free[cells[:, 1], cells[:, 0]].all()


def test_modes_of_a_map(tmp_path):
    """50 of 255 is dark, so occupied; as percent it is neither."""
    (tmp_path / "m.pgm").write_bytes(b"P2 4 1 255\n0 50 100 255\n")
    text = "image: m.pgm\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\n"
    text += "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    found = {}
    for mode in ("trinary", "scale", "raw"):
        (tmp_path / "m.yaml").write_text(f"{text}mode: {mode}\n")
        chart = map_server.read_map(tmp_path / "m.yaml")
        found[mode] = chart.occupied.tolist(), chart.free.tolist()
    free = [False, False, False, True]
    assert found["trinary"] == found["scale"] == ([[True, True, False, False]], [free])
    assert found["raw"] == ([[False, False, True, False]], [[True] + [False] * 3])


def test_who_is_away_is_far_from_everybody_wherever_that_is():
    for place in (0.0, 4_900.0, 1e4, -6e5, 5e6):
        places = np.array([[place, 0.0], [place + 1.0, 0.0]])
        track = Track(np.array([1.0, 2.0]), places, 0.2, fleeting=True)
        position, _ = track.at(3.0)
        assert np.abs(position - places).max(axis=1).min() >= 0.5 * ABSENT
    assert track.at(1.5)[0] == pytest.approx([5e6 + 0.5, 0.0])


def test_a_method_is_another_when_what_it_imports_is(tmp_path, monkeypatch):
    (tmp_path / "gain_r.py").write_text("K = 1.0\n")
    (tmp_path / "uses_r.py").write_text(
        "from gain_r import K\n\ndef go(v, omega, obstacles, context):\n"
        "    return K * v, omega\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    from qpavoid.stamps import file_stamp, imported_files, source_stamp

    def stamp():
        for known in (file_stamp, imported_files, source_stamp):
            known.cache_clear()
        return own_stamp("uses_r:go")

    before = stamp()
    assert stamp() == before and own_stamp("qp") == ""
    (tmp_path / "gain_r.py").write_text("K = 0.0\n")
    assert stamp() != before


@pytest.mark.parametrize("mode", ["trinary", "raw"])
@pytest.mark.parametrize("negate", [0, 1])
def test_a_map_is_the_same_as_png_and_pgm(tmp_path, mode, negate):
    """matplotlib reads PNG as float32: a threshold was met by pixels below it."""
    image = pytest.importorskip("PIL.Image")
    every = np.arange(256, dtype=np.uint8).reshape(16, 16)
    text = f"resolution: 1\norigin: [0, 0, 0]\nnegate: {negate}\nmode: {mode}\n"
    found = []
    for name in ("m.pgm", "m.png"):
        image.fromarray(every).save(tmp_path / name)
        for occupied, free in ((0.6, 0.2), (165 / 255, 90 / 255), (0.65, 0.196)):
            limits = f"occupied_thresh: {occupied}\nfree_thresh: {free}\n"
            (tmp_path / "m.yaml").write_text(f"image: {name}\n{text}{limits}")
            chart = map_server.read_map(tmp_path / "m.yaml")
            found.append((chart.occupied.tolist(), chart.free.tolist()))
    assert found[:3] == found[3:]


def test_a_large_map_has_tasks(tmp_path):
    """Its 1.2 million cells of 0.1 m were more than obstacles may have points."""
    pytest.importorskip("tcod", reason="needs qpavoid[baselines]")
    from qpavoid.lab.worlds.maps import Maps

    (tmp_path / "m.pgm").write_bytes(b"P5 240 200 255\n" + 240 * 200 * b"\xfe")
    limits = "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    text = f"image: m.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\n{limits}"
    (tmp_path / "m.yaml").write_text(text)
    document = Maps("m", str(tmp_path)).sample(0)
    assert all(0.0 < x < 120.0 and 0.0 < y < 100.0 for x, y in everything(document))
