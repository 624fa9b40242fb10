"""Every relative link of every Markdown file leads somewhere, as GitHub renders it."""

import re
from pathlib import PurePosixPath

import pytest

from places import ROOT

UNLOOKED = {"out", "build", "dist", "node_modules"}
FILES = sorted(
    path
    for path in [*ROOT.rglob("*.md"), *(ROOT / ".github").rglob("*.md")]
    if not UNLOOKED & set(path.relative_to(ROOT).parts)
    and not any(part.startswith(".venv") for part in path.parts)
)
FENCE = re.compile(r"^ *(```+|~~~+|:::+).*?^ *\1 *$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^()\s]+)\)")


def slug(heading):
    """Anchor that GitHub makes of a heading."""
    shown = LINK.sub(r"\1", heading).replace("`", "")
    return re.sub(r"[^\w\- ]", "", shown.strip().lower()).replace(" ", "-")


def anchors(text):
    text, found = (
        FENCE.sub("", text),
        set(re.findall(r'<a (?:id|name)=["\x27]([^"\x27]+)', text)),
    )
    for heading in re.findall(r"^#{1,6} +(.+?)#*$", text, re.MULTILINE):
        name, number = slug(heading), 0
        while (one := f"{name}-{number}" if number else name) in found:
            number += 1
        found.add(one)
    return found


def dead(path):
    """Yield the links of a file that lead nowhere, or that have no words."""
    text = re.sub(r"`[^`]*`", "code", FENCE.sub("", path.read_text()))
    for words, link in LINK.findall(text):
        target, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", target):
            continue
        file = path.parent / PurePosixPath(target) if target else path
        there = file.exists() and (not anchor or anchor in anchors(file.read_text()))
        if not there or not words.strip():
            yield link


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_somewhere(path):
    assert not [*dead(path)]


def test_a_dead_link_is_found(tmp_path):
    (tmp_path / "b.md").write_text("# A `b` (c), d\n# Twice\n# Twice\n<a id='x'></a>\n")
    good = (
        "[a](b.md) [b](b.md#a-b-c-d) [c](b.md#twice-1) [d](b.md#x) [e](https://e.org)"
    )
    bad = "[a](c.md) [b](b.md#twice-2) [c](#nothing) [](b.md)"
    (tmp_path / "a.md").write_text(f"{good}\n```\n[a](gone.md)\n```\n{bad}\n")
    found = ["c.md", "b.md#twice-2", "#nothing", "b.md"]
    assert [*dead(tmp_path / "a.md")] == found
