"""Rev1: Alg1 that takes the other side at each new hit point.

Source: Horiuchi and Noborio (2001). Sensing assumed: contact (here the scan within the clearance), goal, own position.
Memory kept: the M-line, the smallest distance to the goal on it, all hit and leave points, the side taken last, the
trace along the present boundary. States: motion_to_goal, boundary_following, walking_back. Guarantee: reaches the goal
or declares it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i at the clearance.
"""

from __future__ import annotations

from bug_gym.agents.bugs.alg1 import Alg1, Alg1Memory
from bug_gym.agents.walls.boundary_bug import alternating_side


class Rev1(Alg1):
    """Rev1; its parameters are those of MLineBug."""

    def next_side(self, memory: Alg1Memory) -> int:
        """Side to turn to at the next hit point."""
        return alternating_side(memory, self.side)
