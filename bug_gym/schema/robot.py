"""The robots: body and limits, laser scanner, odometry, and where several of them start."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, SerializerFunctionWrapHandler, Strict, model_serializer, model_validator

from bug_gym.limits import FASTEST_TURN
from bug_gym.schema.errors import wrong
from bug_gym.schema.ranges import least_of, most_of
from bug_gym.schema.values import (
    Beams,
    Disc,
    DrawnAcceleration,
    DrawnBias,
    DrawnLeastLength,
    DrawnLength,
    DrawnNoise,
    DrawnShare,
    DrawnSpeed,
    DrawnSpread,
    DrawnSteering,
    DrawnTopSpeed,
    DrawnTurnRate,
    NotNegative,
    Part,
    Point,
    Pose,
    RobotCount,
    not_tiny,
)

FULL_TURN = 2.0 * math.pi
FULL_TURN_TOLERANCE = 0.005  # a rounded 6.28 in a file still means the whole circle


class Robot(Part):
    """The robot's body and its limits.

    All numbers but `circles` and `latency` may be drawn for each episode (bug_gym.schema.ranges).
    """

    kinematics: Literal["holonomic", "differential", "ackermann"] = "holonomic"
    """How it moves: in any direction without turning, ahead and around, or as a car does, about its rear axle, on which its
    origin lies."""
    radius: DrawnLength = 0.2
    """Radius of a round body [m]."""
    circles: Annotated[tuple[Disc, ...], Field(min_length=1, max_length=1000)] | None = None
    """A body of several circles x, y, radius in the robot's frame [m], instead of the one of `radius`. While it turns they
    are tested along their arcs: no contact is missed, and none comes more than 0.02 mm too early, or 0.04 mm where two robots
    with such bodies meet."""
    max_speed: DrawnTopSpeed = 1.0
    """Maximum speed, of a differential or ackermann robot ahead [m/s]."""
    max_reverse: DrawnSpeed = 0.3
    """Maximum speed backwards of a differential or ackermann robot [m/s]; unless it is said, no more than the least
    `max_speed`."""
    max_turn_rate: DrawnTurnRate = 1.5
    """Maximum turn rate of a differential robot [rad/s]."""
    wheelbase: DrawnLength = 0.3
    """From the rear axle of an ackermann robot to its front axle [m]."""
    max_steering: DrawnSteering = 0.6
    """Greatest steering angle of an ackermann robot's front wheels to either side; they turn at once [rad]."""
    max_acceleration: DrawnAcceleration | None = None
    """Maximum change of speed [m/s^2]; none: at once."""
    latency: NotNegative = 0.0
    """Time from an action to the moment when it acts, a whole number of steps; until the first one acts, the robot stands
    [s]."""

    @model_validator(mode="after")
    def _limits_fit(self) -> Self:
        if "max_reverse" not in self.model_fields_set and self.max_reverse > least_of(self.max_speed):
            object.__setattr__(self, "max_reverse", least_of(self.max_speed))  # it is frozen
        if self.kinematics != "holonomic" and most_of(self.max_reverse) > least_of(self.max_speed):
            raise wrong(f"got {self.max_reverse}, expected at most max_speed ({self.max_speed})", "max_reverse")
        if self.kinematics == "ackermann" and self.greatest_turn_rate > FASTEST_TURN:
            came = f"got {self.wheelbase}, with which the robot turns by up to {self.greatest_turn_rate:g} rad/s"
            raise wrong(f"{came}, expected at most {FASTEST_TURN:g} rad/s", "wheelbase")
        return self

    @model_serializer(mode="wrap")
    def _without_what_it_lacks(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """What only an ackermann robot has is told of one, or where it has been set."""
        data: dict[str, Any] = handler(self)
        if self.kinematics != "ackermann":
            for key in ("wheelbase", "max_steering"):
                if getattr(self, key) == Robot.model_fields[key].default:
                    data.pop(key, None)
        return data

    @property
    def greatest_turn_rate(self) -> float:
        """How fast a robot that turns does so at most, of all that may be drawn [rad/s]."""
        if self.kinematics != "ackermann":
            return float(self.max_turn_rate)
        return most_of(self.max_speed) * math.tan(most_of(self.max_steering)) / least_of(self.wheelbase)

    @property
    def footprint(self) -> tuple[tuple[float, float, float], ...]:
        """The body as circles x, y, radius [m] in the robot's frame."""
        return self.circles or ((0.0, 0.0, float(self.radius)),)

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


FieldOfView = Annotated[
    float,
    Strict(),
    Field(gt=0.0, le=FULL_TURN + FULL_TURN_TOLERANCE),
    AfterValidator(not_tiny),
    AfterValidator(_whole_circle),
]


class Lidar(Part):
    """The laser scanner, at the robot's origin. Its ranges, noise and dropout may be drawn for each episode.

    Where the circles of a body leave its origin free, an obstacle may come over it: inside a circle beams read 0, inside a
    polygon the way to its sides.
    """

    beams: Beams = 180
    """How many beams, spread evenly."""
    range: DrawnLength = 10.0
    """Longest range; what nothing returns reads this, where it is drawn the longest that may be drawn [m]."""
    min_range: DrawnLeastLength = 0.0
    """Shortest range [m]."""
    fov: FieldOfView = FULL_TURN
    """Field of view, symmetric about the heading; within 0.005 of a full turn it is one [rad]."""
    noise: DrawnSpread = 0.0
    """Standard deviation of a range [m]."""
    dropout: DrawnShare = 0.0
    """Share of beams that return nothing, 0 to 1."""

    @model_validator(mode="after")
    def _ranges_are_ordered(self) -> Self:
        if most_of(self.min_range) >= least_of(self.range):
            raise wrong(f"got {self.min_range}, expected less than range ({self.range})", "min_range")
        return self

    @property
    def is_full_circle(self) -> bool:
        """Whether the beams go all around."""
        return self.fov == FULL_TURN


class Odometry(Part):
    """How the robot's own estimate of its pose drifts; each number may be drawn for each episode."""

    translation_noise: DrawnNoise = 0.0
    """Standard deviation of the distance, growing with its root [m/sqrt(m)]."""
    rotation_noise: DrawnNoise = 0.0
    """Standard deviation of the heading, growing with the root of the distance [rad/sqrt(m)]."""
    translation_bias: DrawnBias = 0.0
    """Excess of the distance [m/m]."""
    rotation_bias: DrawnBias = 0.0
    """Drift of the heading [rad/m]."""


class Place(Part):
    """Where one robot of several starts, and where it goes."""

    start: Pose
    """x [m], y [m], heading [rad]."""
    goal: Point | None = None
    """x, y [m]; none: the world's goal."""


class Robots(Part):
    """How many robots there are; a plain list gives the places of all of them."""

    count: RobotCount = 1
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
            raise wrong(f"got {self.count}, expected at most {len(self.places)}, as many as there are places", "count")
        return self

    @model_serializer(mode="wrap")
    def _shortest(self, handler: SerializerFunctionWrapHandler) -> Any:
        data = handler(self)
        if not self.places:
            return data
        return data["places"] if self.count == len(self.places) else {"count": self.count, "places": data["places"]}
