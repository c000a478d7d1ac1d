"""A goal that moves: its velocity, how far ahead it has kept that velocity so far, and where it can be met.

Source: Hasibuzzaman, Jan and Wu, "predictive interception"; the meeting with a goal of constant velocity is the closed
form of a quadratic equation. How long a velocity is trusted is learnt from how well it has foretold the goal's way. All
coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

from bug_gym.geometry import Point

LEADS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Leads at which predictions are tried [s]."""

LONGEST_LEAD = 10.0
"""A goal is never led by more than this [s]."""

LOOK_BACK = 0.5
"""Time over which a velocity is taken [s]."""

STANDS = 0.02
"""A goal that has stayed this near to its first place has not moved yet [m]."""

KEEP = 0.95
"""Share of the mean errors kept in a step."""

SKILL = 0.5
"""A prediction is trusted where it fails by less than this share of what the goal has moved."""


@dataclass
class MovingGoal:
    """What is known of how a goal moves."""

    places: deque[Point] = field(default_factory=deque)
    """Its last places, odometry frame [m]."""
    step: float = 0.1
    """Time between them [s]."""
    velocity: Point = (0.0, 0.0)
    """Over the last LOOK_BACK seconds [m/s]."""
    errors: dict[float, tuple[float, float]] = field(default_factory=dict)
    """Lead [s] -> by how much a prediction of that lead failed, and how far the goal had moved [m]; fading means."""

    def update(self, place: Point, step: float) -> None:
        """Take in where it is now, `step` seconds after the last place."""
        self.step = step
        self.places.append(place)
        look_back = max(round(LOOK_BACK / step), 1)
        while len(self.places) > round(LEADS[-1] / step) + look_back + 1:
            self.places.popleft()
        newest = len(self.places) - 1
        self.velocity = self._velocity_at(newest, look_back)
        if not self.errors and math.dist(place, self.places[0]) < STANDS:
            return
        for lead in LEADS:
            then = newest - round(lead / step)
            if then < look_back:
                break
            vx, vy = self._velocity_at(then, look_back)
            x, y = self.places[then]
            failed, moved = math.dist(place, (x + vx * lead, y + vy * lead)), math.dist(place, (x, y))
            before = self.errors.get(lead, (failed, moved))
            self.errors[lead] = (
                KEEP * before[0] + (1.0 - KEEP) * failed,
                KEEP * before[1] + (1.0 - KEEP) * moved,
            )

    def _velocity_at(self, index: int, look_back: int) -> Point:
        """Velocity [m/s] when it was at one of the places."""
        first = max(index - look_back, 0)
        if first == index:
            return 0.0, 0.0
        elapsed = (index - first) * self.step
        (x0, y0), (x1, y1) = self.places[first], self.places[index]
        return (x1 - x0) / elapsed, (y1 - y0) / elapsed

    def trusted_lead(self) -> float:
        """The longest time [s] for which its velocity has foretold where it goes; leads not yet tried are trusted."""
        trusted = 0.5 * LEADS[0]
        for lead in LEADS:
            failed, moved = self.errors.get(lead, (0.0, 1.0))
            if failed > SKILL * moved:
                return trusted
            trusted = lead
        return LONGEST_LEAD


def meeting_time(position: Point, goal: Point, velocity: Point, speed: float, radius: float) -> float:
    """Time until a robot that goes straight can first be within `radius` [m] of a goal that keeps its velocity [s].

    Infinite where it never can. (Interception in closed form: |goal + velocity t - position| = speed t + radius.)
    """
    dx, dy = goal[0] - position[0], goal[1] - position[1]
    a = velocity[0] ** 2 + velocity[1] ** 2 - speed * speed
    b = dx * velocity[0] + dy * velocity[1] - speed * radius
    c = dx * dx + dy * dy - radius * radius
    if c <= 0.0:
        return 0.0
    if abs(a) < 1e-12:
        return -0.5 * c / b if b < 0.0 else math.inf
    root = b * b - a * c
    if root < 0.0:
        return math.inf
    # The smallest positive root, in the form that takes no difference of near numbers apart from -b.
    below = (-b + math.sqrt(root), -b - math.sqrt(root))
    return min((c / part for part in below if part > 0.0), default=math.inf)
