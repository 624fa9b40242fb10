"""Filters, guides and their parts answer as it stands on record."""

import numpy as np
import pytest

from recorded import PARTS, filters, guides, recorded, sums

SCENES = PARTS | filters() | guides()
RECORD = recorded()


def test_every_scene_is_on_record():
    assert list(RECORD) == list(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_answers_are_those_on_record(name):
    """If they are meant to be others: python tests/support/recorded.py."""
    np.testing.assert_allclose(
        sums(SCENES[name]()), RECORD[name], rtol=1e-6, atol=1e-7, err_msg=name
    )


def test_what_changes_anywhere_shows():
    rows = np.random.default_rng(1).normal(size=(400, 3))
    before = sums(rows)
    rows[217, 1] += 1e-4
    assert [a == b for a, b in zip(sums(rows), before, strict=True)] == [1, 0, 1]
    assert sums([[np.nan, np.inf]]) != sums([[0.0, np.nan]])
