"""Whether a goal goes elsewhere: that no way leads to where it is now proves nothing then."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.geometry import Point

ELSEWHERE = 0.05
"""A goal so far from where it was has moved [m]."""

SETTLED = 10.0
"""After so long without that it is taken to stay [s]."""


@dataclass
class GoalWatch:
    """Where a goal was, and since when."""

    place: Point | None = None
    """Where it was last seen to have come to [m]; None: it has not been looked at yet."""
    since: float = math.inf
    """How long ago it moved last [s]; infinite where it has not been seen to."""

    def look(self, goal: Point, seconds: float) -> None:
        """Look where it is, so long [s] after the last look."""
        self.since += seconds
        if self.place is None:
            self.place = goal
        elif math.dist(self.place, goal) > ELSEWHERE:
            self.place, self.since = goal, 0.0

    @property
    def has_settled(self) -> bool:
        """Whether it stays where it is, as far as one can tell."""
        return self.since >= SETTLED
