"""Latency, outages, floods and memory of the ROS 2 node over DDS.

A peer of another DDS implementation is sensors and base, in a process of its own
(``tests/support/ros_peer.py``): 50 scans a second of 360 beams, with faults. The table
also has the values that Nav2's collision monitor promises. The environment is made of
PyPI's wheels of rclpy: Linux on x86-64.

    python comparisons/timing/ros_wire.py --scenes latency,kill,flood --out out/ros
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

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from qpavoid.errors import QPAvoidError
from timing.tables import origins, table_text, write_tables
from timing.trials import Row

ROOT = Path(__file__).resolve().parents[2]
SUPPORT = ROOT / "tests" / "support"

UNITS = {
    "p50": "ms", "p99": "ms", "most": "ms", "stops": "ms", "resumes": "ms",
    "hold": "%", "false_stops": "%", "processor": "%", "per_s": "1/s",
    "written_per_s": "1/s", "before": "MB", "after": "MB",
}  # fmt: skip
"""Units of the measured values that the table has."""

NAV2 = {"stops": 600.0, "hold": 90.0, "resumes": 600.0, "false_stops": 5.0}
"""Greatest values of the collision monitor; of ``hold`` the least."""

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
        problem = (done.stderr.strip().splitlines() or ["pip said nothing"])[-1]
        raise QPAvoidError(f"no environment with rclpy: {problem}")
    return Path(done.stdout.splitlines()[-1])


def played(python: Path, scenes: list[str]) -> dict[str, Any]:
    """Return the values that the peer measures in some scenes; none: in all.

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
    values: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return values


def rows_of(values: dict[str, Any]) -> Iterator[Row]:
    """Yield a row for every value of every scene."""
    for scene, found in values.items():
        if not isinstance(found, dict):
            continue
        for key, value in found.items():
            if key not in UNITS:
                continue
            unit = UNITS[key]
            scale = {"ms": 1e3, "%": 100.0}.get(unit, 1.0)
            nav2 = NAV2.get(key) if scene in OUTAGES or key == "false_stops" else ""
            line = {"scene": scene, "what": key, "value": round(scale * value, 3)}
            yield line | {"unit": unit, "nav2": nav2}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default="", metavar="A,B,…", help="default: all")
    parser.add_argument("--environment", type=Path, metavar="DIR", help="with rclpy")
    parser.add_argument("--out", type=Path, default=Path("out/ros"), metavar="DIR")
    options = parser.parse_args()

    scenes = [name for name in options.scenes.split(",") if name]
    try:
        rows = list(rows_of(played(environment(options.environment), scenes)))
    except QPAvoidError as error:
        parser.error(str(error))
    heads = ("scene", "what", "value", "unit", "nav2")
    print(table_text({key: key for key in heads}, rows))
    write_tables(options.out, {"ros_wire": rows}, origins({}))


if __name__ == "__main__":
    main()
