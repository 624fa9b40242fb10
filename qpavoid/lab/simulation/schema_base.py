"""Common part of all models of files: strictness, numbers, units of keys."""

import math
import re
from collections.abc import Sequence
from inspect import cleandoc
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Natural = Annotated[int, Field(ge=0, le=10**15)]
Point = tuple[Finite, Finite]
Place = Annotated[str, Field(pattern=r"^[\w.]+:[\w.]+$")]

UNITS = {
    "rad_per_m2": "rad/m²",
    "per_s": "1/s",
    "mps2": "m/s²",
    "radps2": "rad/s²",
    "mps3": "m/s³",
    "mps": "m/s",
    "radps": "rad/s",
    "rad": "rad",
    "hz": "Hz",
    "nm": "N m",
    "m2": "m²",
    "kg": "kg",
    "m": "m",
    "s": "s",
}
"""Units by the suffix of a key, longest first."""


def ordered(lows: Sequence[float], highs: Sequence[float]) -> None:
    """Raise ValueError unless numbers can be drawn between these bounds."""
    gaps = [high - low for low, high in zip(lows, highs, strict=True)]
    if min(gaps) < 0.0:
        raise ValueError("a low bound lies above its high bound")
    if not math.isfinite(max(gaps)):
        raise ValueError("a low bound lies too far below its high bound")


def attributes_of(kind: type) -> dict[str, str]:
    """Return what the docstrings of a class and its bases say of each attribute."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        text = cleandoc(each.__doc__ or "").partition("Attributes:\n")[2]
        for name, said in re.findall(r"^    (\w+): (.*(?:\n {5,}.*)*)", text, re.M):
            found[name] = plain(said)
    return found


def plain(text: str) -> str:
    """Return a docstring's text on one line, with code in backticks."""
    words = " ".join(text.split()).replace("``", "`")
    return re.sub(r":\w+:`[~.]*([^`]*)`", r"`\1`", words)


class Strict(BaseModel):
    """No unknown keys, no guessing of types, no change afterwards."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the schema, with what the docstrings say of the keys."""
        found: dict[str, Any] = handler(core)
        body = handler.resolve_ref_schema(found)
        body["description"] = plain((cls.__doc__ or "").partition("\n\n")[0])
        said = attributes_of(cls)
        for key, value in body.get("properties", {}).items():
            value.pop("title", None)
            if key in said:
                value["description"] = said[key]
        return found
