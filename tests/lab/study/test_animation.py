"""Films: a frame for every moment, and a clear word on what cannot be filmed."""

from dataclasses import replace

import pytest
from matplotlib.animation import FFMpegWriter
from PIL import Image

from qpavoid.errors import InvalidInputError, QPAvoidError
from qpavoid.lab.study.animation import animate


def test_gif_has_a_frame_for_every_moment(logs, tmp_path):
    shares = []
    file = animate(logs, tmp_path / "new" / "a.GIF", fps=1, progress=shares.append)
    with Image.open(file) as image:
        assert (image.format, image.n_frames, image.width) == ("GIF", 5, 900)
        assert image.info["duration"] == 1000
    assert len(shares) == 5
    assert shares[-1] == 1.0
    with Image.open(animate(logs[0], tmp_path / "b.gif", fps=1, speed=2.0)) as image:
        assert image.n_frames == 3


def test_who_is_done_first_stays_where_it_is(logs, tmp_path):
    short = replace(
        logs[0],
        columns={key: value[:30] for key, value in logs[0].columns.items()},
        discs=logs[0].discs[:30],
    )
    for order in ([short, logs[1]], [logs[1], short]):
        with Image.open(animate(order, tmp_path / "a.gif", fps=1)) as image:
            assert image.n_frames == 5


@pytest.mark.skipif(not FFMpegWriter.isAvailable(), reason="ffmpeg is not installed")
def test_mp4_where_ffmpeg_is(logs, tmp_path):
    file = animate(logs[:1], tmp_path / "a.mp4", fps=1)
    assert file.read_bytes()[4:8] == b"ftyp"


def test_animation_says_what_it_cannot_do(logs, tmp_path, monkeypatch):
    monkeypatch.setattr(FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(QPAvoidError, match=r"needs the program ffmpeg.*\.gif"):
        animate(logs, tmp_path / "a.mp4")
    with pytest.raises(InvalidInputError, match=r"a\.avi.*ends in \.gif or \.mp4"):
        animate(logs, tmp_path / "a.avi")
    for rate in ({"fps": 0}, {"speed": 0.0}, {"speed": float("nan")}):
        with pytest.raises(InvalidInputError, match="fps > 0 and speed > 0"):
            animate(logs, tmp_path / "a.gif", **rate)
    with pytest.raises(InvalidInputError, match="one scenario"):
        animate([], tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []
