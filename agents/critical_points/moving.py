"""What stands and what moves: the sets S_obs, TD_obs and D_obs of known-still, once shifted and twice shifted things.

Each thing seen is looked at every DOT seconds, a fast one sooner. One that has shifted by more than a threshold since
the last look goes from S to TD, at a second such look from TD to D: it is dynamic. One that has not goes back to S. The
threshold is above what noise does to a place, and DOT so long that the slowest thing that counts shifts by as much.

Source: Das, Dutta and Debnath (2020), procedure OBSTACLE_DETECTION. They compare open points of one scan with those of
the next; but an open point slides over a round body as the robot passes. `TrackSets` compares fitted discs (agents/
tracking), `OpenPointSets` plays the printed rule.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.critical_points.looks import LOOK, look_at_things
from bug_gym.agents.critical_points.meeting import Mover
from bug_gym.agents.tracking.layout import AT_X, AT_Y, MOVES, NUMBER, OF_RADIUS, UNSEEN
from bug_gym.geometry import F64, Point
from bug_gym.view import Sensors

SLOWEST = 0.1
"""Speed from which on a thing counts as moving [m/s]."""

LEAST_LOOK = 0.3
"""Least time between two looks [s]."""

SHIFT = 0.05
"""Shift between two looks that is no error of a fitted disc, beside three times the noise of a range [m]."""

SAME_WAY = math.cos(math.radians(60.0))
"""Two shifts of a thing that goes straight differ by no more in direction."""

NEAREST = 0.5
"""How far from an earlier open point one may be the same that has moved: the "small change" of the printed rule [m]."""


@dataclass
class TrackSets:
    """The sets of one episode, over tracks."""

    looks: F64 = field(default_factory=lambda: np.zeros((0, LOOK)))
    """Each thing as it was looked at last (T, LOOK), see looks."""

    def update(self, things: F64, time: float, rules: F64) -> tuple[list[Mover], NDArray[np.bool_]]:
        """Look at what is due.

        Args:
            things: what is told of each thing that is there (THING_ROWS, T), see tracking.
            time: now [s].
            rules: what looks go by, see `rules_of_looks`.

        Returns:
            What is in D, and whether each thing is (T + 1,); the last one is none, which never is.
        """
        count = things.shape[1]
        looks, is_dynamic = np.empty((count, LOOK)), np.zeros(count + 1, dtype=np.bool_)
        seen = things[NUMBER], things[AT_X], things[AT_Y], things[UNSEEN], things[MOVES]
        found = look_at_things(*seen, time, rules, self.looks, looks, is_dynamic)
        self.looks = looks
        if not found:
            return [], is_dynamic
        lines = things[NUMBER : OF_RADIUS + 1, is_dynamic[:-1]].T.tolist()
        return [Mover(int(number), (x, y), (vx, vy), radius) for number, x, y, vx, vy, radius in lines], is_dynamic


def rules_of_looks(sensors: Sensors) -> F64:
    """What looks at tracks go by, see looks: the threshold is above the noise of a range, DOT as long as SLOWEST takes."""
    threshold = SHIFT + 3.0 * sensors.range_noise
    return np.array([threshold, max(LEAST_LOOK, threshold / SLOWEST), LEAST_LOOK, SAME_WAY])


@dataclass
class OpenPointSets:
    """The sets of one episode as printed, over open points in the odometry frame."""

    still: list[Point] = field(default_factory=list)
    """S_obs [m]."""
    shifted: list[tuple[Point, float]] = field(default_factory=list)
    """TD_obs: places [m], and when they were seen [s]."""

    def update(self, points: Sequence[tuple[Point, float]], time: float, threshold: float) -> list[Mover]:
        """Sort the open points of one scan; returns those that are in D.

        Args:
            points: open points in the odometry frame [m], each with the radius of what ends there [m].
            time: now [s].
            threshold: shift up to which a point is the same [m].
        """
        movers = []
        for number, (point, radius) in enumerate(points):
            nearest = min((math.dist(point, other) for other in self.still), default=math.inf)
            if nearest <= threshold:
                continue
            before = [entry for entry in self.shifted if entry[1] < time and math.dist(entry[0], point) <= NEAREST]
            if nearest > NEAREST and not before:
                self.still.append(point)
                continue
            if before:
                (x, y), then = max(before, key=lambda entry: (entry[1], -math.dist(entry[0], point)))
                velocity = ((point[0] - x) / (time - then), (point[1] - y) / (time - then))
                movers.append(Mover(number, point, velocity, radius))
            self.shifted.append((point, time))
        self.shifted = [entry for entry in self.shifted if time - entry[1] <= 1.0]
        return movers
