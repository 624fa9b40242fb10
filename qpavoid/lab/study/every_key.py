"""A scenario file with every key that there is, made of what the models declare."""

import textwrap
from collections.abc import Iterator

from qpavoid.lab.study.keys import Key, KeyTable, tables_of

HEAD = """\
# Every key of a scenario file, made by `qpavoid schema --toml`. What is commented out
# stands at its default, or is not there by default; lines of one table belong together.
# A file needs title, duration_s, and a reference (or [[robots]]), no more.
"""

GIVEN = {
    "": {"title": '"Every key"', "duration_s": "8.0"},
    "reference": {"kind": '"spline"', "points_m": "[[0.0, 0.0], [3.0, 0.0]]"},
    "obstacles": {"kind": '"disc"', "position_m": "[1.8, 0.1]"},
}
"""What the file says by itself, of tables by name, besides a speed."""

WORDS = {
    "string": '"…"',
    "number": "1.0",
    "integer": "1",
    "[number, number]": "[0.0, 0.0]",
    "list of": "[]",
    "[start]": "{ x_m = 0.0, y_m = 0.0 }",
}
"""What stands in for a value that has no default, by how its kind begins."""

WIDTH = 88


def every_key(name: str | None = None) -> str:
    """Return the file, or its lines of one table.

    Raises:
        UnknownNameError: There is no such table.
    """
    lines = [HEAD] if name is None else []
    for table in tables_of("scenario", name):
        lines += ["", *_lines(table)]
    return "\n".join(lines).lstrip() + "\n"


def _lines(table: KeyTable) -> Iterator[str]:
    given = GIVEN.get(table.name, {})
    kind = given.get("kind")
    live = bool(given) and (kind is None or table.head.endswith(f"kind = {kind}"))
    yield from _comment(table.what)
    if table.head:
        yield ("" if live else "# ") + table.head.partition(" kind")[0]
    for key in table.keys:
        below = not table.name and key.kind == "[start]"
        inline = key.kind.startswith(("[number", "[start]"))
        if below or (key.kind.startswith("[") and not inline):
            continue  # a table, with lines of its own
        value = given.get(key.name) or _value(key)
        said = live and (key.name in given or key.default == "required")
        yield from _comment(f"{key.name}: {key.kind}. {key.effect}", "  ")
        yield f"{'' if said else '# '}{key.name} = {value}"


def _value(key: Key) -> str:
    if key.default not in ("", "required"):
        return key.default
    if key.kind.startswith('"'):
        return key.kind.partition(",")[0]
    if "≤ 0" in key.kind:
        return "-1.0"
    return next(word for kind, word in WORDS.items() if key.kind.startswith(kind))


def _comment(text: str, more: str = "") -> list[str]:
    mark = f"#{more} "
    return textwrap.wrap(text, WIDTH, initial_indent=mark, subsequent_indent=mark)
