"""What says that something moves: not what the tracker takes for a mover at once, but what goes on to be one.

The view of a still thing may change so that it passes for a mover for a second or two. But then its disc shifts to and
fro, and its velocity is seldom sure for more than half a second, where that of a mover stays so. So the first mover must
have been seen to go for a while, and to come some way; after that any will do, for in that world things move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from bug_gym.agents.tracking.filter import GATE
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import Point

SEEN_FOR = 1.0
"""How long the first mover must have been in sight, its velocity sure [s]."""

COME_FAR = 0.3
"""How far it must have come meanwhile [m]."""

HOLD = 3.0
"""How long movers are reckoned with after the last one was followed [s]."""


@dataclass
class Sighting:
    """A track since it was first taken for a mover, and its velocity has been sure."""

    place: Point
    """Where it was then, odometry frame [m]."""
    scans: int = 0
    """In how many scans it has been seen since."""


@dataclass
class Switch:
    """Whether things move about the robot; it goes on late and off late, so that nothing flickers."""

    sightings: dict[int, Sighting] = field(default_factory=dict)
    """What surely moves now, by the number of its track."""
    has_seen_one: bool = False
    """Whether something has moved for sure in this episode."""
    left: float = 0.0
    """How long movers are still reckoned with [s]."""

    @property
    def is_on(self) -> bool:
        """Whether movers are reckoned with."""
        return self.left > 0.0

    def update(self, tracks: Tracks, step: float) -> None:
        """Take in what is tracked; call it once a step.

        Args:
            tracks: of now.
            step: time since the last call [s].
        """
        self.left = max(self.left - step, 0.0)
        surely = {int(tracks.id[k]): k for k in np.flatnonzero(tracks.moving).tolist() if is_fast(tracks, k)}
        self.sightings = {number: self.sightings.get(number) or begin(tracks, k) for number, k in surely.items()}
        for number, index in surely.items():
            sighting = self.sightings[number]
            sighting.scans += bool(tracks.unseen[index] <= 0.0)
            gone = math.dist(sighting.place, tracks.position[index])
            self.has_seen_one |= gone >= COME_FAR and sighting.scans * step >= SEEN_FOR - 0.5 * step
        if self.has_seen_one and tracks.moving.any():
            self.left = HOLD


def is_fast(tracks: Tracks, index: int) -> bool:
    """Whether the velocity of a track is surely not nothing, by the gate of the tracker."""
    velocity, covariance = tracks.velocity[index], tracks.covariance[index, 2:, 2:]
    return float(velocity @ np.linalg.solve(covariance, velocity)) >= GATE


def begin(tracks: Tracks, index: int) -> Sighting:
    """A track is taken for a mover."""
    x, y = tracks.position[index].tolist()
    return Sighting((x, y))
