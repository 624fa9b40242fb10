"""Foreign files: regular ones below a size limit and below their folder are read."""

import os
import socket
import struct
import zipfile
import zlib

import numpy as np
import pytest

from qpavoid import files
from qpavoid.cli import main
from qpavoid.errors import ConfigError, DataError, QPAvoidError, UnknownNameError
from qpavoid.lab.scenario.config import find_config
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.worlds.map_server import read_image, read_map
from qpavoid.lab.worlds.source import read_points
from scenario_files import CROSSING, MINIMAL

POINTS = '\n[[obstacles]]\nkind = "points"\nfile = "{}"\n'
RANDOM = """
[[obstacles]]
kind = "random"
count = {}
low_m = [1.0, 1.0]
high_m = [2.0, 2.0]
"""

SCATTERED = """
[[robots]]
kind = "random"
count = 2
low_m = [1.0, 1.0]
high_m = [0.0, 2.0]
speed_mps = 0.5
"""


@pytest.fixture
def scenario(tmp_path):
    folder = tmp_path / "here"
    folder.mkdir()

    def write(text, beginning=CROSSING):
        (folder / "a.toml").write_text(beginning + text)
        return folder / "a.toml"

    return write


def pipe(path):
    os.mkfifo(path)


def device(path):
    path.symlink_to("/dev/zero")


def listening(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(str(path))


@pytest.mark.parametrize(
    "make", [pipe, device, listening, os.mkdir], ids=lambda f: f.__name__
)
@pytest.mark.parametrize("ending", [".npy", ".csv", ".toml", ".yaml", ".pgm"])
def test_what_is_no_regular_file_is_refused_at_once(
    tmp_path, monkeypatch, make, ending
):
    monkeypatch.chdir(tmp_path)  # a socket's name is short
    path = tmp_path / f"a{ending}"
    make(path.name if make is listening else path)
    read = {
        ".toml": load_scenario,
        ".yaml": read_map,
        ".pgm": read_image,
    }.get(ending, read_points)
    said = "regular file|a folder|No such device"
    with pytest.raises((DataError, ConfigError), match=said):
        read(path)


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "a.csv"
    with path.open("wb") as file:
        file.truncate(10**13)
    with pytest.raises(DataError, match=r"000 bytes, more than 8,000,000"):
        read_points(path)


def test_an_array_that_promises_more_than_it_has(tmp_path):
    head = "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 2), }"
    text = head.ljust(117).encode() + b"\n"
    path = tmp_path / "a.npy"
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text)
    with pytest.raises(DataError, match="needs 16000000000000 bytes, where 0 are left"):
        read_points(path)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", ["<f8", ">f4", "<i2", "|u1", "?", "<U3"])
@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (0, 2)], ids=str)
def test_arrays_are_as_numpy_reads_them(tmp_path, shape, kind, order):
    given = np.arange(6)[: int(np.prod(shape))].astype(kind).reshape(shape, order="C")
    given = np.asarray(given, order=order)
    np.save(tmp_path / "a.npy", given)
    found = files.read_array(tmp_path / "a.npy")
    assert found.dtype == given.dtype and found.shape == shape
    np.testing.assert_array_equal(found, np.load(tmp_path / "a.npy"))
    np.savez_compressed(tmp_path / "a.npz", one=given, two=given)
    assert [*files.read_arrays(tmp_path / "a.npz")] == ["one", "two"]


def test_objects_are_never_unpickled(tmp_path):
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(DataError, match="neither numbers nor text"):
        read_points(tmp_path / "a.npy")


def test_what_unpacks_to_too_much_is_refused(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        with parts.open("x.npy", "w", force_zip64=True) as part:
            for _ in range(4):
                part.write(bytes(100_000_000))
    with pytest.raises(DataError, match="400,000,000 bytes unpacked"):
        files.read_arrays(path)


def chunk(kind, content):
    sums = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + sums


def png(*sizes):
    """A picture without pixels, that says how large it is, once or again."""
    heads = (struct.pack(">IIBBBBB", *size, 8, 0, 0, 0, 0) for size in sizes)
    parts = (chunk(b"IHDR", head) for head in heads)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts) + chunk(b"IDAT", b"")


LARGE = (12_000, 12_000)


@pytest.mark.parametrize(
    "image", [png(LARGE), png((9, 9), LARGE), b"P5\n12000 12000\n255\n0"]
)
def test_a_picture_of_too_many_pixels_is_refused(tmp_path, image):
    (tmp_path / "a.png").write_bytes(image)
    with pytest.raises(DataError, match="not a readable image .*(pixels|PNG)"):
        read_image(tmp_path / "a.png")


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("", RANDOM.format(10**9), "count: .*less than or equal to 10000"),
        ("", 3 * RANDOM.format(9_000), "27,00[01] obstacles, where 10,000 are most"),
        ("duration_s = ", "duration_s = 1e12 # ", "steps of dt_s; a run has"),
        ("", "\n[lidar]\nbeams = 1000000000\n", "beams"),
        ("", f"\nx = {5000 * '9'}\n", "digits"),
        ("", f"\nx = {500 * '['}\n", "nested too deeply|not valid TOML"),
        ("", "\n" + 100 * "a." + "b = 1\n", "a key of many parts"),
        (
            "",
            "\n[filter]\n" + "".join(f"k{i} = 1\n" for i in range(9_000)),
            "9000 problems, too many to tell",
        ),
        ("", "\n#" + 2_000_000 * "a", "bytes, more than 2,000,000"),
        ("", SCATTERED, "robots.*low bound lies above"),
        ("", "\nx = 0001-01-01T00:00:00+23:59\n", "unknown key"),
    ],
)
def test_limits_of_a_scenario(scenario, old, new, message):
    path = scenario("")
    text = path.read_text()
    path.write_text(text.replace(old, new, 1) if old else text + new)
    with pytest.raises(QPAvoidError, match=message):
        load_scenario(path)


def test_a_run_has_no_more_places_than_can_be_logged(scenario):
    path = scenario(RANDOM.format(9000))
    text = path.read_text().replace("duration_s = ", "duration_s = 1000.0 # ", 1)
    path.write_text(text)
    with pytest.raises(ConfigError, match="places of discs; a run has 30,000,000"):
        load_scenario(path)


def test_few_bytes_of_yaml_do_not_become_many(tmp_path):
    laughs = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    for k in range(20):
        laughs.append(f"a{k + 1}: &a{k + 1} [{', '.join(9 * [f'*a{k}'])}]")
    (tmp_path / "a.yaml").write_text("\n".join(laughs))
    with pytest.raises(DataError, match="aliases .* are not supported"):
        files.read_yaml(tmp_path / "a.yaml")


def test_a_key_that_is_there_twice_is_said(tmp_path):
    (tmp_path / "a.yaml").write_text("a: 1\nb: {c: 2}\nb: {c: 3}\n")
    with pytest.raises(DataError, match="b is a repeated key"):
        files.read_yaml(tmp_path / "a.yaml")


def test_a_mark_before_a_text_is_none_of_it(tmp_path):
    (tmp_path / "a.txt").write_bytes("\ufeff1 2\n".encode())
    assert files.read_text(tmp_path / "a.txt") == "1 2\n"


# Where a file may lead


@pytest.fixture
def elsewhere(tmp_path, scenario):
    (tmp_path / "there.csv").write_text("x,y\n5.0,5.0\n")
    (tmp_path / "here" / "link.csv").symlink_to(tmp_path / "there.csv")
    (tmp_path / "here" / "inner.csv").write_text("5.0,5.0\n")
    return tmp_path


@pytest.mark.parametrize("name", ["../there.csv", "link.csv", "{}/there.csv"])
def test_a_scenario_leads_nowhere_else(elsewhere, scenario, name, monkeypatch, capsys):
    monkeypatch.delenv(files.TRUST, raising=False)
    path = scenario(POINTS.format(name.format(elsewhere)), MINIMAL)
    with pytest.raises(DataError, match=r"leads out of .*--trust-paths"):
        load_scenario(path)
    assert main(["check", str(path)]) == 1
    assert main(["check", str(path), "--trust-paths"]) == 0
    assert not files.is_trusted()
    load_scenario(path, elsewhere)  # below the data folder
    monkeypatch.setenv(files.TRUST, "1")
    assert len(load_scenario(path).world.points) == 1


@pytest.mark.parametrize("name", ["inner.csv", "./inner.csv", "../here/inner.csv"])
def test_a_scenario_names_what_is_beside_it(elsewhere, scenario, name):
    assert len(load_scenario(scenario(POINTS.format(name))).world.points) == 1


@pytest.mark.parametrize("study", [False, True])
@pytest.mark.parametrize("name", ["a\0b", 300 * "a", 5000 * "a", 5000 * "a" + ".toml"])
def test_names_that_no_scenario_has(name, study):
    with pytest.raises((UnknownNameError, ConfigError)):
        find_config(name, study)


@pytest.mark.parametrize("name", ["", "a\\u0000b", 300 * "a", 5000 * "a", "loop"])
def test_names_that_no_file_has(scenario, name):
    path = scenario("")
    (path.parent / "loop.csv").symlink_to(path.parent / "loop.csv")
    path = scenario(POINTS.format(f"{name}.csv"))
    with pytest.raises(DataError):
        load_scenario(path)


def test_a_study_leads_nowhere_else(elsewhere, scenario, capsys, monkeypatch):
    monkeypatch.delenv(files.TRUST, raising=False)
    scenario("", MINIMAL)
    study = elsewhere / "here" / "below" / "study.toml"
    study.parent.mkdir()
    study.write_text(
        'title = "t"\ncontrollers = ["eq5"]\nscenarios = [{ config = "../a.toml" }]\n'
    )
    assert main(["check", str(study)]) == 1
    assert "leads out of" in capsys.readouterr().err
    assert main(["check", str(study), "--trust-paths"]) == 0
