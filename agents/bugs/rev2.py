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

from dataclasses import dataclass
from typing import Any, Literal

from bug_gym.agents.bugs.alg2 import Alg2, Alg2Memory
from bug_gym.agents.walls.boundary_bug import BoundaryParameters, alternating_side
from bug_gym.agents.walls.contour import Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.checks import shortened
from bug_gym.view import Sensors, View

VARIANTS = ("s001", "noborio")


@dataclass(frozen=True)
class Rev2Parameters(BoundaryParameters):
    """Parameters of Rev2."""

    variant: Literal["s001", "noborio"] = "s001"
    """Which of the two algorithms of that name: "s001" of Oni and Wang's comparison, "noborio" Alg2 with alternating
    sides."""


class Rev2(Alg2):
    """Rev2.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown variant; and what BoundaryBug refuses.
    """

    Parameters = Rev2Parameters
    parameters: Rev2Parameters
    fresh_starts = 0

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        variant = self.parameters.variant
        if variant not in VARIANTS:
            raise ValueError(f"variant must be one of {list(VARIANTS)}, got {shortened(variant)}")
        self.remembers = variant == "noborio"

    def hit(self, view: View, memory: Alg2Memory) -> None:
        """Begin to follow what blocks the way to the goal."""
        super().hit(view, memory)
        if not self.remembers and self.boundary.laps.is_looping(memory):
            memory.verdict = "looping"

    def next_side(self, memory: Alg2Memory) -> int:
        """The other side than last time."""
        return alternating_side(memory, self.side)

    def watch(self, view: View, memory: Alg2Memory, contour: Contour) -> None:
        """Leave the boundary, give up, or turn round, where the last step allows it or demands it."""
        if self.remembers:
            super().watch(view, memory, contour)
        elif self.boundary.may_leave(view, contour, is_nearer=True):
            self.boundary.leave(view, memory)
        elif is_proof(contour):
            memory.verdict = "unreachable"
