"""Plane geometry in plain Python: points, angles, velocities. The compiled counterpart is kernels.geometry."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]
"""x, y [m]; the frame is said where it is used."""
F64 = NDArray[np.float64]
F32 = NDArray[np.float32]


def velocity_along(bearing: float, speed: float) -> Point:
    """The vector of a length `speed` along a bearing [rad]."""
    return speed * math.cos(bearing), speed * math.sin(bearing)


def following(ring: F64) -> F64:
    """Of each corner of a ring, (k, 2) or one of its coordinates (k,), the next one; much faster than `np.roll`."""
    return np.concatenate((ring[1:], ring[:1]))


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
