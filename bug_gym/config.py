"""What a scenario is: the schema of its YAML files and of the dicts that say the same, and the loader that checks them.

Defaults live here, a YAML file holds the differences from them. Lengths are in metres, times in seconds, angles in
radians. To add a family of worlds, write one model with a `family` of its own and list it in `WorldFamily`; a motion
law likewise goes into `Motion`.
"""

from __future__ import annotations

import bisect
import math
import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar, get_args

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    Tag,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import ErrorDetails, PydanticCustomError

from bug_gym.naming import nearest_hint

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from bug_gym.recordings import Recording
    from bug_gym.ros_map import RosMap

SCENARIO_FOLDER = Path(__file__).parent / "configs" / "scenarios"
FULL_TURN = 2.0 * math.pi
FULL_TURN_TOLERANCE = 0.005  # a rounded 6.28 in a file still means the whole circle


class ScenarioError(ValueError):
    """A scenario that can't be: the message names the file, the key, what came and what is allowed."""


def _wrong(reason: str, key: str = "") -> PydanticCustomError:
    """An error about the value that is being validated, or about one `key` of it."""
    return PydanticCustomError("scenario", "{reason}", {"key": key, "reason": reason})


# ---------------------------------------------------------------------------------------------------------------------
# Numbers and places
# ---------------------------------------------------------------------------------------------------------------------


def _sequence(names: str) -> BeforeValidator:
    """Checks that a list has as many items as `names` has, so that the error can say what they are."""
    expected = len(names.split(","))

    def check(value: object) -> object:
        if not isinstance(value, (list, tuple)) or len(value) != expected:
            raise _wrong(f"got {value!r}, expected [{names}]")
        return value

    return BeforeValidator(check)


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if value[0] > value[1]:
        raise _wrong(f"got {list(value)}, expected [least, most]")
    return value


def _not_corners(value: object) -> object:
    if _box_or_corners(value) == "<corners>":
        raise _wrong("got a polygon, expected a box [xmin, ymin, xmax, ymax]: this family has no other border")
    return value


def _box_or_corners(value: object) -> str:
    return "<corners>" if isinstance(value, (list, tuple)) and value and _is_list(value[0]) else "<box>"


def _is_list(value: object) -> bool:
    return isinstance(value, (list, tuple))


def _box(value: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = value
    if not (xmin < xmax and ymin < ymax):
        reason = f"got {list(value)}, expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax"
        raise _wrong(reason)
    return value


def _existing(value: str) -> str:
    path = Path(value).expanduser().absolute()
    if not path.exists():
        raise _wrong(f"got {value!r}, expected a file or folder that exists")
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
                    raise _wrong(f"unknown key{nearest_hint(key, cls.model_fields)} (known here: {known})", str(key))
            for key, field in cls.model_fields.items():
                if field.is_required() and key not in data:
                    raise _wrong(f"missing: {field.description}", key)
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


def _ring(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Drops the repeated last point of a closed ring; at least three must be left."""
    if len(points) > 1 and points[0] == points[-1]:
        points = points[:-1]
    if len(points) < 3:
        reason = f"got {len(points)} corners, expected at least 3 points [x, y]"
        raise _wrong(reason)
    return points


Ring = Annotated[tuple[Point, ...], AfterValidator(_ring)]


def _simple(points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Raises where a ring crosses or touches itself."""
    import shapely

    _check_simple(shapely.Polygon(points))
    return points


def _check_simple(outline: BaseGeometry) -> None:
    """Raises where an outline is not that of a polygon, with the place of the fault."""
    import shapely

    if not shapely.is_valid(outline):
        fault = re.fullmatch(r"(.*)\[(\S+) (\S+)\]", shapely.is_valid_reason(outline))
        what, x, y = fault.groups() if fault else ("not valid", "?", "?")
        what = "crosses itself" if what.endswith("Self-intersection") else f"is not simple ({what})"
        raise _wrong(f"the polygon {what} at ({x}, {y})")


Bounds = Annotated[
    Annotated[Box, Tag("<box>")] | Annotated[Ring, AfterValidator(_simple), Tag("<corners>")],
    Discriminator(_box_or_corners),
]


class Polygon(Part):
    """A simple polygon, corners in either order. Without holes its list of corners is enough."""

    shell: Ring
    """Corners x, y [m], not closed."""
    holes: tuple[Ring, ...] = ()
    """Corners x, y [m] of each hole."""

    @model_validator(mode="before")
    @classmethod
    def _corners_are_enough(cls, data: object) -> object:
        return {"shell": data} if isinstance(data, (list, tuple)) else data

    @model_validator(mode="after")
    def _is_simple(self) -> Self:
        _check_simple(self.geometry())
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> Any:
        data = handler(self)
        return data if self.holes else data["shell"]

    def geometry(self, at: tuple[float, float] = (0.0, 0.0)) -> BaseGeometry:
        """The polygon as shapely's, moved by `at` [m]."""
        import shapely

        def moved(ring: tuple[tuple[float, float], ...]) -> list[tuple[float, float]]:
            return [(x + at[0], y + at[1]) for x, y in ring]

        return shapely.Polygon(moved(self.shell), [moved(hole) for hole in self.holes])


class WeightedRegion(Part):
    """Ground that is hard to cross: a robot whose centre is in it has its greatest speeds divided by the factor.

    Nothing else minds it: no beam, no contact, no mover. Where regions overlap the largest factor counts.
    """

    polygon: Polygon | None = None
    """Corners x, y [m], or `{shell, holes}`."""
    circle: Disc | None = None
    """x, y, radius [m], instead of `polygon`."""
    factor: Annotated[float, Strict(), Field(ge=1.0)]
    """What a metre in it costs, in metres of open ground [1]."""

    @model_validator(mode="after")
    def _has_one_outline(self) -> Self:
        if (self.polygon is None) == (self.circle is None):
            raise _wrong("expected either polygon: [[x, y], ...] or circle: [x, y, radius]", "polygon")
        return self

    def geometry(self) -> BaseGeometry:
        """The region as shapely's; a circle as a polygon of 256 corners."""
        import shapely

        if self.polygon is not None:
            return self.polygon.geometry()
        assert self.circle is not None
        x, y, radius = self.circle
        return shapely.Point(x, y).buffer(radius, quad_segs=64)


def _tags(union: Any, discriminator: str) -> list[str]:
    """The names that a discriminated union of parts knows."""
    members = get_args(get_args(union)[0])
    return [str(get_args(member.model_fields[discriminator].annotation)[0]) for member in members]


# ---------------------------------------------------------------------------------------------------------------------
# Motion laws
# ---------------------------------------------------------------------------------------------------------------------


class Bounce(Part):
    """Constant velocity, reflected by the border and by still obstacles."""

    law: Literal["bounce"]
    velocity: Velocity | None = None
    """Velocity at the start [m/s]."""
    speed: NotNegative | None = None
    """Speed in a direction that is drawn [m/s], instead of `velocity`."""

    @model_validator(mode="after")
    def _has_one_of_two(self) -> Self:
        if (self.velocity is None) == (self.speed is None):
            raise _wrong("expected either velocity: [vx, vy] or speed (the direction is drawn)", "velocity")
        return self


class Waypoints(Part):
    """From point to point in straight lines, through whatever stands there."""

    law: Literal["waypoints"]
    points: Annotated[tuple[Point, ...], Field(min_length=1)]
    """Places x, y [m] in the world, visited in order from where the body starts."""
    speed: NotNegative
    """Speed along the lines [m/s]."""
    stop: Flag = False
    """Whether it stands still at the last point; otherwise it goes on to the first."""


class RandomWalk(Part):
    """Straight legs in directions that are drawn, reflected as `bounce` is."""

    law: Literal["random_walk"]
    speed: NotNegative
    """Speed on every leg [m/s]."""
    min_leg: Positive = 1.0
    """Least duration of a leg [s]."""
    max_leg: Positive = 3.0
    """Greatest duration of a leg [s]."""

    @model_validator(mode="after")
    def _legs_are_ordered(self) -> Self:
        if self.min_leg > self.max_leg:
            raise _wrong(f"got {self.min_leg}, expected at most max_leg ({self.max_leg})", "min_leg")
        return self


class Crowd(Part):
    """Walks to its goals and gets out of the way: of others under this law, each doing half, and of the robots.

    Optimal reciprocal collision avoidance (van den Berg, Guy, Lin and Manocha 2011). Bodies of a crowd never touch one
    another, nor anything that stands, however little room there is; what moves under other laws they don't see. Where
    one is held up it turns to its right. A goal that takes too long (5 s and twice the straight way) is given up.
    """

    law: Literal["crowd"]
    speed: NotNegative
    """Greatest speed, at which it walks where nothing is in its way [m/s]."""
    horizon: Positive = 2.0
    """How far ahead it looks for contacts [s]."""
    goals: Annotated[tuple[Point, ...], Field(min_length=1)] | None = None
    """Places x, y [m] to walk to in turn, over and over; it stays at a single one. None: drawn, each as the one before
    is reached, over all that is free within the bounds."""


class Evade(Part):
    """Flees the nearest robot, along walls where they are in its way; in a corner it stands."""

    law: Literal["evade"]
    speed: NotNegative
    """Speed while it flees [m/s]."""
    sight: Positive = 5.0
    """Distance at which it sees a robot, through walls too [m]."""
    wander: NotNegative = 0.0
    """Speed while it sees none, in directions drawn for 2 s each [m/s]; 0: it stands."""

    @model_validator(mode="after")
    def _flees_no_slower(self) -> Self:
        if self.wander > self.speed:
            raise _wrong(f"got {self.wander:g}, expected at most speed ({self.speed:g})", "wander")
        return self


class Replay(Part):
    """Where it was at recorded times, straight between them; a mover is there from the first to the last of them."""

    law: Literal["replay"]
    points: Annotated[tuple[Record, ...], Field(min_length=1)]
    """Records: time since the start of the episode [s], x, y [m]; times rise, and may begin before 0."""

    @model_validator(mode="after")
    def _times_rise(self) -> Self:
        for index, (before, after) in enumerate(pairwise(self.points), start=1):
            if after[0] <= before[0]:
                raise _wrong(f"got time {after[0]:g}, expected more than {before[0]:g}", f"points.{index}")
        return self

    @property
    def speed(self) -> float:
        """Greatest speed between two records [m/s]."""
        return max((math.dist(a[1:], b[1:]) / (b[0] - a[0]) for a, b in pairwise(self.points)), default=0.0)

    def is_there(self, time: float) -> bool:
        """Whether a time [s] lies between the first and the last record."""
        return self.points[0][0] <= time <= self.points[-1][0]

    def place(self, time: float) -> tuple[float, float]:
        """Place x, y [m] at a time [s]; before the first record and after the last one that of these."""
        after = bisect.bisect_right(self.points, time, key=lambda record: record[0])
        if after in (0, len(self.points)):
            return self.points[min(after, len(self.points) - 1)][1:]
        (t0, x0, y0), (t1, x1, y1) = self.points[after - 1 : after + 1]
        share = (time - t0) / (t1 - t0)
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)


Body = TypeVar("Body", "Mover", "Target")

SAME_PLACE = 1e-6
"""Places nearer to one another than this are one [m]."""


def _begin_with_record(data: object) -> object:
    """Fills in `at` where it is left out and a record tells where a body begins."""
    if not isinstance(data, Mapping) or data.get("at") is not None:
        return data
    motion = data.get("motion")
    if isinstance(motion, Mapping) and motion.get("law") == "replay":
        try:
            motion = Replay.model_validate(motion)
        except ValidationError:
            return {**data, "at": (0.0, 0.0)}  # what is wrong comes out where the motion is checked
    return {**data, "at": motion.place(0.0)} if isinstance(motion, Replay) else data


def _check_begin(body: Body) -> Body:
    """Raises where a body begins elsewhere than its record says."""
    at, motion = body.at, body.motion
    if isinstance(motion, Replay) and at is not None and math.dist(at, motion.place(0.0)) > SAME_PLACE:
        reason = f"got {list(at)}, expected {list(motion.place(0.0))}, where its record has it at 0 s, or nothing"
        raise _wrong(reason, "at")
    return body


Motion = Annotated[Bounce | Waypoints | RandomWalk | Crowd | Evade | Replay, Field(discriminator="law")]


class Shape(Part):
    """The outline of a mover, relative to its place; exactly one of the two."""

    circle: Positive | None = None
    """Radius of a circle [m]."""
    polygon: Polygon | None = None
    """Corners x, y [m] relative to the mover's place."""

    @model_validator(mode="after")
    def _is_one_of_two(self) -> Self:
        if (self.circle is None) == (self.polygon is None):
            raise _wrong("expected either circle: radius or polygon: [[x, y], ...]", "circle")
        return self


class Mover(Part):
    """A circle or a polygon that moves as one body and doesn't turn."""

    shape: Shape
    """Its outline."""
    at: Point
    """Where it starts x, y [m]; left out for `replay`."""
    motion: Motion
    """How it moves."""

    _begins_with_its_record = model_validator(mode="before")(_begin_with_record)
    _begins_where_its_record_does = model_validator(mode="after")(_check_begin)

    @property
    def is_there(self) -> bool:
        """Whether it is in the world as the episode starts."""
        return not isinstance(self.motion, Replay) or self.motion.is_there(0.0)


class Target(Part):
    """A goal that moves."""

    at: Point | None = None
    """Where it starts x, y [m]; left out for `replay`."""
    region: Box | None = None
    """Rectangle to draw its start from [m], instead of `at`."""
    motion: Motion
    """How it moves."""
    room: NotNegative | None = None
    """Distance that it keeps from still obstacles [m]; none: what the robot needs to reach it."""

    _begins_with_its_record = model_validator(mode="before")(_begin_with_record)
    _begins_where_its_record_does = model_validator(mode="after")(_check_begin)

    @model_validator(mode="after")
    def _starts_somewhere(self) -> Self:
        if (self.at is None) == (self.region is None):
            raise _wrong("expected either at: [x, y] or region: [xmin, ymin, xmax, ymax]", "at")
        return self


# ---------------------------------------------------------------------------------------------------------------------
# Families of worlds
# ---------------------------------------------------------------------------------------------------------------------


def _rectangle(xmin: float, ymin: float, xmax: float, ymax: float) -> tuple[tuple[float, float], ...]:
    """Corners x, y of a box."""
    return (xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)


class Family(Part):
    """What all families of worlds share."""

    bounds: Bounds = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    regions: tuple[WeightedRegion, ...] = ()
    """Ground that slows robots down, the same in each world: `{polygon: ..., factor: 2.5}`."""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the bounds, or of what holds them [m]."""
        x, y = zip(*self.corners, strict=True)
        return min(x), min(y), max(x), max(y)

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners x, y of the border [m]."""
        match self.bounds:
            case (float(xmin), float(ymin), float(xmax), float(ymax)):
                return _rectangle(xmin, ymin, xmax, ymax)
            case corners:
                return corners

    def obstruction(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        """What discs (x, y, radius) [m] touch of all that the scenario fixes, or "" where they are clear."""
        return "" if all(self.holds(*disc) for disc in discs) else f"the border of {_shortened(list(self.bounds))}"

    def holds(self, x: float, y: float, radius: float = 0.0) -> bool:
        """Whether a disc [m] lies within the border."""
        xmin, ymin, xmax, ymax = self.box
        inside = xmin + radius <= x <= xmax - radius and ymin + radius <= y <= ymax - radius
        if not inside or self.corners == _rectangle(*self.box):
            return inside
        import shapely

        outline, centre = shapely.Polygon(self.corners), shapely.Point(x, y)
        return bool(outline.covers(centre) and outline.exterior.distance(centre) >= radius)

    def holds_box(self, box: tuple[float, float, float, float]) -> bool:
        """Whether a rectangle xmin, ymin, xmax, ymax [m] lies within the border."""
        corners = _rectangle(*box)
        if self.corners == _rectangle(*self.box):
            return all(self.holds(*corner) for corner in corners)
        import shapely

        return bool(shapely.Polygon(self.corners).covers(shapely.Polygon(corners)))

    def check(self, robot: Robot) -> None:
        """Raises where this robot can't live in this world."""

    def _check_start(self, start: tuple[float, float, float] | StartRegion | None, robot: Robot) -> None:
        if isinstance(start, tuple):
            touched = self.obstruction(robot.body(start))
            if touched:
                raise _wrong(f"got {list(start)}, expected room for the robot; in its way: {touched}", "start")
        elif start is not None:
            self._check_region(start.region, "start.region")

    def _check_goal(self, goal: tuple[float, float] | Region | None) -> None:
        if isinstance(goal, tuple):
            self.check_point(goal, "goal")
        elif goal is not None:
            self._check_region(goal.region, "goal.region")

    def _check_target(self, target: Target | None) -> None:
        if target is None:
            return
        self._check_motion(target.motion, "target.motion")
        if target.at is not None:
            self.check_point(target.at, "target.at")
        if target.region is not None:
            self._check_region(target.region, "target.region")

    def check_point(self, point: tuple[float, float], key: str) -> None:
        """Raises where something fixed stands on a point that the scenario names by `key`."""
        touched = self.obstruction(((*point, 0.0),))
        if touched:
            raise _wrong(f"got {list(point)}, expected a free point; in its way: {touched}", key)

    def _check_region(self, region: tuple[float, float, float, float], key: str) -> None:
        xmin, ymin, xmax, ymax = self.box
        if region[0] < xmin or region[1] < ymin or region[2] > xmax or region[3] > ymax:
            raise _wrong(f"got {list(region)}, expected a rectangle within bounds {list(self.box)}", key)

    def _check_holds(self, needed: tuple[float, float, float, float], what: str) -> None:
        if not self.holds_box(needed):
            came = _shortened(list(self.bounds))
            raise _wrong(f"got {came}, expected bounds that hold the {what}: {list(needed)}", "bounds")

    def _check_width(self, width: float, robot: Robot, key: str) -> None:
        if width <= 2.0 * robot.reach:
            raise _wrong(f"got {width:g}, expected more than the robot's width ({2 * robot.reach:g})", key)

    def _check_clearance(self, clearance: float | None, robot: Robot, key: str) -> None:
        if clearance is not None and clearance < robot.reach:
            raise _wrong(f"got {clearance:g}, expected at least the robot's reach ({robot.reach:g})", key)

    def _check_separation(
        self,
        separation: float,
        start: tuple[float, float, float] | StartRegion | None,
        goal: tuple[float, float] | Region | None,
    ) -> None:
        xmin, ymin, xmax, ymax = self.box
        most = math.hypot(xmax - xmin, ymax - ymin)
        if isinstance(start, tuple) and isinstance(goal, tuple):
            most = math.dist(start[:2], goal)
        if separation > most:
            raise _wrong(f"got {separation:g}, expected at most {most:g}, all that there is", "separation")

    def _check_motion(self, motion: Motion, key: str) -> None:
        name = "goals" if isinstance(motion, Crowd) else "points"
        points: Iterable[tuple[float, ...]] = getattr(motion, name, None) or ()
        for index, point in enumerate(points):
            x, y = point[-2:]
            if Family.obstruction(self, ((x, y, 0.0),)):
                raise _wrong(f"got {[x, y]}, expected a point in {list(self.box)}", f"{key}.{name}.{index}")


class EmptyWorld(Family):
    """Nothing but the border, a start and a goal."""

    family: Literal["empty"]
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    target: Target | None = None
    """A moving goal, instead of `goal`."""
    separation: NotNegative = 0.0
    """Least distance from start to goal [m]."""

    def check(self, robot: Robot) -> None:
        """Start and goal lie within the bounds, and far enough apart."""
        if self.goal is not None and self.target is not None:
            raise _wrong("expected either goal or target, got both", "target")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)
        self._check_target(self.target)
        self._check_separation(self.separation, self.start, self.goal if self.target is None else self.target.at)


class ExplicitWorld(Family):
    """Every obstacle written down."""

    family: Literal["explicit"]
    circles: tuple[Disc, ...] = ()
    """Still circles x, y, radius [m]."""
    polygons: tuple[Polygon, ...] = ()
    """Still polygons: corners x, y [m], or `{shell, holes}`."""
    movers: tuple[Mover, ...] = ()
    """Moving circles and polygons."""
    start: Start
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from."""
    target: Target | None = None
    """A moving goal, instead of `goal`."""

    def obstruction(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        """What discs (x, y, radius) [m] touch: the border, an obstacle or a mover where it starts; or ""."""
        outside = super().obstruction(discs)
        if outside:
            return outside
        still = [(f"circles.{index}", circle) for index, circle in enumerate(self.circles)]
        moving = [
            (f"movers.{index}", (*mover.at, mover.shape.circle))
            for index, mover in enumerate(self.movers)
            if mover.shape.circle is not None and mover.is_there
        ]
        for name, (x, y, radius) in [*still, *moving]:
            if any(math.dist((x, y), disc[:2]) < radius + disc[2] for disc in discs):
                return name
        return self._touched_polygon(discs)

    def _touched_polygon(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        still = [(f"polygons.{index}", polygon.geometry()) for index, polygon in enumerate(self.polygons)]
        moving = [
            (f"movers.{index}", mover.shape.polygon.geometry(mover.at))
            for index, mover in enumerate(self.movers)
            if mover.shape.polygon is not None and mover.is_there
        ]
        if not still and not moving:
            return ""
        import shapely

        for x, y, radius in discs:
            centre = shapely.Point(x, y)
            for name, outline in [*still, *moving]:
                if outline.distance(centre) < radius or outline.contains(centre):
                    return name
        return ""

    def check(self, robot: Robot) -> None:
        """Start, goal and movers lie within the bounds, start and goal clear of all obstacles."""
        if (self.goal is None) == (self.target is None):
            raise _wrong("expected one of goal and target, got " + ("none" if self.goal is None else "both"), "goal")
        for index, mover in enumerate(self.movers):
            if Family.obstruction(self, ((*mover.at, mover.shape.circle or 0.0),)):
                raise _wrong(f"got {list(mover.at)}, expected a place in {list(self.box)}", f"movers.{index}.at")
            self._check_motion(mover.motion, f"movers.{index}.motion")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)
        self._check_target(self.target)


class FieldWorld(Family):
    """Obstacles at random, some of them moving."""

    family: Literal["field"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    obstacles: Count = 20
    """How many, still and moving together."""
    shapes: Literal["circles", "polygons", "squares", "mixed"] = "mixed"
    """What they are; mixed: circles and polygons."""
    sizes: Sizes = (0.3, 1.0)
    """Least and greatest radius, of a polygon that of the circle about it [m]."""
    moving: Share = 0.0
    """Share of the obstacles that move, 0 to 1."""
    speeds: Interval = (0.1, 0.5)
    """Least and greatest speed of those [m/s]."""
    laws: tuple[Literal["bounce", "random_walk", "crowd"], ...] = ("bounce", "random_walk")
    """Their motion laws, in equal parts."""
    pedestrians: Count = 0
    """How many round bodies walk among the obstacles under the crowd law."""
    pedestrian_radius: Positive = 0.3
    """Radius of these [m]."""
    pedestrian_speeds: Interval = (0.6, 1.2)
    """Least and greatest of their speeds [m/s]."""
    solvable: Positive | None = None
    """Clearance [m] at which a path is certain: gaps between still obstacles, and to the border, are at least twice
    as wide. None: no such promise."""
    separation: NotNegative = 8.0
    """Least distance from start to goal [m]."""
    start_clearance: NotNegative = 1.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 0.5
    """Free space around the goal [m]."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    target_motion: Motion | None = None
    """How the goal moves; none: it stands."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through, and start and goal fit into the bounds."""
        if self.moving > 0.0 and not self.laws:
            raise _wrong("got [], expected at least one of 'bounce', 'random_walk', 'crowd'", "laws")
        self._check_clearance(self.solvable, robot, "solvable")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)
        self._check_separation(self.separation, self.start, self.goal)
        if self.target_motion is not None:
            self._check_motion(self.target_motion, "target_motion")


class UTrapWorld(Family):
    """A U that opens toward -x: two arms along x and a base across their ends.

        mouth_x    depth    wall
           +----------------+--+
           +----------------+  |   wall
    start                   |  |   half_width    goal
           +----------------+  |
           +----------------+--+
    """

    family: Literal["u_trap"]
    bounds: Bounds = (-5.0, -10.0, 25.0, 10.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    half_width: Positive = 3.0
    """From the axis y = 0 to the inner side of an arm [m]."""
    depth: Positive = 6.0
    """From the mouth to the inner side of the base [m]."""
    wall: Positive = 1.0
    """Thickness of the arms and of the base [m]."""
    mouth_x: Number = 5.0
    """x of the mouth, before the trap is turned [m]."""
    rotation: Rotation = 0.0
    """Angle by which the trap is turned about the middle of its bounding box [rad], or `random`."""
    start: Start = (0.0, 0.0, 0.0)
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal = (20.0, 0.0)
    """x, y [m], or a region to draw from."""

    @property
    def centre(self) -> tuple[float, float]:
        """Middle of the trap's bounding box x, y [m], about which it is turned."""
        return self.mouth_x + (self.depth + self.wall) / 2.0, 0.0

    def check(self, robot: Robot) -> None:
        """The trap, start and goal lie within the bounds."""
        x, y = self.centre
        half_length, half_height = (self.depth + self.wall) / 2.0, self.half_width + self.wall
        if self.rotation != 0.0:
            half_length = half_height = math.hypot(half_length, half_height)
        needed = (x - half_length, y - half_height, x + half_length, y + half_height)
        self._check_holds(needed, "trap")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)


class RingWorld(Family):
    """A square ring with no way through, round the goal or round the start."""

    family: Literal["ring"]
    centre: Point = (0.0, 0.0)
    """Middle of the ring x, y [m]."""
    outer: Positive = 4.0
    """Half the outer side [m]."""
    inner: Positive = 3.5
    """Half the inner side [m]."""
    inside: Literal["goal", "start"] = "goal"
    """Which of the two is shut in."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere on its side of the ring."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere on its side of the ring."""

    def check(self, robot: Robot) -> None:
        """The ring lies within the bounds, start and goal on their sides of it."""
        if self.inner >= self.outer:
            raise _wrong(f"got {self.inner:g}, expected less than outer ({self.outer:g})", "inner")
        (x, y), side = self.centre, self.outer
        if not self.holds_box((x - side, y - side, x + side, y + side)):
            raise _wrong(f"got {self.outer:g}, expected a ring within bounds {list(self.box)}", "outer")
        if self.inside == "start" and self.inner < robot.reach:
            raise _wrong(f"got {self.inner:g}, expected at least the robot's reach ({robot.reach:g})", "inner")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)
        if isinstance(self.start, tuple):
            self._check_side("start", self.start[:2], robot.reach)
        if isinstance(self.goal, tuple):
            self._check_side("goal", self.goal, 0.0)

    def _check_side(self, key: str, point: tuple[float, float], radius: float) -> None:
        """A disc of `radius` about the point lies inside, or outside, of the ring."""
        dx, dy = abs(point[0] - self.centre[0]), abs(point[1] - self.centre[1])
        if self.inside == key and max(dx, dy) + radius > self.inner:
            raise _wrong(f"got {list(point)}, expected a place inside the ring, as `inside: {key}` says", key)
        if self.inside != key and math.hypot(max(dx - self.outer, 0.0), max(dy - self.outer, 0.0)) < max(radius, 1e-9):
            raise _wrong(f"got {list(point)}, expected a place outside the ring, for {self.inside!r} is inside", key)


class HookWorld(Family):
    """A square box with a slit in its upper wall, turned about its middle: the way out leads away from the goal.

    +------+    +--------+
    | +----+slit+------+ |   wall
    | |                | |
    | | start          | |          goal
    | |                | |
    | +----------------+ |
    +--------------------+
    """

    family: Literal["hook"]
    bounds: Bounds = (-5.0, -12.0, 35.0, 12.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    centre: Point = (10.0, 0.0)
    """Middle of the box x, y [m]."""
    half_side: Positive = 6.0
    """Half the outer side [m]."""
    wall: Positive = 1.0
    """Thickness of the walls [m]."""
    slit: Positive = 2.0
    """Width of the slit [m]."""
    slit_at: Number = -1.0
    """From the middle of the box to that of the slit, along x [m]."""
    rotation: Rotation = 0.0
    """Angle by which the box is turned about its middle [rad], or `random`."""
    start: Start = (7.0, 0.0, 0.0)
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal = (30.0, 0.0)
    """x, y [m], or a region to draw from."""

    def check(self, robot: Robot) -> None:
        """The robot fits through the slit, the slit into the wall, and the box, start and goal into the bounds."""
        self._check_width(self.slit, robot, "slit")
        inner = self.half_side - self.wall
        if abs(self.slit_at) + 0.5 * self.slit > inner:
            raise _wrong(f"got {self.slit:g}, expected a slit between the inner corners, +-{inner:g}", "slit")
        (x, y), half = self.centre, self.half_side
        if self.rotation != 0.0:
            half *= math.sqrt(2.0)
        needed = (x - half, y - half, x + half, y + half)
        self._check_holds(needed, "box")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)


class MazeWorld(Family):
    """A perfect maze, drawn anew for each seed, of as many equal cells as fit into the bounds."""

    family: Literal["maze"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    passage: Positive = 1.2
    """Least width of a passage; the cells widen evenly until they fill the bounds [m]."""
    wall: Positive = 0.2
    """Thickness of the walls between cells [m]."""
    loops: Share = 0.0
    """Share, 0 to 1, of the walls left over that are taken away; 0: one way between any two cells."""
    separation: NotNegative = 8.0
    """Least straight distance from start to goal, both in the middle of a cell [m]."""

    @property
    def cells(self) -> tuple[int, int]:
        """How many cells lie along x and along y."""
        xmin, ymin, xmax, ymax = self.bounds
        return self._fitting(xmax - xmin), self._fitting(ymax - ymin)

    @property
    def passages(self) -> tuple[float, float]:
        """Width of a cell along x and along y [m]: n cells and n - 1 walls fill the bounds."""
        xmin, ymin, xmax, ymax = self.bounds
        columns, rows = self.cells
        return (xmax - xmin - (columns - 1) * self.wall) / columns, (ymax - ymin - (rows - 1) * self.wall) / rows

    def check(self, robot: Robot) -> None:
        """The robot fits through, and there are cells as far apart as `separation` says."""
        self._check_width(self.passage, robot, "passage")
        columns, rows = self.cells
        if columns * rows < 2:
            raise _wrong(f"got {self.passage:g}, expected at most what lets two cells into the bounds", "passage")
        width, height = self.passages
        corner = (columns - 1) * (width + self.wall), (rows - 1) * (height + self.wall)
        self._check_separation(self.separation, (0.0, 0.0, 0.0), corner)

    def _fitting(self, side: float) -> int:
        # 1e-9: a side that is just so many cells must not lose one to rounding
        return math.floor((side + self.wall) / (self.passage + self.wall) + 1e-9)


class CorridorWorld(Family):
    """A passage of one width from side to side that shifts sideways at right angles, drawn anew for each seed.

    +--------------------------+
    |##########           goal |
    |##########    ############|
    | start        ############|
    |##########################|
    +--------------------------+

    The robot starts at the left end and heads along it; the goal lies at the right end.
    """

    family: Literal["corridor"]
    bounds: Box = (-15.0, -8.0, 15.0, 8.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    width: Positive = 2.0
    """Width of the passage [m]."""
    shifts: Count = 3
    """How often it shifts sideways; each shift is two right angles."""
    wall: Positive = 0.5
    """Least thickness of what lies between two of its legs, and between a leg and the border [m]."""

    @property
    def spare(self) -> tuple[float, float]:
        """Way left over along x for the places of the shifts, and along y for the levels of the legs [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        across = self.shifts * self.width + max(self.shifts - 1, 0) * self.wall + 2.0 * self.width
        return xmax - xmin - across, ymax - ymin - self.width - 2.0 * self.wall

    def check(self, robot: Robot) -> None:
        """The robot fits through, and the passage into the bounds."""
        self._check_width(self.width, robot, "width")
        along, sideways = self.spare
        if along < 0.0:
            raise _wrong(f"got {self.shifts}, expected fewer: there is no room along x for so many", "shifts")
        # Wherever the last leg is, the next one finds a level.
        most = 2.0 * (self.width + self.wall) if self.shifts else 0.0
        if sideways < most:
            raise _wrong(f"got {self.width:g}, expected less: legs must fit beside one another along y", "width")


class DrawnPlaces(Family):
    """Families whose worlds are drawn anew for each seed, start and goal wherever there is room."""

    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    separation: NotNegative = 8.0
    """Least distance from start to goal [m]."""

    def check(self, robot: Robot) -> None:
        """Start and goal lie within the bounds, and far enough apart."""
        self._check_start(self.start, robot)
        self._check_goal(self.goal)
        self._check_separation(self.separation, self.start, self.goal)


class RoomsWorld(DrawnPlaces):
    """Rooms in rows and columns, with doors between neighbours; each can be reached from each."""

    family: Literal["rooms"]
    bounds: Box = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    columns: AtLeastOne = 3
    """How many rooms lie along x."""
    rows: AtLeastOne = 3
    """How many rooms lie along y."""
    door: Positive = 1.2
    """Width of the doors [m]."""
    wall: Positive = 0.2
    """Thickness of the walls [m]."""
    loops: Share = 0.25
    """Share, 0 to 1, of the walls between neighbours without need of a door that have one; 0: one way between rooms."""
    unevenness: Share = 0.5
    """How far walls stand off their even places, 0 to 1: 1 is half a room's side to either side."""

    @property
    def pitch(self) -> tuple[float, float]:
        """Distance between even walls along x and along y [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        return (xmax - xmin) / self.columns, (ymax - ymin) / self.rows

    def check(self, robot: Robot) -> None:
        """The robot fits through the doors, and they into the smallest room's walls."""
        self._check_width(self.door, robot, "door")
        least = min(self.pitch) * (1.0 - self.unevenness) - self.wall
        if self.door > least:
            raise _wrong(f"got {self.door:g}, expected at most the smallest room's side ({least:g})", "door")
        super().check(robot)


class CrossingWorld(DrawnPlaces):
    """Streams of round movers across the way: each goes up one lane and down another, round and round.

    Start and goal are drawn from the strips beside the streams, where no mover comes.
    """

    family: Literal["crossing"]
    bounds: Box = (-10.0, -8.0, 10.0, 8.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    streams: AtLeastOne = 3
    """How many streams lie beside one another along x."""
    lane: Positive = 1.6
    """Distance from a stream's lane up to its lane down [m]."""
    radius: Positive = 0.3
    """Radius of the movers [m]."""
    gap: Positive = 3.0
    """Least free way from one mover of a stream to the next [m]."""
    speeds: Interval = (0.3, 0.8)
    """Least and greatest speed of a stream [m/s]."""
    apron: Positive = 3.0
    """Width of the free strips on the left for the start and on the right for the goal [m]."""

    @property
    def stream_width(self) -> float:
        """Room along x for a stream [m]."""
        xmin, _, xmax, _ = self.bounds
        return (xmax - xmin - 2.0 * self.apron) / self.streams

    @property
    def turn_room(self) -> float:
        """Distance from the upper and the lower border to where a stream turns [m]."""
        return 2.0 * self.radius

    def check(self, robot: Robot) -> None:
        """The streams fit between the strips, and the robot into the strips and between two movers."""
        self._check_width(self.apron, robot, "apron")
        self._check_width(self.gap, robot, "gap")
        if self.lane + 2.0 * self.radius > self.stream_width:
            reason = f"got {self.streams}, expected fewer: each needs {self.lane + 2.0 * self.radius:g} m along x"
            raise _wrong(reason, "streams")
        if self.lane < 2.0 * self.radius:
            raise _wrong(f"got {self.lane:g}, expected at least the width of a mover ({2 * self.radius:g})", "lane")
        height = self.bounds[3] - self.bounds[1]
        if height <= 2.0 * self.turn_room:
            raise _wrong(f"got {self.radius:g}, expected less than a quarter of the height ({height:g})", "radius")
        super().check(robot)


class ForestWorld(DrawnPlaces):
    """Many thin trunks: still circles, close together."""

    family: Literal["forest"]
    trees: Count = 150
    """How many."""
    sizes: Sizes = (0.1, 0.3)
    """Least and greatest radius [m]."""
    solvable: Positive | None = 0.3
    """Clearance [m] at which a path is certain: gaps between trunks, and to the border, are at least twice as wide.
    None: no such promise, and trunks may overlap."""
    start_clearance: NotNegative = 1.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 0.5
    """Free space around the goal [m]."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through."""
        self._check_clearance(self.solvable, robot, "solvable")
        super().check(robot)


class UrbanWorld(DrawnPlaces):
    """Blocks of buildings between streets, some round a courtyard; a courtyard is closed or has a gateway.

    A map of this kind and size is Fig. 7 of the D2T-eACO paper. Start and goal lie in streets, on squares, or in
    courtyards with a gateway.
    """

    family: Literal["urban"]
    bounds: Box = (-15.0, -15.0, 15.0, 15.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    columns: AtLeastOne = 4
    """How many blocks lie along x."""
    rows: AtLeastOne = 4
    """How many blocks lie along y."""
    street: Positive = 1.5
    """Least width of the streets, that along the border too [m]."""
    unevenness: Share = 0.3
    """How much of a block's side may be left free beside its building, 0 to 1."""
    squares: Share = 0.1
    """Share of the blocks without a building, 0 to 1."""
    courtyards: Share = 0.5
    """Share of the buildings that have a courtyard, 0 to 1."""
    gateways: Share = 0.6
    """Share of the courtyards that have a gateway, 0 to 1."""
    gateway: Positive = 1.2
    """Width of a gateway [m]."""
    depth: Positive = 1.0
    """Thickness of a building around its courtyard [m]."""
    separation: NotNegative = 15.0
    """Least distance from start to goal [m]."""

    @property
    def block(self) -> tuple[float, float]:
        """Sides of a block along x and along y [m]."""
        xmin, ymin, xmax, ymax = self.bounds
        width, height = xmax - xmin, ymax - ymin
        return (
            (width - (self.columns + 1) * self.street) / self.columns,
            (height - (self.rows + 1) * self.street) / self.rows,
        )

    def check(self, robot: Robot) -> None:
        """The robot fits through streets and gateways, and the smallest building holds a courtyard with a gateway."""
        self._check_width(self.street, robot, "street")
        self._check_width(self.gateway, robot, "gateway")
        least = min(self.block) * (1.0 - self.unevenness) - 2.0 * self.depth
        if least < self.gateway:
            reason = f"got {self.depth:g}, expected less: the smallest courtyard has a side of {least:g} m"
            raise _wrong(f"{reason}, its gateway {self.gateway:g} m", "depth")
        super().check(robot)


class BeachWorld(DrawnPlaces):
    """Irregular obstacles far apart on a long beach, and pedestrians who walk among them.

    After the beach of the D2T-eACO paper (section 7.3: 50 m x 100 m, 28 obstacles).
    """

    family: Literal["beach"]
    bounds: Bounds = (0.0, 0.0, 50.0, 100.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    obstacles: Count = 28
    """How many."""
    sizes: Sizes = (1.0, 4.0)
    """Least and greatest radius of the circle about an obstacle [m]."""
    corners_each: CornerCounts = (5, 10)
    """Least and greatest number of an obstacle's corners."""
    pedestrians: Count = 20
    """How many."""
    radius: Positive = 0.3
    """Radius of a pedestrian [m]."""
    speeds: Interval = (0.5, 1.3)
    """Least and greatest speed of a pedestrian [m/s]."""
    law: Literal["crowd", "random_walk"] = "crowd"
    """Their motion law: to places that are drawn, making way for one another and for the robot, or at random."""
    solvable: Positive | None = 0.5
    """Clearance [m] at which a path is certain: gaps between obstacles, and to the border, are at least twice as wide.
    None: no such promise, and obstacles may overlap."""
    start_clearance: NotNegative = 2.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 1.0
    """Free space around the goal [m]."""
    separation: NotNegative = 60.0
    """Least distance from start to goal [m]."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through."""
        self._check_clearance(self.solvable, robot, "solvable")
        super().check(robot)


class OniWangWorld(Family):
    """The map of Fig. 1 in Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments".

    One spiral obstacle with walls 1 m thick; its four places lie on the line y = 0.
    """

    family: Literal["oni_wang"]
    bounds: Box = (-15.0, -26.0, 42.0, 24.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    start: Literal["A", "B", "C", "D"] = "A"
    """The place where the robot starts, heading for the goal."""
    goal: Literal["A", "B", "C", "D"] = "D"
    """The place it goes to."""

    def check(self, robot: Robot) -> None:
        """Start and goal differ, and the map lies within the bounds."""
        if self.start == self.goal:
            raise _wrong(f"got {self.goal!r}, expected another place than start", "goal")
        for corner in (*ONI_WANG_POLYGON, *ONI_WANG_PLACES.values()):
            if self.obstruction(((*corner, robot.reach),)):
                raise _wrong(f"got {list(self.bounds)}, expected bounds that hold the map: {corner} too", "bounds")


ONI_WANG_POLYGON = (
    (5.0, 4.0),
    (6.0, 4.0),
    (6.0, -9.0),
    (22.0, -9.0),
    (22.0, 7.0),
    (14.0, 7.0),
    (14.0, -2.0),
    (13.0, -2.0),
    (13.0, 8.0),
    (23.0, 8.0),
    (23.0, -10.0),
    (5.0, -10.0),
)
"""Corners x, y [m] of the obstacle of `OniWangWorld`."""

ONI_WANG_PLACES = {"A": (0.0, 0.0), "B": (10.0, 0.0), "C": (17.0, 0.0), "D": (27.0, 0.0)}
"""Places x, y [m] of `OniWangWorld`."""


class BarnWorld(Family):
    """A world of the BARN benchmark (Perille et al. 2020): cylinders, a start and a goal from a file."""

    family: Literal["barn"]
    bounds: Box = (-6.0, -1.0, 2.0, 15.0)
    """xmin, ymin, xmax, ymax [m]; the border is always a wall."""
    path: ExistingPath
    """A .jsonl with one world a line, or a folder of `world_N.world` files; relative to the scenario's file."""
    world: Count | None = None
    """Number of the world; none: drawn."""


class RosMapWorld(DrawnPlaces):
    """An occupancy map as ROS's map_server reads it: a YAML file that names a picture, its scale and its place.

    Its keys are `image`, `resolution`, `origin`, `negate`, `occupied_thresh`, `free_thresh` and `mode: trinary`. The
    picture is a .pgm, or what pillow reads (extra `maps`), of at most 16,000,000 pixels. Occupied cells become polygons,
    drawn straighter than the cells by at most half a cell. Start and goal are drawn from free cells.
    """

    family: Literal["ros_map"]
    bounds: Bounds
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall. Left out: the
    outline of the picture. Less than that: a piece of the map."""
    path: ExistingPath
    """The map's .yaml; relative to the scenario's file."""
    unknown_is_wall: Flag = False
    """Whether cells that are neither occupied nor free are walls too."""
    solvable: Positive | None = 0.3
    """Clearance [m] at which there is a path from start to goal. None: no such promise."""

    @model_validator(mode="before")
    @classmethod
    def _bounds_are_the_picture(cls, data: object) -> object:
        if not isinstance(data, Mapping) or data.get("bounds") is not None:
            return data
        # Without a map there is no outline; its own fault is told where `path` is checked.
        path = data.get("path")
        is_file = isinstance(path, str) and Path(path).expanduser().exists()
        return {**data, "bounds": _ros_map(str(path)).bounds if is_file else (0.0, 0.0, 1.0, 1.0)}

    def check(self, robot: Robot) -> None:
        """The map can be read; start and goal lie within the bounds."""
        _ros_map(self.path)
        self._check_clearance(self.solvable, robot, "solvable")
        super().check(robot)


def _ros_map(path: str) -> RosMap:
    """A map, its faults told as those of the key `path`."""
    from bug_gym.ros_map import load_ros_map

    try:
        return load_ros_map(str(Path(path).expanduser().absolute()))
    except ValueError as error:
        raise _wrong(str(error), "path") from None


class ReplayWorld(Family):
    """Pedestrians where they were recorded, and a robot that has to cross their way."""

    family: Literal["replay"]
    bounds: Box
    """xmin, ymin, xmax, ymax [m]; the border is always a wall. Left out: what holds all recorded bodies and `margin`.
    Who leaves given bounds isn't there until he comes in again."""
    path: ExistingPath
    """A .csv with the columns time_s, pedestrian, x_m, y_m; relative to the scenario's file."""
    margin: NotNegative = 1.0
    """Free space on all sides, where `bounds` are left out [m]."""
    radius: Positive = 0.3
    """Radius of a pedestrian [m]."""
    start_time: Number | None = None
    """Time of the recording at which the episode begins [s]; none: drawn so that the recording doesn't run out."""
    window: Annotated[tuple[Number, Number], _sequence("first, last"), AfterValidator(_increasing)] | None = None
    """Part of the recording to draw from [s]; none: all of it."""
    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: at one side of the flow of pedestrians."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: straight across, on the other side."""

    @model_validator(mode="before")
    @classmethod
    def _bounds_hold_the_record(cls, data: object) -> object:
        if not isinstance(data, Mapping) or data.get("bounds") is not None:
            return data
        # Without a record there are no bounds; its own fault is told where `path` is checked.
        box, path = (0.0, 0.0, 1.0, 1.0), data.get("path")
        margin, radius = (data.get(name, cls.model_fields[name].default) for name in ("margin", "radius"))
        numbers = all(isinstance(value, (int, float)) and value >= 0.0 for value in (margin, radius))
        if isinstance(path, str) and Path(path).expanduser().exists() and numbers:
            xmin, ymin, xmax, ymax = _recording(path).extent
            room = margin + radius
            box = (xmin - room, ymin - room, xmax + room, ymax + room)
        return {**data, "bounds": box}

    def check(self, robot: Robot) -> None:
        """The recording can be read, the time asked for is in it, and start and goal lie within the bounds."""
        first, last = _recording(self.path).times
        if self.start_time is not None and self.window is not None:
            raise _wrong("expected either start_time or window, got both", "window")
        if self.start_time is not None and not first <= self.start_time <= last:
            raise _wrong(f"got {self.start_time:g}, expected a time from {first:g} to {last:g}", "start_time")
        if self.window is not None and not first <= self.window[0] <= self.window[1] <= last:
            raise _wrong(f"got {list(self.window)}, expected times from {first:g} to {last:g}", "window")
        if (self.start is None) != (self.goal is None):
            raise _wrong("expected both start and goal, or neither", "goal" if self.goal is None else "start")
        self._check_start(self.start, robot)
        self._check_goal(self.goal)


def _recording(path: str) -> Recording:
    """A recording, its faults told as those of the key `path`."""
    from bug_gym.recordings import load_recording

    try:
        return load_recording(str(Path(path).expanduser().absolute()))
    except ValueError as error:
        raise _wrong(str(error), "path") from None


WorldFamily = Annotated[
    EmptyWorld
    | ExplicitWorld
    | FieldWorld
    | UTrapWorld
    | HookWorld
    | RingWorld
    | MazeWorld
    | CorridorWorld
    | RoomsWorld
    | CrossingWorld
    | ForestWorld
    | UrbanWorld
    | BeachWorld
    | OniWangWorld
    | BarnWorld
    | ReplayWorld
    | RosMapWorld,
    Field(discriminator="family"),
]

FAMILIES: tuple[str, ...] = tuple(_tags(WorldFamily, "family"))
LAWS: tuple[str, ...] = tuple(_tags(Motion, "law"))


# ---------------------------------------------------------------------------------------------------------------------
# The scenario
# ---------------------------------------------------------------------------------------------------------------------


class Robot(Part):
    """The robot's body and its limits."""

    kinematics: Literal["holonomic", "differential"] = "holonomic"
    """How it moves: in any direction without turning, or ahead and around."""
    radius: Positive = 0.2
    """Radius of a round body [m]."""
    circles: Annotated[tuple[Disc, ...], Field(min_length=1)] | None = None
    """A body of several circles x, y, radius in the robot's frame [m], instead of the one of `radius`. While it turns they
    are tested along their arcs: no contact is missed, and none comes more than 0.01 mm too early."""
    max_speed: Positive = 1.0
    """Maximum speed, of a differential robot ahead [m/s]."""
    max_reverse: NotNegative = 0.3
    """Maximum speed backwards of a differential robot [m/s]."""
    max_turn_rate: Positive = 1.5
    """Maximum turn rate of a differential robot [rad/s]."""
    max_acceleration: Positive | None = None
    """Maximum change of speed [m/s^2]; none: at once."""

    @model_validator(mode="after")
    def _limits_fit(self) -> Self:
        if self.max_reverse > self.max_speed:
            raise _wrong(f"got {self.max_reverse}, expected at most max_speed ({self.max_speed})", "max_reverse")
        return self

    @property
    def footprint(self) -> tuple[tuple[float, float, float], ...]:
        """The body as circles x, y, radius [m] in the robot's frame."""
        return self.circles or ((0.0, 0.0, self.radius),)

    @property
    def reach(self) -> float:
        """Radius of the disc about the robot's origin that holds its body [m]."""
        return max(math.hypot(x, y) + radius for x, y, radius in self.footprint)

    def body(self, pose: tuple[float, float, float]) -> tuple[tuple[float, float, float], ...]:
        """The body as circles x, y, radius [m] in the world, at a pose x [m], y [m], heading [rad]."""
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        return tuple(
            (pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y, radius) for x, y, radius in self.footprint
        )


def _whole_circle(fov: float) -> float:
    return FULL_TURN if abs(fov - FULL_TURN) <= FULL_TURN_TOLERANCE else fov


class Lidar(Part):
    """The laser scanner, at the robot's origin."""

    beams: AtLeastOne = 180
    """How many beams, spread evenly."""
    range: Positive = 10.0
    """Longest range; what nothing returns reads this [m]."""
    min_range: NotNegative = 0.0
    """Shortest range [m]."""
    fov: Annotated[Positive, Field(le=FULL_TURN + FULL_TURN_TOLERANCE), AfterValidator(_whole_circle)] = FULL_TURN
    """Field of view, symmetric about the heading; within 0.005 of a full turn it is one [rad]."""
    noise: NotNegative = 0.0
    """Standard deviation of a range [m]."""
    dropout: Share = 0.0
    """Share of beams that return nothing, 0 to 1."""

    @model_validator(mode="after")
    def _ranges_are_ordered(self) -> Self:
        if self.min_range >= self.range:
            raise _wrong(f"got {self.min_range}, expected less than range ({self.range})", "min_range")
        return self

    @property
    def is_full_circle(self) -> bool:
        """Whether the beams go all around."""
        return self.fov == FULL_TURN


class Odometry(Part):
    """How the robot's own estimate of its pose drifts."""

    translation_noise: NotNegative = 0.0
    """Standard deviation of the distance, growing with its root [m/sqrt(m)]."""
    rotation_noise: NotNegative = 0.0
    """Standard deviation of the heading, growing with the root of the distance [rad/sqrt(m)]."""
    translation_bias: Number = 0.0
    """Excess of the distance [m/m]."""
    rotation_bias: Number = 0.0
    """Drift of the heading [rad/m]."""


class Time(Part):
    """The clock."""

    step: Positive = 0.1
    """Time from one action to the next [s]."""
    limit: Positive = 120.0
    """Time after which an episode is cut off [s]."""

    @model_validator(mode="after")
    def _holds_a_step(self) -> Self:
        if self.limit < self.step:
            raise _wrong(f"got {self.limit}, expected at least step ({self.step})", "limit")
        return self

    @property
    def steps(self) -> int:
        """Most steps of an episode."""
        return round(self.limit / self.step)


class GoalSettings(Part):
    """When the goal is reached and how the robot knows where it is."""

    radius: Positive = 0.3
    """Distance from the goal to the robot's origin within which it is reached [m]."""
    sensing: Literal["beacon", "odometry"] = "beacon"
    """Sensed as a beacon, or computed from odometry."""


class Reward(Part):
    """Weights of the reward's terms; their sum is the reward of a step."""

    progress: Number = 1.0
    """For each metre nearer to the goal [1/m]."""
    goal: Number = 10.0
    """Once, on reaching the goal [1]."""
    collision: Number = -10.0
    """Once, on touching something [1]."""
    step: Number = -0.01
    """For each step [1]."""
    clearance: Number = 0.0
    """For nearness to obstacles [1]."""
    smoothness: Number = 0.0
    """For a change of the action [1]."""


class Place(Part):
    """Where one robot of several starts, and where it goes."""

    start: Pose
    """x [m], y [m], heading [rad]."""
    goal: Point | None = None
    """x, y [m]; none: the world's goal."""


class Robots(Part):
    """How many robots there are; a plain list gives the places of all of them."""

    count: AtLeastOne = 1
    """How many robots; where `places` are given, the first ones are taken."""
    places: tuple[Place, ...] = ()
    """Start and goal of each; none: 1 m to either side of the world's start, with one goal."""

    @model_validator(mode="before")
    @classmethod
    def _a_list_is_places(cls, data: object) -> object:
        if isinstance(data, (list, tuple)):
            data = {"places": data}
        if isinstance(data, Mapping) and "count" not in data and isinstance(data.get("places"), (list, tuple)):
            return {**data, "count": len(data["places"])}
        return data

    @model_validator(mode="after")
    def _each_has_a_place(self) -> Self:
        if self.places and self.count > len(self.places):
            raise _wrong(f"got {self.count}, expected at most {len(self.places)}, as many as there are places", "count")
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> Any:
        data = handler(self)
        if not self.places:
            return data
        return data["places"] if self.count == len(self.places) else {"count": self.count, "places": data["places"]}


class Scenario(Part):
    """All that defines a task: robot, sensors, clock, world, reward."""

    name: Annotated[str, Field(min_length=1)] = "custom"
    """What tables and pictures call it; a file's stem where the file gives none."""
    robot: Robot = Robot()
    """The robot's body and its limits."""
    lidar: Lidar = Lidar()
    """The laser scanner."""
    odometry: Odometry = Odometry()
    """How the robot's own estimate of its pose drifts."""
    time: Time = Time()
    """The clock."""
    goal: GoalSettings = GoalSettings()
    """When the goal is reached."""
    world: WorldFamily = EmptyWorld(family="empty")
    """The family of worlds and its parameters."""
    reward: Reward = Reward()
    """Weights of the reward's terms."""
    robots: Robots = Robots()
    """How many robots."""

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        try:
            self.world.check(self.robot)
        except PydanticCustomError as error:
            context = error.context or {}
            raise _wrong(context["reason"], f"world.{context['key']}") from None
        self._check_places()
        return self

    def _check_places(self) -> None:
        """Each robot starts clear of what is fixed and of the robots before it, and its goal is free."""
        bodies: list[tuple[tuple[float, float, float], ...]] = []
        for index, place in enumerate(self.robots.places[: self.robots.count]):
            key, body = f"robots.places.{index}", self.robot.body(place.start)
            touched = self.world.obstruction(body)
            for other, earlier in enumerate(bodies):
                if any(math.dist(a[:2], b[:2]) < a[2] + b[2] for a in body for b in earlier):
                    touched = touched or f"robots.places.{other}"
            if touched:
                reason = f"got {list(place.start)}, expected room for the robot; in its way: {touched}"
                raise _wrong(reason, f"{key}.start")
            if place.goal is not None:
                self.world.check_point(place.goal, f"{key}.goal")
            bodies.append(body)


# ---------------------------------------------------------------------------------------------------------------------
# Loading
# ---------------------------------------------------------------------------------------------------------------------


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package, sorted."""
    return sorted(path.stem for path in SCENARIO_FOLDER.glob("*.yaml"))


def load(source: str | Path | Mapping[str, Any] | Scenario, overrides: Mapping[str, Any] | None = None) -> Scenario:
    """Makes a scenario.

    Args:
        source: a name from `scenario_names()`, the path of a YAML file, a mapping that says the same, or a scenario.
        overrides: values by dotted key, such as `{"lidar.beams": 360}`; each replaces all that stands there. Relative
            paths in a file start from its folder, those in mappings and overrides from the working directory.

    Raises:
        ScenarioError: where something is unknown, missing or not allowed.
    """
    if isinstance(source, Scenario) and not overrides:
        return source
    label, data = _read(source)
    for key, value in (overrides or {}).items():
        _override(data, key, _plain(value), label)
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(explain(error, f"{label} with overrides" if overrides else label)) from None


def dump(scenario: Scenario) -> dict[str, Any]:
    """The scenario's differences from the defaults, as a dict that JSON can hold; `load` gives the scenario back."""
    data: dict[str, Any] = scenario.model_dump(mode="json", exclude_defaults=True)
    return data


def to_yaml(scenario: Scenario) -> str:
    """The scenario's differences from the defaults, as the text of a YAML file."""
    return yaml.safe_dump(dump(scenario), sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)


def _read(source: str | Path | Mapping[str, Any] | Scenario) -> tuple[str, dict[str, Any]]:
    """A name for errors, and the scenario as plain data."""
    if isinstance(source, Scenario):
        return source.name, dump(source)
    if isinstance(source, Mapping):
        return "scenario", _plain(source)
    if not isinstance(source, (str, Path)):
        raise ScenarioError(f"scenario: got {source!r}, expected a name, a path, a mapping or a Scenario")
    if isinstance(source, str) and not re.search(r"[/\\]|\.ya?ml$", source):
        if source not in scenario_names():
            known = ", ".join(scenario_names())
            raise ScenarioError(f"no scenario {source!r}{nearest_hint(source, scenario_names())} (known: {known})")
        return f"{source}.yaml", read_yaml(SCENARIO_FOLDER / f"{source}.yaml")
    return str(source), read_yaml(Path(source).expanduser())


class YamlLoader(yaml.SafeLoader):
    """Safe YAML in which a key may stand only once, and 1e-3 is a number as in YAML 1.2."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """A mapping without a key that stands there twice."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                raise yaml.constructor.ConstructorError(problem=f"key {key.value!r} twice", problem_mark=key.start_mark)
            seen.add(str(key.value))
        return super().construct_mapping(node, deep=deep)


YamlLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file, paths in it starting from its folder and `name` its stem where it gives none.

    Raises:
        ScenarioError: no such file, or no mapping in it.
    """
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=YamlLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        line = f" line {mark.line + 1}, column {mark.column + 1}:" if mark else ""
        raise ScenarioError(f"{path}:{line} {error.problem}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: not a YAML file: {error}") from None
    except OSError as error:
        known = [*(file.name for file in path.parent.glob("*.y*ml")), *scenario_names()]
        raise ScenarioError(f"{path}: {error.strerror}{nearest_hint(path.name, known)}") from None
    if not isinstance(data, dict):
        raise ScenarioError(f"{path}: got {_shortened(data)}, expected a mapping such as `world: {{family: empty}}`")
    data = _plain(data)  # what two aliases share comes apart, so that each can change alone
    _resolve_paths(data, path.parent)
    return {"name": path.stem, **data}


def _resolve_paths(data: Any, folder: Path) -> None:
    """Makes what stands under a key `path` start from the file's folder, at any depth, in place."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if key == "path" and isinstance(value, str):
            data[key] = str(folder / Path(value).expanduser())
        else:
            _resolve_paths(value, folder)


def _plain(value: Any) -> Any:
    """A copy in which there are only dicts, lists, numbers and text, as JSON has them."""
    if isinstance(value, Part):
        return value.model_dump(mode="json")
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def _override(data: dict[str, Any], key: str, value: Any, label: str) -> None:
    """Puts `value` at a dotted key of nested mappings and lists, in place."""
    if isinstance(data.get("robots"), list):
        data["robots"] = {"places": data["robots"]}
    *parents, last = str(key).split(".")
    place: Any = data
    for parent in parents:
        place = place.setdefault(parent, {}) if isinstance(place, dict) else _item(place, parent, key, label)
    if isinstance(place, dict):
        place[last] = value
    else:
        _item(place, last, key, label)
        place[int(last)] = value


def _item(items: Any, index: str, key: str, label: str) -> Any:
    if not isinstance(items, list) or not index.isdecimal() or int(index) >= len(items):
        expected = f"an index below {len(items)}" if isinstance(items, list) else f"no key below {_shortened(items)}"
        raise ScenarioError(f"{label}: override {key!r}: got {index!r}, expected {expected}")
    return items[int(index)]


# ---------------------------------------------------------------------------------------------------------------------
# Errors in plain words
# ---------------------------------------------------------------------------------------------------------------------

EXPECTED = {
    "greater_than": "a number above {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "a number below {lt:g}",
    "less_than_equal": "at most {le:g}",
    "finite_number": "a finite number",
    "float_type": "a number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "tuple_type": "a list",
    "too_short": "a list of at least {min_length}",
    "literal_error": "{expected}",
    "union_tag_invalid": "{expected_tags}",
    "model_type": "a mapping of keys to values",
    "model_attributes_type": "a mapping of keys to values",
}
"""What is allowed, by pydantic's name of the error."""


def explain(error: ValidationError, label: str) -> str:
    """One line a fault: file, key, what came, what is allowed.

    A list that is too short because its entries are faulty is not told again: pydantic counts the good ones only.
    """
    details = error.errors()
    faulty = {detail["loc"][:depth] for detail in details for depth in range(len(detail["loc"]))}
    told = [one for one in details if not (one["type"] == "too_short" and one["loc"] in faulty)]
    return "\n".join(f"{label}: {_explain_one(detail)}" for detail in told)


def _explain_one(detail: ErrorDetails) -> str:
    context, came, kind = detail.get("ctx", {}), detail["input"], detail["type"]
    keys = _keys(detail["loc"])
    if kind == "scenario":
        key = ".".join(filter(None, [*keys, context["key"]]))
        return f"{key}: {context['reason']}" if key else str(context["reason"])
    known: tuple[str, ...] = ()
    if kind.startswith("union_tag"):
        discriminator = str(context["discriminator"]).strip("'")
        known = FAMILIES if discriminator == "family" else LAWS
        keys.append(discriminator)
        if kind == "union_tag_not_found":
            return f"{'.'.join(keys)}: missing, expected one of {', '.join(known)}"
        came = context["tag"]
    elif kind == "literal_error":
        known = tuple(re.findall(r"'([^']+)'", context["expected"]))
    expected = EXPECTED[kind].format(**context) if kind in EXPECTED else detail["msg"]
    return f"{'.'.join(keys)}: got {_shortened(came)}, expected {expected}{nearest_hint(came, known)}"


def _keys(location: tuple[int | str, ...]) -> list[str]:
    """The keys a reader sees: without the names of branches, which pydantic puts after the key of a union."""
    unions = ("world", "motion", "target_motion")
    pairs = zip(("", *location), location, strict=False)
    return [str(item) for before, item in pairs if before not in unions and not str(item).startswith("<")]


def _shortened(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
