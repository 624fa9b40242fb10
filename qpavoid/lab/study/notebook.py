"""The replay in a notebook."""

from collections.abc import Sequence
from html import escape
from importlib import import_module
from typing import Any

from qpavoid.errors import MissingExtraError
from qpavoid.lab.simulation.log import Log
from qpavoid.lab.study.report.page import replay_page
from qpavoid.lab.study.report.payload import pack_group
from qpavoid.lab.study.scene import first_of
from qpavoid.lab.study.style import styles


def show(logs: Log | Sequence[Log], height: int = 900) -> Any:
    """Return the replay of one run, or of several side by side, for Jupyter.

    Args:
        logs: A log, or logs of one scenario. Those of ``run(…, explain=True)`` show
            the rows of the QP too.
        height: Of the frame, pixels.

    Raises:
        InvalidInputError: No logs, or logs of several scenarios.
        MissingExtraError: IPython is not installed.
    """
    logs = [logs] if isinstance(logs, Log) else list(logs)
    title = str(first_of(logs).meta["title"])
    try:
        html = import_module("IPython.display").HTML
    except ImportError:
        raise MissingExtraError("IPython", "notebook") from None
    looks = enumerate(zip(styles(logs), logs, strict=True))
    named = [(str(i), style.label, log) for i, (style, log) in looks]
    page = replay_page(title, {"groups": [pack_group(named)], "left_out": 0})
    frame = (
        f'<iframe title="Replay" srcdoc="{escape(page)}" width="100%" '
        f'height="{int(height)}" style="border:0"></iframe>'
    )
    return html(f"<div>{frame}</div>")
