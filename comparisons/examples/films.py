"""Films of the paper's two cases and of five other scenes, methods side by side.

    python comparisons/examples/films.py --out out/films               # GIF
    python comparisons/examples/films.py --kind mp4 --scenes trap      # with ffmpeg

One film per scene, at twice its speed.
"""

import argparse
from pathlib import Path

from qpavoid.lab.simulation.run import run_fleet
from qpavoid.lab.simulation.scenario import load_scenario
from qpavoid.lab.study.animation import animate

SCENES = {
    "test_case_1": ("paper/test_case_1", "eq5,eq7,qp-ahead"),
    "test_case_2": ("paper/test_case_2", "eq5,eq7,qp-ahead"),
    "strangers": ("demo/strangers", "eq5,qp-ahead,qp-ahead+guide"),
    "trap": ("demo/trap", "qp-ahead,qp-ahead+guide"),
    "crowd": ("demo/crowd", "eq5,qp-ahead"),
    "swap": ("fleet/swap", "qp-ahead+guide"),
    "circle": ("fleet/circle_8", "qp-ahead+guide"),
}
"""By name: scenario and methods."""

FPS, SPEED = 10, 2.0


def film(name: str, path: Path) -> Path:
    """Run a scene by its methods, and write the film of it."""
    config, methods = SCENES[name]
    scenario = load_scenario(config)
    logs = [log for one in methods.split(",") for log in run_fleet(scenario, one)]
    return animate(logs, path, FPS, SPEED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default=",".join(SCENES), metavar="A,B,…")
    parser.add_argument("--kind", choices=("gif", "mp4"), default="gif")
    parser.add_argument("--out", type=Path, default=Path("out/films"))
    options = parser.parse_args()
    names = options.scenes.split(",")
    for name in names:
        if name not in SCENES:
            parser.error(f"unknown scene {name!r}; there are {', '.join(SCENES)}")
    for name in names:
        print(film(name, options.out / f"{name}.{options.kind}"))


if __name__ == "__main__":
    main()
