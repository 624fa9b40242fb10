"""Decisions: a status is said of what the robot does, by one bound."""

import pytest

from qpavoid.avoidance.decision import AT_REST, Decision, Status, blocked_if


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("v", "omega", "stands"),
    [
        (0.0, 0.0, True),
        (0.9 * AT_REST, 0.9 * AT_REST, True),
        (AT_REST, 0.0, False),
        (0.0, AT_REST, False),
    ],
)
def test_blocked_is_said_of_what_stands(v, omega, stands, sign):
    made = Decision(sign * v, sign * omega, Status.HOLDING, 0.3, 0.0, 0.0, (), 0.0)
    assert blocked_if(made, False) == made
    found = blocked_if(made, True)
    assert (found.status is Status.BLOCKED) == stands
    assert found._replace(status=made.status) == made
