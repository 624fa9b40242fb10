"""First commands of the tutorials' kernels; a reader's own IPython does without.

Figures are drawn as SVG, and ``%%sh`` ends a page with an error where a command of it
does, and prints what it printed in one piece.
"""

import os
import subprocess

from IPython import get_ipython
from IPython.core.magic import register_cell_magic

shell = get_ipython()
shell.run_line_magic("matplotlib", "inline")
shell.run_line_magic("config", "InlineBackend.figure_formats = ['svg']")
os.environ |= {"FORCE_COLOR": "", "COLUMNS": "100"}


@register_cell_magic
def sh(line, cell):
    """Run commands, and show what they print."""
    done = subprocess.run(
        ["sh", "-e"],
        input=cell,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    print(done.stdout, end="")
    done.check_returncode()
