"""VisBug-22: VisBug-21 that takes any visible point of the M-line nearer to the goal than the last hit point.

Source: Lumelsky and Skewis (1990). Sensing assumed: ranges up to the vision range, goal, own position. Memory kept:
the M-line, the distances to the goal at the last hit point H and the last crossing X, the intermediate target T_i, a
gate at H. States: motion_to_goal (T_i on the M-line), motion_to_sub_goal (T_i on a contour), boundary_following (T_i
right before the robot). Guarantee: reaches the goal or declares it unreachable. Length: may be more or less
than that of VisBug-21.
"""

from __future__ import annotations

import math

from bug_gym.agents.walls.vision import Scout, VisBug
from bug_gym.view import View


class VisBug22(VisBug):
    """VisBug-22; its parameters are those of VisBug."""

    def reference(self, view: View, scout: Scout) -> float:
        """How near to the goal T_i is on the M-line, or else H [m]: a point of the M-line that counts is nearer."""
        return scout.hit_distance if scout.contour is not None else math.dist(scout.place, scout.m_line.goal)
