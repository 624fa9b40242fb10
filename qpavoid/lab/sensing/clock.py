"""Clock of a sensor with a rate."""

import math

from qpavoid.errors import InvalidInputError

SOON = 1e-9
"""s; tolerance of a tick for rounding."""


class Clock:
    """Ticks at k/rate, tolerant to rounding of the time.

    Args:
        rate: Hz.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate
        self._now, self._due = -math.inf, -math.inf

    def ticks(self, time: float) -> bool:
        """Return whether a tick has passed since the last call, or is now; s.

        Raises:
            InvalidInputError: Time runs backwards.
        """
        if not time >= self._now:
            raise InvalidInputError(
                f"time runs backwards, from {self._now:g} to {time:g} s"
            )
        self._now = time
        if time < self._due - SOON:
            return False
        self._due = (math.floor((time + SOON) * self.rate) + 1) / self.rate
        return True
