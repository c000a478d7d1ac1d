"""HD-BUG chooses where nothing moves: candidates in the light area, their costs, and the velocity (eq. 7 to 9)."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug.frames import direction_to, in_odometry, turn_matrix
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.parameters import HDBugParameters, Measures
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.agents.hd_bug.poses import TURNING, turn_to
from bug_gym.agents.mapping.way import Way
from bug_gym.geometry import F64
from bug_gym.kinematics import TURN_IN_PLACE

RINGS = 4
"""Radii of the grid of candidates (Procedure 3)."""

HEADINGS: F64 = np.linspace(0.0, 2.0 * math.pi, 32, endpoint=False)
"""Headings of the grid of candidates [rad]."""

OFFSETS: F64 = np.radians(np.stack([np.arange(3.0, 177.0, 3.0), -np.arange(3.0, 177.0, 3.0)], axis=1).ravel())
"""Turns away from a direction that are tried, the smallest first [rad]."""

HOLD = 0.02
"""How much cheaper another candidate must be than the one chosen last [m]."""


def unit_grid() -> F64:
    """The grid of candidates (32 * RINGS, 2), in units of the detection radius."""
    turned, rings = np.repeat(HEADINGS, RINGS), np.tile(np.arange(1.0, RINGS + 1.0) / RINGS, len(HEADINGS))
    grid: F64 = rings[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
    return grid


class Candidates:
    """The choice among candidates.

    Args:
        parameters: of HD-BUG.
        measures: of the robot.
    """

    def __init__(self, parameters: HDBugParameters, measures: Measures) -> None:
        self.parameters = parameters
        self.measures = measures
        self.grid = unit_grid()

    def choose(self, scene: Scene, memory: HDBugMemory, way: Way) -> tuple[float, float]:
        """Direction [rad] and speed [m/s] toward the cheapest candidate, where nothing moves."""
        view, grid = scene.view, scene.grid
        position = np.array(view.position)
        node = way.places[1]
        gap = math.dist(position, node)
        is_last = len(way.places) == 2
        memory.mode = "direct" if is_last else "candidates"
        if self._is_turning(scene, memory):
            # What looks best may change with what the beams meet while it turns on the spot: finish the turn.
            return self._drive(scene, memory, memory.direction, gap, is_last)
        if memory.backtracking_to is not None:
            memory.mode = "backtracking"
        cost = float(way.rest[1]) + float(grid.costs_to(view.position, node[None])[0])
        found = self._find(scene, memory, way, cost) if not is_last else np.empty((0, 2))
        if len(found):
            total = self.parameters.alpha * (grid.costs_to(view.position, found) + grid.rest_distances(found, way))
            total += self.parameters.beta * self._risk(scene, found)
            total[np.hypot(*(found - np.array(memory.chosen)).T) < 1e-6] -= HOLD
            memory.candidates, memory.costs = found, total
            best = int(total.argmin())
            if total[best] < self.parameters.alpha * cost - 1e-9:
                node = found[best]
                gap = float(np.hypot(*(node - position)))
        else:
            memory.candidates, memory.costs = np.array([node]), np.array([cost])
        memory.chosen = float(node[0]), float(node[1])
        return self._drive(scene, memory, direction_to(view, memory.chosen), gap, is_last)

    def _is_turning(self, scene: Scene, memory: HDBugMemory) -> bool:
        """Whether a differential robot still turns on the spot toward the last direction, which is free."""
        drive = scene.view.sensors.drive
        if drive.kinematics == "holonomic" or memory.steps == 1:
            return False
        if abs(turn_to(scene.view.heading, memory.direction)) <= TURN_IN_PLACE:
            return False
        bearing = memory.direction - scene.view.heading
        return bool(scene.light.free(np.array([bearing]))[0] >= self.measures.top * drive.step)

    def _find(self, scene: Scene, memory: HDBugMemory, way: Way, most: float) -> F64:
        """Candidates (m, 2) that could cost less than `most`, odometry frame [m]."""
        view, light = scene.view, scene.light
        # The grid doesn't turn with the robot: what looked best before it turned still does afterwards.
        grid = light.reach * (self.grid @ turn_matrix(-view.heading))
        # Half-plane filter about the next node.
        ahead, chosen = view.to_robot(*way.places[1].tolist()), view.to_robot(*memory.chosen)
        bearings = HEADINGS - view.heading
        found = light.candidates(grid, bearings, chosen, view.goal, ahead, self.measures.radius, most)
        return in_odometry(view.pose, found)

    def _risk(self, scene: Scene, places: F64) -> F64:
        """Risk (m,) of places in the odometry frame: how much nearer to a wall than the clearance they are."""
        points = (places - np.array(scene.view.position)) @ turn_matrix(-scene.view.heading)
        radius, clearance = self.measures.radius, self.measures.clearance
        short = (scene.light.gaps(points) - radius) / (clearance - radius)
        risk: F64 = np.clip(1.0 - short, 0.0, 1.0) ** 2
        return risk

    def _drive(
        self, scene: Scene, memory: HDBugMemory, direction: float, gap: float, is_last: bool
    ) -> tuple[float, float]:
        """Direction and speed that lead along a direction, past what stands in the first steps."""
        light, drive, measures = scene.light, scene.view.sensors.drive, self.measures
        direction, free = slide(scene, memory, direction, min(measures.top * drive.step, gap))
        speed = measures.top
        if free < min(gap, light.reach):
            speed = measures.base if free < self.parameters.r_base else speed
            sideways = direction - scene.view.heading + 0.5 * math.pi * np.array([1.0, -1.0])
            if float(light.free(sideways).sum()) < 2.0 * measures.radius:
                speed = min(speed, measures.slow)
        if math.isfinite(drive.max_acceleration):
            speed = min(speed, math.sqrt(2.0 * drive.max_acceleration * max(free - speed * drive.step, 0.0)))
        speed = min(speed, free / drive.step)
        if not is_last:
            speed = min(speed, max(gap, 1e-3) / drive.step)
        return direction, max(speed, TURNING)


def slide(scene: Scene, memory: HDBugMemory, direction: float, need: float) -> tuple[float, float]:
    """The direction nearest to the desired one with a free way of `need` [m], and that way [m].

    Without any, that of an emergency point.
    """
    light, heading = scene.light, scene.view.heading
    free = light.free(np.array([direction - heading]))
    if free[0] >= need:
        return direction, float(free[0])
    found = light.free(direction - heading + OFFSETS)
    good = np.flatnonzero(found >= need)
    if len(good):
        return direction + float(OFFSETS[good[0]]), float(found[good[0]])
    return emergency_point(scene, memory)


def emergency_point(scene: Scene, memory: HDBugMemory) -> tuple[float, float]:
    """Direction and way to the emergency point that is farthest from everything seen (Procedure 3, line 17)."""
    memory.mode = "emergency"
    light, bearings = scene.light, HEADINGS - scene.view.heading
    ways = np.minimum(light.free(bearings), light.reach)
    gaps = light.gaps(ways[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
    # Among points equally far from everything, the one with the longest way.
    best = int(np.lexsort((-ways, -gaps))[0]) if ways.max() > 0.0 else 0
    return float(HEADINGS[best]), float(ways[best])
