"""Standing with discrete actions, none of which stands: a step there and a step back."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.geometry import velocity_along, wrap
from bug_gym.view import View

Velocity = tuple[float, float]


def sway(view: View, choices: NDArray[np.float64], last: Velocity | None) -> tuple[Velocity, Velocity | None]:
    """What a robot asks for that is to stand, and what to come back from at the next step.

    A differential robot turns to one side and back, a holonomic one goes away from what is nearest, as slowly as it can.

    Args:
        view: what it sees.
        choices: the velocities of the discrete actions (m, 2) [m/s].
        last: what it asked for at the last step, to come back from; robot's frame [m/s]. None: it did not sway, or is back.
    """
    if last is not None:
        return (-last[0], -last[1]), None
    slowest = float(np.hypot(*choices.T).min())
    is_differential = view.sensors.drive.kinematics == "differential"
    aside = 0.5 * math.pi if is_differential else view.nearest()[1] + math.pi
    headings = (2.0 * math.pi * number / kinematics.DISCRETE_HEADINGS for number in range(kinematics.DISCRETE_HEADINGS))
    velocity = velocity_along(min(headings, key=lambda heading: abs(wrap(heading - aside))), slowest)
    return velocity, velocity
