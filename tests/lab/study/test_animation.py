"""Films: a frame for every moment, and a clear word on what cannot be filmed."""

from dataclasses import replace

import pytest
from PIL import Image

from qpavoid.errors import InvalidInputError
from qpavoid.lab.study.animation import animate


def test_gif_has_a_frame_for_every_moment(logs, tmp_path):
    file = animate(logs, tmp_path / "new" / "a.GIF", fps=1)
    with Image.open(file) as image:
        assert (image.format, image.n_frames, image.width) == ("GIF", 5, 900)
        assert image.info["duration"] == 1000
    with Image.open(animate(logs[0], tmp_path / "b.gif", fps=2)) as image:
        assert image.n_frames == 9


def test_who_is_done_first_stays_where_it_is(logs, tmp_path):
    short = replace(
        logs[0],
        columns={key: value[:30] for key, value in logs[0].columns.items()},
        discs=logs[0].discs[:30],
    )
    for order in ([short, logs[1]], [logs[1], short]):
        with Image.open(animate(order, tmp_path / "a.gif", fps=1)) as image:
            assert image.n_frames == 5


def test_animation_says_what_it_cannot_do(logs, tmp_path):
    with pytest.raises(InvalidInputError, match=r"a\.mp4.*ends in \.gif"):
        animate(logs, tmp_path / "a.mp4")
    with pytest.raises(InvalidInputError, match="one scenario"):
        animate([], tmp_path / "a.gif")
    assert list(tmp_path.iterdir()) == []
