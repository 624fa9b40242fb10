"""What the page says of records beside the tables: tuning, and a rerun of random rows.

* ``results/tuned.toml``: what ``tune_baselines.py`` searched, and found.
* ``results/rerun/rows.csv``: what ``rerun.py`` drew, and whether it agrees.
"""

import tomllib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from page_runs import Row, read_csv

TUNED = "tuned.toml"
RERUN = "rerun/rows.csv"


def tuned_words(path: Path) -> dict[str, str]:
    """Return on what each method was tuned, and what that gained."""
    found = tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return {
        name: f"{of['tried']} settings, {runs_of(of)} runs, loss "
        f"{of['loss']['before']:.3f} → {of['loss']['best']:.3f}"
        for name, of in found.items()
    }


def runs_of(record: Mapping[str, Mapping[str, int]]) -> int:
    """Return how many runs a search took: every setting tried on every scene."""
    scenes = record["forests"]["count"] + record["strangers"]["count"]
    return int(record["tried"]) * scenes


def rerun_words(path: Path) -> list[str]:
    """Return what a rerun of random rows found, as blocks of text; none without one."""
    rows = read_csv(path) if path.is_file() else []
    if not rows:
        return []
    wrong = [row for row in rows if row["what"]]
    many = Counter(row["study"] for row in rows)
    of = ", ".join(f"{n} of `{name}`" for name, n in many.items())
    words = (
        f"**A stranger's rerun.** Of {len(rows)} random rows of these tables, run "
        f"again by `python comparisons/rerun.py` ({of}), "
        f"**{len(rows) - len(wrong)} agree**: the same outcome, arrival, least room "
        "and metric, to the last digit."
    )
    if not wrong:
        return [words]
    return [f"{words} Those that do not:", "\n".join(map(told, wrong))]


def told(row: Row) -> str:
    """Return a row that differs, in a line."""
    place = " ".join(filter(None, (row["setting"], row["scene"])))
    return f"- `{row['study']}`, `{row['method']}`, {place}: {row['what']}"
