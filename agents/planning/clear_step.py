"""What the map allows of a velocity: who leaves a way is kept off what stands there by the map, not by the scan alone.

Corners lie between the beams, and some beams are lost; a robot that turns swings out of a bend. A velocity is clear if the
robot, which drives it for a step and then brakes straight on, touches nothing of the map. As what it did before was clear,
braking straight on always is.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.planning.map import PlanningMap, Pose
from bug_gym.geometry import F64
from bug_gym.kinematics import Drive, turning
from bug_gym.policy import Velocity

SHARES = (1.0, 0.5, 0.2, 1e-6)
"""Of a velocity, tried in turn; the last turns a robot that has to turn, and hardly moves it."""
ROOM = 0.002
"""What is kept beside the body [m]."""
CHORDS = 4
"""Of the arc of a step."""


def clear_velocity(
    still: PlanningMap, pose: Pose, own: Velocity, wish: Velocity, drive: Drive, radius: float
) -> Velocity:
    """As much of a velocity as touches nothing that stands; none of it where all does.

    A body that is nearer than `radius` to something, as one that is no disc may be, comes no nearer.

    Args:
        still: what stands.
        pose: of the robot.
        own: its velocity now, in its frame [m/s].
        wish: the velocity that is asked about, in its frame [m/s].
        drive: how it moves.
        radius: of the disc about it [m].
    """
    if still.is_clear(swept(drive, pose, own, wish), radius + ROOM):
        return wish
    kept = min(radius + ROOM, still.clearance_at(pose[:2]) - 1e-9)
    for share in SHARES:
        velocity = share * wish[0], share * wish[1]
        if still.is_clear(swept(drive, pose, own, velocity), kept):
            return velocity
    return 0.0, 0.0


def swept(drive: Drive, pose: Pose, own: Velocity, wish: Velocity) -> F64:
    """Places (k, 2) that the robot comes through if it drives a velocity for a step, and then brakes straight on [m]."""
    x, y, heading = pose
    most = drive.max_acceleration * drive.step
    if drive.kinematics == "holonomic":
        change = wish[0] - own[0], wish[1] - own[1]
        share = min(1.0, most / max(math.hypot(*change), 1e-12))
        ahead, left = own[0] + share * change[0], own[1] + share * change[1]
        speed, rate, heading = math.hypot(ahead, left), 0.0, heading + math.atan2(left, ahead)
    else:
        asked, rate = turning(drive, wish)
        speed = min(max(asked, own[0] - most), own[0] + most)
    angles = heading + rate * drive.step * (np.arange(CHORDS) + 0.5) / CHORDS
    lengths = np.full(CHORDS + 1, speed * drive.step / CHORDS)
    lengths[-1] = 0.5 * speed * abs(speed) / drive.max_acceleration
    angles = np.append(angles, heading + rate * drive.step)
    steps = lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([[(x, y)], (x, y) + np.cumsum(steps, axis=0)])
