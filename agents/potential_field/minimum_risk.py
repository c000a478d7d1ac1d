"""Minimum risk: out of traps by a memory grid, to where the fewest dots of walls and own tracks are.

Source: Wang and Liu (2005, 2008), known by its abstracts; an opponent of the paper on potential field and wall following.
Grid, weights and ends of the behaviours are ours. Sensing assumed: a scan all round, goal, own position. Memory kept: the
grid, the distance to the goal where it was trapped. States: goal_seeking, obstacle_avoidance, path_searching. Guarantee:
none within a time; dots grow without bound, so that every part of a finite world is searched at last ("trial and
return"); it calls itself looping after `patience` without coming nearer. Length bound: none.

Reported, by the paper that it is an opponent of: longer paths, for it goes back into a trap until its grid makes that
unattractive. Found: so in the three scenes made in that paper's manner, by up to three times, but not in each simple trap;
in mazes it seldom arrives before its patience ends. No formula is repaired, as none is at hand: the weights of dots are
ours, and its lengths move with them. Numbers: docs/results/apf-wall-following.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bug_gym.agents.parameters import Length, Weight
from bug_gym.agents.potential_field.risk_grid import DIRECTIONS, RiskGrid, Weights
from bug_gym.agents.walls.boundary import WAIT, Boundary
from bug_gym.geometry import F64, Point, velocity_along, wrap
from bug_gym.policy import STANDING, Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

LEAST_CELL = 0.01
"""Side of the smallest cell of a grid [m]: the first one, of some 20 m x 20 m, takes 64 MB then."""

TRAPPED_AFTER = 5.0
"""Time without coming nearer to the goal after which a robot is trapped [s]."""

NEARER = 0.1
"""By how much nearer is nearer [m]."""

FREED = 0.3
"""How much nearer to the goal than where it was trapped a search ends [m]."""

HELD_WAY = 0.5
"""Way for which a direction of the search is kept [m]."""

ASIDE = 0.5 * math.pi
"""How far from the goal's bearing obstacle avoidance may turn [rad]; beyond it is a trap."""


@dataclass(frozen=True)
class MinimumRiskParameters:
    """Parameters of the minimum risk method."""

    cell: Length = 0.25
    """Side of a cell of the grid [m]."""
    sector: Length = 2.0
    """Radius of the sector in which a direction's dots are counted [m]."""
    obstacle_weight: Weight = 3.0
    """Weight of a dot where something was seen."""
    trajectory_weight: Weight = 1.0
    """Weight of a dot where the robot has been."""
    free_way: Length = 0.5
    """Free way that makes a direction one [m]."""
    patience: Length = 300.0
    """Time without coming nearer to the goal after which it gives up [s]."""


@dataclass
class MinimumRiskMemory(Memory):
    """Memory of the minimum risk method."""

    grid: RiskGrid = field(default_factory=lambda: RiskGrid(0.25))
    """The dots."""
    nearest: float = math.inf
    """Smallest distance to the goal [m]."""
    waited: float = 0.0
    """Time since that became smaller [s]."""
    shut: float = 0.0
    """Time without any free direction [s]."""
    trapped_at: float | None = None
    """Distance to the goal where it was trapped [m]; None: it is not."""
    direction: float | None = None
    """Direction of the search, odometry frame [rad]."""
    place: Point = (0.0, 0.0)
    """Where that was chosen, odometry frame [m]."""


class MinimumRisk(ScriptedPolicy):
    """The minimum risk method.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a length or weight that is not above zero, or infinite (`patience` may be), a cell below LEAST_CELL, or
            more than 200 across a sector.
    """

    Parameters = MinimumRiskParameters
    parameters: MinimumRiskParameters
    foresight = True

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        for name in ("cell", "sector", "obstacle_weight", "trajectory_weight", "free_way", "patience"):
            value = getattr(own, name)
            if not value > 0.0 or (math.isinf(value) and name != "patience"):
                raise ValueError(f"{name} must be above 0{' and finite' if math.isinf(value) else ''}, got {value!r}")
        if own.cell < LEAST_CELL:
            raise ValueError(f"cell must be at least {LEAST_CELL} m, or the grid fills the memory, got {own.cell!r}")
        if own.sector / own.cell > 200.0:
            raise ValueError(f"cell must be at least a 200th of the sector of {own.sector:g} m, got {own.cell!r}")
        self.boundary = Boundary(sensors, foresees=self.foresees)
        self.weights = Weights(own.obstacle_weight, own.trajectory_weight)
        self.free_way = max(own.free_way, sensors.step_length)
        self.directions: F64 = np.arange(DIRECTIONS, dtype=np.float64) * (2.0 * math.pi / DIRECTIONS)
        """Of the odometry frame (16,) [rad]."""

    def start(self) -> MinimumRiskMemory:
        """Memory of a new episode."""
        return MinimumRiskMemory(mode="goal_seeking", grid=RiskGrid(self.parameters.cell))

    def act(self, view: View, memory: MinimumRiskMemory) -> Velocity:
        """One decision."""
        self._leave_dots(view, memory)
        self._watch_progress(view, memory)
        if memory.verdict:
            return STANDING
        if self.boundary.is_free(view, view.goal_bearing, view.goal_distance) and self._is_seeking(view, memory):
            return self._seek(view, memory)
        free = view.free_distances(self.directions - view.heading, self.boundary.safe_radius) >= self.free_way
        if not free.any():
            return self._wait(memory)
        memory.shut = 0.0
        if memory.trapped_at is None:
            bearing = self._aside(view, free)
            if bearing is not None:
                memory.mode = "obstacle_avoidance"
                return self._go(view, bearing)
            memory.trapped_at = view.goal_distance
        memory.mode = "path_searching"
        return self._go(view, self._search(view, memory, free) - view.heading)

    def _leave_dots(self, view: View, memory: MinimumRiskMemory) -> None:
        """Dots for what is seen within a sector, and for being here."""
        grid, reach = memory.grid, self.parameters.sector + self.parameters.cell
        grid.cover(*view.position, reach)
        x, y = view.points
        near = x * x + y * y <= reach * reach
        cos, sin = math.cos(view.heading), math.sin(view.heading)
        ahead, left = x[near], y[near]
        px, py = view.position
        grid.add(view.position, px + cos * ahead - sin * left, py + sin * ahead + cos * left)

    def _watch_progress(self, view: View, memory: MinimumRiskMemory) -> None:
        """Trapped, freed, or at the end of patience."""
        if view.goal_distance < memory.nearest - NEARER:
            memory.nearest, memory.waited = view.goal_distance, 0.0
        else:
            memory.waited += self.sensors.drive.step
        if memory.trapped_at is None and memory.waited > TRAPPED_AFTER:
            memory.trapped_at = view.goal_distance
        if memory.waited > self.parameters.patience:
            memory.verdict = "looping"

    def _is_seeking(self, view: View, memory: MinimumRiskMemory) -> bool:
        """Whether it may go straight: not trapped, or nearer than where it was."""
        return memory.trapped_at is None or view.goal_distance < memory.trapped_at - FREED

    def _seek(self, view: View, memory: MinimumRiskMemory) -> Velocity:
        """Straight to the goal; a search is over."""
        if memory.trapped_at is not None:
            memory.trapped_at, memory.direction = None, None
            memory.nearest, memory.waited = min(memory.nearest, view.goal_distance), 0.0
        memory.mode = "goal_seeking"
        return self._go(view, view.goal_bearing)

    def _aside(self, view: View, free: np.ndarray[Any, np.dtype[np.bool_]]) -> float | None:
        """The free direction nearest to the goal's [rad]; None: all lead away from it."""
        bearings = [wrap(float(one) - view.heading) for one in self.directions[free]]
        nearest = min(bearings, key=lambda one: abs(wrap(one - view.goal_bearing)))
        return nearest if abs(wrap(nearest - view.goal_bearing)) <= ASIDE else None

    def _search(self, view: View, memory: MinimumRiskMemory, free: np.ndarray[Any, np.dtype[np.bool_]]) -> float:
        """Direction of least risk among the free ones, odometry frame [rad]; of equal ones that nearest to the goal's."""
        last = memory.direction
        is_held = last is not None and math.dist(memory.place, view.position) < HELD_WAY
        if last is not None and is_held and self._is_free(view, last):
            return last
        risks = memory.grid.risks(view.position, self.parameters.sector, self.weights)
        goal = view.heading + view.goal_bearing
        choices = [(float(risks[k]), abs(wrap(float(self.directions[k]) - goal)), k) for k in np.flatnonzero(free)]
        memory.direction, memory.place = float(self.directions[min(choices)[2]]), view.position
        return memory.direction

    def _is_free(self, view: View, direction: float) -> bool:
        """Whether a direction of the odometry frame [rad] is free as far as one must be."""
        return view.free_distance(direction - view.heading, self.boundary.safe_radius) >= self.free_way

    def _go(self, view: View, bearing: float) -> Velocity:
        """A step along a bearing [rad], cut to what is free."""
        free = view.free_distance(bearing, self.boundary.safe_radius)
        speed = min(self.sensors.drive.max_speed, min(free, view.goal_distance) / self.sensors.drive.step)
        return velocity_along(bearing, speed)

    def _wait(self, memory: MinimumRiskMemory) -> Velocity:
        """Stand where no direction is free, and give up after a while."""
        memory.shut += self.sensors.drive.step
        if memory.shut > WAIT:
            memory.verdict = "stuck"
        return STANDING

    def draw(self, memory: MinimumRiskMemory) -> Drawing:
        """Cells with dots, and the direction of the search."""
        walls, track = memory.grid.middles(0).tolist(), memory.grid.middles(1).tolist()
        points = [(x, y, "obstacle") for x, y in walls] + [(x, y, "trajectory") for x, y in track]
        if memory.direction is None or memory.trapped_at is None:
            return Drawing(points=points)
        (x, y), angle = memory.place, memory.direction
        return Drawing(points=points, segments=[(x, y, x + math.cos(angle), y + math.sin(angle), "direction")])
