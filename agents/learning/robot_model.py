"""What a learned policy was trained for: the robot, its scanner and the layout of its observation, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
from pydantic import Field

from bug_gym.kinematics import DISCRETE_HEADINGS, DISCRETE_SPEEDS
from bug_gym.observation import SENSED
from bug_gym.policy import MisfitError
from bug_gym.schema.values import AtLeastOne, Count, NotNegative, Number, Positive
from bug_gym.spaces import ActionBox
from bug_gym.view import Sensors

LAYOUT = ("ranges", "goal", "pose", "velocity", "peers")
"""Fields of the observation that a learned policy knows, in their order."""


SAID_WHERE_THERE = ("own", "wheelbase", "max_steering")
"""Fields that are left out where they say nothing."""

OF_THE_WORLD = ("goal", "pose", "terrain", "peers")
"""Fields whose bounds are another world's where it is larger: a model may be played in both."""


@dataclass(frozen=True)
class RobotModel:
    """The part of `Sensors` that a network depends on; pydantic checks it where it is part of a file's schema."""

    kinematics: Annotated[str, Field(pattern="^(holonomic|differential|ackermann)$")]
    """ "holonomic", "differential" or "ackermann"."""
    radius: NotNegative
    """Radius of the disc that holds the body [m]."""
    max_speed: NotNegative
    """Largest forward speed [m/s]."""
    max_reverse: NotNegative
    """Largest backward speed [m/s]."""
    max_turn_rate: NotNegative
    """Largest turn rate [rad/s]."""
    max_acceleration: Positive | None
    """Largest change of speed [m/s^2]; None: no limit."""
    step: Positive
    """Time between two actions [s]."""
    beams: AtLeastOne
    """Beams of the scanner, B."""
    first_angle: Number
    """Bearing of the first beam [rad]."""
    angle_step: Number
    """Angle from one beam to the next [rad]."""
    range: Positive
    """Range that means "nothing seen" [m]."""
    peers: Count = 0
    """Other robots that the observation tells of."""
    own: tuple[tuple[str, int, float], ...] = ()
    """The scenario's own fields behind them: name, how many numbers, and the greatest size that one may have."""
    latency: Count = 0
    """Steps from an action to the one in which it acts."""
    wheelbase: NotNegative = 0.0
    """Between the axles [m]; 0: it is no ackermann robot."""
    max_steering: NotNegative = 0.0
    """Greatest steering angle [rad]; likewise."""

    @classmethod
    def of(cls, sensors: Sensors) -> RobotModel:
        """The model of a robot.

        Raises:
            ValueError: the observation has a field that learned policies do not know.
        """
        names = [field.name for field in sensors.fields]
        if strange := [name for name in names if name in SENSED and name not in LAYOUT]:
            raise ValueError(
                f"learned policies know the fields {', '.join(LAYOUT)}, the observation has {strange[0]!r}"
            )
        drive, angles = sensors.drive, sensors.angles
        return cls(
            kinematics=drive.kinematics,
            radius=sensors.radius,
            max_speed=drive.max_speed,
            max_reverse=drive.max_reverse,
            max_turn_rate=drive.max_turn_rate,
            max_acceleration=drive.max_acceleration if math.isfinite(drive.max_acceleration) else None,
            step=drive.step,
            beams=len(angles),
            first_angle=float(angles[0]),
            angle_step=float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi,
            range=sensors.range,
            latency=drive.latency,
            wheelbase=drive.wheelbase,
            max_steering=drive.max_steering,
            peers=sum(field.shape[0] for field in sensors.fields if field.name == "peers"),
            own=tuple(
                (field.name, field.end - field.begin, float(np.abs([field.low, field.high]).max()))
                for field in sensors.fields
                if field.name not in SENSED
            ),
        )

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> RobotModel:
        """The model that `as_dict` gave.

        Raises:
            ValueError: a key is missing or unknown.
        """
        try:
            return cls(**{**data, "own": tuple(tuple(field) for field in data.get("own", ()))})
        except TypeError as error:
            raise ValueError(f"this describes no robot: {error}") from None

    def as_dict(self) -> dict[str, Any]:
        """The fields as plain data; those of SAID_WHERE_THERE only where they say something."""
        return {name: value for name, value in asdict(self).items() if name not in SAID_WHERE_THERE or value}

    def differences(self, other: RobotModel) -> Iterator[str]:
        """Each field in which another robot differs, as "field 64, not 32"."""
        for field in fields(self):
            mine, theirs = getattr(self, field.name), getattr(other, field.name)
            same = math.isclose(mine, theirs, abs_tol=1e-9) if isinstance(mine, float) and theirs else mine == theirs
            if not same:
                yield f"{field.name} {mine}, not {theirs}"

    @property
    def is_full_circle(self) -> bool:
        """Whether the beams go all around."""
        return math.isclose(self.beams * self.angle_step, 2.0 * math.pi, rel_tol=1e-6)

    @property
    def width(self) -> int:
        """Length D of the flat observation."""
        return self.beams + 7 + 4 * self.peers + self.own_width

    @property
    def own_width(self) -> int:
        """How many of its numbers, the last ones, are the scenario's own."""
        return sum(numbers for _, numbers, _ in self.own)

    @property
    def own_scales(self) -> list[float]:
        """What each of those is divided by, so that it is a number near one."""
        return [scale or 1.0 for _, numbers, scale in self.own for _ in range(numbers)]


def require_spaces(told: object, observed: Any, acted: Any, sensors: Sensors) -> None:
    """Raise a MisfitError where a model was trained in other spaces than those of a robot.

    Their bounds tell of a scanner with another reach, of another top speed, and of wrappers that scale or that join the
    fields in another order: all of which the model's network takes for granted.

    Args:
        told: what an error calls the model, such as its file.
        observed: its observation space.
        acted: its action space.
        sensors: the robot.
    """
    is_dict, fields = isinstance(observed, gym.spaces.Dict), sensors.fields
    came = {name: space.shape for name, space in observed.items()} if is_dict else observed.shape
    expected = {field.name: field.shape for field in fields} if is_dict else (fields[-1].end,)
    if came != expected:
        raise MisfitError(f"{told} was made for observations {came}, the robot's are {expected}")
    for field in fields:
        if field.name not in OF_THE_WORLD:
            space, part = (observed[field.name], ...) if is_dict else (observed, slice(field.begin, field.end))
            low, high = space.low[part], space.high[part]
            if (low.ravel() != field.low.ravel()).any() or (high.ravel() != field.high.ravel()).any():
                raise MisfitError(
                    f"{told} was made for {field.name} from {low.min():g} to {high.max():g}, the robot's are from "
                    f"{field.low.min():g} to {field.high.max():g}: another robot, or wrappers that change what it sees"
                )
    if acted not in (ActionBox(), gym.spaces.Discrete(DISCRETE_HEADINGS * DISCRETE_SPEEDS)):
        actions = f"{gym.spaces.Box(-1.0, 1.0, (2,))} or {gym.spaces.Discrete(DISCRETE_HEADINGS * DISCRETE_SPEEDS)}"
        raise MisfitError(f"{told} was made for actions {acted}, the robot's are {actions}")
