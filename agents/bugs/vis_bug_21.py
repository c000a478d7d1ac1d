"""VisBug-21: Bug2 with eyes. The robot goes straight to the farthest visible point of the path that Bug2 would walk.

Source: Lumelsky and Skewis (1990). Sensing assumed: ranges up to the vision range, goal, own position. Memory kept:
the M-line, the distances to the goal at the last hit point H and the last crossing X, the intermediate target T_i, a
gate at H. States: motion_to_goal (T_i on the M-line), motion_to_sub_goal (T_i on a contour), boundary_following (T_i
right before the robot). Guarantee: reaches the goal or declares it unreachable. Length: meant to be at most that of
Bug2, without a proof.
"""

from __future__ import annotations

import math

from bug_gym.agents.walls.vision import Scout, VisBug
from bug_gym.view import View


class VisBug21(VisBug):
    """VisBug-21; its parameters are those of VisBug."""

    def reference(self, view: View, scout: Scout) -> float:
        """How near to the goal T_i is on the M-line, or else X [m]: a point of the M-line that counts is nearer.

        None counts (0) while the robot is outside the main semiplane, the side of the M-line that it turns to at a hit.
        """
        if scout.m_line.offset(view.position) * self.vision.side < -self.vision.on_line:
            return 0.0
        return scout.crossing_distance if scout.contour is not None else math.dist(scout.place, scout.m_line.goal)
