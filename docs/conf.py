"""Sphinx's settings: furo, MyST, and pages that are made of the declarations.

python -m sphinx -W -b html docs out/docs
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))

from make_pages import write_pages  # noqa: E402

project = "qpavoid"
author = "The qpavoid developers"
copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "generated/live.md"]
html_extra_path = ["generated/extra"]
html_theme = "furo"
html_title = "qpavoid"
html_copy_source = False
html_show_sphinx = False
myst_heading_anchors = 3
myst_enable_extensions = ["colon_fence"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_use_ivar = True
suppress_warnings = ["myst.xref_missing", "myst.header"]


def plain_bars(app, what, name, obj, options, lines):
    """Escape what docstrings mean as |v|, and reStructuredText as a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    """Write the generated pages, then let Sphinx read."""
    write_pages(HERE / "generated")
    app.connect("autodoc-process-docstring", plain_bars, priority=900)
