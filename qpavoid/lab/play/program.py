"""The package as WebAssembly: as it was built, else from the cache, else made now."""

from typing import NamedTuple


class Program(NamedTuple):
    """The functions of the package as a browser runs them.

    Attributes:
        module: WebAssembly.
        script: The JavaScript that calls it.
    """

    module: bytes
    script: str
