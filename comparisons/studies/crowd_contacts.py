"""Contacts of the people themselves in recorded crowds.

python comparisons/studies/crowd_contacts.py [--data PATH]
"""

import argparse
import math

import numpy as np

from qpavoid.lab.worlds.crowd import PERSON, SCENES, Crowd, Task


def own_clearance(task: Task) -> float:
    """Return the least distance, m, of the human's disc to all others on its own way.

    Of discs of radius :data:`PERSON`, linear between the samples; below 0 is a contact.
    """
    times, least = task.human.times, math.inf
    for other in task.others:
        begin, end = max(times[0], other.times[0]), min(times[-1], other.times[-1])
        if begin > end:
            continue
        both = np.unique(np.clip([*times, *other.times], begin, end))
        x, y = (
            np.interp(both, other.times, other.positions[:, axis])
            - np.interp(both, times, task.human.positions[:, axis])
            for axis in (0, 1)
        )
        way = np.column_stack([x, y])
        leg = np.diff(way, axis=0, append=way[-1:])
        share = -(way * leg).sum(axis=1) / np.maximum((leg**2).sum(axis=1), 1e-12)
        nearest = way + np.clip(share, 0.0, 1.0)[:, None] * leg
        least = min(least, float(np.hypot(*nearest.T).min()))
    return least - 2.0 * PERSON


def main() -> None:
    """Print in how many tasks recorded people touch each other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", metavar="PATH", help="published data sets")
    data = parser.parse_args().data
    for scene in SCENES:
        tasks = Crowd(scene, data).tasks
        touched = sum(own_clearance(task) < 0.0 for task in tasks)
        print(f"crowd {scene}: contact in {touched} of {len(tasks)} tasks")


if __name__ == "__main__":
    main()
