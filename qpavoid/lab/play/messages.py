"""What a client may say: one strict model a message, nothing guessed."""

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError

from qpavoid.errors import InvalidInputError
from qpavoid.lab.simulation.config import problems_of
from qpavoid.lab.simulation.schema_base import Strict

MOST_BYTES = 4096
"""Of a message; a longer one ends its connection."""

Coordinate = Annotated[float, Field(ge=-1000, le=1000, allow_inf_nan=False)]
Number = Annotated[int, Field(ge=0, le=1_000_000)]
Word = Annotated[str, Field(max_length=40)]


class Drag(Strict):
    """Pull a disc to a place; to be repeated while it is held."""

    kind: Literal["drag"]
    disc: Number
    x_m: Coordinate
    y_m: Coordinate


class Release(Strict):
    """Let go of a disc."""

    kind: Literal["release"]
    disc: Number


class Add(Strict):
    """Put a new disc into the world."""

    kind: Literal["add"]
    x_m: Coordinate
    y_m: Coordinate
    radius_m: Annotated[float, Field(ge=0, le=5, allow_inf_nan=False)] = 0.2


class Remove(Strict):
    """Take a disc away."""

    kind: Literal["remove"]
    disc: Number


class Choose(Strict):
    """Let another controller drive."""

    kind: Literal["controller"]
    name: Word


class Set(Strict):
    """Change a setting, named as in a scenario file."""

    kind: Literal["set"]
    section: Word
    key: Word
    value: bool | float | Word


class Run(Strict):
    """Go on, or pause."""

    kind: Literal["run"]
    on: bool


class Restart(Strict):
    """Put the robot and all discs back to their start, at time 0."""

    kind: Literal["restart"]


class FollowReference(Strict):
    """Follow the scenario's reference, or park where the robot is."""

    kind: Literal["drive"]
    on: bool


class Record(Strict):
    """Restart and record, or end the recording."""

    kind: Literal["record"]
    on: bool


Message = (
    Drag
    | Release
    | Add
    | Remove
    | Choose
    | Set
    | Run
    | Restart
    | FollowReference
    | Record
)

_MESSAGE: Any = Annotated[Message, Field(discriminator="kind")]
_READER: TypeAdapter[Message] = TypeAdapter(_MESSAGE)


def read_message(text: str) -> Message:
    """Return the message that a text is.

    Raises:
        InvalidInputError: It is none; says what is wrong, in one line.
    """
    try:
        return _READER.validate_json(text)
    except ValidationError as error:
        raise InvalidInputError(next(problems_of(error, _MESSAGE))) from None
