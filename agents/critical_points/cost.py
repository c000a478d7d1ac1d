"""The cost of a way in seconds: C_T = sum(d_i / v + alpha_i / omega) + sum(DOT), to move, to rotate and to detect.

Source: Das, Dutta and Debnath (2020), section 3.2. Each moving obstacle that is found costs the time between the two
looks that find it (the robot goes on meanwhile), and waiting for one counts as detection too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import wrap


@dataclass
class Cost:
    """What a way has cost so far."""

    length: float = 0.0
    """Way [m]."""
    rotation: float = 0.0
    """Rotation on the spot and on the way [rad]."""
    moving: float = 0.0
    """T_M [s]."""
    rotating: float = 0.0
    """T_R [s]."""
    detecting: float = 0.0
    """Sum of DOT [s]."""
    pose: tuple[float, float, float] | None = None
    """Last pose x [m], y [m], heading [rad], odometry frame."""

    @property
    def total(self) -> float:
        """C_T [s]."""
        return self.moving + self.rotating + self.detecting

    def go_on(self, pose: tuple[float, float, float], speed: float, turn_rate: float) -> None:
        """Count the way since the last pose.

        Args:
            pose: now x [m], y [m], heading [rad], odometry frame.
            speed: v [m/s].
            turn_rate: omega [rad/s]; infinite where the robot need not turn.
        """
        if self.pose is not None:
            way, turn = math.dist(pose[:2], self.pose[:2]), abs(wrap(pose[2] - self.pose[2]))
            self.length += way
            self.rotation += turn
            self.moving += way / speed
            self.rotating += turn / turn_rate
        self.pose = pose
