"""A forest."""

from __future__ import annotations

from typing import Literal

from bug_gym.geometry import Point
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import NotNegative, Obstacles, Positive, Sizes
from bug_gym.worlds.family import Crew, DrawnPlaces, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import Pose, finish
from bug_gym.worlds.scattering import Scattering, draw_around, scattered


class ForestWorld(DrawnPlaces):
    """Many thin trunks: still circles, close together."""

    family: Literal["forest"]
    trees: Obstacles = 150
    """How many."""
    sizes: Sizes = (0.1, 0.3)
    """Least and greatest radius [m]."""
    solvable: Positive | None = 0.3
    """Clearance [m] at which a path is certain: gaps between trunks, and to the border, are at least twice as wide.
    None: no such promise, and trunks may overlap."""
    start_clearance: NotNegative = 1.0
    """Free space around the robot's body at the start [m]."""
    goal_clearance: NotNegative = 0.5
    """Free space around the goal [m]."""

    def check(self, robot: Robot) -> None:
        """The promised gaps let this robot through."""
        self.check_clearance(self.solvable, robot, "solvable")
        super().check(robot)

    @property
    def scattering(self) -> Scattering:
        """What is said of the trunks."""
        return Scattering(self.trees, self.sizes, self.solvable, self.start_clearance, self.goal_clearance)

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Many thin trunks."""

        def grow(start: Pose, goal: Point) -> Layout:
            trees = scattered(crew, self, self.scattering, start, goal, rng)
            return finish(crew, self, start, goal, circles=trees)

        return draw_around(crew, self, self.scattering, rng, grow)
