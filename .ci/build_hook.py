"""Hatch's hook: the extension module is made while the wheel is built.

By the system's compiler, else by zig, which then is a requirement of the build. Where
neither works the wheel has none, the build says so, and numba compiles at run time.
Where zig is at hand, or QPAVOID_WASM asks for it, the wheel gets the program of the
live page too, as WebAssembly; else ``qpavoid play`` makes it when it is first wanted.
It lies beside what the project is tested by, for a robot wants nothing of it. Of the
package it imports what needs numpy alone.
"""

import os
import shutil
import sys
import sysconfig
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "qpavoid/_native.abi3.so"


class NativeHook(BuildHookInterface):
    """Makes ``qpavoid/_native`` of the functions that the ``modules`` declare."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Return zig where the system has no compiler."""
        build = self._package("qpavoid.export.build")
        enough = build.system_compiler() and not os.environ.get("QPAVOID_WASM")
        return [] if enough else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build the extension, and tag the wheel for it.

        Args:
            version: ``editable``: the extension is beside its sources alone, else in
                the wheel, too.
            build_data: Of hatch.
        """
        self._folder = Path(mkdtemp())
        if version != "editable":
            self._add_program(build_data)
        file = self._folder / Path(PLACE).name
        try:
            made = self._made(file)
        except Exception as error:  # of a compiler or of an import: any
            self.app.display_warning(
                f"qpavoid: no extension module, numba compiles instead: {error}"
            )
            return
        self.app.display_info(f"qpavoid: extension module made by {made}")
        with suppress(OSError):  # a tree that cannot be written
            # A Python that is started in this folder reads these sources, not the
            # wheel's. Renamed, not written into: somebody may be running the old one.
            near = Path(self.root) / f"{PLACE}.new"
            shutil.copyfile(file, near)
            near.replace(Path(self.root) / PLACE)
        if version != "editable":
            build_data["force_include"][str(file)] = PLACE
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform}"

    def _add_program(self, build_data: dict[str, Any]) -> None:
        """Put the live page's program into the wheel, where it can be made."""
        try:
            program = self._package("qpavoid.lab.play.program")
            program.build(self._folder / "page")
        except Exception as error:
            self.app.display_info(f"qpavoid: play makes its program later: {error}")
            return
        for name in program.FILES:
            place = f"qpavoid/lab/play/{program.BUILT.name}/{name}"
            build_data["force_include"][str(self._folder / "page" / name)] = place

    def finalize(self, version: str, build_data: dict[str, Any], artifact: str) -> None:
        """Remove what is in the wheel by now."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def _made(self, file: Path) -> str:
        """Make the file, and return by what."""
        stable = not sysconfig.get_config_var("Py_GIL_DISABLED")
        if sys.implementation.name != "cpython" or not stable:
            raise RuntimeError("it is for the stable ABI of CPython")
        for module in self.config["modules"]:
            self._package(module)
        made: str = self._package("qpavoid.export.extension").build_extension(file)
        return made

    def _package(self, module: str) -> Any:
        """Return a module of the tree that is built."""
        if self.root not in sys.path:
            sys.path.insert(0, self.root)
        return import_module(module)
