"""VisBug-21: Bug2 with eyes. The robot goes straight to the farthest visible point of the path that Bug2 would walk.

Source: Lumelsky and Skewis (1990). Sensing assumed: ranges up to the vision range, goal, own position. Memory kept:
the M-line, the distances to the goal at the last hit point H and the last crossing X, the intermediate target T_i, a
gate at H. States: motion_to_goal (T_i on the M-line), motion_to_sub_goal (T_i on a contour), boundary_following (T_i
right before the robot). Guarantee: reaches the goal or declares it unreachable. Length: meant to be at most that of
Bug2, without a proof.
"""

from __future__ import annotations

import math

from bug_gym.observation import Sensors, View
from bug_gym.policy import Drawing, ScriptedPolicy, Velocity

from .boundary_following import LeaveRule, Turn
from .vision import Scout, Vision, VisionMemory


class VisBug21(ScriptedPolicy):
    """VisBug-21.

    Args:
        sensors: what a driver knows of the robot.
        clearance: centre to wall while following [m]; None: body radius and one step.
        turn: which way to turn at a wall.
        leave_rule: "any": leave at a crossing wherever the goal lies (the algorithm as published); "front": only with
            the goal within 90 degrees of the direction of travel.
        vision_range: how far the robot looks [m]; None: as far as its LIDAR.
        discrete: whether actions are numbers of the discrete table.

    Raises:
        ValueError: a clearance not above the radius, an unknown turn or rule, a vision range below the clearance.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "any",
        vision_range: float | None = None,
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, discrete=discrete)
        self.vision = Vision(sensors, clearance=clearance, turn=turn, leave_rule=leave_rule, vision_range=vision_range)

    def start(self) -> VisionMemory:
        """Memory of a new episode."""
        return VisionMemory(mode="motion_to_goal")

    def act(self, view: View, memory: VisionMemory) -> Velocity:
        """One decision."""
        vision = self.vision
        scan = vision.look(view, memory)
        if not vision.sees_goal(scan, memory):
            vision.walk_ahead(scan, memory)
            while vision.jump(scan, memory, self._reference(view, memory.scout)):
                vision.walk_ahead(scan, memory)
        return vision.move(scan, memory)

    def _reference(self, view: View, scout: Scout) -> float:
        """How near to the goal T_i is on the M-line, or else X [m]: a point of the M-line that counts is nearer.

        None counts (0) while the robot is outside the main semiplane, the side of the M-line that it turns to at a hit.
        """
        if scout.m_line.offset(view.position) * self.vision.side < -self.vision.on_line:
            return 0.0
        return scout.crossing_distance if scout.contour is not None else math.dist(scout.place, scout.m_line.goal)

    def draw(self, memory: VisionMemory) -> Drawing:
        """Hit and leave points, the M-line and T_i."""
        return self.vision.draw(memory)
