"""The C compiler of the tests, and extension modules that are loaded from a file."""

import importlib.util
import shutil

COMPILER = shutil.which("gcc") or shutil.which("cc")

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Werror")


def loaded(file):
    """An extension module of a file."""
    spec = importlib.util.spec_from_file_location("_native", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
