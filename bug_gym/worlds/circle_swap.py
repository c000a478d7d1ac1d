"""Robots that change places across a circle.

Source: the example "Circle" of the library RVO2 of van den Berg, Guy, Snape, Lin and Manocha.
"""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from bug_gym.geometry import F64
from bug_gym.schema.errors import wrong
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Flag, NotNegative, Positive, Rotation
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish_crew, written_or_drawn


class CircleSwapWorld(Family):
    """Robots on a circle about the middle of the bounds, each facing its goal on the other side.

    Evenly spaced, all straight ways meet in the middle; else neighbours are at least half as far apart, and ways cross about
    the middle at any angle.
    """

    has_own_goals: ClassVar[bool] = True

    family: Literal["circle_swap"]
    radius: Positive = 4.0
    """Radius of the circle [m]."""
    jitter: NotNegative = 0.0
    """Each start is drawn from the disc of this radius about its place [m]; its goal lies opposite to where it starts."""
    rotation: Rotation = 0.0
    """Angle at which the first robot stands, seen from the middle [rad], or `random`."""
    evenly: Flag = True
    """Whether all neighbours on the circle are as far apart; else angles are drawn, and goals from discs of their own."""

    @property
    def middle(self) -> tuple[float, float]:
        """Middle of the circle x, y [m]."""
        xmin, ymin, xmax, ymax = self.box
        return 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)

    def check(self, robot: Robot) -> None:
        """The circle lies within the bounds, with room for a robot anywhere on it."""
        if self.jitter >= self.radius:
            raise wrong(f"got {self.jitter:g}, expected less than radius ({self.radius:g})", "jitter")
        if not self.holds(*self.middle, self.radius + self.jitter + robot.reach):
            raise wrong(f"got {self.radius:g}, expected a circle within bounds {list(self.box)}", "radius")

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Nothing but the border; starts and goals on the circle.

        Raises:
            ValueError: neighbours on the circle would overlap.
        """
        robots, reach = crew.robots.count, crew.robot.reach
        if robots > 1 and self._nearest(robots) < 2.0 * reach:
            what = f"{robots} robots that reach {reach:g} m overlap on a circle of {self.radius:g} m"
            drawn = f"(jitter {self.jitter:g}, evenly {str(self.evenly).lower()})"
            raise ValueError(f"{what} {drawn}, expected at most {self._most_robots(reach)}")
        first = float(rng.uniform(-math.pi, math.pi)) if self.rotation == "random" else float(self.rotation)
        angles = first + (2.0 * math.pi * np.arange(robots) / robots if self.evenly else self._angles(robots, rng))
        away = self._places(angles, rng)
        beyond = away if self.evenly else self._places(angles, rng)
        ahead = -beyond - away
        starts = np.column_stack([self.middle + away, np.arctan2(ahead[:, 1], ahead[:, 0])])
        return finish_crew(crew, self, *written_or_drawn(crew, starts, self.middle - beyond))

    def _nearest(self, robots: int) -> float:
        """Least distance that two neighbours may have [m]."""
        half = (1.0 if self.evenly else 0.5) * math.pi / max(robots, 2)
        return 2.0 * self.radius * math.sin(half) - 2.0 * self.jitter

    def _most_robots(self, reach: float) -> int:
        """How many robots of some reach [m] never overlap."""
        most = 1
        while self._nearest(most + 1) >= 2.0 * reach:
            most += 1
        return most

    def _angles(self, robots: int, rng: Rng) -> F64:
        """Angles (R,) from that of the first robot on, neighbours at least half as far apart as if evenly spaced [rad]."""
        cuts = np.sort(rng.random(robots - 1))
        return np.append(0.0, math.pi * (np.arange(1, robots) / robots + cuts))

    def _places(self, angles: F64, rng: Rng) -> F64:
        """Places (R, 2) drawn about these on the circle, seen from the middle [m]."""
        aside, share = rng.uniform(-math.pi, math.pi, len(angles)), np.sqrt(rng.random(len(angles)))
        drawn = self.jitter * share * np.array([np.cos(aside), np.sin(aside)])
        places: F64 = (self.radius * np.array([np.cos(angles), np.sin(angles)]) + drawn).T
        return places
