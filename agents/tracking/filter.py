"""The Kalman filter of a track: constant velocity, measured by the discs fitted to its clusters.

Source: Bar-Shalom, Li and Kirubarajan 2001, Estimation with Applications to Tracking and Navigation.
"""

from __future__ import annotations

import math

from bug_gym.agents.tracking.discs import NEW_SHAPE, fit_disc
from bug_gym.agents.tracking.layout import (
    CENTRES,
    CXX,
    CXY,
    CYX,
    CYY,
    FR,
    FR_VARIANCE,
    FX,
    FY,
    HISTORY,
    HITS,
    ID,
    INNOVATION,
    IS_MOVING,
    PXX,
    PXY,
    PYY,
    RADIUS,
    RADIUS_VARIANCE,
    SEEN,
    SHAPE,
    TRACKS,
    VX,
    VXX,
    VXY,
    VY,
    VYY,
    ZXX,
    ZXY,
    ZYY,
    Hits,
    Memory,
    X,
    Y,
)
from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats, Integers

ACCELERATION = 0.4  # of a mover, one standard deviation [m/s^2]
LEAST_SPREAD = 0.05  # of a radius that is known [m]: things aren't round
GATE = 9.21  # chi-square of two degrees of freedom, 99 %
SWERVE = 0.6  # velocity that a mover may have changed by where it departs from its course [m/s]
SWERVE_PLACE = 0.05  # and place [m]


@called
def predict_tracks(memory: Memory, dt: float) -> None:
    """Move each track on by `dt` [s] at constant velocity."""
    noise = ACCELERATION * ACCELERATION
    for m in range(TRACKS):
        if memory.numbers[m, ID] == 0:
            continue
        s = memory.state[m]
        s[X] += dt * s[VX]
        s[Y] += dt * s[VY]
        s[PXX] += 2.0 * dt * s[CXX] + dt * dt * s[VXX] + 0.25 * noise * dt**4
        s[PXY] += dt * (s[CXY] + s[CYX]) + dt * dt * s[VXY]
        s[PYY] += 2.0 * dt * s[CYY] + dt * dt * s[VYY] + 0.25 * noise * dt**4
        s[CXX] += dt * s[VXX] + 0.5 * noise * dt**3
        s[CXY] += dt * s[VXY]
        s[CYX] += dt * s[VXY]
        s[CYY] += dt * s[VYY] + 0.5 * noise * dt**3
        s[VXX] += noise * dt * dt
        s[VYY] += noise * dt * dt


@inlined
def mahalanobis(dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
    """Squared length of (dx, dy) by a covariance."""
    return (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)


@inlined
def departure(s: Floats, fit: Floats, px: float, py: float) -> float:
    """Squared Mahalanobis distance of a measured place from where a track expects it."""
    dx, dy = fit[FX] + px - s[X], fit[FY] + py - s[Y]
    return mahalanobis(dx, dy, s[PXX] + fit[ZXX], s[PXY] + fit[ZXY], s[PYY] + fit[ZYY])


@inlined
def gain(s: Floats, zx: float, zy: float, xx: float, xy: float, yy: float) -> None:
    """Kalman's update of a track by a place (zx, zy) with a covariance."""
    ixx, ixy, iyy = s[PXX] + xx, s[PXY] + xy, s[PYY] + yy
    determinant = ixx * iyy - ixy * ixy
    jxx, jxy, jyy = iyy / determinant, -ixy / determinant, ixx / determinant
    vx, vy = zx - s[X], zy - s[Y]
    # gains K = P_(.,place) S^-1, rows x, y, vx, vy
    kxx, kxy = s[PXX] * jxx + s[PXY] * jxy, s[PXX] * jxy + s[PXY] * jyy
    kyx, kyy = s[PXY] * jxx + s[PYY] * jxy, s[PXY] * jxy + s[PYY] * jyy
    wxx, wxy = s[CXX] * jxx + s[CYX] * jxy, s[CXX] * jxy + s[CYX] * jyy
    wyx, wyy = s[CXY] * jxx + s[CYY] * jxy, s[CXY] * jxy + s[CYY] * jyy
    s[X] += kxx * vx + kxy * vy
    s[Y] += kyx * vx + kyy * vy
    s[VX] += wxx * vx + wxy * vy
    s[VY] += wyx * vx + wyy * vy
    pxx, pxy, pyy = s[PXX], s[PXY], s[PYY]
    cxx, cxy, cyx, cyy = s[CXX], s[CXY], s[CYX], s[CYY]
    s[PXX] = pxx - kxx * pxx - kxy * pxy
    s[PXY] = pxy - kxx * pxy - kxy * pyy
    s[PYY] = pyy - kyx * pxy - kyy * pyy
    s[CXX] = cxx - kxx * cxx - kxy * cyx
    s[CXY] = cxy - kxx * cxy - kxy * cyy
    s[CYX] = cyx - kyx * cxx - kyy * cyx
    s[CYY] = cyy - kyx * cxy - kyy * cyy
    s[VXX] -= wxx * cxx + wxy * cyx
    s[VXY] -= wxx * cxy + wxy * cyy
    s[VYY] -= wyx * cxy + wyy * cyy


@inlined
def measure(s: Floats, n: Integers, fit: Floats, history: Floats, px: float, py: float, now: float) -> None:
    """Update a track with the disc fitted to its cluster (`fit`, the radius as the track has it)."""
    zx, zy = fit[FX] + px, fit[FY] + py
    square = departure(s, fit, px, py)
    s[INNOVATION] = square
    excess = 1.0
    if square > GATE:
        if n[IS_MOVING] > 0:  # it has turned
            s[PXX] += SWERVE_PLACE * SWERVE_PLACE
            s[PYY] += SWERVE_PLACE * SWERVE_PLACE
            s[VXX] += SWERVE * SWERVE
            s[VYY] += SWERVE * SWERVE
        else:  # another side of it has come into view
            excess = square / GATE
    gain(s, zx, zy, excess * fit[ZXX], excess * fit[ZXY], excess * fit[ZYY])
    s[SEEN] = now
    n[HITS] |= 1
    at = n[CENTRES] % HISTORY
    history[at, 0], history[at, 1], history[at, 2] = zx, zy, now
    n[CENTRES] += 1


@called
def refit(s: Floats, hits: Hits, begin: int, end: int, fit: Floats) -> None:
    """Fit the disc of a track to its cluster, and learn its radius.

    A radius learnt moves the centre that the same hits stand for; that is no motion, so the track moves along with it.
    """
    spread = math.sqrt(s[RADIUS_VARIANCE])
    fit_disc(hits, begin, end, s[RADIUS], spread, NEW_SHAPE**2, False, fit)
    radius, variance, shape = fit[FR], fit[FR_VARIANCE], fit[SHAPE]
    fit_disc(hits, begin, end, s[RADIUS], spread, shape, True, fit)
    bx, by = fit[FX], fit[FY]
    fit_disc(hits, begin, end, radius, spread, shape, True, fit)
    s[X] += fit[FX] - bx
    s[Y] += fit[FY] - by
    s[RADIUS], s[RADIUS_VARIANCE] = radius, max(variance, LEAST_SPREAD * LEAST_SPREAD)
