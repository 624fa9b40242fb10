"""Rows of a report, and a page unpacked again."""

import base64
import gzip
import math

import numpy as np

HOSTILE = 'A </script><script>boom()</script> <b>disc</b> & "quotes"'


def row(controller="qp", success=True, **more):
    return {
        "run": f"{controller}-{more.get('seed', 0)}",
        "scenario": "s",
        "seed": 0,
        "controller": controller,
        "solver": "exact",
        "outcome": "arrived" if success else "stalled",
        "success": success,
        "contact": False,
        "arrived_s": 4.0 if success else None,
        "min_clearance_m": 0.2,
        **more,
    }


def unpacked(packed):
    raw, offset, found = gzip.decompress(base64.b64decode(packed["data"])), 0, {}
    for name, shape, kind in packed["parts"]:
        size = math.prod(shape) * np.dtype(kind).itemsize
        found[name] = np.frombuffer(raw[offset : offset + size], f"<{kind}")
        found[name] = found[name].reshape(shape)
        offset += size
    assert offset == len(raw)
    return found
