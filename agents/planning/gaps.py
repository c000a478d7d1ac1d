"""Ways that a robot drives whose brake keeps more room than the body needs.

A robot is held before what the disc of its braking radius (`policy.braking_radius`) would touch: on a way that keeps less it
goes on by less and less. Beside one obstacle there is room for another way, a little farther off; between two that are too
near to each other there is none.
"""

from __future__ import annotations

import numpy as np

from bug_gym.agents.planning.smoothing import Solids, pulled, spread
from bug_gym.geometry import F64

STEP = 0.01
"""How far apart the places are at which a way is looked at [m]."""

PUSHES = 40
"""How often places are pushed off what is too near."""

ROUNDED = 1e-4
"""By so much less room a place still counts as wide enough [m]."""


def pushed_off(places: F64, solids: Solids) -> F64:
    """A way (k, 2) [m] with the growth's room where there is so much, else between what is near; its ends stay.

    Its places move across it alone: along it they would be squeezed out of gaps.
    """
    fine = spread(places, STEP)
    ways = fine[2:] - fine[:-2]
    across = np.column_stack([-ways[:, 1], ways[:, 0]]) / np.maximum(np.hypot(*ways.T), 1e-9)[:, None]
    close = np.arange(len(across))
    for _ in range(PUSHES):
        apart, away = to_obstacles(fine[1 + close], solids)
        lacking = np.maximum(solids.growth - away, 0.0)
        still = lacking.any(axis=1)
        if not still.any():
            break
        close, share = close[still], lacking[still] / np.maximum(away[still], 1e-9)
        pushes = -share * np.einsum("ijk,ik->ij", apart[still], across[close])
        # Of those on one side the strongest counts: all together they would throw a place to and fro.
        push = 0.5 * (pushes.max(axis=1, initial=0.0) + pushes.min(axis=1, initial=0.0))
        fine[1 + close] += push[:, None] * across[close]
    return pulled(fine, STEP, solids.is_clear)


def narrow_places(places: F64, solids: Solids) -> F64:
    """The narrowest places (n, 2) of all parts of a way that keep less than the growth.

    A part at its beginning counts only where less is left further on: who stands near to something may go away from it.

    Args:
        places: (k, 2) of the way [m].
        solids: the obstacles, and as growth the radius of a disc.
    """
    fine = spread(places, STEP)
    room = to_obstacles(fine, solids)[1].min(axis=1, initial=np.inf)
    numbers = np.flatnonzero(room < solids.growth - ROUNDED)
    parts = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1) if len(numbers) else []
    narrowest = [(part[0], part[int(np.argmin(room[part]))]) for part in parts]
    return fine[[at for begin, at in narrowest if begin > 0 or room[at] < room[0] - ROUNDED]]


def to_obstacles(places: F64, solids: Solids) -> tuple[F64, F64]:
    """Vectors (n, m, 2) from places to the nearest place of each obstacle's surface, and how long they are (n, m) [m]."""
    start, run = solids.edges[:, :2], solids.edges[:, 2:] - solids.edges[:, :2]
    square = np.maximum(np.einsum("ij,ij->i", run, run), 1e-300)
    share = np.clip(np.einsum("nij,ij->ni", places[:, None] - start, run) / square, 0.0, 1.0)
    to_edges = start + share[..., None] * run - places[:, None]
    to_centres = solids.discs[:, :2] - places[:, None]
    far = np.maximum(np.hypot(to_centres[..., 0], to_centres[..., 1]), 1e-9)
    to_discs = to_centres * (1.0 - solids.discs[:, 2] / far)[..., None]
    apart = np.concatenate([to_edges, to_discs], axis=1)
    return apart, np.hypot(apart[..., 0], apart[..., 1])
