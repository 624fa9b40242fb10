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
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from shutil import copyfile
from typing import Any

from page_figures import draw
from page_parts import Part, at_the_top, make_parts, moved, others, rival
from page_records import (
    MADE,
    RERUN,
    TUNED,
    day_words,
    days_of,
    note_day,
    rerun_words,
    tuned_words,
)
from page_runs import Row, by, condense, filled, read_csv, read_runs
from page_text import (
    code,
    differences,
    grid,
    not_best,
    ranking,
    single_runs,
    standing,
    table,
)
from qpavoid.lab.simulation.methods import find_entry, find_method, methods
from qpavoid.lab.study.tables import markdown_table, write_csv

HERE = Path(__file__).parent
RESULTS = HERE / "results"
README = HERE.parent / "README.md"
MARKS = "<!-- comparisons -->\n", "<!-- end -->"
"""Between these stands the table of all studies in the project's README."""

PUBLISHED = "published.csv"
MOST_PARTS = 3
"""Settings of a study that get a ranking each; more are ranked together."""

UNKNOWN = "Why was not looked at."
"""Said of a loss of which ``page.toml`` says nothing."""

QUANTITIES = "success", "time", "metric"
"""In which ours stands against the best other."""

PREDICTIVE = "mppi", "nmpc", "teb", "mpc-cbf"
"""Who plan for seconds ahead: the first tables say where they did not run."""

WIDE = 5.0
"""Points; intervals of success are not to be wider to either side."""

MOST_BYTES = 2_000_000
"""All tables together, so that they may be committed."""


@dataclass(frozen=True)
class Study:
    """What the page knows of a study.

    Attributes:
        name: Of its folder.
        text: Its part of ``page.toml``.
        rows: Of its table.
        of_runs: Whether these are runs; else it left a table only.
    """

    name: str
    text: Mapping[str, Any]
    rows: Sequence[Row]
    of_runs: bool

    @cached_property
    def parts(self) -> Sequence[Part]:
        """Its rankings, with all their statistics."""
        return make_parts(self.rows, self.text, MOST_PARTS) if self.of_runs else []

    @property
    def tests(self) -> int:
        """How many comparisons Holm's p are over."""
        pairs = (pair for part in self.parts for pair in part.pairs.values())
        return sum(len(pair.differences) for pair in pairs)

    @property
    def title(self) -> str:
        """What the page calls it."""
        return str(self.text.get("title", self.name))


def read_studies(results: Path, texts: Mapping[str, Any]) -> list[Study]:
    """Return all studies that have a table, in the order of their texts."""
    paths = {path.stem: path for path in sorted(results.glob("*.csv"))}
    paths.pop(Path(PUBLISHED).stem, None)
    names = [name for name in texts["study"] if name in paths]
    names += [name for name in paths if name not in names]
    studies = []
    for name in names:
        text, runs = texts["study"].get(name, {}), read_runs(paths[name])
        rows = read_csv(paths[name]) if runs is None else runs
        studies.append(Study(name, text, rows, runs is not None))
    return studies


def make_page(studies: Sequence[Study], results: Path, texts: Mapping[str, Any]) -> str:
    """Return the page."""
    known = results / PUBLISHED
    published = by(read_csv(known), "study") if known.is_file() else {}
    said = texts["page"]
    blocks = [said["before"], overview(studies), lost(studies), said["figures"]]
    blocks += [said["reading"], *rerun_words(results / RERUN), wide(studies)]
    days = days_of(results / MADE)
    blocks += [
        section(study, published.get(study.name, []), days.get(study.name, {}))
        for study in studies
    ]
    tuned = texts["tuned"] | tuned_words(results / TUNED)
    blocks += ["## Methods", method_table(studies, tuned, texts["own"])]
    blocks += [texts["page"]["after"]]
    return "\n\n".join(block.strip() for block in blocks) + "\n"


def overview(studies: Iterable[Study]) -> str:
    """Return the table of all studies."""
    heads = ["study", "scenes", "ours", "others", "success, ours / best other"]
    heads += ["contacts moving, ours / that other"]
    heads += ["time, ours over best other (95 %)", "metric, ours / best other"]
    lines = []
    for study, part in ranked(studies):
        line = [linked(study, part), said_scenes(part), code(part.ours)]
        success, *more = (standing(part, key) for key in QUANTITIES)
        lines.append([*line, against(part), success, struck(part), *more])
    return table(heads, lines)


def struck(part: Part) -> str:
    """Return contacts begun in motion: ours, and of the other that succeeds most."""
    names = [part.ours, rival(part, "success")]
    return " / ".join(str(moved(part.runs[name])) for name in names if name)


def against(part: Part) -> str:
    """Return how many other methods ran, and which of the four planners did not."""
    names = others(part)
    ran = {find_method(name).controller for name in names}
    missing = [code(name) for name in PREDICTIVE if name not in ran]
    if len(missing) == len(PREDICTIVE):
        return f"{len(names)}" + ", none of the four" * bool(names)
    return f"{len(names)}" + f", not {', '.join(missing)}" * bool(missing)


def brief(studies: Iterable[Study]) -> str:
    """Return the table of the project's README: where ours met another method."""
    heads = ["study", "others", "success, ours / best other"]
    heads += ["contacts moving", "time, ours / other (95 %)"]
    lines = [
        [
            linked(study, part).replace("](#", "](comparisons/README.md#"),
            against(part),
            standing(part, "success"),
            struck(part),
            standing(part, "time"),
        ]
        for study, part in ranked(studies)
        if rival(part, "success")
    ]
    return table(heads, lines)


def ranked(studies: Iterable[Study]) -> list[tuple[Study, Part]]:
    """Return the rankings with ours: worse than another, behind one, all others."""
    found = [
        (study, part)
        for study in studies
        if not study.text.get("aside")
        for part in study.parts
        if part.scenes > 1 and part.ours and part.title not in elsewhere(study)
    ]
    return sorted(found, key=lambda pair: (not worse(pair[1]), not losses_of(pair[1])))


def wide(studies: Iterable[Study]) -> str:
    """Return where the intervals of two planners are wider than ± 5 points, or none."""
    pairs, lines = ranked(studies), []
    for name in "nmpc", "mppi":
        halves, absent = [], []
        for study, part in pairs:
            ran = [x for x in others(part) if find_method(x).controller == name]
            _, low, high = part.success(ran[0]) if ran else (0.0, 0.0, 0.0)
            half = 50.0 * (high - low)
            if half > WIDE:
                halves.append(f"{linked(study, part)}: ± {half:.0f}")
            absent += [linked(study, part)] * (not ran)
        told = f"- {code(name)}: {'; '.join(halves) or 'nowhere'}."
        lines.append(told + f" It did not run in {'; '.join(absent)}." * bool(absent))
    said = f"**Intervals of success wider than ± {WIDE:g} points**, half their width:"
    return "\n".join([said, "", *lines])


def elsewhere(study: Study) -> list[str]:
    """Return the rankings of a study that another one has already."""
    return list(study.text.get("ranked_elsewhere", ()))


def worse(part: Part) -> list[str]:
    """Return the quantities in which the best other is clearly better than ours."""
    return [key for key in QUANTITIES if standing(part, key).startswith("**worse")]


def losses_of(part: Part) -> list[str]:
    """Return the same, and successes of which another has more that are level."""
    name = rival(part, "success")
    behind = bool(name) and part.pairs[name].differences["success"].value[0] < 0.0
    keys = worse(part)
    return keys + ["success (level)"] * (behind and "success" not in keys)


def linked(study: Study, part: Part) -> str:
    """Return the title of a ranking, with a link to it."""
    return f"[{study.title}](#{study.name}), {part.title}".removesuffix(", ")


def lost(studies: Iterable[Study]) -> str:
    """Return what ours still loses, and why as far as ``loses`` of a study says it.

    Which may be a table by the titles of its rankings.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for study, part in ranked(studies):
        if losses_of(part):
            why = study.text.get("loses", UNKNOWN)
            why = why if isinstance(why, str) else why.get(part.title, UNKNOWN)
            told = f"{', '.join(losses_of(part))}. {' '.join(why.split())}"
            found.setdefault((study.name, told), []).append(linked(study, part))
    lines = [f"- {'; '.join(named)}: {told}" for (_, told), named in found.items()]
    return "\n".join(["**What ours still loses, and why**\n", *lines] * bool(lines))


def with_overview(text: str, studies: Iterable[Study]) -> str:
    """Return the project's README with the table of all studies in its place."""
    before, _, rest = text.partition(MARKS[0])
    told = in_short(studies) + brief(studies)
    return before + MARKS[0] + told + MARKS[1] + rest.partition(MARKS[1])[2]


def in_short(studies: Iterable[Study]) -> str:
    """Return how often ours is better, level and worse, in a sentence."""
    found = [pair for pair in ranked(studies) if rival(pair[1], "success")]
    parts = [part for _, part in found]

    def count(key: str, kind: str) -> int:
        return sum(standing(part, key).startswith(f"**{kind}") for part in parts)

    kinds = "better", "level", "worse"
    success, time = (
        [count(key, kind) for kind in kinds] for key in ("success", "time")
    )
    behind = sum("success (level)" in losses_of(part) for part in parts)
    top = sum(at_the_top(part, study.tests) for study, part in found)
    return (
        f"In success ours is better in {success[0]} of {len(parts)} rankings, level in "
        f"{success[1]} (in {behind} of these the other\nsucceeded more often), worse "
        f"in {success[2]}: in {top} ours fails so seldom that even one who never fails "
        f"could not be clearly better.\nIn time it is better in {time[0]}, level in "
        f"{time[1]}, worse in {time[2]}.\n\n"
    )


def section(
    study: Study, published: Sequence[Row], days: Mapping[str, str] = {}
) -> str:
    """Return what the page says of a study.

    Args:
        study: With its rows.
        published: Of others, beside them.
        days: On which the rows of a method were made.
    """
    text = study.text
    blocks = [f'<a id="{study.name}"></a>\n\n## {study.title}', text.get("asks", "")]
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
        blocks += [f"**{head}** {text[key].strip()}"] if text.get(key) else []
    return "\n\n".join(block.strip("\n") for block in blocks if block)


def commands(study: Study) -> list[str]:
    """Return what makes the study's folder, with the scenes and methods of its runs."""
    lines = [str(line) for line in study.text.get("commands", ())]
    if not study.of_runs or not study.text.get("methods", True):
        return lines
    names = ",".join(by(study.rows, "method"))
    scenes = study.parts[0].scenes + len(study.parts[0].began)
    return [line.format(scenes=scenes) + f" --methods {names}" for line in lines]


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
    return blocks


def said_scenes(part: Part) -> str:
    """Return how many scenes there are, and of how many clusters."""
    clusters = len(set(part.clusters.values()))
    return f"{part.scenes}" + f" in {clusters} clusters" * (clusters < part.scenes)


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
        found = find_method(name)
        what = [known[found.search]] if found.search else []
        what += (
            [known[found.controller]] if found.controller != "alone" or not what else []
        )
        what += {
            "detour": ["led round what stalls it"],
            "guide": ["guided by the coming seconds"],
        }.get(found.stage, [])
        told = found.search, found.controller, found.stage
        on = [tuned[part] for part in told if part in tuned]
        entry = find_entry(found.controller)
        shape = "polygon" if entry is None else entry.shape
        on = ["; ".join(on) or "nothing"]
        lines.append([code(name), "; then ".join(what), shape, *on])
    heads = ["method", "what it is", "what it takes the robot for", "tuned on"]
    return markdown_table(heads, lines)


def panels(studies: Iterable[Study]) -> list[tuple[str, Part]]:
    """Return every ranking with its title."""
    return [
        (f"{study.title}, {part.title}".removesuffix(", "), part)
        for study in studies
        if not study.text.get("aside")
        for part in study.parts
    ]


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
            known = settings_of(filled(read_csv(path)))
            ran = [
                name for name in settings if settings[name] >= known.get(name, set())
            ]
            note_day(RESULTS / MADE, path.stem, ran, date.today().isoformat())
        for name in texts["study"].get(folder.name, {}).get("figures", ()):
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
        "--beside", action="store_true", help="what did not run again stays"
    )
    options = parser.parse_args()
    folders = list(options.folders)
    if options.results is not None:
        folders += sorted(path for path in options.results.iterdir() if path.is_dir())
    texts = tomllib.loads((HERE / "page.toml").read_text(encoding="utf-8"))
    refresh(folders, texts, options.data, options.beside)
    studies = read_studies(RESULTS, texts)
    made = make_page(studies, RESULTS, texts)
    (HERE / "README.md").write_text(made, encoding="utf-8")
    shown = with_overview(README.read_text(encoding="utf-8"), studies)
    README.write_text(shown, encoding="utf-8")
    draw(panels(studies), HERE / "figures")
    print(HERE / "README.md")


if __name__ == "__main__":
    main()
