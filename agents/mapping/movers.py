"""What moves is kept out of what is remembered of still obstacles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.tracking.tracker import Tracks


def beams_on_still(tracks: Tracks) -> NDArray[np.bool_]:
    """Which beams (B,) did not hit something that moves."""
    owner = tracks.beam_track
    if not tracks.moving.any():
        return np.ones(len(owner), dtype=np.bool_)
    is_still: NDArray[np.bool_] = ~((owner >= 0) & tracks.moving[np.maximum(owner, 0)])
    return is_still


def forget_movers(grid: PointMap, tracks: Tracks) -> None:
    """Forget what was remembered of movers before they were known to move."""
    for index in np.flatnonzero(tracks.moving):
        radius = float(tracks.radius[index]) + 0.1
        places = [tracks.position[index], *(tracks.history[index] if tracks.age[index] < 2.0 else ())]
        for x, y in places:
            grid.forget(float(x), float(y), radius)
