"""What HD-BUG and the map planner show of their minds."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug.light import ANGLES
from bug_gym.geometry import F64


def light_ring(place: F64, light: F64) -> F64:
    """Outline (K, 2) of a light area (K,) about a place (2,) [m]."""
    ring: F64 = place + light[:, None] * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    return ring


def labelled(candidates: F64, costs: F64) -> list[tuple[float, float, str]]:
    """Candidates (m, 2) with a label for their costs (m,): the share of the way from the least to the highest."""
    finite = costs[np.isfinite(costs)]
    if len(finite) == 0:
        return []
    low, high = float(finite.min()), float(finite.max())
    points = []
    for (px, py), cost in zip(candidates.tolist(), costs.tolist(), strict=True):
        share = (cost - low) / (high - low) if high > low and math.isfinite(cost) else 1.0
        points.append((px, py, "cheap" if share < 0.25 else "candidate" if share < 0.6 else "dear"))
    return points
