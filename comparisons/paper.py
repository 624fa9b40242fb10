"""The paper's two test cases: Figures 4 to 12, and its numbers beside ours.

Every controller runs under identical conditions. Writes figures, logs and summaries to
a folder, and prints a table a test case with the paper's own numbers in brackets.

    python comparisons/paper.py --out out/paper --animate
"""

import argparse
from pathlib import Path

from rich.console import Console
from rich.progress import track

from qpavoid.simulation.scenario import load_scenario
from qpavoid.study.animation import animate
from qpavoid.study.compare import compare, table
from qpavoid.study.plots import save_figures

CASES = ("paper/test_case_1", "paper/test_case_2")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/paper"), metavar="DIR")
    parser.add_argument("--controllers", default="eq5,eq7,qp", metavar="A,B,…")
    parser.add_argument(
        "--animate", action="store_true", help="write a GIF a test case"
    )
    options = parser.parse_args()

    console = Console()
    scenarios = [load_scenario(case) for case in CASES]
    logs, summary = compare(scenarios, options.controllers.split(","), out=options.out)
    for scenario in track(scenarios, "drawing", console=console, transient=True):
        console.print(table(scenario, summary))
        runs = [log for log in logs if log.meta["scenario"] == scenario.name]
        figures = save_figures(runs, options.out)
        if options.animate:
            film = figures[0].with_name(f"{scenario.name.replace('/', '_')}.gif")
            figures.append(animate(runs, film))
        console.print(*figures, sep="\n", soft_wrap=True)


if __name__ == "__main__":
    main()
