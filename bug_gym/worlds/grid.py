"""Which cells of a grid are open to one another: a random tree of ways, and loops."""

from __future__ import annotations

import numpy as np

from bug_gym.worlds.family import Rng


def carve(columns: int, rows: int, loops: float, rng: Rng) -> tuple[np.ndarray, np.ndarray]:
    """Which cells are open to their right (columns - 1, rows) and upper (columns, rows - 1) neighbours."""
    open_right, open_up = np.zeros((columns - 1, rows), dtype=bool), np.zeros((columns, rows - 1), dtype=bool)
    seen = np.zeros((columns, rows), dtype=bool)
    trail = [(int(rng.integers(columns)), int(rng.integers(rows)))]
    seen[trail[0]] = True
    while trail:
        x, y = trail[-1]
        ways = [(x + dx, y + dy) for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        ways = [(u, v) for u, v in ways if 0 <= u < columns and 0 <= v < rows and not seen[u, v]]
        if not ways:
            trail.pop()
            continue
        u, v = ways[int(rng.integers(len(ways)))]
        if v == y:
            open_right[min(x, u), y] = True
        else:
            open_up[x, min(y, v)] = True
        seen[u, v] = True
        trail.append((u, v))
    open_right |= rng.random(open_right.shape) < loops
    open_up |= rng.random(open_up.shape) < loops
    return open_right, open_up
