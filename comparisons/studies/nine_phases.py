"""DynaBARN episodes at nine times in each world; seeds are 9 · world + phase."""

from qpavoid.lab.worlds.dynabarn import DynaBarn, Restart


def episodes(jumps: Restart, speed_mps: float) -> DynaBarn:
    """Return the episodes of the data in the environment's ``QPAVOID_DATA``."""
    return DynaBarn(jumps, speed_mps, None, 9)
