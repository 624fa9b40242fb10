"""The ROS 2 node on the wire: latency, outages, floods, memory.

A peer of another DDS implementation is sensors and base, in a process of its own
(``tests/support/ros_peer.py``): 50 scans a second of 360 beams, and what may go wrong.
Beside each number stands what is to be reached, and what Nav2's collision monitor
promises. The environment is made of PyPI's wheels of rclpy: Linux on x86-64.

    python comparisons/ros_wire.py --scenes latency,kill,flood --out out/ros
"""

import argparse
import json
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from qpavoid.errors import QPAvoidError
from qpavoid.lab.study.tables import write_csv
from studies import Row, main_of

ROOT = Path(__file__).resolve().parent.parent
SUPPORT = ROOT / "tests" / "support"

UNITS = {
    "p50": "ms", "p99": "ms", "most": "ms", "stops": "ms", "resumes": "ms",
    "hold": "%", "false_stops": "%", "processor": "%", "per_s": "1/s",
    "written_per_s": "1/s", "before": "MB", "after": "MB",
}  # fmt: skip
"""Of what a scene tells; all else is left out."""

REACH = {
    ("latency", "p50"): 2.0,
    ("latency", "p99"): 10.0,
    ("kill", "stops"): 200.0,
}
"""To be reached on a quiet machine."""

NAV2 = {"stops": 600.0, "hold": 90.0, "resumes": 600.0, "false_stops": 5.0}
"""What the collision monitor promises: at most, but for ``hold``, at least."""

OUTAGES = "kill odometry same_stamp future past blind covered frozen".split()


def environment(folder: Path | None) -> Path:
    """Return the Python of an environment with rclpy; it is made where there is none.

    Raises:
        QPAvoidError: It cannot be made.
    """
    command = [sys.executable, str(SUPPORT / "ros_environment.py")]
    command += [] if folder is None else [str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or ["pip said nothing"])[-1]
        raise QPAvoidError(f"no environment with rclpy: {said}")
    return Path(done.stdout.splitlines()[-1])


def played(python: Path, scenes: list[str]) -> dict[str, Any]:
    """Return what the peer tells of the scenes; none: of all.

    Raises:
        QPAvoidError: It ends with an error.
    """
    domain = str(random.SystemRandom().randrange(60, 100))
    done = subprocess.run(
        [python, SUPPORT / "ros_peer.py", domain, *scenes],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode:
        raise QPAvoidError(f"the peer ended with {done.returncode}")
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return told


def rows_of(told: dict[str, Any]) -> Iterator[Row]:
    """Yield a line for every number of every scene."""
    for scene, found in told.items():
        if not isinstance(found, dict):
            continue
        for key, value in found.items():
            if key not in UNITS:
                continue
            unit = UNITS[key]
            scale = {"ms": 1e3, "%": 100.0}.get(unit, 1.0)
            promised = NAV2.get(key) if scene in OUTAGES or key == "false_stops" else ""
            line = {"scene": scene, "what": key, "value": round(scale * value, 3)}
            reach = REACH.get((scene, key), "")
            yield line | {"unit": unit, "reach": reach, "nav2": promised}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default="", metavar="A,B,…", help="default: all")
    parser.add_argument("--environment", type=Path, metavar="DIR", help="with rclpy")
    parser.add_argument("--out", type=Path, default=Path("out/ros"), metavar="DIR")
    options = parser.parse_args()

    def study() -> None:
        scenes = [name for name in options.scenes.split(",") if name]
        rows = list(rows_of(played(environment(options.environment), scenes)))
        table = Table(*rows[0])
        for row in rows:
            table.add_row(*map(str, row.values()))
        Console().print(table)
        options.out.mkdir(parents=True, exist_ok=True)
        write_csv(options.out / "ros_wire.csv", rows)

    main_of(study, parser)


if __name__ == "__main__":
    main()
