"""What says that something moves: not what the tracker takes for a mover at once, but what goes on to be one.

The view of a still thing may change so that it passes for a mover for some scans: in 32 worlds without movers such
ghosts were seen for at most 11 scans of 0.1 s, and the one seen longest came 0.24 m far. A mover goes on. So the first
one must have been seen for a while, and have come some way; after that any will do, for in that world things move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import Point

SEEN_FOR = 1.0
"""How long the first mover must have been in sight as one [s]."""

COME_FAR = 0.3
"""How far it must have come meanwhile [m]."""

HOLD = 3.0
"""How long movers are reckoned with after the last one was followed [s]."""


@dataclass
class Sighting:
    """A track since it was first taken for a mover."""

    place: Point
    """Where it was then, odometry frame [m]."""
    scans: int = 0
    """In how many scans it was seen, and taken for one."""


@dataclass
class Switch:
    """Whether things move about the robot; it goes on late and off late, so that nothing flickers."""

    sightings: dict[int, Sighting] = field(default_factory=dict)
    """What has been taken for a mover, by the number of its track."""
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
        known = set(tracks.id.tolist())
        self.sightings = {number: sighting for number, sighting in self.sightings.items() if number in known}
        for index in np.flatnonzero(tracks.moving):
            x, y = tracks.position[index].tolist()
            sighting = self.sightings.setdefault(int(tracks.id[index]), Sighting((x, y)))
            sighting.scans += bool(tracks.unseen[index] <= 0.0)
            gone = math.dist(sighting.place, (x, y))
            self.has_seen_one |= gone >= COME_FAR and sighting.scans * step >= SEEN_FOR - 0.5 * step
        if self.has_seen_one and tracks.moving.any():
            self.left = HOLD
