"""What it would cost that movers turn all of a sudden, which no prediction of where they are likeliest to be shows.

Source: this package. A mover that turns goes on in any direction, each as likely, as fast as before: some time later it is
somewhere on a circle about the place where it turned. The share of that circle from which it touches the robot is the
chance to be hit. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.agents.hd_bug.roll_out import Steering, Velocities, go_on, steering_of
from bug_gym.compiling import inlined, kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats
from bug_gym.kinematics import Drive

AHEAD = 1.4
"""For so long it matters who turns [s]: later the robot can answer it."""

FADING = 0.7
"""Time constant with which a hit ahead fades [s]."""


class Turning(NamedTuple):
    """T movers that may turn at N times, the first one now, evenly spaced."""

    places: F64
    """Where they would turn (T, N, 2) [m]."""
    radii: F64
    """(T,) [m]."""
    speeds: F64
    """(T,) [m/s]."""
    spacing: float
    """Between the times [s]."""
    rate: float
    """How often one turns [1/s]."""


def turning(positions: F64, radii: F64, speeds: F64, predicted: F64, spacing: float, rate: float) -> Turning:
    """Movers that go as predicted until they turn.

    Args:
        positions: where they are (T, 2) [m].
        radii: (T,) [m].
        speeds: (T,) [m/s].
        predicted: where they are said to go (T, K, 2) [m], at every spacing [s] from the first on; K is 2 or more.
        spacing: of the prediction [s]; of each two times one is looked at.
        rate: how often one turns [1/s].
    """
    count = min(max(round(AHEAD / (2.0 * spacing)), 1), predicted.shape[1] // 2)
    places = np.concatenate([positions[:, None], predicted[:, 1 : 2 * count - 2 : 2]], axis=1)
    return Turning(places, radii, speeds, 2.0 * spacing, float(rate))


def turn_risks(
    drive: Drive, pose: tuple[float, float, float], radius: float, velocities: Velocities, turning: Turning
) -> F64:
    """Chance to be hit (m,) after a turn, fading with time, summed over when they turn, and over the movers.

    Args:
        drive: kinematics and limits of the robot.
        pose: x, y [m], heading [rad].
        radius: of the robot [m].
        velocities: desired ones, m of them, that it holds.
        turning: who may turn, and where.
    """
    risks = np.zeros(len(velocities.directions))
    robot = np.empty((turning.places.shape[1], 2))
    _turn_risks(steering_of(drive), pose, radius, velocities, turning, robot, risks)
    return risks


@inlined
def share_within(distance: float, gone: float, reach: float) -> float:
    """Share of a circle of radius `gone` whose points lie within reach of a place at a distance from its middle."""
    if distance + gone <= reach:
        return 1.0
    if distance >= gone + reach or gone >= distance + reach:
        return 0.0
    cos = (distance * distance + gone * gone - reach * reach) / (2.0 * distance * gone)
    return math.acos(min(max(cos, -1.0), 1.0)) / math.pi


@kernel
def _turn_risks(
    steering: Steering,
    pose: tuple[float, float, float],
    radius: float,
    velocities: Velocities,
    turning: Turning,
    robot: Floats,
    risks: Floats,
) -> None:
    directions, speeds, free = velocities
    places, radii, mover_speeds, spacing, rate = turning
    count = len(robot)
    for i in range(len(directions)):
        px, py, theta = pose
        left = free[i]
        for k in range(count):
            for _ in range(2):
                px, py, theta, way = go_on(steering, directions[i], speeds[i], left, 0.5 * spacing, px, py, theta)
                left -= way
            robot[k, 0], robot[k, 1] = px, py
        for t in range(len(radii)):
            reach = radius + radii[t]
            for n in range(count):
                worst = 0.0
                for k in range(n, count):
                    gone = mover_speeds[t] * (k + 1 - n) * spacing
                    dx, dy = places[t, n, 0] - robot[k, 0], places[t, n, 1] - robot[k, 1]
                    square = dx * dx + dy * dy
                    if square < (reach + gone) ** 2:
                        hit = share_within(math.sqrt(square), gone, reach)
                        worst = max(worst, hit * math.exp(-(k + 1) * spacing / FADING))
                risks[i] += rate * spacing * math.exp(-rate * n * spacing) * worst
