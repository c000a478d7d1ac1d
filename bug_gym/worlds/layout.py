"""One world as plain data: what a family makes, what pictures, shortest paths and files read."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bug_gym.geometry import F64
from bug_gym.schema.motions import Motion, Replay

Rings = tuple[F64, ...]
"""Corners (k, 2) of a polygon's shell, then of its holes [m]."""

SAME_POINT = 1e-9
"""Corners nearer to one another than this are one [m]: every wall has a direction."""


@dataclass(frozen=True)
class Mover:
    """An obstacle that moves as one body and doesn't turn."""

    outline: float | F64
    """Radius of a circle [m], or corners (k, 2) of a polygon relative to its place [m]."""
    at: tuple[float, float]
    """Place x, y [m]."""
    motion: Motion
    """How it moves."""

    @property
    def is_circle(self) -> bool:
        """Whether the outline is a radius."""
        return np.ndim(self.outline) == 0

    @property
    def is_there(self) -> bool:
        """Whether it stands at `at`: one that follows a record may have yet to come, or have left."""
        return not isinstance(self.motion, Replay) or self.motion.is_there(0.0)


@dataclass(frozen=True)
class Layout:
    """One world at the start of an episode."""

    border: F64
    """Corners (k, 2) of the simple polygon that bounds the world [m]; always a wall."""
    starts: F64
    """Poses (R, 3) of the robots: x, y [m], heading [rad]."""
    goals: F64
    """Places (G, 2) of the goals [m]: one for all robots, or one each."""
    circles: F64
    """Still circles (n, 3): x, y, radius [m]."""
    polygons: tuple[Rings, ...] = ()
    """Still polygons, each a tuple of rings (k, 2): the shell, then its holes [m]."""
    movers: tuple[Mover, ...] = ()
    """Moving circles and polygons."""
    target: Motion | None = None
    """How the goals move; None: they stand."""
    goal_room: float = 0.0
    """Distance that a moving goal keeps from still obstacles [m]."""


def side_by_side(start: Sequence[float], robots: int) -> F64:
    """Poses (R, 3) of robots 2 m apart in a row across the heading, their middle at `start`."""
    x, y, heading = start
    sin, cos = math.sin(heading), math.cos(heading)
    offsets = [2.0 * robot - (robots - 1.0) for robot in range(robots)]
    return np.array([(x - offset * sin, y + offset * cos, heading) for offset in offsets])
