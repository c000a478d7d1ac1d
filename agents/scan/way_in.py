"""How a body comes within the radius of a goal beside which there is no room for it, as in the corner of a room.

There it may be that only some straight ways come within the radius, and not the one on to the goal itself.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.view import View

MOST = 16
"""In how many parts the angle is cut at which a way only touches the goal's radius."""

SHARES = np.concatenate([[0.0], np.repeat(np.arange(1, MOST) / MOST, 2) * np.tile([1.0, -1.0], MOST - 1)])
"""Those that are tried of it, the smallest first."""


def is_goal_by_wall(view: View) -> bool:
    """Whether something seen is nearer to the goal than lets the body stand there."""
    point = view.point_nearest_to(*view.goal)
    return point is not None and math.dist(point, view.goal) < view.sensors.radius


def way_in(view: View, radius: float) -> tuple[float, float] | None:
    """Bearing [rad] and way [m] that bring a disc within the goal's radius, with most to spare; None: no straight way does.

    Args:
        view: what is seen.
        radius: of the disc that must not touch anything [m].
    """
    distance, reach = view.goal_distance, view.sensors.goal_radius
    if distance <= reach:
        return None
    asides = math.asin(reach / distance) * SHARES
    along = distance * np.cos(asides)
    ways = along - np.sqrt(np.maximum(reach * reach - (distance * np.sin(asides)) ** 2, 0.0))
    # Beyond where it comes nearest to the goal a free way is worth nothing.
    spare = np.minimum(view.free_distances(view.goal_bearing + asides, radius), along) - ways
    best = int(spare.argmax())
    if spare[best] <= 0.0:
        return None
    return view.goal_bearing + float(asides[best]), float(ways[best] + 0.5 * spare[best])
