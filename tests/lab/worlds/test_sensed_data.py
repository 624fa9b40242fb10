"""Readers of maps and BARN worlds: published files, and clear errors on damage."""

import numpy as np
import pytest

from qpavoid.errors import DataError
from qpavoid.lab.worlds import barn, map_server

YAML = """# a map
image: map.pgm
resolution: 0.5
origin: [1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def write_map(folder, image=b"P2 3 2 255\n0 205 254\n0 0 254\n", yaml=YAML):
    (folder / "map.pgm").write_bytes(image)
    (folder / "map.yaml").write_text(yaml)
    return folder / "map.yaml"


@pytest.mark.parametrize("name", ["depot", "warehouse", "tb3_sandbox"])
def test_published_maps(data_folder, name):
    grid = map_server.read_map(data_folder / "maps" / f"{name}.yaml")
    image = map_server.read_image(data_folder / "maps" / f"{name}.pgm")
    assert grid.occupied.shape == image.shape
    assert (grid.occupied == (image[::-1] < 0.35)).all()
    assert not (grid.occupied & grid.free).any()
    walls = grid.walls()
    lengths = np.abs(walls[:, 2:] - walls[:, :2]).sum(axis=1)
    padded = np.pad(grid.occupied, 1)
    sides = sum(np.diff(padded, axis=axis).sum() for axis in (0, 1))
    assert lengths.sum() == pytest.approx(sides * grid.resolution)
    assert len(walls) < 0.6 * sides  # merged


def test_a_map_is_seen_from_below(tmp_path):
    grid = map_server.read_map(write_map(tmp_path))
    assert grid.occupied.tolist() == [[True, True, False], [True, False, False]]
    assert grid.free.tolist() == [[False, False, True], [False, False, True]]
    assert grid.resolution == 0.5 and grid.origin == (1.0, 2.0, 0.0)
    walls = {tuple(x) for x in grid.walls().tolist()}
    assert walls == {
        (1, 2, 2, 2),
        (1.5, 2.5, 2, 2.5),
        (1, 3, 1.5, 3),
        (1, 2, 1, 3),
        (1.5, 2.5, 1.5, 3),
        (2, 2, 2, 2.5),
    }


def test_what_is_at_a_threshold_is_unknown(tmp_path):
    yaml = YAML.replace("0.65", "0.2").replace("0.196", "0.2")
    yaml = yaml.replace("negate: 0", "negate: true")
    grid = map_server.read_map(write_map(tmp_path, b"P2 3 1 255 0 51 255 ", yaml))
    assert grid.occupied.tolist() == [[False, False, True]]
    assert grid.free.tolist() == [[True, False, False]]


@pytest.mark.parametrize(
    "image",
    [
        b"P5\n# made by hand\n3 2\n# and\n255\n\x00\xcd\xfe\x00\x00\xfe",
        b"P5 3 2 65535\n"
        + np.array([0, 52685, 65278] + [0, 0, 65278], ">u2").tobytes(),
    ],
)
def test_all_kinds_of_pgm_give_the_same(tmp_path, image):
    grid = map_server.read_map(write_map(tmp_path, image))
    assert grid.occupied.tolist() == [[True, True, False], [True, False, False]]
    assert grid.free.tolist() == [[False, False, True], [False, False, True]]


def test_modes_of_a_map(tmp_path):
    """50 of 255 is dark, so occupied."""
    (tmp_path / "m.pgm").write_bytes(b"P2 4 1 255\n0 50 100 255\n")
    text = "image: m.pgm\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\n"
    text += "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    found = {}
    for mode in ("trinary", "scale"):
        (tmp_path / "m.yaml").write_text(f"{text}mode: {mode}\n")
        chart = map_server.read_map(tmp_path / "m.yaml")
        found[mode] = chart.occupied.tolist(), chart.free.tolist()
    free = [False, False, False, True]
    assert found["trinary"] == found["scale"] == ([[True, True, False, False]], [free])


@pytest.mark.parametrize("negate", [0, 1])
def test_a_map_is_the_same_as_png_and_pgm(tmp_path, negate):
    """matplotlib reads PNG as float32: a threshold was met by pixels below it."""
    image = pytest.importorskip("PIL.Image")
    every = np.arange(256, dtype=np.uint8).reshape(16, 16)
    text = f"resolution: 1\norigin: [0, 0, 0]\nnegate: {negate}\n"
    found = []
    for name in ("m.pgm", "m.png"):
        image.fromarray(every).save(tmp_path / name)
        for occupied, free in ((0.6, 0.2), (165 / 255, 90 / 255), (0.65, 0.196)):
            limits = f"occupied_thresh: {occupied}\nfree_thresh: {free}\n"
            (tmp_path / "m.yaml").write_text(f"image: {name}\n{text}{limits}")
            chart = map_server.read_map(tmp_path / "m.yaml")
            found.append((chart.occupied.tolist(), chart.free.tolist()))
    assert found[:3] == found[3:]


def test_images_that_cannot_be_read(tmp_path):
    image = pytest.importorskip("PIL.Image")
    clear = image.fromarray(np.full((2, 3, 4), 99, dtype=np.uint8))
    clear.save(tmp_path / "map.png")
    path = write_map(tmp_path, yaml=YAML.replace("map.pgm", '"map.png"  # RGBA'))
    with pytest.raises(DataError, match="transparent"):
        map_server.read_map(path)
    whole = (tmp_path / "map.png").read_bytes()
    (tmp_path / "map.png").write_bytes(whole[:40])
    with pytest.raises(DataError, match="map.png: not a readable image"):
        map_server.read_map(path)


@pytest.mark.parametrize(
    "old, new, error",
    [
        ("negate: 0\n", "", "negate: Field required"),
        ("negate: 0", "negate: 2", "negate: Input should be a valid bool"),
        ("negate: 0", "negate: 0: 1", "not readable YAML"),
        ("negate: 0", "negate: &a [*a]", "aliases .* are not supported"),
        ("map.pgm", "[map.pgm]", "image: Input should be a valid string"),
        ("map.pgm", "../map.pgm", "leads out of .*--trust-paths"),
        (YAML, "0.65", "keys: Input should be"),
        ("negate: 0", "negate: 0\nmode: raw", "mode: Input should be .trinary"),
        ("0.65", "much", "occupied_thresh: Input should be a valid number"),
        ("0.65", "0.1", "free_thresh <= occupied_thresh does not"),
        ("0.5", "-0.5", "resolution: Input should be greater than 0"),
        ("0.5", "true", "resolution: Input should be a valid number"),
        ("2.0, 0.0]", "2.0, 90]", "origin.2: Input should be less than"),
        ("[1.0, 2.0, 0.0]", "[1.0, 2.0]", "origin.2: Field required"),
        ("map.pgm", "none.pgm", "none.pgm: not a readable image"),
    ],
)
def test_damaged_map_files(tmp_path, old, new, error):
    with pytest.raises(DataError, match=error):
        map_server.read_map(write_map(tmp_path, yaml=YAML.replace(old, new)))


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
