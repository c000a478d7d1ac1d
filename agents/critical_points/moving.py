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
from typing import NamedTuple

from bug_gym.agents.critical_points.meeting import Mover
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import Point
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


class Look(NamedTuple):
    """A thing as it was looked at last."""

    time: float
    """[s]."""
    place: Point
    """Odometry frame [m]."""
    shift: Point
    """Since the look before [m]."""
    shifts: int
    """0: in S, 1: in TD, 2: in D."""


@dataclass
class TrackSets:
    """The sets of one episode, over tracks."""

    looks: dict[int, Look] = field(default_factory=dict)
    """By the number of the track."""

    def update(self, tracks: Tracks, time: float, threshold: float, interval: float) -> list[Mover]:
        """Look at what is due; returns what is in D.

        Args:
            tracks: what is seen.
            time: now [s].
            threshold: shift between two looks above which a thing has moved [m].
            interval: time between two looks, DOT [s].
        """
        movers = []
        looks: dict[int, Look] = {}
        places, unseen, moving = tracks.position.tolist(), tracks.unseen.tolist(), tracks.moving.tolist()
        for k, number in enumerate(tracks.id.tolist()):
            place = (places[k][0], places[k][1])
            last = self.looks.get(number) or Look(time, place, (0.0, 0.0), 0)
            if unseen[k] == 0.0 and is_due(last, time, place, threshold, interval):
                last = looked_at(last, time, place, threshold)
            looks[number] = last
            # Twice shifted, and in space seen free before: the view of a long thing may shift too.
            if last.shifts >= 2 and moving[k]:
                velocity = (float(tracks.velocity[k, 0]), float(tracks.velocity[k, 1]))
                movers.append(Mover(number, place, velocity, float(tracks.radius[k])))
        self.looks = looks
        return movers


def is_due(last: Look, time: float, place: Point, threshold: float, interval: float) -> bool:
    """Whether it is time for the next look: after DOT, or earlier where a fast thing has shifted already."""
    passed = time - last.time + 1e-6
    return passed >= interval or (passed >= LEAST_LOOK and math.dist(place, last.place) > threshold)


def looked_at(last: Look, time: float, place: Point, threshold: float) -> Look:
    """A thing after one more look."""
    x, y = place[0] - last.place[0], place[1] - last.place[1]
    shift = math.hypot(x, y)
    if shift <= threshold:
        return Look(time, place, (x, y), 0)
    if last.shifts == 0:
        return Look(time, place, (x, y), 1)
    is_same_way = x * last.shift[0] + y * last.shift[1] >= SAME_WAY * shift * math.hypot(*last.shift)
    return Look(time, place, (x, y), 2 if is_same_way else 1)


def track_settings(sensors: Sensors) -> tuple[float, float]:
    """The threshold [m] and the interval DOT [s] of looks at tracks."""
    threshold = SHIFT + 3.0 * sensors.range_noise
    return threshold, max(LEAST_LOOK, threshold / SLOWEST)


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
