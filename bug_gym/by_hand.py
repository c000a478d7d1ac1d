"""Driving by hand: what keyboard, mouse and pad say -> the action of a robot's kinematics.

On the screen y goes up. A holonomic robot is sent where the arrows point; one that turns gets gas and wheel. A mouse
button that is held sends either kind to where the mouse is.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.kinematics import (
    DISCRETE_HEADINGS,
    DISCRETE_SPEEDS,
    Drive,
    differential_action,
    steering,
)

DIRECTIONS: dict[str, tuple[float, float]] = {
    "up": (0.0, 1.0),
    "down": (0.0, -1.0),
    "left": (-1.0, 0.0),
    "right": (1.0, 0.0),
    "w": (0.0, 1.0),
    "s": (0.0, -1.0),
    "a": (-1.0, 0.0),
    "d": (1.0, 0.0),
}
"""Keys that drive -> to the right and up, on the screen; ahead is up where the screen does not count."""
LETTERS = "wasd"
"""Those that every keyboard has as a letter."""
SLOW_KEYS, SLOW = {"left shift", "right shift"}, 0.4
"""Keys that slow a robot down, and the share of its speed that they leave."""
DEAD = 0.15
"""Tilt of a stick below which it is at rest: worn sticks do not come back to zero."""
ARRIVAL = 0.4
"""Time in which a robot that follows the mouse would be there [s]: nearer than its top speed takes it, it slows down."""


class Hands(NamedTuple):
    """What keyboard, mouse and pad say."""

    pressed: tuple[str, ...] = ()
    """Keys that went down since the last look, by the names that pygame gives them: "r", "escape", "left"."""
    held: frozenset[str] = frozenset()
    """Keys that are down."""
    mouse: tuple[float, float] | None = None
    """Column and row of the mouse while its left button is down [pixels]."""
    stick: tuple[float, float] = (0.0, 0.0)
    """The pad's left stick: to the right, and up, -1 to 1."""
    is_closed: bool = False
    """Whether somebody has closed the window."""


def levers(hands: Hands) -> tuple[float, float]:
    """How far stick, arrows or letters are pushed to the right, and up: each from -1 to 1."""
    if math.hypot(*hands.stick) > DEAD:
        return hands.stick
    pushed = [DIRECTIONS[key] for key in hands.held & DIRECTIONS.keys()]
    right, up = (max(-1.0, min(1.0, sum(axis))) for axis in zip((0.0, 0.0), *pushed, strict=True))
    share = SLOW if hands.held & SLOW_KEYS else 1.0
    return share * right, share * up


def direction(hands: Hands) -> tuple[float, float]:
    """Where they point: to the right, and up, at most 1 long."""
    right, up = levers(hands)
    scale = 1.0 / max(math.hypot(right, up), 1.0)
    return scale * right, scale * up


def hand_action(
    hands: Hands, drive: Drive, pose: tuple[float, float, float], place: tuple[float, float] | None = None
) -> NDArray[np.float32]:
    """What a robot is told by hand.

    Args:
        hands: what keyboard, mouse and pad say.
        drive: kinematics and limits of the robot.
        pose: where it is: x, y [m], heading [rad].
        place: where the mouse sends it x, y [m]; None: it does not.

    Returns:
        (2,) float32 action in [-1, 1]; of nobody's hands, the one that stands still.
    """
    if place is not None:
        return steering(drive, _velocity_to(place, drive, pose))
    if drive.kinematics == "holonomic":
        right, up = direction(hands)
        return steering(drive, _turned((drive.max_speed * right, drive.max_speed * up), -pose[2]))
    wheel, gas = levers(hands)
    speed = gas * (drive.max_speed if gas > 0.0 else drive.max_reverse)
    if drive.kinematics == "ackermann":  # the wheel is turned, whether it drives or not
        return np.array([differential_action(drive, speed, 0.0)[0], -wheel], dtype=np.float32)
    return differential_action(drive, speed, -wheel * drive.max_turn_rate)


def _velocity_to(place: tuple[float, float], drive: Drive, pose: tuple[float, float, float]) -> tuple[float, float]:
    """The velocity [m/s] in the robot's frame that takes it to a place."""
    ahead = (place[0] - pose[0], place[1] - pose[1])
    distance = math.hypot(*ahead)
    scale = min(drive.max_speed, distance / ARRIVAL) / distance if distance > 0.0 else 0.0
    return _turned((scale * ahead[0], scale * ahead[1]), -pose[2])


def _turned(vector: tuple[float, float], angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]


def keys_to_action(drive: Drive, *, discrete: bool) -> dict[tuple[str, ...], Any]:
    """Letters w, a, s, d, one or two held together -> action, as `gymnasium.utils.play.play` wants them.

    Up is ahead of the robot: who plays an env does not see where it looks. The discrete actions have none that stands; what
    Gymnasium takes for no key (0) creeps ahead.

    Args:
        drive: kinematics and limits of the robot.
        discrete: whether the actions are the numbers of the discrete ones, else arrays (2,) float32.
    """
    ahead = (0.0, 0.0, 0.5 * math.pi)  # looking up the screen
    actions: dict[tuple[str, ...], Any] = {}
    for keys in [*combinations(LETTERS, 1), *combinations(LETTERS, 2)]:
        hands = Hands(held=frozenset(keys))
        right, up = direction(hands)
        if right or up:  # opposite keys together say nothing
            actions[keys] = _discrete(right, up) if discrete else hand_action(hands, drive, ahead)
    return actions


def _discrete(right: float, up: float) -> int:
    """The number of the discrete action at full speed whose heading is nearest."""
    heading = round(math.atan2(-right, up) / (2.0 * math.pi / DISCRETE_HEADINGS)) % DISCRETE_HEADINGS
    return heading * DISCRETE_SPEEDS + DISCRETE_SPEEDS - 1
