"""What a scan shows: the ends of obstacles (open points), of virtual ones too, and the points that legs must pass.

An open point is where the reading jumps from one surface to another, or to none: an end of the nearer one. It is looked
for with a disc as wide as the body (agents/walls/open_points), and up to three beams without a return within a surface
are no gap. The ends of what moves give no sub-goals; virtual obstacles are cast into the scan.

Source: Das, Dutta and Debnath (2020), sections 2.1.2 and 3.1, equations (1) and (2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.critical_points.meeting import VirtualObstacle
from bug_gym.agents.critical_points.scan_kernels import bridge_dropouts, cast_capsule
from bug_gym.agents.walls.open_points import Lookout
from bug_gym.geometry import F64, Point
from bug_gym.kernels import scan_points
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


class Scanner:
    """How a robot reads its scan.

    Args:
        sensors: what a driver knows of the robot.
        radius: of the disc that gaps must let through to have ends [m].
        jump: change of the reading that makes an open point [m].

    Raises:
        ValueError: a jump not above 0 m.
    """

    def __init__(self, sensors: Sensors, *, radius: float, jump: float) -> None:
        if not jump > 0.0 or not math.isfinite(jump):
            raise ValueError(f"jump must be above 0 m, got {jump!r}")
        self.sensors = sensors
        self.lookout = Lookout(sensors, radius=radius, jump=jump)
        angles = sensors.angles
        self._wraps = bool(angles[-1] + 1.5 * self.lookout.spacing >= angles[0] + 2.0 * math.pi)
        self._directions = np.ascontiguousarray(sensors.beam_directions)

    def read(self, view: View, is_mover: NDArray[np.bool_] | None, virtual: Sequence[VirtualObstacle]) -> Reading:
        """Read a scan.

        Args:
            view: the observation.
            is_mover: whether each beam ended at something that moves (B,); None: none did.
            virtual: obstacles to cast into it.
        """
        reach, jump = self.sensors.range, self.lookout.jump
        ranges, owner = np.empty(len(view.ranges)), np.full(len(view.ranges), -1, dtype=np.int64)
        bridge_dropouts(view.ranges, reach, jump, BRIDGED, self._wraps, ranges)
        cos, sin = self._directions
        moving = np.zeros(len(ranges), dtype=np.bool_) if is_mover is None else is_mover
        ranges[moving] = reach  # a mover may hide its own virtual obstacle
        for number, obstacle in enumerate(virtual):
            ends = view.to_robot(*obstacle.begin), view.to_robot(*obstacle.end)
            cast_capsule(cos, sin, *ends[0], *ends[1], obstacle.radius, number, ranges, owner)
        moving = moving & (owner < 0)
        ranges[moving] = view.ranges[moving]
        found = []
        for point in self.lookout.look(view.with_ranges(ranges)).open_points:
            bearing = math.atan2(point.corner[1], point.corner[0])
            beam = self._beam_at(bearing)
            if not moving[beam]:
                its = virtual[owner[beam]] if owner[beam] >= 0 else None
                found.append(End(point.corner, bearing, point.side, its))
        return Reading(found, *self.points_but(ranges, moving))

    def points_but(self, ranges: F64, is_left_out: NDArray[np.bool_]) -> tuple[F64, F64]:
        """Points x (k,) and y (k,) of a scan (B,) without those of some beams (B,), robot's frame [m]."""
        places = np.empty(self._directions.shape)
        kept = np.where(is_left_out, self.sensors.range, ranges)
        count = scan_points(kept, self._directions, self.sensors.range, places)
        return places[0, :count], places[1, :count]

    def _beam_at(self, bearing: float) -> int:
        """The beam nearest to a bearing [rad]."""
        first = float(self.sensors.angles[0])
        turned = (bearing - first + 0.5 * self.lookout.spacing) % (2.0 * math.pi)
        return min(int(turned / self.lookout.spacing), len(self.sensors.angles) - 1)
