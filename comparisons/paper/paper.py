"""The paper's two test cases: Figures 2 and 4 to 12, and its numbers beside ours.

Every method runs under identical conditions. Writes figures, logs and summaries to a
folder, and to ``tables.md`` what was measured and which of the paper's statements it
bears out; ``table.csv`` and ``runs.csv`` are those of every study here.

    python comparisons/paper/paper.py --out out/paper --animate
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from qpavoid.lab.simulation.scenario import Scenario, load_scenario
from qpavoid.lab.study.animation import animate
from qpavoid.lab.study.compare import COLUMNS, cell, compare, table
from qpavoid.lab.study.metrics import Metrics
from qpavoid.lab.study.plots import save_figures
from qpavoid.lab.study.sweep.sources import scenario_file
from qpavoid.lab.study.tables import markdown_table
from statements import MORE, statement_table

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # for studies.py
from studies import Row, Scenes, main_of, make_parser, run_study

METHODS = "eq5,eq7,qp,qp-repulsion,qp-ahead"
CASES = ("paper/test_case_1", "paper/test_case_2")
LAWS = ("eq5", "eq7")
"""What the paper's other scenarios are run with."""

CALIBRATIONS = Path(__file__).resolve().parents[1] / "results" / "calibrations.csv"
"""How often a statement holds, as ``calibrations.py`` finds it."""

LONG = {"final_heading_error_rad", "v_max_mps", "omega_max_radps", "solve_median_us"}
SHORT = [key for key in COLUMNS if key not in LONG]
"""Columns of the Markdown table."""


def main() -> None:
    parser = make_parser(__doc__, METHODS, "out/paper")
    parser.add_argument("--animate", action="store_true", help="write GIFs too")
    options = parser.parse_args()

    def study() -> list[Row]:
        scenes = [Scenes(scenario_file(case), [None], case) for case in CASES]
        rows = run_study("The paper's two test cases", scenes, options)
        failed = {row["method"] for row in rows if row["error"]}
        names = [name for name in options.methods.split(",") if name not in failed]
        draw(names, options.out, options.animate)
        return rows

    main_of(study, parser)


def paper_table(scenarios: Sequence[Scenario], summary: Sequence[Metrics]) -> str:
    """Return the runs as a Markdown table, the paper's numbers in brackets."""
    lines = [
        [scenario.name, *(cell(scenario, row, key) for key in SHORT)]
        for scenario in scenarios
        for row in summary
        if row["scenario"] == scenario.name
    ]
    return markdown_table(["scenario", *(COLUMNS[key] for key in SHORT)], lines)


def draw(controllers: Sequence[str], out: Path, film: bool) -> None:
    console = Console()
    scenarios, more = (list(map(load_scenario, cases)) for cases in (CASES, MORE))
    laws = [name for name in LAWS if name in controllers]
    with console.status("simulating"):
        logs, summary = compare(scenarios, controllers, out=out)
        tables = paper_table(scenarios, summary)
        if laws:
            others, lines = compare(more, laws, out=out)
            logs, summary = [*logs, *others], [*summary, *lines]
    for scenario in [*scenarios, *more] if laws else scenarios:
        runs = [log for log in logs if log.meta["scenario"] == scenario.name]
        console.print(table(scenario, summary))
        with console.status("drawing"):
            files = save_figures(runs, out)
            if film:
                name = f"{scenario.name.replace('/', '-')}.gif"
                files.append(animate(runs, out / name))
        console.print(*files, sep="\n", soft_wrap=True, highlight=False)
    if len(laws) == len(LAWS):
        by_name = {(log.meta["scenario"], log.meta["controller"]): log for log in logs}
        tables += "\n" + statement_table(by_name, known_shares())
    (out / "tables.md").write_text(tables, encoding="utf-8")
    console.print(out / "tables.md", soft_wrap=True, highlight=False)


def known_shares() -> dict[tuple[str, str], str]:
    """Return in which share of the calibrations each statement holds, where known.

    By its words and how they are read.
    """
    if not CALIBRATIONS.is_file():
        return {}
    with CALIBRATIONS.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {
        (row["statement"], row["read"]): f"{row['holds']} of {row['of']}"
        for row in rows
        if row["of"]
    }


if __name__ == "__main__":
    main()
