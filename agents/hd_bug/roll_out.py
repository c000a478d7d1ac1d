"""What would come of a desired velocity among things that move: the roll-outs behind HD-BUG's avoidance.

Each candidate is a desired velocity that the robot holds. It is rolled out with the robot's own kinematics and compared,
time by time, with the predicted places of the tracks. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.compiling import inlined, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats
from bug_gym.kinematics import TURN_GAIN, TURN_IN_PLACE, Drive

FADING = 1.5
"""Time constant with which a hit ahead fades [s]."""


class Velocities(NamedTuple):
    """Desired velocities, m of them, that the robot would hold."""

    directions: F64
    """(m,) odometry frame [rad]."""
    speeds: F64
    """(m,) [m/s]."""
    free: F64
    """(m,) free way along each direction [m]; the robot stops at its end."""


class Movers(NamedTuple):
    """Where T discs are predicted to be at K times."""

    places: F64
    """Centres (T, K, 2) [m]."""
    radii: F64
    """Radii with what is not known of their places (T, K) [m]."""


class Steering(NamedTuple):
    """How the robot turns a desired velocity into motion, as kinematics.steering does."""

    is_holonomic: bool
    """Whether it goes any way without turning."""
    max_turn_rate: float
    """[rad/s]."""
    turn_gain: float
    """Turn rate per radian of heading error [1/s]."""
    turn_in_place: float
    """Heading error beyond which it stands while it turns [rad]."""


class RollOut(NamedTuple):
    """What comes of m velocities."""

    contact: F64
    """Time until it meets something predicted (m,) [s]; infinite where it doesn't within the horizon."""
    nearness: F64
    """The greatest chance of a hit, fading with time, summed over the discs (m,)."""
    end: F64
    """Where it is after the time to be compared at (m, 3): x, y [m], heading [rad]."""
    early: F64
    """How long before that it is at the goal (m,) [s]; 0: it is not."""


def steering_of(drive: Drive) -> Steering:
    """How a robot turns a desired velocity into motion."""
    turn_gain = min(TURN_GAIN, 1.0 / drive.step)
    return Steering(drive.kinematics == "holonomic", drive.max_turn_rate, turn_gain, TURN_IN_PLACE)


@inlined
def go_on(
    steering: Steering, direction: float, speed: float, left: float, dt: float, px: float, py: float, theta: float
) -> tuple[float, float, float, float]:
    """Place, heading and way [m] after a time dt [s] toward a desired velocity, no farther than `left` [m]."""
    is_holonomic, max_turn_rate, turn_gain, turn_in_place = steering
    if is_holonomic:
        way = min(speed * dt, left)
        return px + way * math.cos(direction), py + way * math.sin(direction), theta, way
    error = direction - theta
    error = math.atan2(math.sin(error), math.cos(error))
    turn = min(max(turn_gain * error, -max_turn_rate), max_turn_rate) * dt
    if abs(turn) > abs(error):
        turn = error
    way = min(speed * math.cos(error) * dt, left) if abs(error) <= turn_in_place else 0.0
    middle = theta + 0.5 * turn
    return px + way * math.cos(middle), py + way * math.sin(middle), theta + turn, way


def hit_risks(
    drive: Drive,
    pose: tuple[float, float, float],
    radius: float,
    velocities: Velocities,
    places: F64,
    radii: F64,
    spread: F64,
    times: F64,
    compare: int,
    goal: tuple[float, float, float],
) -> RollOut:
    """Roll out desired velocities among discs whose places are known up to a spread.

    The chance to be hit by a disc at a time is that of a normal deviation beyond the gap: Phi(-gap / sigma).

    Args:
        drive: kinematics and limits of the robot.
        pose: x, y [m], heading [rad].
        radius: of the robot [m].
        velocities: desired ones.
        places: (T, K, 2) centres [m].
        radii: (T,) of the discs [m].
        spread: (T, K) standard deviation of each coordinate [m].
        times: (K,) rising, evenly spaced, the first one spacing from now [s].
        compare: index of the time at which `end` is taken.
        goal: x, y, radius [m]; nothing hits a robot that has been there.

    Returns:
        contact: the time at which it is as likely hit as not (m,) [s]; nearness: the greatest chance of a hit, fading
        with time, summed over the discs (m,); end and early: see RollOut.
    """
    m = len(velocities.directions)
    result = RollOut(np.full(m, np.inf), np.zeros(m), np.empty((m, 3)), np.zeros(m))
    worst = np.empty(len(radii))
    _hit_risks(steering_of(drive), pose, radius, velocities, places, radii, spread, times, compare, goal, worst, result)
    return result


@kernel
def _hit_risks(
    steering: Steering,
    pose: tuple[float, float, float],
    radius: float,
    velocities: Velocities,
    places: Floats,
    radii: Floats,
    spread: Floats,
    times: Floats,
    compare: int,
    goal: tuple[float, float, float],
    worst: Floats,
    result: RollOut,
) -> None:
    directions, speeds, free = velocities
    contact, nearness, end, early = result
    dt = times[0]
    for i in range(directions.size):
        px, py, theta = pose
        left = free[i]
        worst[:] = 0.0
        for k in range(times.size):
            px, py, theta, way = go_on(steering, directions[i], speeds[i], left, dt, px, py, theta)
            left -= way
            fade = math.exp(-times[k] / FADING)
            for t in range(radii.size):
                gap = math.hypot(places[t, k, 0] - px, places[t, k, 1] - py) - radius - radii[t]
                if gap > 4.0 * spread[t, k]:
                    continue
                chance = 0.5 * math.erfc(gap / (math.sqrt(2.0) * spread[t, k]))
                if chance >= 0.5 and contact[i] == np.inf:
                    contact[i] = times[k]
                worst[t] = max(worst[t], chance * fade)
            is_there = (px - goal[0]) ** 2 + (py - goal[1]) ** 2 <= goal[2] * goal[2]
            if k == compare or (is_there and k < compare):
                end[i, 0], end[i, 1], end[i, 2] = px, py, theta
                early[i] = times[compare] - times[k]
            if is_there:
                break
        nearness[i] = worst.sum()
