"""One HTML file from its parts; all data stands in it as JSON, and as text only.

Its policy lets run the scripts that were put into it, known by their hashes, and
nothing else: no script in an attribute or in data, no connection to anywhere.
"""

import hashlib
import json
from base64 import b64encode
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

SCRIPTS = "dom tables report".split()
POLICY = (
    "default-src 'none'; script-src {}; style-src 'unsafe-inline'; "
    "img-src data: blob:; base-uri 'none'; form-action 'none'"
)
"""Styles stay free: scripts set them on their elements."""


def report_page(title: str, data: object) -> str:
    """Return the page of a study."""
    scripts = [part(f"{name}.js") for name in SCRIPTS]
    return Template(part("page.html")).substitute(
        title=escape(title),
        policy=POLICY.format(" ".join(map(_hash, scripts))),
        style=part("style.css") + part("report.css"),
        data=as_json(data),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts),
    )


def _hash(script: str) -> str:
    """Return how a policy names a script."""
    # A browser hashes what it has read, in which every end of line is one "\n".
    read = script.replace("\r\n", "\n").replace("\r", "\n")
    return f"'sha256-{b64encode(hashlib.sha256(read.encode()).digest()).decode()}'"


def part(name: str) -> str:
    """Return the text of a file beside this one."""
    return (files(__package__) / name).read_text(encoding="utf-8")


def as_json(data: Any) -> str:
    """Return JSON that no HTML can hide in, NaN and infinities as ``null``."""
    text = json.dumps(_finite(data), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _finite(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    if isinstance(data, float) and not abs(data) < float("inf"):
        return None
    return data
