"""What the page says of records beside the tables: tuning, and a rerun of random rows.

* ``results/tuned.toml``: what ``tune_baselines.py`` searched, and found.
* ``results/rerun/rows.csv``: what ``rerun.py`` drew, and whether it agrees.
* ``results/rerun/without_avx512.csv``: the same, as on a processor that has none.
* ``results/made.toml``: on which day the rows of a method were made.
"""

import sys
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from page_runs import Row, by, read_csv
from qpavoid.errors import MissingExtraError

try:
    import tomli_w
except ImportError:
    sys.exit(str(MissingExtraError("tomli-w", "study")))

TUNED = "tuned.toml"
RERUN = "rerun/rows.csv"
RERUN_WITHOUT = "rerun/without_avx512.csv"
MADE = "made.toml"


def read_toml(path: Path) -> dict[str, Any]:
    """Return what a record says; nothing where there is none."""
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def tuned_words(path: Path) -> dict[str, str]:
    """Return on what each method was tuned, and what that gained."""
    found = read_toml(path)
    return {name: "; then ".join(searches_of(of)) for name, of in found.items()}


def searches_of(record: Mapping[str, Any]) -> list[str]:
    """Return every search of a method in words: of forests and strangers, of all."""
    words = []
    if "forests" in record:
        scenes = record["forests"]["count"] + record["strangers"]["count"]
        runs = int(record["tried"]) * scenes
        loss = record["loss"]["before"], record["loss"]["best"]
        words.append("forests and strangers: " + searched(record["tried"], runs, *loss))
    more = record.get("all_kinds")
    if more:
        found = searched(more["tried"], more["runs"], *both_losses(more))
        words.append("all kinds: " + found)
    if more and "check" in more:
        words[-1] += " (held out {:.3f} → {:.3f})".format(*both_losses(more["check"]))
    if more and "held_out" in more:
        held = both_losses(more["held_out"])
        if "drawn" in more:
            words[-1] += (
                f", the best of {more['drawn']} drawn {more['best_drawn']['loss']:.3f}"
            )
        words[-1] += ", held out {:.3f} → {:.3f}".format(*held)
        words[-1] += ": not driven with" * (held[0] <= held[1])
    return words


def both_losses(both: Mapping[str, Any]) -> tuple[float, float]:
    """Return the losses before and after a search, or of whatever is told like it."""
    return float(both["before"]["loss"]), float(both["after"]["loss"])


def on_all_kinds(path: Path) -> dict[str, Mapping[str, Any]]:
    """Return the searches on all kinds of cases by method."""
    found = read_toml(path)
    return {x: of["all_kinds"] for x, of in found.items() if "all_kinds" in of}


def check_words(path: Path) -> str:
    """Return whose search found what is better on cases held out, too, and whose not.

    Empty where none was asked.
    """
    found = on_all_kinds(path)
    asked = {x: both_losses(of["check"]) for x, of in found.items() if "check" in of}
    better = [f"`{x}`" for x, (before, after) in asked.items() if after < before]
    rest = [f"`{x}`" for x, (before, after) in asked.items() if after >= before]
    if not asked:
        return ""
    return (
        f"**What a search found is driven with.** Of {len(asked)} methods it is not "
        "what the search began with; that was asked on the 142 cases held out, too, in "
        f"brackets above. It is better there for {len(better)}: {', '.join(better)}; "
        f"and not for {len(rest)}: {', '.join(rest) or 'none'}. Nothing was changed "
        "for it. So they are not held to what ours is: what its search found is not "
        "better there either, and ours drives with what it had."
    )


def found_only(more: Mapping[str, Any]) -> bool:
    """Return whether what a search found is not driven with: the start still is."""
    return bool(more.get("driven") == "start")


def searched(settings: int, runs: int, before: float, after: float) -> str:
    """Return what a search took and gained in words."""
    return f"{settings} settings, {runs} runs, loss {before:.3f} → {after:.3f}"


def yard_words(path: Path, ours: str) -> str:
    """Return how much those lose that were searched on all kinds of cases, as driven.

    Args:
        path: Of the records.
        ours: What the one that leads our filter is called.
    """
    driven = {
        name: of["before" if found_only(of) else "after"]
        for name, of in on_all_kinds(path).items()
    }
    if "guide" not in driven:
        return ""
    words = [
        f"`{ours if name == 'guide' else name}` {of['loss']:.3f} "
        f"({100.0 * of['failure']:g} + {100.0 * of['contact']:g} %)"
        for name, of in sorted(driven.items(), key=lambda item: item[1]["loss"])
    ]
    return (
        "- By our own loss, the share that fails + 10 × that touches + the mean share "
        "of the time allowed, all of it where one fails, on the 40 cases on which "
        "these were searched (which fail + touch; who touches fails): "
        + ", ".join(words)
        + "."
    )


def rerun_of(path: Path) -> tuple[list[Row], list[Row]]:
    """Return the rows of a rerun, and those that differ; none without one."""
    rows = read_csv(path) if path.is_file() else []
    return rows, [row for row in rows if row["what"]]


def rerun_words(path: Path) -> list[str]:
    """Return what a rerun of random rows found, as blocks of text; none without one."""
    rows, wrong = rerun_of(path)
    if not rows:
        return []
    many = Counter(row["study"] for row in rows)
    of = ", ".join(f"{n} of `{name}`" for name, n in many.items())
    words = (
        f"**A stranger's rerun.** Of {len(rows)} random rows of the studies that run "
        "single rows (not ablation, the paper's outlook and calibrations, the "
        "recorded drive), run "
        "again by `python comparisons/rerun.py --data PATH --seed "
        f"{rows[0]['seed']}` ({of}), "
        f"**{len(rows) - len(wrong)} agree**: the same outcome, arrival, least room "
        "and what is kept of a run beside, to the last digit."
    )
    if not any("+guide" in row["method"] for row in rows):
        words += " Rows of our guide were not drawn."
    if not wrong:
        return [words]
    return [f"{words} Those that do not:", "\n".join(map(told, wrong))]


def other_words(path: Path) -> list[str]:
    """Return the same of a rerun as on another processor."""
    rows, wrong = rerun_of(path)
    if not rows:
        return []
    ends = sum("outcome" in row["what"] for row in wrong)
    who = ", ".join(f"`{name}`" for name in sorted({row["method"] for row in wrong}))
    words = (
        f"**On another processor** (`--without-avx512`), {len(rows) - len(wrong)} of "
        f"{len(rows)} such rows agree"
    )
    if not wrong:
        return [words + "."]
    return [
        f"{words}; {ends} of the others, of {who}, end otherwise. Sums and sines of "
        "libraries have another last digit there, which planners that iterate carry on."
    ]


def days_of(path: Path) -> dict[str, dict[str, str]]:
    """Return the day on which rows were made by study and method, where it is known."""
    found = read_toml(path)
    return {
        study: {name: day for day, names in of.items() for name in names.split(", ")}
        for study, of in found.items()
    }


def note_day(path: Path, study: str, methods: Iterable[str], day: str) -> None:
    """Write down that rows of a study were made on a day; those of others stay."""
    known = days_of(path)
    known[study] = known.get(study, {}) | dict.fromkeys(methods, day)
    lines = {
        study: {
            day: ", ".join(name for name in of if of[name] == day)
            for day in sorted({*of.values()})
        }
        for study, of in known.items()
    }
    path.write_text(tomli_w.dumps(lines), encoding="utf-8")


def day_words(days: Mapping[str, str], methods: Iterable[str]) -> str:
    """Return which of some methods' rows were made when; the rest are of before."""
    names = list(methods)
    noted = [{"day": days[name], "name": name} for name in names if name in days]
    parts = [
        f"{day}: " + ", ".join(f"`{row['name']}`" for row in some)
        for day, some in by(sorted(noted, key=lambda row: row["day"]), "day").items()
    ]
    if not parts:
        return ""
    rest = "; all others before that" if len(noted) < len(names) else ""
    return f"Rows made on {'; on '.join(parts)}{rest}."


def told(row: Row) -> str:
    """Return a row that differs, in a line."""
    place = " ".join(filter(None, (row["setting"], row["scene"])))
    return f"- `{row['study']}`, `{row['method']}`, {place}: {row['what']}"
