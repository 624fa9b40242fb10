"""Compiled functions translated to C, compiled, and called like the Python ones."""

import ctypes
import shutil
import subprocess

import numpy as np

from qpavoid.export.translate import Translation
from qpavoid.export.values import Value


def in_c(folder, function, **arguments):
    """Return a function that calls the C of one that returns a tuple of numbers."""
    kinds = {"f": "double", "i": "int", "v": "vector"}
    values, made, types, shapes = [], [], [], []
    for name, kind in arguments.items():
        values.append(Value(kinds[kind], name))
        types.append(kind)
        if kind == "v":
            made.append(f"double *{name}_at, int {name}_n")
            shapes.append(f"    vector {name} = {{{name}_at, {name}_n}};")
            shapes.append(f"    (void){name};")
        else:
            made.append(f"{kinds[kind]} {name}")
            shapes.append(f"    (void){name};")
    unit = Translation()
    call = unit.call(function, values)
    parts = unit.structs[call.kind].parts
    outs = [f"    out[{i}] = r.{part.text};" for i, part in enumerate(parts)]
    source = "\n".join(
        [
            "#include <math.h>\n#include <stdbool.h>\n#include <stdlib.h>",
            unit.text,
            f"void ask({', '.join([*made, 'double *out'])})\n{{",
            *shapes,
            f"    const {call.kind} r = {call.text};",
            *outs,
            "}",
        ]
    )
    (folder / "c.c").write_text(source)
    flags = ["-std=c99", "-O2", "-ffp-contract=off", *STRICT, "-shared", "-fPIC"]
    command = [COMPILER, *flags, "c.c", "-o", "c.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "c.so"))

    def ask(*given):
        numbers = []
        for kind, one in zip(types, given, strict=True):
            if kind == "v":
                numbers += [one.ctypes.data_as(ctypes.c_void_p), one.shape[0]]
            else:
                numbers.append({"f": ctypes.c_double, "i": ctypes.c_int}[kind](one))
        out = np.empty(len(parts))
        library.ask(*numbers, out.ctypes.data_as(ctypes.c_void_p))
        return out

    return ask


def same(one, other):
    """Say whether two results are the same to the last bit; all NaN are the same."""
    one, other = np.asarray(one, float), np.asarray(other, float)
    return one.tobytes() == other.tobytes() or np.array_equal(one, other, True)


def draws():
    """Yield random numbers by name."""
    rng = np.random.default_rng(1)
    for _ in range(300):
        x, y = rng.uniform(-3.0, 3.0, 2)
        n, m = (int(k) for k in rng.integers(-7, 8, 2))
        yield {"x": x, "y": y, "n": n, "m": m or 1, "rng": rng}


COMPILER = shutil.which("gcc") or shutil.which("cc")

STRICT = ("-Wall", "-Wextra", "-pedantic", "-Werror")
