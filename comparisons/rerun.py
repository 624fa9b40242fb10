"""A stranger's rerun: random rows of the committed tables, run again and compared.

Each row is run by the command that the page states for its study, with ``--rows``. It
agrees if outcome, arrival, least room and metrics that are kept of a run are what the
table says, so rounded.
``rows.csv`` has the seed, all that were drawn by it, and what differs; if anything
does, or some could not be run, the exit status is 1. With ``--record`` the page says
so.

    python comparisons/rerun.py --data PATH --count 100
    python comparisons/rerun.py --data PATH --count 100 --without-avx512
"""

import argparse
import os
import random
import subprocess
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from page import HERE, RESULTS
from page_records import RERUN, RERUN_WITHOUT
from page_runs import OF_BLOCK, OUTCOMES, Row, compact, names_of, read_csv
from page_studies import Study, commands, read_studies
from qpavoid.lab.study.tables import write_csv

SWEEPS = (
    *("barn", "crowd", "crowdnav", "dynabarn", "encounters", "fleet", "forest"),
    *("maps", "paper", "sensing", "strangers"),
)
"""Scripts that take ``--rows``."""

KEY = "method", "setting", "scene"


def reruns(studies: Sequence[Study]) -> list[Study]:
    """Return the studies whose first command is one that takes rows."""
    scripts = {study.name: commands(study)[:1] for study in studies if study.of_runs}
    known = {
        name: Path(lines[0].split()[1]).stem for name, lines in scripts.items() if lines
    }
    return [study for study in studies if known.get(study.name) in SWEEPS]


def drawn(
    studies: Sequence[Study],
    count: int,
    seed: int,
    methods: set[str],
    but: str = "",
) -> list[tuple[str, Row]]:
    """Return random rows, each with its study's name.

    Args:
        studies: Of whose tables.
        count: How many rows.
        seed: Of the draw.
        methods: Whose rows; none: everybody's.
        but: No rows of methods in whose name this is.
    """
    rows = [
        (study.name, row)
        for study in studies
        for row in study.rows
        if row["outcome"] in OUTCOMES
        and (not methods or row["method"] in methods)
        and not (but and but in row["method"])
    ]
    return random.Random(seed).sample(rows, min(count, len(rows)))


def command_of(study: Study, rows: Sequence[Row], data: Path, out: Path) -> list[str]:
    """Return the command that runs some rows of a study, and write their table."""
    out.mkdir(parents=True, exist_ok=True)
    write_csv(
        out / "rows.csv", [{k: row[k] for k in (*KEY, "outcome")} for row in rows]
    )
    words = commands(study)[0].split()[1:]
    words = words[: words.index("--methods")] if "--methods" in words else words
    given = {"PATH": str(data), words[words.index("--out") + 1]: str(out)}
    script = str(HERE / Path(words[0]).name)
    methods = ",".join(dict.fromkeys(row["method"] for row in rows))
    words = [given.get(word, word) for word in words[1:]]
    rest = ["--methods", methods, "--rows", str(out / "rows.csv")]
    return [sys.executable, script, *words, *rest]


def found_in(path: Path) -> dict[tuple[str, ...], Row]:
    """Return compact rows of ``runs.csv`` under every name that a table may use.

    What two may be called is the first one's.
    """
    found: dict[tuple[str, ...], Row] = {}
    for run in read_csv(path) if path.is_file() else []:
        (line,) = compact([run])
        for scene in names_of(run):
            found.setdefault((line["method"], line["setting"], scene), line)
    return found


def difference(row: Row, again: Mapping[str, str] | None) -> Row:
    """Return what names a row, and what differs; nothing: it agrees. Of no clock."""
    place = {key: row[key] for key in KEY}
    if again is None:
        return place | {"what": "not run"}
    keys = [
        "arrived_s",
        "min_room_m",
        *(key for key in row if key.startswith("metric") and key not in OF_BLOCK),
    ]
    wrong = {
        key: f"{row[key]:g} / {again.get(key)}"
        for key in keys
        if row.get(key) is not None and float(again.get(key) or "nan") != row[key]
    }
    if again["outcome"] != row["outcome"]:
        wrong["outcome"] = f"{row['outcome']} / {again['outcome']}"
    said = ", ".join(f"{key}: {value}" for key, value in wrong.items())
    return place | {"what": said}


def without_avx512() -> dict[str, str]:
    """Return the environment in which numpy and OpenBLAS do as where there is none."""
    found = np.show_config(mode="dicts")["SIMD Extensions"]["found"]
    names = [name for name in found if "AVX512" in name or name == "X86_V4"]
    switches = {"NPY_DISABLE_CPU_FEATURES": " ".join(names)} if names else {}
    return {**os.environ, **switches, "OPENBLAS_CORETYPE": "Haswell"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, metavar="PATH", required=True)
    parser.add_argument("--count", type=int, default=100, metavar="N")
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument(
        "--methods", default="", metavar="A,B,…", help="all if not given"
    )
    parser.add_argument("--but", default="", metavar="PART", help="of a method's name")
    parser.add_argument("--out", type=Path, default=Path("out/rerun"), metavar="DIR")
    parser.add_argument("--record", action="store_true", help="into results/rerun")
    parser.add_argument(
        "--without-avx512", action="store_true", help="as on a processor that has none"
    )
    options = parser.parse_args()
    env = without_avx512() if options.without_avx512 else None
    record = RESULTS / (RERUN_WITHOUT if options.without_avx512 else RERUN)
    texts = tomllib.loads((HERE / "page.toml").read_text(encoding="utf-8"))
    studies = reruns(read_studies(RESULTS, texts))
    methods = {name for name in options.methods.split(",") if name}
    chosen = drawn(studies, options.count, options.seed, methods, options.but)
    done = []
    for study in studies:
        rows = [row for name, row in chosen if name == study.name]
        if not rows:
            continue
        out = options.out / study.name
        subprocess.run(command_of(study, rows, options.data, out), check=False, env=env)
        found = found_in(out / "runs.csv")
        again = [
            found.get((row["method"], row["setting"], row["scene"])) for row in rows
        ]
        told = [difference(*pair) for pair in zip(rows, again, strict=True)]
        named = {"seed": options.seed, "study": study.name}
        done += [named | line for line in told]
    for path in [options.out / "rows.csv", *[record] * options.record]:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_csv(path, done)
    differ = [line for line in done if line["what"]]
    for line in differ:
        print(" | ".join(map(str, line.values())))
    print(f"{len(done) - len(differ)} of {len(done)} rows agree")
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
