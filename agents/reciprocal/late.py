"""ORCA with inertia: it decides for where a command of now will find the robots, and none crosses a border.

Of itself a robot knows where that is, as it has what is under way in mind; others are taken to go on as they go. That is
a guess, which the borders (borders.py) do not need: what is chosen, and what is sent at last, stays behind them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels, kinematics
from bug_gym.agents.reciprocal.bodies import BODY, GAP_SHARE, PX, PY, RADIUS, VX, VY
from bug_gym.agents.reciprocal.borders import ALONG, BORDER, TOWARD_X, TOWARD_Y, move_borders
from bug_gym.geometry import F64
from bug_gym.inertia import Ahead, after, foreseen
from bug_gym.kinematics import Drive
from bug_gym.policy import STANDING
from bug_gym.view import Sensors, View

ROUNDING = 1e-6
"""What places that were turned from frame to frame may be off [m]."""


class LateRobots:
    """What robots do among others that run the same, none of which can change its speed at once.

    Args:
        sensors: of each of them.
        peers: how many others each sees.
        room: what two of them leave between them [m].
    """

    def __init__(self, sensors: Sensors, peers: int, room: float) -> None:
        self.sensors, self.peers = sensors, peers
        drive = sensors.drive
        self.kept = sensors.radius + 0.5 * room
        """How far the middle of a robot keeps from a border [m]."""
        self._drive = np.array([self.kept, drive.max_speed, drive.max_acceleration, drive.step * drive.latency])

    def borders(self, view: View, bodies: F64, before: F64 | None) -> F64:
        """The borders (R - 1, BORDER) to the other robots, the first of bodies (n, BODY); `before`: those of a step ago."""
        borders = np.zeros((self.peers, BORDER)) if before is None else before
        speed = math.hypot(*view.own_velocity)
        move_borders(borders, bodies[: self.peers], np.array(view.pose), speed, self._drive)
        return borders

    def bodies_then(self, view: View, bodies: F64, borders: F64) -> F64:
        """Where bodies (n, BODY) will be when a command of now acts, in the robot's frame of then; and one for each border."""
        ahead, drive, least = foreseen(view), self.sensors.drive, self.sensors.radius + bodies[:, RADIUS]
        to_then, then = turned(ahead.turn), bodies.copy()
        places = bodies[:, PX : PY + 1] + drive.step * drive.latency * bodies[:, VX : VY + 1] - (ahead.x, ahead.y)
        apart = np.hypot(*places.T)
        places *= (np.maximum(apart, (1.0 + ROUNDING) * least) / np.maximum(apart, ROUNDING))[:, None]
        then[:, PX : PY + 1], then[:, VX : VY + 1] = places @ to_then, bodies[:, VX : VY + 1] @ to_then
        then[: self.peers, GAP_SHARE] = math.inf  # the borders see to that
        return np.concatenate([then, self._as_bodies(view, ahead, borders)])

    def _as_bodies(self, view: View, ahead: Ahead, borders: F64) -> F64:
        """Bodies (R - 1, BODY) that stand, of which a robot in its frame of then may come as near as to the borders."""
        drive = self.sensors.drive
        left = np.maximum(room_left(view, ahead, borders) - self.kept, 0.0)
        if math.isfinite(
            drive.max_acceleration
        ):  # it brakes along its way, so as hard toward a border as that lies to it
            fastest = min(speed_of(drive, ahead) + drive.max_acceleration * drive.step, drive.max_speed)
            speed = left / (drive.step + 0.5 * fastest / drive.max_acceleration)
            left = speed * drive.step + 0.5 * speed**2 / drive.max_acceleration
        bodies = np.zeros((len(borders), BODY))
        toward = borders[:, [TOWARD_X, TOWARD_Y]] @ turned(view.heading + ahead.turn)
        bodies[:, PX : PY + 1] = (2.0 * self.sensors.radius + left)[:, None] * toward
        bodies[:, RADIUS], bodies[:, GAP_SHARE] = self.sensors.radius, 1.0
        return bodies

    def kept_back(self, view: View, action: NDArray[np.float32], borders: F64) -> NDArray[np.float32]:
        """The action (2,); to brake, where after it the robot could not come to stand before each border."""
        drive, ahead = self.sensors.drive, foreseen(view)
        at_last = stopped(drive, after(drive, ahead, kinematics.asked_velocity(drive, action)))
        left = room_left(view, at_last, borders)
        if (left < np.minimum(self.kept, room_left(view, stopped(drive, ahead), borders)) - ROUNDING).any():
            return kinematics.steering(drive, STANDING)
        return action


def turned(angle: float) -> F64:
    """What turns rows (n, 2) into a frame that is turned by an angle [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def room_left(view: View, ahead: Ahead, borders: F64) -> F64:
    """How far before each border the middle of a robot will be (R - 1,) [m]."""
    x, y = view.to_odometry(ahead.x, ahead.y)
    return borders[:, ALONG] - borders[:, TOWARD_X] * x - borders[:, TOWARD_Y] * y


def speed_of(drive: Drive, ahead: Ahead) -> float:
    """How fast a robot will go [m/s]."""
    return math.hypot(*ahead.velocity) if drive.kinematics == "holonomic" else abs(ahead.velocity[0])


def stopped(drive: Drive, ahead: Ahead) -> Ahead:
    """Where a robot stands that brakes from there on, straight on."""
    speed = speed_of(drive, ahead)
    if speed == 0.0:
        return ahead
    way = kernels.stopping_way(speed, drive.max_acceleration, drive.step)
    if drive.kinematics == "holonomic":
        dx, dy = (way / speed * each for each in ahead.velocity)
    else:
        signed = math.copysign(way, ahead.velocity[0])
        dx, dy = signed * math.cos(ahead.turn), signed * math.sin(ahead.turn)
    return ahead._replace(x=ahead.x + dx, y=ahead.y + dy)
