"""Futures of movers, sampled: each goes as predicted until it turns, and then straight on, wherever it likes.

Source: this package. Turns come at random, at a rate, and lead anywhere, each direction as likely; speeds stay. The futures
are the same at each decision for the same numbers of movers: times and directions are stratified, and every second one is
the mirror image of the one before, so that left is as likely as right. All coordinates are in the odometry frame [m].
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats, Integers

COUNT = 24
"""How many futures are looked at."""

MOVERS = 64
"""So many movers turn each in its own way; others share theirs."""


class Futures(NamedTuple):
    """Where T discs are at N times in K futures."""

    position: F64
    """Where they are now (T, 2) [m]."""
    x: F64
    """Centres (T, N, K) [m]."""
    y: F64
    """Centres (T, N, K) [m]."""
    radii: F64
    """(T, N) [m]."""
    reach: F64
    """How far from where it is now it may be (T, N) [m]."""


def _strata() -> tuple[F64, F64]:
    """For each mover and future a share of turns that come sooner, and a turn [rad] (MOVERS, COUNT)."""
    rng = np.random.default_rng(0)
    half = COUNT // 2
    middles = (np.arange(half) + 0.5) / half
    shares = np.stack([rng.permutation(middles) for _ in range(MOVERS)])
    turns = np.stack([rng.permutation(2.0 * middles - 1.0) for _ in range(MOVERS)]) * math.pi
    return np.repeat(shares, 2, axis=1), np.stack([turns, -turns], axis=2).reshape(MOVERS, COUNT)


SHARES, TURNS = _strata()


def sample_futures(
    number: NDArray[np.int64],
    position: F64,
    velocity: F64,
    predicted: F64,
    radii: F64,
    spacing: float,
    rate: float,
) -> Futures:
    """Futures of T movers.

    Args:
        number: of each (T,), by which it keeps its way of turning from decision to decision.
        position: where they are (T, 2) [m].
        velocity: (T, 2) [m/s].
        predicted: where they go unless they turn (T, N, 2) [m], at every spacing from the first on.
        radii: (T, N) at the same times [m].
        spacing: between the times [s].
        rate: how often one turns [1/s]; 0: never.
    """
    count, times, _ = predicted.shape
    which = number % MOVERS
    when = -np.log1p(-SHARES[which]) / rate if rate > 0.0 else np.full((count, COUNT), np.inf)
    heading = np.arctan2(velocity[:, 1], velocity[:, 0])[:, None] + TURNS[which]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    result = Futures(
        position, np.empty((count, times, COUNT)), np.empty((count, times, COUNT)), radii, np.empty((count, times))
    )
    last = np.minimum(when / spacing, times).astype(np.int64)
    _go(position, speed * spacing, np.cos(heading), np.sin(heading), last, predicted, result)
    return result


@kernel
def _go(
    position: Floats, way: Floats, cos: Floats, sin: Floats, last: Integers, predicted: Floats, result: Futures
) -> None:
    _, x, y, _, reach = result
    count, times, futures = x.shape
    for t in range(count):
        for k in range(futures):
            px, py = position[t, 0], position[t, 1]
            dx, dy = way[t] * cos[t, k], way[t] * sin[t, k]
            for n in range(times):
                if n < last[t, k]:
                    px, py = predicted[t, n, 0], predicted[t, n, 1]
                else:
                    px, py = px + dx, py + dy
                x[t, n, k], y[t, n, k] = px, py
        for n in range(times):
            farthest = 0.0
            for k in range(futures):
                dx, dy = x[t, n, k] - position[t, 0], y[t, n, k] - position[t, 1]
                farthest = max(farthest, dx * dx + dy * dy)
            reach[t, n] = math.sqrt(farthest)
