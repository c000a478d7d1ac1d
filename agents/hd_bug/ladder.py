"""How far HD-BUG looks: the ladder of detection radii, from how dense the surroundings are.

Source: Hasibuzzaman, Jan and Wu, eq. (6) and Table 1. They contradict each other in three ways; here there is one ladder
r' = r 2^k, k = 0 to 3, so that r'_max = 8 r, and it climbs where it is dense. It begins at k = 2, where the grid of
Procedure 3 (four radii of 0.5 m) is met exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bug_gym.geometry import F64

DENSE, SPARSE = 0.4, 0.15
"""Above and below this share of short beams the surroundings count as dense and as sparse."""

DENSE_STEPS, SPARSE_STEPS = 3, 10
"""For how many steps in a row they must, so that the detection radius changes."""

RUNGS = 4
"""Detection radii: r, 2 r, 4 r and 8 r."""


@dataclass
class Ladder:
    """The detection radius r' = r 2^k; Table 1 also counts how often it was changed, which nothing asks for."""

    k: int = 2
    dense: int = 0
    """Steps in a row with many short beams."""
    sparse: int = 0
    """Steps in a row with few."""

    def update(self, density: float) -> None:
        """Climb after three dense steps, descend after ten sparse ones; density: share of short beams."""
        self.dense = self.dense + 1 if density > DENSE else 0
        self.sparse = self.sparse + 1 if density < SPARSE else 0
        if self.dense >= DENSE_STEPS and self.k < RUNGS - 1:
            self.k, self.dense = self.k + 1, 0
        elif self.sparse >= SPARSE_STEPS and self.k > 0:
            self.k, self.sparse = self.k - 1, 0


def density(ranges: F64, reach: float) -> float:
    """Share of the beams (B,) that end within the detection radius [m], 0 to 1."""
    return float(np.count_nonzero(ranges < reach)) / len(ranges)
