"""HD-BUG perceives: what moves, the light area about it, and how far it looks."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bug_gym.agents.hd_bug.frames import in_odometry
from bug_gym.agents.hd_bug.ladder import density
from bug_gym.agents.hd_bug.light import HEADINGS, fill_walls, measure_light
from bug_gym.agents.hd_bug.memory import HDBugMemory, Walls
from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.scan.pieces import find_pieces
from bug_gym.agents.tracking.tracker import Tracker, Tracks
from bug_gym.agents.walls.tangent_graph import GROWTH
from bug_gym.geometry import F64
from bug_gym.view import Sensors, View

SPACING = 0.15
"""Largest distance between the points of one wall [m]."""

MOST_POINTS = 4096
"""Points of walls in a scan."""


class Scene(NamedTuple):
    """What one decision rests on."""

    view: View
    tracks: Tracks
    """What it sees, and what of it moves."""


class Perception:
    """What makes a scene of an observation.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of HD-BUG.
        radius: of the disc whose light is measured [m].
    """

    def __init__(self, sensors: Sensors, parameters: HDBugParameters, radius: float) -> None:
        self.sensors = sensors
        self.parameters = parameters
        self.radius = radius
        self.tracker = Tracker(sensors)
        angles = sensors.angles
        self.spacing = float(angles[1] - angles[0]) if len(angles) > 1 else 2.0 * math.pi
        """Angle between neighbouring beams [rad]."""
        self._x, self._y = np.empty(MOST_POINTS), np.empty(MOST_POINTS)
        self._still = np.empty(MOST_POINTS, dtype=np.bool_)

    def perceive(self, view: View, memory: HDBugMemory) -> Scene:
        """Track what moves, adapt the detection radius."""
        if memory.steps:
            memory.odometer += math.dist(view.position, memory.pose[:2])
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        memory.steps += 1
        memory.pose = view.pose
        if self.parameters.without != "radius_ladder":
            memory.ladder.update(density(view.ranges, self._detection_radius(memory)))
        memory.reach = self._detection_radius(memory)
        return Scene(view, tracks)

    def light_up(self, scene: Scene) -> tuple[F64, Walls]:
        """The light area (K,) about the robot [m], and the walls in sight."""
        view, tracks = scene.view, scene.tracks
        px, py = view.points
        owner = tracks.beam_track[view.ranges < self.sensors.range]
        is_still = np.ones(len(px), dtype=np.bool_)
        if tracks.moving.any():
            is_still = ~((owner >= 0) & tracks.moving[np.maximum(owner, 0)])
        piece = np.empty(len(px), dtype=np.int64)
        find_pieces(px, py, 2.0 * self.radius, GROWTH * self.spacing, self.sensors.range_noise, piece)
        count = fill_walls(px, py, piece, is_still, SPACING, self._x, self._y, self._still)
        x, y, still = self._x[:count], self._y[:count], self._still[:count].copy()
        light = np.empty(HEADINGS)
        first = float(self.sensors.angles[0])
        measure_light(
            x, y, view.ranges, first, self.spacing, view.heading, self.radius, self.sensors.range, light
        )  # fmt: skip
        x, y = in_odometry(view.pose, np.column_stack([x, y])).T.copy()
        return light, Walls(x, y, still)

    def _detection_radius(self, memory: HDBugMemory) -> float:
        """R' of eq. (6) [m]."""
        return min(self.parameters.r_base * 2.0**memory.ladder.k, self.sensors.range)
