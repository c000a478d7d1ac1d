"""Values that a scenario is written in, and `Part`, of which all its models are.

A value is a type with the checks that go with it; its errors say what came and what is expected.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Strict,
    Tag,
    ValidationError,
    model_validator,
)

from bug_gym.field_texts import texts_under_fields
from bug_gym.limits import (
    BEAM_BYTES,
    CELL_BYTES,
    CORNER_BYTES,
    DRIFT,
    EPOCH,
    FAR,
    FAST,
    FASTEST_TURN,
    HEAVY,
    LONG,
    LONGEST_STEP,
    MOST,
    MOST_BEAMS,
    MOST_CELLS,
    MOST_CORNERS,
    MOST_EPISODES,
    MOST_OBSTACLES,
    MOST_ROBOTS,
    MOST_SAMPLES,
    MOST_WIDTH,
    OBSTACLE_BYTES,
    PEER_BYTES,
    ROW_BYTES,
    SAMPLE_BYTES,
    SMALL,
    STEEP,
    STEEPEST_STEERING,
    STRONG,
    WEIGHT_BYTES,
    told_bytes,
)
from bug_gym.naming import nearest_hint
from bug_gym.schema.errors import ScenarioError, shortened, wrong
from bug_gym.schema.faults import explain
from bug_gym.schema.ranges import MAY_BE_DRAWN, MAY_BE_DRAWN_LEAST

CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Characters that end a line, or tell a terminal what to do; and halves of characters, which no file can hold."""


def _sequence(names: str) -> BeforeValidator:
    """Checks that a list has as many items as `names` has, so that the error can say what they are."""
    expected = len(names.split(","))

    def check(value: object) -> object:
        if not isinstance(value, (list, tuple)) or len(value) != expected:
            raise wrong(f"got {shortened(value)}, expected [{names}]")
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
    if min(xmax - xmin, ymax - ymin) < SMALL:
        raise wrong(f"got {list(value)}, expected sides of at least {SMALL:g}")
    return value


def _existing(value: str) -> str:
    path = existing_path(value)
    if path is None:
        raise wrong(f"got {shortened(value, 300)}, expected a file or folder that exists")
    return str(path)


def _one_line(value: str) -> str:
    if CONTROL.search(value):
        raise wrong(f"got {shortened(value)}, expected one line without control characters")
    return value


def existing_path(text: object) -> Path | None:
    """The absolute path that a text names, None where nothing is there."""
    if not isinstance(text, str):
        return None
    try:
        path = Path(text).expanduser().absolute()
        return path if path.exists() else None
    except (OSError, ValueError, RuntimeError):  # too long, with a zero byte, or of a user whom nobody knows
        return None


def not_tiny(value: float) -> float:
    """The value, where it is no number whose squares and quotients are lost."""
    if value < SMALL:
        raise wrong(f"got {value:g}, expected at least {SMALL:g}")
    return value


def _takes(most: int, bytes_of: Callable[[int], int], where: str) -> BeforeValidator:
    """Checks a count against the most that there may be; the error says what memory so many would take, and where."""

    def check(value: object) -> object:
        if isinstance(value, int) and not isinstance(value, bool) and value > most:
            memory = f"so many would take {told_bytes(bytes_of(value))} {where}"
            raise wrong(f"got {shortened(value)}, expected at most {most:,}: {memory}")
        return value

    return BeforeValidator(check)


# Every number has limits (bug_gym.limits says why these): within them the state stays finite, whatever the actions.
Number = Annotated[float, Strict(), Field(ge=-FAR, le=FAR)]
"""A coordinate or a difference of two [m]."""
Angle = Annotated[float, Strict(), Field(ge=-STEEP, le=STEEP)]
Positive = Annotated[float, Strict(), Field(gt=0.0, le=FAR), AfterValidator(not_tiny)]
"""A length that is not 0 [m]."""
NotNegative = Annotated[float, Strict(), Field(ge=0.0, le=FAR)]
"""A length [m]."""
Duration = Annotated[float, Strict(), Field(gt=0.0, le=LONG), AfterValidator(not_tiny)]
StepTime = Annotated[float, Strict(), Field(gt=0.0, le=LONGEST_STEP), AfterValidator(not_tiny)]
Moment = Annotated[float, Strict(), Field(ge=-EPOCH, le=EPOCH)]
"""A time on some clock [s]."""
Speed = Annotated[float, Strict(), Field(ge=0.0, le=FAST)]
TopSpeed = Annotated[float, Strict(), Field(gt=0.0, le=FAST), AfterValidator(not_tiny)]
TurnRate = Annotated[float, Strict(), Field(gt=0.0, le=FASTEST_TURN), AfterValidator(not_tiny)]
Steering = Annotated[float, Strict(), Field(gt=0.0, le=STEEPEST_STEERING), AfterValidator(not_tiny)]
"""An angle of steered wheels from straight ahead [rad]."""
Acceleration = Annotated[float, Strict(), Field(gt=0.0, le=STRONG), AfterValidator(not_tiny)]
Factor = Annotated[float, Strict(), Field(ge=1.0, le=STRONG)]
Noise = Annotated[float, Strict(), Field(ge=0.0, le=DRIFT)]
Bias = Annotated[float, Strict(), Field(ge=-DRIFT, le=DRIFT)]
Weight = Annotated[float, Strict(), Field(ge=-HEAVY, le=HEAVY)]
Coefficient = Annotated[float, Strict(), Field(gt=0.0, le=HEAVY)]
"""A number of a training that is not 0 [1]."""
Share = Annotated[float, Strict(), Field(ge=0.0, le=1.0)]

# The same numbers where they may be drawn for each episode.
DrawnLength = Annotated[Positive, *MAY_BE_DRAWN]
DrawnLeastLength = Annotated[NotNegative, *MAY_BE_DRAWN_LEAST]
DrawnSpread = Annotated[NotNegative, *MAY_BE_DRAWN]
DrawnTopSpeed = Annotated[TopSpeed, *MAY_BE_DRAWN]
DrawnSpeed = Annotated[Speed, *MAY_BE_DRAWN]
DrawnTurnRate = Annotated[TurnRate, *MAY_BE_DRAWN]
DrawnSteering = Annotated[Steering, *MAY_BE_DRAWN]
DrawnAcceleration = Annotated[Acceleration, *MAY_BE_DRAWN_LEAST]
DrawnNoise = Annotated[Noise, *MAY_BE_DRAWN]
DrawnBias = Annotated[Bias, *MAY_BE_DRAWN]
DrawnShare = Annotated[Share, *MAY_BE_DRAWN]
Count = Annotated[int, Strict(), Field(ge=0, le=MOST)]
AtLeastOne = Annotated[int, Strict(), Field(ge=1, le=MOST)]
Steps = Annotated[int, Strict(), Field(ge=1, le=1000 * MOST)]
"""Steps of environments."""
Beams = Annotated[
    int, Strict(), Field(ge=1, le=MOST_BEAMS), _takes(MOST_BEAMS, lambda beams: BEAM_BYTES * beams, "for each robot")
]
RobotCount = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_ROBOTS),
    _takes(MOST_ROBOTS, lambda robots: PEER_BYTES * robots**2, "in each world, for each sees all others"),
]
Obstacles = Annotated[
    int,
    Strict(),
    Field(ge=0, le=MOST_OBSTACLES),
    _takes(MOST_OBSTACLES, lambda count: OBSTACLE_BYTES * count, "in each world"),
]
Streams = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_OBSTACLES),
    _takes(MOST_OBSTACLES, lambda count: OBSTACLE_BYTES * count, "in each world"),
]
Lines = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_CELLS),
    _takes(MOST_CELLS, lambda count: CELL_BYTES * count, "in each world"),
]
"""Rows or columns of cells; `check_cells` looks at their product."""
Episodes = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_EPISODES),
    _takes(MOST_EPISODES, lambda count: ROW_BYTES * count, "in rows"),
]
Samples = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_SAMPLES),
    _takes(MOST_SAMPLES, lambda count: SAMPLE_BYTES * count, "of memory"),
]
"""Observations with what became of them, of which a training learns."""
Width = Annotated[
    int,
    Strict(),
    Field(ge=1, le=MOST_WIDTH),
    _takes(MOST_WIDTH, lambda count: WEIGHT_BYTES * count**2, "between two layers"),
]
"""Neurons of a layer."""
Flag = Annotated[bool, Strict()]
Name = Annotated[str, AfterValidator(_one_line)]
"""What something is called, in tables, in comments of files and on the terminal."""
GivenName = Annotated[str, Field(min_length=1), AfterValidator(_one_line)]
"""A name that is not empty."""
ExistingPath = Annotated[str, AfterValidator(_existing)]

Point = Annotated[tuple[Number, Number], _sequence("x, y")]
VelocityPart = Annotated[float, Strict(), Field(ge=-FAST, le=FAST)]
Velocity = Annotated[tuple[VelocityPart, VelocityPart], _sequence("vx, vy")]
Pose = Annotated[tuple[Number, Number, Angle], _sequence("x, y, heading")]
Record = Annotated[tuple[Moment, Number, Number], _sequence("time, x, y")]
Disc = Annotated[tuple[Number, Number, Positive], _sequence("x, y, radius")]
Box = Annotated[
    tuple[Number, Number, Number, Number],
    _sequence("xmin, ymin, xmax, ymax"),
    BeforeValidator(_not_corners),
    AfterValidator(_box),
]
Speeds = Annotated[tuple[Speed, Speed], _sequence("least, most"), AfterValidator(_increasing)]
AtLeastThree = Annotated[
    int,
    Strict(),
    Field(ge=3, le=MOST_CORNERS),
    _takes(MOST_CORNERS, lambda count: CORNER_BYTES * count, "for each obstacle"),
]
CornerCounts = Annotated[tuple[AtLeastThree, AtLeastThree], _sequence("least, most"), AfterValidator(_increasing)]
Sizes = Annotated[tuple[Positive, Positive], _sequence("least, most"), AfterValidator(_increasing)]
Shares = Annotated[tuple[Share, Share], _sequence("least, most"), AfterValidator(_increasing)]
Rounds = Annotated[int, Strict(), Field(ge=0, le=100)]
"""How often something is done over in making a world."""
RoundCounts = Annotated[tuple[Rounds, Rounds], _sequence("least, most"), AfterValidator(_increasing)]
Neighbours = Annotated[int, Strict(), Field(ge=0, le=9)]
"""How many of the eight cells about a cell are full; 9: never so many."""
Window = Annotated[tuple[Moment, Moment], _sequence("first, last"), AfterValidator(_increasing)]


class Part(BaseModel):
    """A part of a scenario: frozen; an unknown key is an error that names the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True, allow_inf_nan=False)

    def __init__(self, /, **data: Any) -> None:
        """Make one from Python.

        Raises:
            ScenarioError: what a file that said the same would be refused for, in the same words.
        """
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise ScenarioError(explain(error, type(self).__name__)) from None

    # As pydantic's own: what is validated as a part of another part is not made by it, so that its faults keep their place.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="before")
    @classmethod
    def _keys_are_right(cls, data: object) -> object:
        if isinstance(data, Mapping):
            for key in data:
                if key not in cls.model_fields:
                    known = ", ".join(cls.model_fields)
                    shown = key if isinstance(key, str) and key.isprintable() else repr(key)
                    raise wrong(f"unknown key{nearest_hint(key, cls.model_fields)} (known here: {known})", shown)
            for key, field in cls.model_fields.items():
                if field.is_required() and key not in data:
                    raise wrong(f"missing: {cls.meanings().get(key, 'it has no default')}", key)
        return data

    @classmethod
    def meanings(cls) -> dict[str, str]:
        """What its keys mean, with their units; a key under which nothing is written is missing."""
        said = {key: field.description for key, field in cls.model_fields.items() if field.description}
        return said | texts_under_fields(base for base in reversed(cls.__mro__) if issubclass(base, Part))


PartT = TypeVar("PartT", bound=Part)


def unsaid(part: PartT, key: str) -> PartT:
    """The part with a value marked as one that follows from others: nobody has said it, so `load` finds it anew."""
    part.model_fields_set.discard(key)
    return part


class Region(Part):
    """A rectangle to draw a point from, evenly over what is free in it."""

    region: Box
    """xmin, ymin, xmax, ymax [m]."""


class StartRegion(Region):
    """A rectangle to draw a start from."""

    heading: Angle | None = None
    """Heading at the start [rad]; none: drawn, any is as likely as another."""


def _fixed_or_drawn(value: object) -> str:
    return "<drawn>" if isinstance(value, (Mapping, Region)) else "<fixed>"


# Tags in angle brackets mark the branches of a union; they are no keys, and errors leave them out.
Start = Annotated[
    Annotated[Pose, Tag("<fixed>")] | Annotated[StartRegion, Tag("<drawn>")], Discriminator(_fixed_or_drawn)
]
Goal = Annotated[Annotated[Point, Tag("<fixed>")] | Annotated[Region, Tag("<drawn>")], Discriminator(_fixed_or_drawn)]


Rotation = Annotated[
    Annotated[Angle, Tag("<angle>")] | Annotated[Literal["random"], Tag("<random>")],
    Discriminator(lambda value: "<random>" if isinstance(value, str) else "<angle>"),
]


def tags(union: Any, discriminator: str) -> list[str]:
    """The names that a discriminated union of parts knows."""
    members = get_args(get_args(union)[0])
    return [str(get_args(member.model_fields[discriminator].annotation)[0]) for member in members]
