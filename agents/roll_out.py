"""What would come of a desired velocity among things that move: the roll-outs behind HD-BUG's two-phase avoidance.

Each candidate is a desired velocity that the robot holds. It is rolled out with the robot's own kinematics and compared,
time by time, with the predicted places of the tracks. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.kernels import Floats, kernel
from bug_gym.kinematics import TURN_GAIN, TURN_IN_PLACE, Drive

F64 = NDArray[np.float64]


class RollOut(NamedTuple):
    """What comes of m candidates."""

    contact: F64
    """Time until it meets something predicted (m,) [s]; infinite where it doesn't within the horizon."""
    nearness: F64
    """Penalty for passing nearer than the margin (m,): the squared shortfall as a share, fading with time."""
    end: F64
    """Where it is after the time to be compared at (m, 2) [m]."""


def roll_out(
    drive: Drive,
    pose: tuple[float, float, float],
    directions: F64,
    speeds: F64,
    free: F64,
    radius: float,
    times: F64,
    predicted: F64,
    radii: F64,
    margin: float,
    fading: float,
    compare: int,
) -> RollOut:
    """Roll out desired velocities.

    Args:
        drive: kinematics and limits of the robot.
        pose: x, y [m], heading [rad].
        directions: (m,) of the desired velocities, odometry frame [rad].
        speeds: (m,) [m/s].
        free: (m,) free way along each direction [m]; the robot stops at its end.
        radius: of the robot [m].
        times: (K,) rising, evenly spaced, the first one spacing from now [s].
        predicted: (T, K, 2) places of the tracks then [m].
        radii: (T, K) radii of the tracks, with what is not known of their places [m].
        margin: nearer than this is near [m].
        fading: time constant with which nearness fades [s].
        compare: index of the time at which `end` is taken.
    """
    m = len(directions)
    result = RollOut(np.empty(m), np.empty(m), np.empty((m, 2)))
    _roll_out(
        drive.kinematics == "holonomic", drive.max_turn_rate, min(TURN_GAIN, 1.0 / drive.step),
        pose[0], pose[1], pose[2], directions, speeds, free, radius, times, predicted, radii, margin, fading, compare,
        result.contact, result.nearness, result.end,
    )  # fmt: skip
    return result


@kernel
def _roll_out(
    is_holonomic: bool,
    max_turn_rate: float,
    turn_gain: float,
    x: float,
    y: float,
    heading: float,
    directions: Floats,
    speeds: Floats,
    free: Floats,
    radius: float,
    times: Floats,
    predicted: Floats,
    radii: Floats,
    margin: float,
    fading: float,
    compare: int,
    contact: Floats,
    nearness: Floats,
    end: Floats,
) -> None:
    tracks, count = radii.shape
    dt = times[0]
    for i in range(len(directions)):
        px, py, theta = x, y, heading
        left = free[i]
        contact[i] = np.inf
        nearness[i] = 0.0
        ox, oy = px, py
        for k in range(count):
            if is_holonomic:
                way = min(speeds[i] * dt, left)
                px += way * math.cos(directions[i])
                py += way * math.sin(directions[i])
            else:
                error = directions[i] - theta
                error = math.atan2(math.sin(error), math.cos(error))
                turn = min(max(turn_gain * error, -max_turn_rate), max_turn_rate) * dt
                if abs(turn) > abs(error):
                    turn = error
                way = min(speeds[i] * math.cos(error) * dt, left) if abs(error) <= TURN_IN_PLACE else 0.0
                px += way * math.cos(theta + 0.5 * turn)
                py += way * math.sin(theta + 0.5 * turn)
                theta += turn
            left -= way
            fade = math.exp(-times[k] / fading)
            for t in range(tracks):
                reach = radius + radii[t, k]
                dx, dy = predicted[t, k, 0] - px, predicted[t, k, 1] - py
                square = dx * dx + dy * dy
                if square >= (reach + margin) ** 2:
                    continue
                if square < reach * reach:
                    if contact[i] == np.inf:
                        contact[i] = times[k]
                    nearness[i] = max(nearness[i], fade)
                else:
                    short = 1.0 - (math.sqrt(square) - reach) / margin
                    nearness[i] = max(nearness[i], short * short * fade)
            if k == compare:
                ox, oy = px, py
        end[i, 0], end[i, 1] = ox, oy
