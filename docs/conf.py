"""Sphinx settings: furo, MyST, and pages generated from the declarations.

python -m sphinx -W -b html docs out/docs
"""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
sys.path.insert(0, str(HERE.parent))


def prepare_tutorials():
    """Let the tutorials' kernels use this package, and begin with startup.py."""
    profile = Path(tempfile.mkdtemp()) / "profile_default" / "startup"
    profile.mkdir(parents=True)
    shutil.copy(HERE / "startup.py", profile)
    os.environ["IPYTHONDIR"] = str(profile.parents[1])
    for name, first in (
        ("PYTHONPATH", HERE.parent),
        ("PATH", Path(sys.executable).parent),
    ):
        paths = [str(first), *filter(None, [os.environ.get(name)])]
        os.environ[name] = os.pathsep.join(paths)


from make_pages import write_pages  # noqa: E402

project = "qpavoid"
author = "The qpavoid developers"
copyright = author
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "paper", "generated/live.md"]
html_extra_path = ["generated/extra"]
html_theme = "furo"
html_title = "qpavoid"
html_copy_source = False
html_show_sphinx = False
myst_heading_anchors = 3
autodoc_mock_imports = ["gymnasium", "pettingzoo"]  # of the extra gym
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s: the first start compiles
nb_merge_streams = True
myst_enable_extensions = ["colon_fence"]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_use_ivar = True
suppress_warnings = ["myst.xref_missing", "myst.header"]


PAGES = {
    HERE.parent / "comparisons/README.md": "all-comparisons.md",
    HERE.parent / "comparisons/paper/README.md": "paper-statements.md",
}
LINK = re.compile(r"(?<!!)\[([^]]+)\]\(([^():#\s]+)(#[^)\s]*)?\)")


def on_site(text, folder):
    """Return Markdown of a folder with links to pages of the site; others are text."""

    def link(found):
        words, target, anchor = found.groups()
        path = Path(os.path.normpath(folder / target))
        if path in PAGES:
            return f"[{words}]({PAGES[path]}{anchor or ''})"
        if HERE not in path.parents:
            return words
        return f"[{words}]({os.path.relpath(path, HERE)}{anchor or ''})"

    return LINK.sub(link, text)


def on_read(app, name, source):
    """Adapt the links of a page, all of which are in this folder or are generated."""
    source[0] = on_site(source[0], HERE)


def on_include(app, path, page, source):
    """Adapt the links of an included file, as of the comparisons."""
    source[0] = on_site(source[0], (HERE / path).parent)


def plain_bars(app, what, name, obj, options, lines):
    """Escape what docstrings mean as |v|, and reStructuredText as a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    """Write the generated pages, prepare the tutorials, then let Sphinx read."""
    prepare_tutorials()
    write_pages(HERE / "generated")
    app.connect("source-read", on_read)
    app.connect("include-read", on_include)
    app.connect("autodoc-process-docstring", plain_bars, priority=900)
