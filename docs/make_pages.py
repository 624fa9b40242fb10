"""Generated pages: every key and command from the declarations, and the live page.

python docs/make_pages.py FOLDER
"""

import sys
from pathlib import Path

from keys import key_tables

from qpavoid.cli import COMMANDS
from qpavoid.errors import MissingExtraError
from qpavoid.lab.play.page import play_page
from qpavoid.lab.play.program import program
from qpavoid.lab.scenario.schema import ScenarioModel
from qpavoid.lab.study.sweep.study import StudyModel
from qpavoid.lab.study.tables import markdown_table

HEADS = ("key", "value", "unit", "default", "effect")
FILES = {"scenario": ("Scenarios", ScenarioModel), "study": ("Studies", StudyModel)}


def keys_page():
    """Return the reference of all keys as Markdown."""
    text = (
        "# Every key\n\nThis page lists every key of scenario and study files. It is "
        "for those who write such files. The unit is the end of the key. An unknown "
        "key is an error that lists those of its table. `qpavoid schema` prints a "
        "JSON Schema for editors.\n"
    )
    for file, (title, model) in FILES.items():
        text += f"\n## {title}\n"
        for table in key_tables(model):
            text += f"\n### {file}: `{table.head or 'top of the file'}`\n\n"
            text += f"{prose(table.what)}\n\n"
            rows = [[*map(cell, key[:4]), prose(key.effect)] for key in table.keys]
            text += markdown_table(HEADS, rows)
    return text


def commands_page():
    """Return the reference of all commands as Markdown."""
    text = (
        "# Every command\n\nThis page lists every command with its options. It is for "
        "users of the command line; `qpavoid COMMAND --help` prints the same.\n"
    )
    for name, (command, *options) in COMMANDS.items():
        text += f"\n## {name}\n\n{command.__doc__}\n\n"
        rows = [option_row(flags, how) for flags, how in options]
        text += markdown_table(("option", "what"), rows)
    return text + "\nEvery command takes `--quiet`: errors alone.\n"


def option_row(flags, how):
    """Return the two cells of an option."""
    head = how["metavar"] if not flags[0].startswith("-") else ", ".join(flags)
    if flags[0].startswith("-") and "metavar" in how:
        head += f" {how['metavar']}"
    text = how["help"] % {"default": how.get("default", "")}
    return cell(head), prose(text)


def cell(text):
    """Return code in a cell of a table; an empty text stays empty."""
    return f"`{text.replace('|', '¦')}`" if text else ""


def prose(text):
    """Return prose in a cell of a table, escaped."""
    marks = {"|": "\\|", "*": "\\*", "_": "\\_", "<": "&lt;", "[": "\\[", "…": "…"}
    parts = text.split("`")
    for i in range(0, len(parts), 2):
        parts[i] = "".join(marks.get(letter, letter) for letter in parts[i])
    return "`".join(
        part.replace("|", "¦") if i % 2 else part for i, part in enumerate(parts)
    )


LIVE = """```{raw} html
<iframe src="play.html#embed-paused" title="Live: robots among obstacles that you drag"
style="width: 100%; height: min(1150px, 88vh); border: 1px solid #8884;
border-radius: 6px" loading="lazy"></iframe>
<p><a href="play.html">The same on its own page</a>, with settings and recordings, as
<code>qpavoid play</code> writes it.</p>
```
"""


def live_page(extra):
    """Write the live page; return the part of the front page that embeds it."""
    extra.mkdir(parents=True, exist_ok=True)
    try:
        made = program()
    except MissingExtraError:
        return "`qpavoid play` shows it live: robots among obstacles that you drag.\n"
    methods = ("eq5", "qp-ahead", "qp-ahead+guide")
    text = play_page(made, "demo/play", methods)
    (extra / "play.html").write_text(text, encoding="utf-8")
    return LIVE


def write_pages(folder):
    """Write all generated pages."""
    folder.mkdir(parents=True, exist_ok=True)
    live = live_page(folder / "extra")
    (folder / "live.md").write_text(live, encoding="utf-8")
    for name, page in (("keys", keys_page), ("commands", commands_page)):
        (folder / f"{name}.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    write_pages(Path(sys.argv[1]))
