"""Noise of a scan: beams that are dropped, ranges that are off.

Every number is a function of a key and an index, so it can be drawn in any order, by any thread, again.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Ranges

LN_2 = np.float32(math.log(2.0))
ROOT_2_BITS = np.int32(0x3F3504F3)  # sqrt(1/2) as the bits of a float32
SIN_1, SIN_3, SIN_5, SIN_7, SIN_9 = (
    np.float32(c) for c in (3.14159258, -5.16770689, 2.55003138, -0.59804517, 0.07722013)
)
LOG_3, LOG_4, LOG_5, LOG_6, LOG_7, LOG_8, LOG_9 = (
    np.float32(c) for c in (0.33334166, -0.25001699, 0.19954873, -0.16564417, 0.14978013, -0.14379083, 0.08672227)
)
HALF_32 = np.float32(0.5)
TWO_32 = np.float32(2.0)
BEAM_STEP = np.uint32(0x9E3779B9)  # odd: beams of one key never share a state
SECOND = np.uint32(0x68BC21EB)
THIRD = np.uint32(0x02E5BE93)


@inlined
def _mix(x: np.uint32) -> np.uint32:
    """Bijection of 32 bits, each output bit depending on each input bit (lowbias32 of C. Wellons' hash prospector)."""
    x = np.uint32(x ^ (x >> np.uint32(16)))
    x = np.uint32(x * np.uint32(0x7FEB352D))
    x = np.uint32(x ^ (x >> np.uint32(15)))
    x = np.uint32(x * np.uint32(0x846CA68B))
    return np.uint32(x ^ (x >> np.uint32(16)))


@inlined
def _minus_log(u: np.float32) -> np.float32:
    """-ln u of a float32 in (0, 1), within 2e-7 of its size."""
    bits = np.int32(np.float32(u).view(np.int32) - ROOT_2_BITS)
    exponent = np.int32(bits >> np.int32(23))
    fraction = np.int32((bits & np.int32(0x007FFFFF)) + ROOT_2_BITS).view(np.float32)
    m = np.float32(fraction - np.float32(1.0))
    tail = LOG_3 + m * (LOG_4 + m * (LOG_5 + m * (LOG_6 + m * (LOG_7 + m * (LOG_8 + m * LOG_9)))))
    return -(np.float32(exponent) * LN_2 + (m + m * m * (m * tail - HALF_32)))


@inlined
def _cos_pi(t: np.float32) -> np.float32:
    """cos(pi t) of a float32 in [-1, 1], within 2.1e-7."""
    z = HALF_32 - abs(t)
    square = z * z
    return z * (SIN_1 + square * (SIN_3 + square * (SIN_5 + square * (SIN_7 + square * SIN_9))))


@called
def _drop_beams(
    ranges: Ranges, beams: int, far: np.float32, lost_below: np.int32, low: np.uint32, high: np.uint32
) -> None:
    """Sets each beam to `far` with probability lost_below / 2^24, on hashes of its own."""
    for i in range(beams):
        draw = _mix(np.uint32(_mix(np.uint32(high - np.uint32(i) * BEAM_STEP)) + low + THIRD))
        ranges[i] = far if np.int32(draw >> np.uint32(8)) < lost_below else ranges[i]


@called
def add_noise(
    ranges: Ranges, beams: int, reach: float, min_range: float, sigma: float, dropout: float, key: np.uint64
) -> None:
    """Adds Gaussian noise to a scan and drops beams.

    A beam without return keeps reading `reach`. Noise is a pure function of (key, beam): Box-Muller on two 32-bit
    hashes, the whole bell up to 5.7 sigma.

    Args:
        ranges: (B,) f4 [m], changed in place.
        beams: How many of them count.
        reach: Largest range [m].
        min_range: Smallest range [m].
        sigma: Standard deviation [m].
        dropout: Probability that a beam reads `reach` whatever it met, in steps of 2^-24.
        key: uint64 from `hash64`.
    """
    if sigma == 0.0 and dropout == 0.0 and min_range == 0.0:
        return
    key = np.uint64(key)
    low = np.uint32(key & np.uint64(0xFFFFFFFF))
    high = np.uint32(key >> np.uint64(32))
    scale = np.float32(sigma)
    far = np.float32(reach)
    near = np.float32(min_range)
    for i in range(beams):
        state = np.uint32(_mix(np.uint32(low + np.uint32(i) * BEAM_STEP)) + high)
        first = _mix(state)
        second = _mix(np.uint32(state + SECOND))
        # 23 bits and a half: a number in (0, 1) that float32 holds exactly.
        u = np.float32((np.float32(np.int32(first >> np.uint32(9))) + HALF_32) * np.float32(2.0**-23))
        t = np.float32(np.float32(np.int32(second)) * np.float32(2.0**-31))
        radius = np.float32(math.sqrt(np.float32(TWO_32 * _minus_log(u))))
        distance = ranges[i]
        noisy = np.float32(distance + scale * np.float32(radius * _cos_pi(t)))
        noisy = noisy if noisy > near else near
        noisy = noisy if noisy < far else far
        ranges[i] = far if distance >= far else noisy
    if dropout > 0.0:
        _drop_beams(ranges, beams, far, np.int32(dropout * 16777216.0 + 0.5), low, high)
