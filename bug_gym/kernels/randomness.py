"""Random numbers without a generator: each is a function of seed, episode, time, stream and index.

splitmix64 of Steele, Lea and Flood (2014): a Weyl sequence and a mixing of 64 bits.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.geometry import TWO_PI

WEYL = np.uint64(0x9E3779B97F4A7C15)


@inlined
def _mix64(x: np.uint64) -> np.uint64:
    x = np.uint64(x)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@kernel
def hash64(seed: int, episode: int, time: int, stream: int) -> np.uint64:
    """Key of all that is drawn for `stream` at this time of this episode; four int64 -> uint64."""
    key = _mix64(np.uint64(seed) + WEYL)
    key = _mix64((key ^ np.uint64(episode)) + WEYL)
    key = _mix64((key ^ np.uint64(time)) + WEYL)
    return _mix64((key ^ np.uint64(stream)) + WEYL)


@kernel
def uniform(key: np.uint64, index: int) -> float:
    """Number `index` of `key`, uniform in [0, 1), 53 bits."""
    return np.float64(_mix64(np.uint64(key) + (np.uint64(index) + np.uint64(1)) * WEYL) >> np.uint64(11)) * 2.0**-53


@inlined
def between(key: np.uint64, draw: int, low: float, high: float) -> float:
    """Draw number `draw` of the stream, uniform in [low, high)."""
    return low + (high - low) * uniform(key, draw)


@called
def normal(key: np.uint64, index: int) -> float:
    """Number `index` of `key`, of the standard normal distribution (Box-Muller). Independent of `uniform`'s numbers."""
    own_key = _mix64(np.uint64(key) ^ np.uint64(0xD1B54A32D192ED03))
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(own_key, 2 * index)))
    return radius * math.cos(TWO_PI * uniform(own_key, 2 * index + 1))
