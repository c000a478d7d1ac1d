"""How a differential robot goes on along a wall: it pursues the contour ahead, and rounds its corners on arcs.

A robot that cannot go sideways would stand and turn at each corner. So a foot walks the contour for it, exactly as the hand
leads, always where the contour is nearest to the robot; the contour that is seen ahead of the foot is the robot's course
(bug_gym/steering.py). The hand is on the wall at the foot. Where the contour does not lead on plainly (a gap that is hardly
one, a way that is blocked, a wall that has moved away) there is no foot, and the rule of Boundary.follow decides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.scan.contour_ahead import contour_ahead
from bug_gym.agents.walls.contour import Contour
from bug_gym.geometry import Point
from bug_gym.kinematics import Drive
from bug_gym.steering import corner_cut, look_ahead
from bug_gym.view import View

LEAST_AHEAD = 3
"""Steps of the contour that must be in sight ahead of the foot to go by it."""


@dataclass(frozen=True)
class Rounding:
    """How the contour ahead is made a course; lengths [m]."""

    drive: Drive
    """Of the robot."""
    step: float
    """The way of one step."""
    clearance: float
    """Distance to a wall while following it."""
    inner: float
    """Half the width down to which a gap counts as one."""
    gate_half_width: float
    """Half the width of a lap's gate."""
    safe_radius: float
    """Of the disc that must be able to go to the contour."""

    @property
    def aside(self) -> float:
        """How far the robot may be off the contour [m]: what the fastest arc cuts from a right-angled corner."""
        return min(corner_cut(self.drive), self.clearance)

    @property
    def toward(self) -> float:
        """How far it may be off the contour where that turns toward the wall [m]: a lap's gate must be passed again."""
        return 0.5 * self.gate_half_width

    def begin(self, view: View, contour: Contour, heading: float) -> None:
        """The foot begins where the robot is, which goes along the wall with a heading [rad] now."""
        contour.foot = (*view.position, heading + view.heading)
        self._look(view, contour)

    def land(self, view: View, contour: Contour) -> Point | None:
        """Where to go next to come from the straight way onto a contour that is not followed yet, robot's frame [m].

        None: it does not lead on plainly, or is blocked.
        """
        return self._next_place(view, contour) if self._look(view, contour, lands=True) else None

    def go_on(self, view: View, contour: Contour) -> Point | None:
        """Where to go next along the contour, robot's frame [m]; None: the rule of boundary following decides."""
        return self._next_place(view, contour) if self._look(view, contour) else None

    def _next_place(self, view: View, contour: Contour) -> Point | None:
        """The next place of the course, robot's frame [m]; None: it is blocked."""
        assert contour.course is not None
        x, y = contour.course[1].tolist()
        way = math.hypot(x, y)
        if view.free_distance(math.atan2(y, x), self.safe_radius) < min(way, self.step):
            contour.foot = contour.course = None
            return None
        return x, y

    def _look(self, view: View, contour: Contour, *, lands: bool = False) -> bool:
        """Bring the foot to where the contour is nearest to the robot, and see how it leads on; whether it does.

        A robot that lands comes to where the contour begins from as far as it looks ahead.
        """
        assert contour.foot is not None
        x, y, heading = contour.foot
        contour.foot, contour.course = None, None
        start = (*view.to_robot(x, y), heading - view.heading)
        caught_up = math.ceil((2.0 * self.aside + self.step) / self.step) + 1
        places = np.empty((caught_up + math.ceil(look_ahead(self.drive) / self.step) + 1, 3))
        points = view.points
        count = contour_ahead(*points, start, contour.side, self.step, self.clearance, self.inner, places)
        gaps = np.hypot(places[: min(count, caught_up), 0], places[: min(count, caught_up), 1])
        nearest = int(gaps.argmin())
        is_far = gaps[nearest] > self.aside + self.step
        if is_far and lands:
            nearest = 0  # it may turn back there, toward a robot that has not come to it yet
        is_before = lands and nearest == 0
        if (is_far and not lands) or count - nearest <= LEAST_AHEAD:
            return False
        ahead = places[nearest:count]
        if not self._lay_hand(view, contour, ahead[0]):
            return False
        x, y, bearing = ahead[0].tolist()
        contour.foot = (*view.to_odometry(x, y), heading + bearing - start[2])
        turn = float(ahead[1, 2]) - bearing
        # In the end of a narrow wedge, about half a turn, whose sense two directions alone leave open.
        contour.sweep = turn if abs(turn) > 0.5 * math.pi else 0.0
        # From beside the contour back to it at half a right angle.
        joins = 0 if is_before else min(1 + int(gaps[nearest] / self.step), len(ahead) - 1)
        contour.course = np.concatenate([np.zeros((1, 2)), ahead[joins:, :2]])
        return True

    def _lay_hand(self, view: View, contour: Contour, foot: NDArray[np.float64]) -> bool:
        """Lay the hand on the wall's point nearest to the foot; False: there is no wall at hand."""
        x, y = view.points
        dx, dy = x - foot[0], y - foot[1]
        beside = contour.side * (dx * math.sin(foot[2]) - dy * math.cos(foot[2]))
        square = np.where(beside > 0.0, dx * dx + dy * dy, math.inf)
        index = int(square.argmin()) if len(square) else -1
        if index < 0 or square[index] > (self.clearance + self.step) ** 2:
            return False
        contour.wall = view.to_odometry(float(x[index]), float(y[index]))
        return True
