"""Studies as the page knows them: tables, what ``page.toml`` says, rankings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from page_parts import OTHERS, Part, family, grouped, make_parts, scene_of, with_more
from page_runs import Row, by, read_csv, read_runs

PUBLISHED = "published.csv"
MOST_PARTS = 3
"""Settings of a study that get a ranking each; more are ranked together."""


@dataclass(frozen=True)
class Study:
    """What the page knows of a study.

    Attributes:
        name: Of its folder.
        text: Its part of ``page.toml``.
        rows: Of its table.
        of_runs: Whether these are runs; else it left a table only.
        more: The study that has more of its scenes, for some methods; or None.
    """

    name: str
    text: Mapping[str, Any]
    rows: Sequence[Row]
    of_runs: bool
    more: "Study | None" = None

    @cached_property
    def parts(self) -> Sequence[Part]:
        """Its rankings, with all their statistics."""
        parts = make_parts(self.rows, self.text, MOST_PARTS) if self.of_runs else []
        return with_more(parts, self.more.parts, self.text) if self.more else parts

    @property
    def tests(self) -> list[float]:
        """The p of successes of others, planned as ours is, each by itself."""
        return [
            part.versus(name)["success"].single
            for part in self.parts
            for name in part.pairs
            if family(part, name) == OTHERS
        ]

    @property
    def counted(self) -> str:
        """With which study it is counted as one: itself, or whose runs it repeats."""
        return str(self.text.get("counted", self.name))

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
    known = {study.name: study for study in studies}
    return [replace(x, more=known.get(x.text.get("more", ""))) for x in studies]


def commands(study: Study) -> list[str]:
    """Return what makes the study's folder, with the scenes and methods of its runs."""
    lines = [str(line) for line in study.text.get("commands", ())]
    if not study.of_runs or not study.text.get("methods", True):
        return lines
    names = ",".join(by(study.rows, "method"))
    first, *_ = grouped(study.rows, study.text, MOST_PARTS).values()
    scenes = len({scene_of(row) for row in first})
    return [line.format(scenes=scenes) + f" --methods {names}" for line in lines]
