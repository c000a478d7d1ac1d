"""The map planner perceives: it tracks what moves, remembers what stands, and sees light and shadow.

The detection radius and its ladder are told in hd_bug/ladder.py.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.ladder import Ladder, density
from bug_gym.agents.hd_bug_map.light_area import LightArea
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters, Measures
from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.movers import beams_on_still, forget_movers
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.tracking.tracker import Tracker, Tracks
from bug_gym.view import Sensors, View

TERRAIN_SPACING = 0.25
"""Distance between the rings of the terrain field [m]."""

VANISHED = 3
"""More points than this taken away by one scan say that something moved."""

BODY_MARGIN = 0.025
"""Kept about the body beside twice the range noise [m]: a little more than the last brake asks for (policy.brake)."""


class Scene(NamedTuple):
    """What one decision rests on."""

    view: View
    grid: PointMap
    """Remembered points of still obstacles."""
    light: LightArea
    tracks: Tracks
    """What it sees, and what of it moves."""


class Perception:
    """What makes a scene of an observation.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of the policy.
        measures: of the robot.
        tracker: of what moves.
    """

    def __init__(self, sensors: Sensors, parameters: HDBugMapParameters, measures: Measures, tracker: Tracker) -> None:
        self.sensors = sensors
        self.parameters = parameters
        self.measures = measures
        self.tracker = tracker
        self.search = Search()
        self.is_long = len(measures.footprint) > 1 and sensors.drive.kinematics == "differential"
        """Whether the body is more than a disc, and so has to turn where it is narrow."""
        self.has_terrain = any(field.name == "terrain" for field in sensors.fields)

    def perceive(self, view: View, memory: HDBugMapMemory) -> Scene:
        """Track what moves, remember what stands, adapt the detection radius."""
        memory.steps += 1
        memory.pose = view.pose
        memory.goal_watch.look(view.goal_position, self.sensors.drive.step)
        tracks = self.tracker.update(memory.tracker, view, memory.steps * self.sensors.drive.step)
        if tracks.moving.any():
            memory.moved_at = memory.steps
        is_still = beams_on_still(tracks)
        grid = self._remember(view, memory, tracks, is_still)
        if self.parameters.adapt_radius:
            memory.ladder.update(density(view.ranges, self._detection_radius(memory.ladder)))
        memory.light = self._light_area(view, memory.ladder, is_still)
        return Scene(view, grid, memory.light, tracks)

    def _light_area(self, view: View, ladder: Ladder, is_still: NDArray[np.bool_]) -> LightArea:
        """Light and shadow within the detection radius."""
        return LightArea(
            self.sensors.angles,
            view.ranges,
            self.sensors.range,
            self._body(view),
            self._detection_radius(ladder),
            is_still,
            trusts_blind=self.sensors.drive.kinematics != "holonomic",
        )

    def _detection_radius(self, ladder: Ladder) -> float:
        """How far candidates, risk and horizon reach [m]."""
        return min(self.parameters.r_base * 2.0**ladder.k, self.sensors.range)

    def _body(self, view: View) -> float:
        """Radius of the disc that looks for free ways [m]: never more than what is free about the robot now."""
        nearest = float(view.ranges.min())
        margin = BODY_MARGIN + 2.0 * self.sensors.range_noise
        return min(self.measures.radius + margin, max(nearest - 1e-3, 0.9 * self.measures.radius))

    def _remember(self, view: View, memory: HDBugMapMemory, tracks: Tracks, is_still: NDArray[np.bool_]) -> PointMap:
        """Take the scan into the map; what moves is left out, and forgotten where it was remembered before."""
        if memory.map is None:
            memory.map = self._begin_map(view)
            if self.is_long:
                memory.body_map = self._map_for_body(memory.map)
        grid, removed = memory.map, memory.map.removed
        if not self.parameters.remember:
            grid.forget_all()
        sensors = self.sensors
        scan = (view.position, view.heading, sensors.angles, view.ranges, sensors.range, sensors.range_noise, is_still)
        grid.add_scan(*scan)
        if memory.body_map is not None:
            memory.body_map.add_scan(*scan)
        if grid.removed - removed > VANISHED:
            memory.moved_at = memory.steps
        forget_movers(grid, tracks)
        if self.has_terrain:
            grid.add_terrain(view.position, view.heading, view.field("terrain"), TERRAIN_SPACING)
        return grid

    def _begin_map(self, view: View) -> PointMap:
        """An empty map about the way to the goal."""
        goal, measures = view.goal_position, self.measures
        middle, span = (0.5 * goal[0], 0.5 * goal[1]), 0.5 * max(abs(goal[0]), abs(goal[1]))
        span += self.sensors.range + 4.0
        return PointMap(middle, span, measures.cell, measures.clearance, self.search, is_weighted=self.has_terrain)

    def _map_for_body(self, grid: PointMap) -> PointMap:
        """An empty map in which a long body turns, over the same ground."""
        clearance = float(self.measures.footprint[:, 2].max()) + BODY_MARGIN + 2.0 * self.sensors.range_noise
        cell = min(self.measures.cell, 0.25 * clearance)
        rows, columns = grid.cells.holds.shape
        side = 0.5 * self.measures.cell * max(rows, columns)
        center = grid.cells.x + 0.5 * self.measures.cell * columns, grid.cells.y + 0.5 * self.measures.cell * rows
        return PointMap(center, side, cell, clearance + 0.5 * cell, self.search)
