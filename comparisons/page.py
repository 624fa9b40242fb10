"""The page of all comparisons: ``comparisons/README.md``, made from result tables.

    python comparisons/page.py --results out    # a folder a study: refresh the tables
    python comparisons/page.py out/barn out/forest
    python comparisons/page.py --beside out/barn   # the others stay
    python comparisons/page.py                  # the page from the tables as they are

The tables are ``comparisons/results/<study>.csv``, compact and committed; what no table
can say (what a study asks, why somebody else is better) is in ``page.toml``. Writes the
table of all studies into the project's README too, and draws
``figures/comparisons-success.png`` and ``figures/comparisons-differences.png``.
"""

import argparse
import re
import sys
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from shutil import copyfile
from typing import Any

from page_cells import PLANNER, code
from page_counts import in_short, one_by_one
from page_differences import differences, not_best
from page_figures import draw
from page_losses import lost
from page_numbers import Numbers
from page_overview import brief, further, overview, parts_of, said_scenes
from page_parts import OURS, Part
from page_ranking import absent, grid, partly, ranking, single_runs, unplanned
from page_records import (
    MADE,
    RERUN,
    RERUN_WITHOUT,
    TUNED,
    check_words,
    day_words,
    days_of,
    note_day,
    other_words,
    rerun_words,
    tuned_words,
    yard_words,
)
from page_runs import Row, by, condense, read_csv, read_runs, whole
from page_scenes import planned, wide
from page_studies import PUBLISHED, Study, commands, read_studies
from qpavoid.lab.simulation.methods import REGISTRY, methods, parsed
from qpavoid.lab.study.tables import markdown_table, write_csv

HERE = Path(__file__).parent
RESULTS = HERE / "results"
README = HERE.parent / "README.md"
MARKS = "<!-- comparisons -->\n", "<!-- end -->"
"""Between these stands the table of all studies in the project's README."""

MOST_BYTES = 2_000_000
"""All tables together, so that they may be committed."""


def make_page(studies: Sequence[Study], results: Path, texts: Mapping[str, Any]) -> str:
    """Return the page."""
    known = results / PUBLISHED
    published = by(read_csv(known), "study") if known.is_file() else {}
    numbers = Numbers(studies)
    said = {key: numbers.fill(text) for key, text in texts["page"].items()}
    losses = "\n".join([lost(studies), yard_words(results / TUNED, OURS[0])])
    blocks = [said["before"], overview(studies), said["made"], losses, said["figures"]]
    blocks += [further(studies), one_by_one(studies)]
    blocks += [said["planned"], planned(studies)]
    blocks += [said["reading"], *rerun_words(results / RERUN)]
    blocks += [*other_words(results / RERUN_WITHOUT), wide(studies)]
    days = days_of(results / MADE)
    blocks += [
        section(study, numbers, published.get(study.name, []), days.get(study.name, {}))
        for study in studies
    ]
    tuned = texts["tuned"] | tuned_words(results / TUNED)
    blocks += ["## Methods", method_table(studies, tuned, texts["own"])]
    blocks += [check_words(results / TUNED)]
    blocks += [said["after"]]
    return "\n\n".join(block.strip() for block in blocks) + "\n"


def thin(text: str) -> str:
    """Return a page with no blanks beside the bars of its tables: 70 kB in all.

    Of a longer one GitHub shows the first 500 KiB.
    """
    return re.sub(
        r"^\|.*\|$", lambda row: re.sub(r" *\| *", "|", row[0]), text, flags=re.M
    )


def with_overview(text: str, studies: Sequence[Study]) -> str:
    """Return the project's README with the table of all studies in its place."""
    before, _, rest = text.partition(MARKS[0])
    told = brief(studies) + "\n" + in_short(studies)
    return before + MARKS[0] + told + MARKS[1] + rest.partition(MARKS[1])[2]


def section(
    study: Study,
    numbers: Numbers,
    published: Sequence[Row],
    days: Mapping[str, str] = {},
) -> str:
    """Return what the page says of a study.

    Args:
        study: With its rows.
        numbers: Of all studies, for its texts.
        published: Of others, beside them.
        days: On which the rows of a method were made.
    """
    text = study.text
    blocks = [f'<a id="{study.name}"></a>\n\n## {study.title}']
    blocks.append(numbers.fill(text.get("asks", ""), study))
    blocks.append("\n".join(f"    {line}" for line in commands(study)))
    if study.of_runs:
        blocks.append(day_words(days, by(study.rows, "method")))
        settings = len(by(study.rows, "setting"))
        blocks += [grid(study.rows)] if settings > len(study.parts) else []
        for part in study.parts:
            blocks += section_part(part, text)
    else:
        blocks.append(day_words(days, days))
        blocks.append(plain(study.rows, text.get("columns")))
    if published:
        blocks += ["Published, measured by others in Gazebo:", plain(published, None)]
    for name, words in text.get("figures", {}).items():
        blocks.append(f"![{words}](figures/{study.name}-{name})")
    for head, key in (("Why.", "why"), ("Limits.", "limits")):
        told = numbers.fill(text.get(key, ""), study).strip()
        blocks += [f"**{head}** {told}"] * bool(told)
    return "\n\n".join(block.strip("\n") for block in blocks if block)


def section_part(part: Part, text: Mapping[str, Any]) -> list[str]:
    """Return what the page says of one ranking."""
    scored = text.get("scored", False)
    blocks = [f"### {part.title}"] if part.title else []
    if part.began:
        names = ", ".join(" ".join(scene).strip() for scene in part.began)
        blocks.append(
            f"Left out, for they begin in contact: {len(part.began)} ({names})."
        )
    if len(set(part.clusters.values())) < part.scenes:
        blocks.append(said_scenes(part).replace(" in", " scenes in") + ".")
    if part.scenes == 1:
        return [*blocks, single_runs(part)]
    blocks.append(ranking(part, text.get("apart", False)))
    if part.pairs:
        where = f"**Where ours is not best:** {not_best(part, scored)}."
        blocks += [differences(part, scored), where]
    blocks.append(partly(part))
    if part.pairs and not text.get("aside"):
        blocks += [absent(part, text.get("absent", "")), unplanned(part)]
    return blocks


def plain(rows: Sequence[Row], columns: Mapping[str, str] | None) -> str:
    """Return a table as it is, or some of its columns under other names."""
    columns = columns or {key: key for key in rows[0] if key != "study"}
    lines = [[row.get(key) or "–" for key in columns] for row in rows]
    numbers = [
        head
        for head, cells in zip(columns.values(), zip(*lines, strict=True), strict=True)
        if all(re.fullmatch(r"–|[-+.e\d]+", str(cell)) for cell in cells)
    ]
    return markdown_table(list(columns.values()), lines, numbers)


def method_table(
    studies: Iterable[Study], tuned: Mapping[str, str], own: Mapping[str, str]
) -> str:
    """Return what each method is, takes the robot for, and was tuned on.

    Args:
        studies: All of them.
        tuned: On what, by name.
        own: What those are that only one study knows, by name.
    """
    known, lines = methods(), []
    rows = [row for study in studies for row in study.rows if row.get("method")]
    for name in dict.fromkeys(row["method"].partition(" ")[0] for row in rows):
        if name in own:
            lines.append([code(name), own[name], "disc", "nothing"])
            continue
        found = parsed(name)
        what = [known[found.search]] if found.search else []
        if found.controller != "alone" or not what:
            what.append(known.get(found.controller, "a method of one's own"))
        what += {
            "detour": ["led round what stalls it"],
            "guide": ["guided by the coming seconds"],
        }.get(found.stage, [])
        told = found.search, found.controller, found.stage
        on = [tuned[part] for part in told if part in tuned]
        entry = REGISTRY.get(found.controller)
        shapes = ["half the width on its way"] if found.search else []
        if found.controller != "alone" or not found.search:
            shapes.append("polygon" if entry is None else entry.shape)
        on = ["; ".join(on) or "nothing"]
        lines.append([code(name), "; then ".join(what), "; then ".join(shapes), *on])
    heads = ["method", "what it is", "what it takes the robot for", "tuned on"]
    return markdown_table(heads, lines)


def panels(studies: Iterable[Study]) -> list[tuple[str, Part]]:
    """Return every ranking of several methods with its title.

    Without methods behind A* where ours is not: they have a table (:func:`planned`).
    """
    return [
        (f"{study.title}, {part.title}".removesuffix(", "), shown(part))
        for study, part in parts_of(studies)
        if len(part.runs) > 1
    ]


def shown(part: Part) -> Part:
    """Return a ranking as the figures show it."""
    if part.ours.startswith(PLANNER):
        return part
    names = [name for name in part.runs if not name.startswith(PLANNER)]
    pairs = {name: part.pairs[name] for name in names if name in part.pairs}
    return part._replace(runs={name: part.runs[name] for name in names}, pairs=pairs)


def settings_of(rows: Iterable[Row]) -> dict[str, set[str]]:
    """Return in which settings each method ran."""
    return {
        name: {row["setting"] for row in some}
        for name, some in by(rows, "method").items()
    }


def refresh(
    folders: Iterable[Path], texts: Mapping[str, Any], data: Path | None, beside: bool
) -> None:
    """Keep tables and figures of these folders, and what is published beside them."""
    for folder in folders:
        path = condense(folder, RESULTS, beside)
        if path is not None and (folder / "runs.csv").is_file():
            settings = settings_of(read_csv(folder / "runs.csv"))
            known = settings_of(whole(read_csv(path)))
            ran = [
                name for name in settings if settings[name] >= known.get(name, set())
            ]
            note_day(RESULTS / MADE, path.stem, ran, date.today().isoformat())
        figures = texts["study"].get(folder.name, {}).get("figures", ())
        for name in () if beside else figures:
            if (folder / name).is_file():
                copyfile(folder / name, HERE / "figures" / f"{folder.name}-{name}")
        print(f"{folder}: no runs.csv or table.csv" if path is None else path)
        if path is not None and path.stem == "barn":
            from barn import published

            worlds = sorted({int(row["scene"]) for row in read_runs(path) or ()})
            rows = [{"study": "barn", **row} for row in published(worlds, data)]
            write_csv(RESULTS / PUBLISHED, rows)
    size = sum(path.stat().st_size for path in RESULTS.rglob("*.*"))
    if size > MOST_BYTES:
        print(f"{RESULTS}: {size} bytes are too many to commit", file=sys.stderr)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="*", metavar="FOLDER")
    parser.add_argument("--results", type=Path, metavar="DIR", help="of such folders")
    parser.add_argument("--data", type=Path, metavar="PATH", help="published data sets")
    parser.add_argument(
        "--beside", action="store_true", help="what did not run stays, and all figures"
    )
    options = parser.parse_args()
    folders = list(options.folders)
    if options.results is not None:
        folders += sorted(path for path in options.results.iterdir() if path.is_dir())
    texts = tomllib.loads((HERE / "page.toml").read_text(encoding="utf-8"))
    refresh(folders, texts, options.data, options.beside)
    studies = read_studies(RESULTS, texts)
    made = make_page(studies, RESULTS, texts)
    (HERE / "README.md").write_text(thin(made), encoding="utf-8")
    shown = with_overview(README.read_text(encoding="utf-8"), studies)
    README.write_text(shown, encoding="utf-8")
    draw(panels(studies), HERE / "figures")
    print(HERE / "README.md")


if __name__ == "__main__":
    main()
