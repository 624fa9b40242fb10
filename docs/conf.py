"""Sphinx settings: furo, MyST, and pages generated from the declarations.

python -m sphinx -W -b html docs out/docs
"""

import os
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


def own_pages(app, name, source):
    """Lead to a page of the site where one is made of a file outside of docs/."""
    for file, page in (
        ("comparisons/README.md", "all-comparisons.md"),
        ("comparisons/paper/README.md", "paper-statements.md"),
    ):
        source[0] = source[0].replace(f"](../{file}", f"]({page}")


def plain_bars(app, what, name, obj, options, lines):
    """Escape what docstrings mean as |v|, and reStructuredText as a substitution."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    """Write the generated pages, prepare the tutorials, then let Sphinx read."""
    prepare_tutorials()
    write_pages(HERE / "generated")
    app.connect("source-read", own_pages)
    app.connect("autodoc-process-docstring", plain_bars, priority=900)
