"""Plane geometry: sine and cosine that are the same on every machine, lengths, angles."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.compiling import inlined

TWO_PI = 2.0 * math.pi
HALF_PI = 0.5 * math.pi

# pi / 2 in three parts, the first two with so few bits that their multiples are exact, and 1.5 * 2^52, to which adding
# a number rounds it.
HALF_PI_HIGH, HALF_PI_MIDDLE, HALF_PI_LOW = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21
ROUNDING = 6755399441055744.0
SINE_3, SINE_5, SINE_7, SINE_9, SINE_11, SINE_13, SINE_15, SINE_17 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(3, 18, 2)
)
COSINE_4, COSINE_6, COSINE_8, COSINE_10, COSINE_12, COSINE_14, COSINE_16 = (
    (-1.0) ** (n // 2) / math.factorial(n) for n in range(4, 17, 2)
)


@inlined
def sin_cos(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle [rad] of up to a thousand turns, within 2 units in the last place.

    Taylor's series on an eighth of a turn. Both at once, copied into the caller, and the same on every machine:
    libraries differ in the last place.
    """
    quarter = angle * (2.0 / math.pi) + ROUNDING - ROUNDING
    turned = np.int64(quarter)
    x = ((angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_MIDDLE) - quarter * HALF_PI_LOW
    z = x * x
    tail = z * (SINE_9 + z * (SINE_11 + z * (SINE_13 + z * (SINE_15 + z * SINE_17))))
    small_sin = x + x * z * (SINE_3 + z * (SINE_5 + z * (SINE_7 + tail)))
    tail = z * (COSINE_10 + z * (COSINE_12 + z * (COSINE_14 + z * COSINE_16)))
    small_cos = 1.0 - (0.5 * z - z * z * (COSINE_4 + z * (COSINE_6 + z * (COSINE_8 + tail))))
    sin = small_cos if turned & 1 else small_sin
    cos = small_sin if turned & 1 else small_cos
    return -sin if turned & 2 else sin, -cos if (turned + 1) & 2 else cos


@inlined
def length(x: float, y: float) -> float:
    """Length of a vector. Lengths here are far from where a square overflows."""
    return math.sqrt(x * x + y * y)


@inlined
def chord_of(way: float, half: float) -> float:
    """Length of the chord of an arc that is so long and turns by twice an angle [rad]."""
    half_sin, _half_cos = sin_cos(half)
    return way * (half_sin / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)


@inlined
def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inlined
def clip(value: float, low: float, high: float) -> float:
    """The value limited to [low, high]."""
    return min(max(value, low), high)
