"""Values that a scenario is written in, and `Part`, of which all its models are.

A value is a type with the checks that go with it; its errors say what came and what is expected.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    model_validator,
)

from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import wrong


def _sequence(names: str) -> BeforeValidator:
    """Checks that a list has as many items as `names` has, so that the error can say what they are."""
    expected = len(names.split(","))

    def check(value: object) -> object:
        if not isinstance(value, (list, tuple)) or len(value) != expected:
            raise wrong(f"got {value!r}, expected [{names}]")
        return value

    return BeforeValidator(check)


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise wrong(f"got {list(value)}, expected [least, most]")
    return value


def _not_corners(value: object) -> object:
    if box_or_corners(value) == "<corners>":
        raise wrong("got a polygon, expected a box [xmin, ymin, xmax, ymax]: this family has no other border")
    return value


def box_or_corners(value: object) -> str:
    """The branch of `Bounds` that a value is meant for."""
    return "<corners>" if isinstance(value, (list, tuple)) and value and _is_list(value[0]) else "<box>"


def _is_list(value: object) -> bool:
    return isinstance(value, (list, tuple))


def _box(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = value
    if not (xmin < xmax and ymin < ymax):
        reason = f"got {list(value)}, expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax"
        raise wrong(reason)
    return value


def _existing(value: str) -> str:
    path = Path(value).expanduser().absolute()
    if not path.exists():
        raise wrong(f"got {value!r}, expected a file or folder that exists")
    return str(path)


Number = Annotated[float, Strict()]
Positive = Annotated[float, Strict(), Field(gt=0.0)]
NotNegative = Annotated[float, Strict(), Field(ge=0.0)]
Share = Annotated[float, Strict(), Field(ge=0.0, le=1.0)]
Count = Annotated[int, Strict(), Field(ge=0)]
AtLeastOne = Annotated[int, Strict(), Field(ge=1)]
Flag = Annotated[bool, Strict()]
ExistingPath = Annotated[str, AfterValidator(_existing)]

Point = Annotated[tuple[Number, Number], _sequence("x, y")]
Velocity = Annotated[tuple[Number, Number], _sequence("vx, vy")]
Pose = Annotated[tuple[Number, Number, Number], _sequence("x, y, heading")]
Record = Annotated[tuple[Number, Number, Number], _sequence("time, x, y")]
Disc = Annotated[tuple[Number, Number, Positive], _sequence("x, y, radius")]
Box = Annotated[
    tuple[Number, Number, Number, Number],
    _sequence("xmin, ymin, xmax, ymax"),
    BeforeValidator(_not_corners),
    AfterValidator(_box),
]
Interval = Annotated[tuple[NotNegative, NotNegative], _sequence("least, most"), AfterValidator(_increasing)]
AtLeastThree = Annotated[int, Strict(), Field(ge=3)]
CornerCounts = Annotated[tuple[AtLeastThree, AtLeastThree], _sequence("least, most"), AfterValidator(_increasing)]
Sizes = Annotated[tuple[Positive, Positive], _sequence("least, most"), AfterValidator(_increasing)]
Window = Annotated[tuple[Number, Number], _sequence("first, last"), AfterValidator(_increasing)]


class Part(BaseModel):
    """A part of a scenario: frozen; an unknown key is an error that names the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _keys_are_right(cls, data: object) -> object:
        if isinstance(data, Mapping):
            for key in data:
                if key not in cls.model_fields:
                    known = ", ".join(cls.model_fields)
                    raise wrong(f"unknown key{nearest_hint(key, cls.model_fields)} (known here: {known})", str(key))
            for key, field in cls.model_fields.items():
                if field.is_required() and key not in data:
                    raise wrong(f"missing: {field.description}", key)
        return data


class Region(Part):
    """A rectangle to draw a point from, evenly over what is free in it."""

    region: Box
    """xmin, ymin, xmax, ymax [m]."""


class StartRegion(Region):
    """A rectangle to draw a start from."""

    heading: Number | None = None
    """Heading at the start [rad]; none: drawn, any is as likely as another."""


def _fixed_or_drawn(value: object) -> str:
    return "<drawn>" if isinstance(value, (Mapping, Region)) else "<fixed>"


# Tags in angle brackets mark the branches of a union; they are no keys, and errors leave them out.
Start = Annotated[
    Annotated[Pose, Tag("<fixed>")] | Annotated[StartRegion, Tag("<drawn>")], Discriminator(_fixed_or_drawn)
]
Goal = Annotated[Annotated[Point, Tag("<fixed>")] | Annotated[Region, Tag("<drawn>")], Discriminator(_fixed_or_drawn)]


Rotation = Annotated[
    Annotated[Number, Tag("<angle>")] | Annotated[Literal["random"], Tag("<random>")],
    Discriminator(lambda value: "<random>" if isinstance(value, str) else "<angle>"),
]


def tags(union: Any, discriminator: str) -> list[str]:
    """The names that a discriminated union of parts knows."""
    members = get_args(get_args(union)[0])
    return [str(get_args(member.model_fields[discriminator].annotation)[0]) for member in members]
