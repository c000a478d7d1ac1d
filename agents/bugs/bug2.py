"""Bug2: follow the straight line from start to goal (the M-line), and walls from one crossing of it to a nearer one.

Source: Lumelsky and Stepanov (1987). Sensing assumed: contact (here the scan within the clearance), goal, own position.
Memory kept: the M-line, the distance to the goal at the last hit point, a gate there. States: motion_to_goal,
boundary_following. Guarantee: reaches the goal or declares it unreachable. Length: at most D + sum(n_i p_i) / 2, n_i
crossings of the M-line with the boundary of obstacle i, p_i its perimeter at the clearance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.contour import Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.agents.walls.m_line import MLine, MLineBug, MLineMemory, go_along_until_hit, nearer_crossing
from bug_gym.policy import Velocity
from bug_gym.view import View


@dataclass
class Bug2Memory(MLineMemory):
    """Memory of Bug2."""

    hit_distance: float = math.inf
    """Distance to the goal at the last hit point [m], or at the crossing where the wall before was left, if that is nearer: the
    step that crosses the line may end farther off."""


class Bug2(MLineBug):
    """Bug2; its parameters are those of MLineBug."""

    def start(self) -> Bug2Memory:
        """Memory of a new episode."""
        return Bug2Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Bug2Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        line = self.m_line(view, memory)
        contour = memory.contour
        if contour is not None:
            if self._may_leave(view, memory, contour, line):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            elif is_proof(contour):
                memory.verdict = "unreachable"
        if memory.contour is None:
            velocity = go_along_until_hit(boundary, view, memory, self.side, line)
            if velocity is not None:
                return velocity
            contour = boundary.hit(view, memory, self.side, view.goal_bearing)
            memory.hit_distance = min(memory.hit_distance, contour.hit_distance)
            memory.mode = "boundary_following"
        return boundary.follow(view, memory)

    def forget_distances(self, view: View, memory: Bug2Memory) -> None:
        """On a wall, the place where the line begins now stands for the hit point."""
        memory.hit_distance = view.goal_distance if memory.contour is not None else math.inf

    def _may_leave(self, view: View, memory: Bug2Memory, contour: Contour, line: MLine) -> bool:
        """Whether the last step crossed the M-line nearer to the goal than the hit point, with a free way on."""
        distance = nearer_crossing(self.boundary, view, contour, line, memory.hit_distance)
        if distance is None or not self.boundary.may_go_on(view, contour):
            return False
        memory.hit_distance = distance
        return True
