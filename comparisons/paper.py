"""The paper's two test cases: Figures 4 to 12, and its numbers beside ours.

Every controller runs under identical conditions. Writes figures, logs and summaries to
a folder, and prints a table a test case with the paper's own numbers in brackets.

    python comparisons/paper.py --out out/paper --animate
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from qpavoid.errors import QPAvoidError
from qpavoid.simulation.scenario import Scenario, load_scenario
from qpavoid.study.animation import animate
from qpavoid.study.compare import COLUMNS, cell, compare
from qpavoid.study.metrics import Metrics
from qpavoid.study.plots import save_figures

CASES = ("paper/test_case_1", "paper/test_case_2")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/paper"), metavar="DIR")
    parser.add_argument("--controllers", default="eq5,eq7,qp", metavar="A,B,…")
    parser.add_argument("--animate", action="store_true", help="write GIFs too")
    options = parser.parse_args()
    try:
        draw(options.controllers.split(","), options.out, options.animate)
    except QPAvoidError as error:
        parser.error(str(error))


def draw(controllers: Sequence[str], out: Path, film: bool) -> None:
    console = Console()
    scenarios = [load_scenario(case) for case in CASES]
    with console.status("simulating"):
        logs, summary = compare(scenarios, controllers, out=out)
    for scenario in scenarios:
        runs = [log for log in logs if log.meta["scenario"] == scenario.name]
        console.print(table(scenario, summary))
        with console.status("drawing"):
            files = save_figures(runs, out)
            if film:
                name = f"{scenario.name.replace('/', '_')}.gif"
                files.append(animate(runs, out / name))
        console.print(*files, sep="\n", soft_wrap=True, highlight=False)


def table(scenario: Scenario, summary: Sequence[Metrics]) -> Table:
    rows = [row for row in summary if row["scenario"] == scenario.name]
    result = Table("", title=scenario.title, title_justify="left")
    for row in rows:
        result.add_column(str(row["controller"]), justify="right")
    for key, heading in list(COLUMNS.items())[1:]:
        result.add_row(heading, *(cell(scenario, row, key) for row in rows))
    return result


if __name__ == "__main__":
    main()
