"""Rev2: a bug that takes the other side at each hit point. Two algorithms go by this name.

"s001": leaves a wall wherever the way to the goal is free; keeps nothing but the side. Source: Oni and Wang's
comparison, after McGuire et al. (2019). States: motion_to_goal, boundary_following. Guarantee: none, it can cycle for
ever and then calls itself looping; a full lap without any free heading does prove that the goal is shut in. Length
bound: none.

"noborio": Alg2 with alternating sides. Source: Horiuchi and Noborio (2001). Memory kept: the smallest distance to the
goal on the whole trip, all hit and leave points, the trace along the present boundary. A further state: walking_back.
Guarantee: reaches the goal or declares it unreachable. Length: at most D + 2 sum(p_i), p_i the perimeter of obstacle i
at the clearance.

Sensing assumed by both: contact (here the scan within the clearance), goal; by the second also the own position.
"""

from __future__ import annotations

from typing import Literal

from bug_gym.agents.bugs.alg2 import Alg2, Alg2Memory
from bug_gym.agents.walls.boundary_following import Contour, LeaveRule, Turn, alternating_side
from bug_gym.view import Sensors, View

VARIANTS = ("s001", "noborio")


class Rev2(Alg2):
    """Rev2. Parameters not named here are those of BoundaryBug.

    Args:
        variant: "s001" or "noborio", see above.

    Raises:
        ValueError: an unknown variant; and what BoundaryBug refuses.
    """

    def __init__(
        self,
        sensors: Sensors,
        *,
        clearance: float | None = None,
        turn: Turn = "left",
        leave_rule: LeaveRule = "front",
        variant: Literal["s001", "noborio"] = "s001",
        discrete: bool = False,
    ) -> None:
        super().__init__(sensors, clearance=clearance, turn=turn, leave_rule=leave_rule, discrete=discrete)
        if variant not in VARIANTS:
            raise ValueError(f"variant must be one of {list(VARIANTS)}, got {variant!r}")
        self.remembers = variant == "noborio"

    def hit(self, view: View, memory: Alg2Memory) -> None:
        """Begin to follow what blocks the way to the goal, to the other side than last time."""
        self.boundary.hit_and_trace(view, memory, alternating_side(memory, self.side), view.goal_bearing)
        if not self.remembers and self.boundary.is_looping(memory):
            memory.verdict = "looping"

    def watch(self, view: View, memory: Alg2Memory, contour: Contour) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        if self.remembers:
            super().watch(view, memory, contour)
        elif self.boundary.is_free(view, view.goal_bearing, view.goal_distance, contour):
            self.boundary.leave(view, memory)
        elif contour.is_lap_closed:
            memory.verdict = "unreachable"
