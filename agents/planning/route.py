"""A planned way as a chain of places, and how far along it the robot has come. The frame is that of the plan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym.geometry import F64, Point

AHEAD = 2.0
"""How far beyond the place reached last the nearest place of a way is looked for [m]."""


class Route:
    """A planned way of the robot's centre.

    Args:
        places: (k, 2) from the start to the goal [m]; the same place twice in a row counts once.
        margin: what it keeps from obstacles beside the body [m].
    """

    def __init__(self, places: F64, *, margin: float) -> None:
        self.margin = margin
        array = np.asarray(places, dtype=np.float64).reshape(-1, 2)
        steps = np.hypot(*np.diff(array, axis=0).T)
        self.places: F64 = array[np.concatenate([[True], steps > 0.0])]
        self.along: F64 = np.concatenate([[0.0], np.cumsum(steps[steps > 0.0])])
        """How far it is to each place along the way (k,) [m]."""
        self.done = 0.0
        """How far along the way the robot has come [m]; it never falls."""
        self.is_left = False
        """Whether the robot was held beside it, and goes back to it."""

    @property
    def length(self) -> float:
        """Of the whole way [m]."""
        return float(self.along[-1])

    @property
    def rest(self) -> float:
        """What is left of it [m]."""
        return self.length - self.done

    def at(self, along: float) -> Point:
        """The place so far along the way [m]; its end where it is shorter."""
        return float(np.interp(along, self.along, self.places[:, 0])), float(
            np.interp(along, self.along, self.places[:, 1])
        )

    def advance(self, x: float, y: float) -> float:
        """Come along to the nearest place that lies ahead, up to AHEAD; returns how far the robot is from it [m]."""
        first, last = self._pieces(self.done, self.done + AHEAD)
        begin, end = self.places[first:last], self.places[first + 1 : last + 1]
        if len(begin) == 0:
            return math.hypot(x - self.places[-1, 0], y - self.places[-1, 1])
        run = end - begin
        square = np.einsum("ij,ij->i", run, run)
        share = np.clip(np.einsum("ij,ij->i", (x, y) - begin, run) / square, 0.0, 1.0)
        here = self.along[first:last] + share * np.sqrt(square)
        share = np.where(here < self.done, (self.done - self.along[first:last]) / np.sqrt(square), share)
        foot = begin + share[:, None] * run
        away = np.hypot(foot[:, 0] - x, foot[:, 1] - y)
        best = int(away.argmin())
        self.done = max(self.done, float(self.along[first + best] + share[best] * math.sqrt(square[best])))
        return float(away[best])

    def ahead(self, reach: float) -> F64:
        """The places (k, 2) from the one reached to one `reach` metres on, its bends between them."""
        end = min(self.done + reach, self.length)
        inner = (self.along > self.done) & (self.along < end)
        return np.concatenate([[self.at(self.done)], self.places[inner], [self.at(end)]])

    def _pieces(self, begin: float, end: float) -> tuple[int, int]:
        """Numbers of the first piece of the way between two distances along it, and of the one after the last."""
        first = max(int(np.searchsorted(self.along, begin, side="right")) - 1, 0)
        last = int(np.searchsorted(self.along, end, side="left"))
        return min(first, max(len(self.places) - 2, 0)), min(last, len(self.places) - 1)


def distances_to_chain(chain: F64, places: F64) -> NDArray[np.float64]:
    """Distance (n,) of places (n, 2) from a chain of straight pieces through other places (k, 2) [m]."""
    if len(chain) < 2:
        chain = np.concatenate([chain, chain])
    begin, run = chain[:-1], np.diff(chain, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", run, run), 1e-300)
    offset = places[:, None] - begin
    share = np.clip(np.einsum("nij,ij->ni", offset, run) / square, 0.0, 1.0)
    gap = offset - share[:, :, None] * run
    away: NDArray[np.float64] = np.sqrt(np.einsum("nij,nij->ni", gap, gap)).min(axis=1)
    return away
