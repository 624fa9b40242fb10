"""The timing of the environments runs; its numbers are reported, never asserted."""

import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("pettingzoo")

import gym_timing


@pytest.mark.parametrize("shield", [False, True])
def test_what_is_timed_is_what_is_counted(shield):
    assert gym_timing.one(shield, 7)() == 7
    assert gym_timing.many(shield, 7, 3)() == 9
    wall, processor = gym_timing.speeds(gym_timing.many(shield, 6, 3))
    assert wall > 0.0 and processor > 0.0


def test_episodes_that_end_begin_anew():
    """More steps than any episode has."""
    assert gym_timing.one(False, 1000)() == 1000
