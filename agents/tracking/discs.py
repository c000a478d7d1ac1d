"""A disc fitted to a cluster of hits: what a tracker measures.

The points of the cluster lie on the circle, and where the next beam passes the cluster by, the circle touches the ray
halfway between: with few beams these two rays say more about size and bearing than the points do. What is hidden
(another thing before it, the end of the LIDAR's range) has no such ray. The squares of all these errors are made least
by the method of Gauss and Newton.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.agents.tracking.clusters import edges_of
from bug_gym.agents.tracking.layout import (
    ANGLE_STEP,
    FR,
    FR_VARIANCE,
    FX,
    FY,
    MXX,
    MXY,
    MYY,
    NOISE,
    SHAPE,
    ZXX,
    ZXY,
    ZYY,
    Hits,
)
from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats

NEW_RADIUS, NEW_RADIUS_SPREAD = 0.5, 0.3  # of a thing not seen before [m]
LEAST_RADIUS, MOST_RADIUS = 0.1, 1.2  # of a thing that is tracked [m]
NEW_SHAPE, LEAST_SHAPE = 0.03, 0.012  # how far the outline of a thing departs from a circle: at first, and at least [m]


class Equations(NamedTuple):
    """Normal equations of a change of the centre (x, y) and the radius r: a symmetric matrix and a right side."""

    xx: float
    xy: float
    yy: float
    xr: float
    yr: float
    rr: float
    x: float
    y: float
    r: float


@called
def fit_disc(
    hits: Hits, begin: int, end: int, radius: float, spread: float, shape: float, is_radius_fixed: bool, fit: Floats
) -> None:
    """Fit a disc to beams members[begin:end] by three Gauss-Newton steps.

    Args:
        hits: the scan; the fit is made relative to the scanner's place, in the odometry frame's axes.
        begin, end: of the cluster among `hits.members`.
        radius, spread: what is known of the radius [m].
        shape: variance of the outline about a circle [m^2].
        is_radius_fixed: whether the radius is as given.
        fit: where to write the result (FIT,).
    """
    left, right = edges_of(hits, begin, end)
    mx, my, away = middle_of(hits, begin, end)
    half = 0.5 * hits.settings[ANGLE_STEP]
    beta_left, beta_right = hits.bearings[hits.members[end - 1]] + half, hits.bearings[hits.members[begin]] - half
    lx, ly = math.sin(beta_left), -math.cos(beta_left)
    rx, ry = -math.sin(beta_right), math.cos(beta_right)
    noise = hits.settings[NOISE] * hits.settings[NOISE]
    weight = 1.0 / (noise + (end - begin) * shape)  # hits on one outline depart from a circle together
    edge = (away * hits.settings[ANGLE_STEP]) ** 2 / 12.0 + noise + shape
    prior = 1.0 / (spread * spread)
    cx, cy, r = mx + 0.8 * radius * mx / away, my + 0.8 * radius * my / away, radius
    equations = Equations(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(3):
        equations = Equations(1e-6, 0.0, 1e-6, 0.0, 0.0, prior, 0.0, 0.0, prior * (radius - r))
        equations = with_hits(equations, hits, begin, end, cx, cy, r, weight)
        if left == 1:
            equations = with_edge(equations, lx, ly, cx, cy, r, edge)
        if right == 1:
            equations = with_edge(equations, rx, ry, cx, cy, r, edge)
        # Where nothing tells the bearing, the middle of what is seen does, to within the radius.
        equations = with_bearing(equations, -my / away, mx / away, cx, cy, 1.0 / (r * r + edge))
        if is_radius_fixed:
            dx, dy = solved(equations.xx, equations.xy, equations.yy, equations.x, equations.y)
            cx += dx
            cy += dy
            continue
        dx, dy, dr = solved_with_radius(equations)
        cx += dx
        cy += dy
        r = min(max(r + dr, LEAST_RADIUS), MOST_RADIUS)
    fit[FX], fit[FY], fit[FR] = cx, cy, r
    fit[SHAPE] = max(square_about(hits, begin, end, cx, cy, r) - noise, LEAST_SHAPE * LEAST_SHAPE)
    write_variances(equations, fit)


@inlined
def middle_of(hits: Hits, begin: int, end: int) -> tuple[float, float, float]:
    """The mean place x, y of a cluster's hits and its distance from the scanner, which is never 0 [m]."""
    count = end - begin
    mx, my = 0.0, 0.0
    for k in range(begin, end):
        mx += hits.x[hits.members[k]]
        my += hits.y[hits.members[k]]
    mx, my = mx / count, my / count
    away = math.hypot(mx, my)
    if away < 1e-6:
        mx, my, away = 1e-6, 0.0, 1e-6
    return mx, my, away


@inlined
def with_hits(
    equations: Equations, hits: Hits, begin: int, end: int, cx: float, cy: float, r: float, weight: float
) -> Equations:
    """The equations with what the hits say: they lie on the circle."""
    x, y, members = hits.x, hits.y, hits.members
    axx, axy, ayy, axr, ayr, arr, bx, by, br = equations
    for k in range(begin, end):
        dx, dy = x[members[k]] - cx, y[members[k]] - cy
        distance = max(math.hypot(dx, dy), 1e-6)
        ux, uy, gap = dx / distance, dy / distance, distance - r
        # gap falls by u.dc + dr
        axx += weight * ux * ux
        axy += weight * ux * uy
        ayy += weight * uy * uy
        axr += weight * ux
        ayr += weight * uy
        arr += weight
        bx += weight * ux * gap
        by += weight * uy * gap
        br += weight * gap
    return Equations(axx, axy, ayy, axr, ayr, arr, bx, by, br)


@inlined
def with_edge(equations: Equations, nx: float, ny: float, cx: float, cy: float, r: float, variance: float) -> Equations:
    """The equations with what the ray beside a cluster says: the circle touches it; (nx, ny) points across it."""
    axx, axy, ayy, axr, ayr, arr, bx, by, br = equations
    gap = r - (nx * cx + ny * cy)
    axx += nx * nx / variance
    axy += nx * ny / variance
    ayy += ny * ny / variance
    axr -= nx / variance
    ayr -= ny / variance
    arr += 1.0 / variance
    bx += nx * gap / variance
    by += ny * gap / variance
    br -= gap / variance
    return Equations(axx, axy, ayy, axr, ayr, arr, bx, by, br)


@inlined
def with_bearing(equations: Equations, tx: float, ty: float, cx: float, cy: float, weight: float) -> Equations:
    """The equations with a bearing of the centre; (tx, ty) points across it."""
    axx, axy, ayy, axr, ayr, arr, bx, by, br = equations
    gap = -(tx * cx + ty * cy)
    axx += weight * tx * tx
    axy += weight * tx * ty
    ayy += weight * ty * ty
    bx += weight * tx * gap
    by += weight * ty * gap
    return Equations(axx, axy, ayy, axr, ayr, arr, bx, by, br)


@inlined
def solved(xx: float, xy: float, yy: float, x: float, y: float) -> tuple[float, float]:
    """Solution of two symmetric equations."""
    determinant = xx * yy - xy * xy
    return (yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant


@inlined
def without_radius(equations: Equations) -> tuple[float, float, float]:
    """The matrix of the centre alone, the radius eliminated: Schur's complement."""
    axx, axy, ayy, axr, ayr, arr, _, _, _ = equations
    return axx - axr * axr / arr, axy - axr * ayr / arr, ayy - ayr * ayr / arr


@inlined
def solved_with_radius(equations: Equations) -> tuple[float, float, float]:
    """Solution of all three equations."""
    _, _, _, axr, ayr, arr, bx, by, br = equations
    pxx, pxy, pyy = without_radius(equations)
    dx, dy = solved(pxx, pxy, pyy, bx - axr * br / arr, by - ayr * br / arr)
    return dx, dy, (br - axr * dx - ayr * dy) / arr


@inlined
def square_about(hits: Hits, begin: int, end: int, cx: float, cy: float, r: float) -> float:
    """Mean square of a cluster's distances from a circle [m^2]."""
    square = 0.0
    for k in range(begin, end):
        square += (math.hypot(hits.x[hits.members[k]] - cx, hits.y[hits.members[k]] - cy) - r) ** 2
    return square / (end - begin)


@inlined
def write_variances(equations: Equations, fit: Floats) -> None:
    """Write how sure the place is, the radius known and unknown, and how sure the radius is."""
    axx, axy, ayy, axr, ayr, arr, _, _, _ = equations
    determinant = axx * ayy - axy * axy
    fit[ZXX], fit[ZXY], fit[ZYY] = ayy / determinant, -axy / determinant, axx / determinant
    # variance of the radius: 1 / (arr - a' A^-1 a)
    inner = (ayy * axr * axr - 2.0 * axy * axr * ayr + axx * ayr * ayr) / determinant
    fit[FR_VARIANCE] = 1.0 / max(arr - inner, 1e-6)
    pxx, pxy, pyy = without_radius(equations)
    determinant = pxx * pyy - pxy * pxy
    fit[MXX], fit[MXY], fit[MYY] = pyy / determinant, -pxy / determinant, pxx / determinant
