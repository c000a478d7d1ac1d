"""HD-BUG drives: to a place, past what stands in the first steps, as fast as eq. (9) allows."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.geometry import F64, Point, wrap
from bug_gym.view import View

OFFSETS: F64 = np.radians(np.stack([np.arange(0.0, 88.0, 3.0), -np.arange(0.0, 88.0, 3.0)], axis=1).ravel())[1:]
"""Turns away from a direction that are tried, the smallest first [rad]."""

RING: F64 = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
"""Directions of the emergency points, odometry frame [rad]."""

TURNING = 1e-6
"""A speed that only tells where to turn [m/s]."""


class Motion:
    """How HD-BUG turns a place into a direction and a speed.

    Args:
        parameters: of HD-BUG.
        boundary: clearances, and what they mean.
    """

    def __init__(self, parameters: HDBugParameters, boundary: Boundary) -> None:
        self.parameters = parameters
        self.boundary = boundary
        self.drive = boundary.sensors.drive
        self.speeds = tuple(
            share * self.drive.max_speed for share in (parameters.v_max, parameters.v_base, parameters.v_min)
        )
        """v_max, v_base and v_min of eq. (9) [m/s]."""

    def radius_for(self, view: View) -> float:
        """Radius of the disc that must not touch anything [m]: never more than what is free about the robot now."""
        radius = self.boundary.sensors.radius
        return min(self.boundary.hit_radius, max(view.nearest()[0] - 1e-3, 0.9 * radius))

    def toward(self, scene: Scene, place: Point) -> tuple[float, float] | None:
        """Direction [rad] and speed [m/s] to a place of the odometry frame; None where everything is in the way."""
        view = scene.view
        x, y = view.to_robot(*place)
        gap, bearing = math.hypot(x, y), math.atan2(y, x)
        ways = view.free_distances(bearing + OFFSETS, self.radius_for(view))
        need = min(self.boundary.step, gap)
        good = np.flatnonzero(ways >= need)
        if len(good) == 0:
            return None
        bearing += float(OFFSETS[good[0]])
        free = float(ways[good[0]])
        speed = min(self.rule(view, bearing, free, gap), gap / self.drive.step)
        return wrap(bearing + view.heading), max(speed, TURNING)

    def rule(self, view: View, bearing: float, free: float, gap: float) -> float:
        """The speed of eq. (9) along a bearing [rad] that is free so far [m], to a place so far away [m]; with brakes.

        v_max where the way to the place is clear, v_base where an obstacle is nearer than a pace, v_min in a passage
        narrower than two bodies.
        """
        top, base, slow = self.speeds
        speed = top
        if self.parameters.without != "velocity_rule" and free < gap:
            if free < self.parameters.r_base:
                speed = base
            sideways = bearing + 0.5 * math.pi * np.array([1.0, -1.0])
            if view.free_distances(sideways, self.radius_for(view)).sum() < 2.0 * self.boundary.sensors.radius:
                speed = min(speed, slow)
        if math.isfinite(self.drive.max_acceleration):
            speed = min(speed, math.sqrt(2.0 * self.drive.max_acceleration * max(free - speed * self.drive.step, 0.0)))
        return min(speed, free / self.drive.step)

    def emergency_point(self, view: View, reach: float) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] to the place about the robot that is farthest from everything seen."""
        ways = np.minimum(view.free_distances(RING - view.heading, self.boundary.sensors.radius + 0.005), reach)
        x, y = view.points
        if ways.max() <= 0.0 or len(x) == 0:
            return view.heading, 0.0
        bearings = RING - view.heading
        room = np.hypot((ways * np.cos(bearings))[:, None] - x, (ways * np.sin(bearings))[:, None] - y).min(axis=1)
        best = int(np.lexsort((-ways, -room))[0])
        return float(RING[best]), min(float(ways[best]) / self.drive.step, self.speeds[2])
