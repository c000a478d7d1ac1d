"""What a scan shows: the ends of obstacles (open points), of virtual ones too, and the points that legs must pass.

An open point is where neighbouring beams see different surfaces: an end of the nearer one. Up to three beams without a
return within a surface are no gap. The ends of what moves give no sub-goals; virtual obstacles are cast into the scan.

Source: Das, Dutta and Debnath (2020), sections 2.1.2 and 3.1, equations (1) and (2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.critical_points.meeting import VirtualObstacle
from bug_gym.agents.critical_points.scan_kernels import bridge_dropouts, cast_capsule, find_ends
from bug_gym.agents.scan import open_ways
from bug_gym.geometry import F64, Point
from bug_gym.view import Sensors, View

BRIDGED = 3
"""Beams without a return in a row that are no gap."""

JUMP = 0.5
"""Change of the reading that makes an open point [m], at most, where noise is small."""


class End(NamedTuple):
    """An open point, in the robot's frame."""

    point: Point
    """[m]."""
    bearing: float
    """Of the beam that saw it [rad]."""
    side: int
    """+1: the left end of an obstacle, -1: the right one."""
    virtual: VirtualObstacle | None
    """The virtual obstacle that it belongs to."""


class Reading(NamedTuple):
    """A scan as critical points need it, in the robot's frame."""

    ends: list[End]
    """Counter-clockwise from the first beam."""
    x: F64
    """Points of what stands, and of virtual obstacles (k,) [m]."""
    y: F64
    """[m]."""
    extents: list[float]
    """Half of the width in sight of what ends at each end [m]."""


class Scanner:
    """How a robot reads its scan.

    Args:
        sensors: what a driver knows of the robot.
        jump: change of the reading that makes an open point [m].

    Raises:
        ValueError: a jump not above 0 m.
    """

    def __init__(self, sensors: Sensors, jump: float) -> None:
        if not jump > 0.0 or not math.isfinite(jump):
            raise ValueError(f"jump must be above 0 m, got {jump!r}")
        self.sensors = sensors
        self.jump = jump
        angles, beams = sensors.angles, len(sensors.angles)
        spacing = float(angles[1] - angles[0]) if beams > 1 else 2.0 * math.pi
        self._wraps = bool(angles[-1] + 1.5 * spacing >= angles[0] + 2.0 * math.pi)
        self._directions = np.ascontiguousarray(sensors.beam_directions)
        self._link = np.empty(beams, dtype=np.bool_)
        self._beam, self._side = np.empty(2 * beams, dtype=np.int64), np.empty(2 * beams, dtype=np.int64)

    def read(self, view: View, is_mover: NDArray[np.bool_] | None, virtual: Sequence[VirtualObstacle]) -> Reading:
        """Read a scan.

        Args:
            view: the observation.
            is_mover: whether each beam ended at something that moves (B,); None: none did.
            virtual: obstacles to cast into it.
        """
        reach, noise = self.sensors.range, self.sensors.range_noise
        ranges, owner = np.empty(len(view.ranges)), np.full(len(view.ranges), -1, dtype=np.int64)
        bridge_dropouts(view.ranges, reach, self.jump, BRIDGED, self._wraps, ranges)
        cos, sin = self._directions
        for number, obstacle in enumerate(virtual):
            ends = view.to_robot(*obstacle.begin), view.to_robot(*obstacle.end)
            cast_capsule(cos, sin, *ends[0], *ends[1], obstacle.radius, number, ranges, owner)
        x, y = cos * ranges, sin * ranges
        # Gaps of any width count here: those too narrow are what SAFE_POINT is for.
        open_ways.link_beams(x, y, ranges, reach, self.jump, 0.0, noise, self._wraps, self._link)
        self._link &= owner == np.roll(owner, -1)
        moving = np.zeros(len(ranges), dtype=np.bool_) if is_mover is None else is_mover & (owner < 0)
        count = find_ends(ranges, reach, self._link, self._wraps, self._beam, self._side)
        found, extents = [], []
        for beam, side in zip(self._beam[:count].tolist(), self._side[:count].tolist(), strict=True):
            if moving[beam]:
                continue
            obstacle_of = virtual[owner[beam]] if owner[beam] >= 0 else None
            found.append(End((float(x[beam]), float(y[beam])), float(self.sensors.angles[beam]), side, obstacle_of))
            extents.append(self._extent(x, y, beam, side))
        seen = (ranges < reach) & ~moving
        return Reading(found, x[seen], y[seen], extents)

    def _extent(self, x: F64, y: F64, beam: int, side: int) -> float:
        """Half of the width in sight of the surface that ends at a beam [m]."""
        count, other = len(x), beam
        for _ in range(count):
            before = (other - side) % count
            if not self._link[before if side > 0 else other]:
                break
            other = before
        return 0.5 * math.hypot(x[beam] - x[other], y[beam] - y[other])
