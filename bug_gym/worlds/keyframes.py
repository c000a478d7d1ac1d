"""Tracks of keyframes as Gazebo plays them: a spline through places at uneven times, over and over.

The spline is that of ignition::math::Spline with tension 0: cubic Hermite pieces between keys, whose tangents know nothing
of the keys' times. After the last key it begins anew at the first one; unless they are in one place, the body jumps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bug_gym.geometry import F64
from bug_gym.limits import SMALL
from bug_gym.schema.motions import Replay

ERROR = 5e-4
"""How far a record of the track may be from it between two of its times [m]."""
CLOSED = 1e-3
"""A track whose last key is this near to the first closes smoothly [m]."""
LAST_INSTANT = 2.0 * SMALL
"""How long before the jump the body is last seen where it jumps from [s]."""


@dataclass(frozen=True)
class Keyframes:
    """A track."""

    times: F64
    """Of each key (k,), from 0 to the period [s]."""
    points: F64
    """Place x, y of each key (k, 2) [m]."""

    @property
    def period(self) -> float:
        """Time from the first key to the last one [s]."""
        return float(self.times[-1])

    @property
    def is_closed(self) -> bool:
        """Whether it goes on without a jump."""
        return math.dist(self.points[0], self.points[-1]) < CLOSED

    @cached_property
    def tangents(self) -> F64:
        """Tangent at each key (k, 2) [m a piece]: half of the way between its neighbours, of a half chord at open ends."""
        inner = 0.5 * (self.points[2:] - self.points[:-2])
        if self.is_closed:
            first = last = 0.5 * (self.points[1] - self.points[-2])
        else:
            first, last = 0.5 * (self.points[1] - self.points[0]), 0.5 * (self.points[-1] - self.points[-2])
        return np.vstack([first, inner, last])

    def places(self, times: F64) -> F64:
        """Places (n, 2) [m] at times (n,) of the track's own clock [s], which starts anew after each period."""
        times = np.mod(times, self.period)
        piece = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        f = ((times - self.times[piece]) / (self.times[piece + 1] - self.times[piece]))[:, None]
        return (
            (2.0 * f**3 - 3.0 * f**2 + 1.0) * self.points[piece]
            + (-2.0 * f**3 + 3.0 * f**2) * self.points[piece + 1]
            + (f**3 - 2.0 * f**2 + f) * self.tangents[piece]
            + (f**3 - f**2) * self.tangents[piece + 1]
        )

    @cached_property
    def lap(self) -> F64:
        """Records (n, 3) of one lap, up to the last instant before it begins anew: time [s], x, y [m].

        Straight lines between them keep to the track within ERROR at each time. Over a piece the chord of a share h is off
        by at most h^2/8 of the greatest second derivative, which is linear in the share: it is greatest at an end.
        """
        p, m = self.points, self.tangents
        chords = 6.0 * (p[1:] - p[:-1])
        begins, ends = chords - 4.0 * m[:-1] - 2.0 * m[1:], -chords + 2.0 * m[:-1] + 4.0 * m[1:]
        bends = np.maximum(np.hypot(*begins.T), np.hypot(*ends.T))
        parts = np.maximum(np.ceil(np.sqrt(bends / (8.0 * ERROR))), 1.0).astype(int)
        pieces = zip(self.times[:-1], self.times[1:], parts, strict=True)
        times = np.concatenate([np.linspace(a, b, n, endpoint=False) for a, b, n in pieces])
        times = np.append(times[times < self.period - 2.0 * LAST_INSTANT], self.period - LAST_INSTANT)
        return np.column_stack([times, self.places(times)])

    def replays(self, since: float, limit: float) -> tuple[Replay, ...]:
        """The track as records of an episode that starts at `since` on its clock and ends after `limit` [s].

        One body, if the track is closed. Else a body a lap, that is there for its lap: one vanishes where the next one
        appears, and nothing is touched on the way of the jump.
        """
        begins = np.arange(-math.fmod(since, self.period), limit + SMALL, self.period)
        laps = [self.lap + [begin, 0.0, 0.0] for begin in begins]
        if self.is_closed:
            laps = [np.concatenate(laps)]
        # The keys have been checked as they were read; pydantic would take as long again for each episode.
        return tuple(Replay.model_construct(law="replay", points=tuple(map(tuple, lap.tolist()))) for lap in laps)
