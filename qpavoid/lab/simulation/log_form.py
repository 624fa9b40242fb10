"""Whether the content of a file is a log: its metadata and the shapes of its arrays."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from qpavoid.types import Array

Number = Annotated[float, Field(allow_inf_nan=False)]
Time = Annotated[float, Field(gt=0.0, lt=1e7)]
"""s; more than four months are no run."""

SHAPES = {
    "final": (3,),
    "final_reference": (5,),
    "discs": ("n", None, 3),
    "points": (None, 2),
    "walls": (None, 4),
    "vertices": (None, 2),
    "planes": ("n", None, 4),
    "corners": (None, None, 2),
    "polygons": (None,),
}
"""Of the arrays beside the columns: n steps, or any number."""


class Meta(BaseModel):
    """Metadata that every log has; others are kept as they are."""

    model_config = ConfigDict(strict=True)
    scenario: str
    title: str
    controller: str
    solver: str
    dt_s: Time
    duration_s: Time
    arrival: Annotated[list[Number], Field(min_length=2, max_length=2)]
    frames_s: list[Number]


def misfit(meta: Any, columns: Mapping[str, Array], arrays: Mapping[str, Array]) -> str:
    """Return what is wrong with the parts of a log; empty: nothing."""
    try:
        Meta.model_validate(meta)
    except ValidationError as error:
        return f"its metadata: {error.errors()[0]['loc']}"
    every = {**columns, **arrays}
    if text := next((name for name, x in every.items() if x.dtype.kind != "f"), ""):
        return f"{text} are no floating-point numbers"
    n = columns["t_s"].size
    if not n or any(x.shape != (n,) for x in columns.values()):
        return "columns that are empty, or of two lengths"
    for name, shape in SHAPES.items():
        wanted, found = [n if k == "n" else k for k in shape], arrays[name].shape
        fits = [k in (None, size) for k, size in zip(wanted, found, strict=False)]
        if len(found) != len(wanted) or not all(fits):
            return f"{name} of shape {found}"
    if len(arrays["vertices"]) < 3:
        return "a footprint of fewer than three corners"
    steps, corners, _ = arrays["corners"].shape
    sizes = arrays["polygons"]
    whole = (sizes >= 1.0).all() and (sizes % 1.0 == 0.0).all()
    if not whole or sizes.sum() != corners or (corners and steps != n):
        return "corners of no polygon"
    return ""
