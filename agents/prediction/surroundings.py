"""The compiled part of what a learned predictor is told: what the scan says of the surroundings of each mover.

One call describes all tracks of one robot; `features` encodes the numbers.
"""

from __future__ import annotations

import math

from bug_gym.compiling import called, kernel
from bug_gym.kernels.layout import Floats, Integers


@kernel
def describe_surroundings(
    hits: Floats,
    owners: Integers,
    places: Floats,
    axes: Floats,
    radii: Floats,
    speeds: Floats,
    headings: Floats,
    wall_reach: float,
    horizon: float,
    room: Floats,
    free: Floats,
    touch: Floats,
) -> None:
    """Describe what the hits about each track say, those on itself aside.

    Args:
        hits: places of the scan's hits (H, 2) [m].
        owners: which track each is on (H,), -1 none.
        places, axes, radii, speeds: of the tracks (T, 2), (T, 2), (T,), (T,); an axis is the direction of a velocity.
        headings: directions from the velocity, as unit vectors (K, 2).
        wall_reach: hits this near to the one that it would touch first say how the wall runs there [m].
        horizon: the longest time that counts [s].
        room: where to write the distance of the nearest hit from the outline in each sector (T, S), inf none [m].
        free: where to write the share of the horizon for which it could go on in each heading (T, K).
        touch: where to write of the first hit that it would touch: distance to its left over the radius, cosine and
            sine of twice the angle of the wall from the velocity, less where the hits don't lie on a line, and 1; all
            0 where it would touch nothing (T, 4).
    """
    sectors = room.shape[1]
    for t in range(len(places)):
        ax, ay, radius = axes[t, 0], axes[t, 1], radii[t]
        pace = max(speeds[t], 0.1) * horizon
        room[t, :] = math.inf
        free[t, :] = 1.0
        touch[t, :] = 0.0
        first, at = math.inf, -1
        for h in range(len(hits)):
            if owners[h] == t:
                continue
            dx, dy = hits[h, 0] - places[t, 0], hits[h, 1] - places[t, 1]
            x, y = ax * dx + ay * dy, ax * dy - ay * dx
            sector = int(math.floor(math.atan2(y, x) * sectors / (2.0 * math.pi) + 0.5)) % sectors
            room[t, sector] = min(room[t, sector], math.hypot(x, y) - radius)
            for k in range(len(headings)):
                cos, sin = headings[k, 0], headings[k, 1]
                along, aside = x * cos + y * sin, y * cos - x * sin
                if along <= 0.0 or abs(aside) >= radius:
                    continue
                way = max(along - math.sqrt(radius * radius - aside * aside), 0.0)
                free[t, k] = min(free[t, k], way / pace)
                if k == 0 and way < first:
                    first, at = way, h
                    touch[t, 0] = aside / radius
        if at >= 0:
            describe_wall(hits, owners, t, at, wall_reach, ax, ay, touch)


@called
def describe_wall(
    hits: Floats, owners: Integers, t: int, at: int, reach: float, ax: float, ay: float, touch: Floats
) -> None:
    """Write how the hits about hit `at` lie, by the second moments of their places, into touch[t, 1:]."""
    count = 0
    mx, my, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0
    for h in range(len(hits)):
        dx, dy = hits[h, 0] - hits[at, 0], hits[h, 1] - hits[at, 1]
        if owners[h] == t or dx * dx + dy * dy >= reach * reach:
            continue
        x, y = ax * dx + ay * dy, ax * dy - ay * dx
        count += 1
        mx += x
        my += y
        sxx += x * x
        sxy += x * y
        syy += y * y
    sxx -= mx * mx / count
    sxy -= mx * my / count
    syy -= my * my / count
    size = max(sxx + syy, 1e-9)
    touch[t, 1], touch[t, 2], touch[t, 3] = (sxx - syy) / size, 2.0 * sxy / size, 1.0
