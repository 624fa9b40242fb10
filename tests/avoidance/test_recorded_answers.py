"""Filters and guides answer as it stands on record."""

import numpy as np
import pytest

from recorded import filters, guides, recorded, sums

SCENES = filters() | guides()
RECORD = recorded()


def test_every_scene_is_on_record():
    assert list(RECORD) == list(SCENES)


@pytest.mark.parametrize("name", SCENES)
def test_answers_are_those_on_record(name):
    """If they are meant to be others: python tests/support/recorded.py."""
    np.testing.assert_allclose(
        sums(SCENES[name]()), RECORD[name], rtol=1e-6, atol=1e-7, err_msg=name
    )
