"""Compiled code of the tracker: cut a scan into clusters, fit discs, associate them with tracks, filter, tell movers.

Nothing here calls bug_gym.kernels (numba's cache does not notice a change of a callee in another file); only the
decorators come from there. One call works on one robot's memory. Places are in the odometry frame [m]; a fit is made
relative to the scanner's place, in the odometry frame's axes.

The measurement is a disc fitted to a cluster. Its points lie on the circle, and where the next beam passes the cluster
by, the circle touches the ray halfway between: with few beams these two rays say more about size and bearing than the
points do. What is hidden (another thing before it, the end of the LIDAR's range) has no such ray.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bug_gym.compiling import inlined, kernel
from bug_gym.kernels.layout import Flags, Floats, Integers

TRACKS = 96
"""Places for tracks in a memory."""
HISTORY = 32
"""Measured centres kept for each track."""
SCANS = 16
"""Past scans kept, for the space seen free."""

# Columns of a track's state. PXX to PYY: covariance of the place, CXX to CYY: of place (first letter) and velocity,
# VXX to VYY: of the velocity.
X, Y, VX, VY, PXX, PXY, PYY, CXX, CXY, CYX, CYY, VXX, VXY, VYY = range(14)
RADIUS, RADIUS_VARIANCE, EVIDENCE, BORN, SEEN, INNOVATION = range(14, 20)
STATE = 20

# Columns of a track's integers. ID 0: no track here. HITS: one bit an update, the last one lowest.
ID, HITS, IS_CONFIRMED, IS_MOVING, CENTRES, CLUSTER = range(6)
NUMBERS = 6

# Constants of a robot's scanner and of the filter, packed.
(RANGE, FIRST_ANGLE, ANGLE_STEP, NOISE, IS_FULL_CIRCLE) = range(5)
SETTINGS = 5

# Columns of a fitted disc: place relative to the scanner, radius and their covariances; Z*: the variances of the place
# if the radius is known; M*: if it isn't. SHAPE: the
# variance of the hits about the circle that the noise of a range doesn't explain.
FX, FY, FR, FR_VARIANCE, ZXX, ZXY, ZYY, MXX, MXY, MYY, SHAPE = range(11)
FIT = 11

NEW_RADIUS, NEW_RADIUS_SPREAD = 0.5, 0.3  # of a thing not seen before [m]
LEAST_RADIUS, MOST_RADIUS = 0.1, 1.2  # of a thing that is tracked [m]
LEAST_SPREAD = 0.05  # of a radius that is known [m]: things aren't round
JUMP = 0.1  # ranges that differ by more, for their noise and spacing, are of two surfaces [m]
OPEN_END = 0.3  # a cluster that ends this near to the end of what is in range may go on there [m]
CLAIM, MOST_CLAIM = 0.1, 0.3  # how far from a mover's predicted outline a hit may be its: at least, and at most [m]
WALL_EXTENT = 2.4  # a cluster longer than this is a wall [m]
NEW_SHAPE, LEAST_SHAPE = 0.03, 0.012  # how far the outline of a thing departs from a circle: at first, and at least [m]
ACCELERATION = 0.4  # of a mover, one standard deviation [m/s^2]
NEW_SPEED = 1.0  # of a thing not seen before, one standard deviation [m/s]
GATE = 9.21  # chi-square of two degrees of freedom, 99 %
LOST = 0.35  # what is farther than this from a mover's course, and far out of the gate, is another thing [m]
NEAR_GATE = 1.5  # no cluster farther than this from a track's place is its next measurement [m]
SWERVE = 0.6  # velocity that a mover may have changed by where it departs from its course [m/s]
SWERVE_PLACE = 0.05  # and place [m]
OUT_OF_ROUND = 0.1  # how far a hit of one thing lies from its circle [m]
ENOUGH_HITS = 6  # to tell one disc from two
SAME_COURSE = 0.4  # velocities of two pieces of one thing differ by no more [m/s]
LEAST_SPEED = 0.1  # of a mover [m/s]
# how long a track stays where its place is seen empty, for a mover, and where it isn't seen [s]
SEEN_AWAY, MOVER_SEEN_AWAY, HIDDEN_AWAY = 1.0, 0.5, 3.0
EVIDENT_SHARE = 0.2  # of a thing's hits that show motion when it moves
LAGS = (0.3, 0.6, 1.2)  # ages of the scans that say what was free [s]
SCAN_SPACING = 0.09  # least time between scans kept [s]


class Hits(NamedTuple):
    """A scan as points, and the beams of its clusters."""

    x: Floats
    """Hits relative to the scanner, in the odometry frame's axes, x (B,) and y (B,) [m]."""
    y: Floats
    bearings: Floats
    """Bearings of the beams in the same axes (B,) [rad]."""
    ranges: Floats
    """(B,) [m]."""
    members: Integers
    """Numbers of beams; a cluster is a run of them, counter-clockwise."""
    settings: Floats
    """Constants of the scanner (SETTINGS,)."""


@inlined
def wrap(angle: float) -> float:
    """The angle in [-pi, pi)."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel
def predict_tracks(state: Floats, numbers: Integers, dt: float) -> None:
    """Move each track on by `dt` [s] at constant velocity."""
    noise = ACCELERATION * ACCELERATION
    for m in range(TRACKS):
        if numbers[m, ID] == 0:
            continue
        s = state[m]
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


@kernel
def claim_beams(state: Floats, numbers: Integers, wx: Floats, wy: Floats, is_hit: Flags, owner: Integers) -> None:
    """Give hits at the predicted outline of a mover to it: near a wall its points can't be told by their ranges."""
    beams = len(wx)
    for m in range(TRACKS):
        if numbers[m, ID] == 0 or numbers[m, IS_MOVING] == 0:
            continue
        s = state[m]
        slack = min(CLAIM + 1.5 * math.sqrt(max(s[PXX], s[PYY])), MOST_CLAIM)
        reach = s[RADIUS] + slack
        for i in range(beams):
            if not is_hit[i]:
                continue
            dx, dy = wx[i] - s[X], wy[i] - s[Y]
            square = dx * dx + dy * dy
            if square > reach * reach:
                continue
            if owner[i] >= 0:
                other = state[owner[i]]
                if abs(math.hypot(wx[i] - other[X], wy[i] - other[Y]) - other[RADIUS]) <= abs(
                    math.sqrt(square) - s[RADIUS]
                ):
                    continue
            owner[i] = m


@kernel
def gather_claimed(owner: Integers, m: int, is_full: bool, members: Integers) -> int:
    """List the beams of a mover counter-clockwise, beginning behind the widest gap; returns how many."""
    beams, count = len(owner), 0
    widest, begin, before = 0, 0, -1
    for i in range(beams):
        if owner[i] != m:
            continue
        if before >= 0 and i - before > widest:
            widest, begin = i - before, count
        members[count] = i
        before = i
        count += 1
    if not is_full or count == 0 or members[0] + beams - before >= widest:
        return count
    for k in range(begin):  # turn the list so that it begins behind the gap
        members[count + k] = members[k]
    for k in range(count):
        members[k] = members[begin + k]
    return count


@inlined
def is_one_surface(ranges: Floats, is_hit: Flags, i: int, settings: Floats) -> bool:
    """Whether beam i and the one before it saw the same surface.

    They did where their ranges differ little for their distance from one another, or where the line through the two
    hits on one side leads to the hit on the other: on a line, 1 / range is a sinusoid of the angle.
    """
    beams = len(ranges)
    h = i - 1 if i > 0 else beams - 1
    if not (is_hit[i] and is_hit[h]):
        return False
    near = min(ranges[i], ranges[h])
    spacing = near * settings[ANGLE_STEP]
    if abs(ranges[i] - ranges[h]) <= JUMP + 3.0 * settings[NOISE] + spacing:
        return True
    slack = JUMP + 3.0 * settings[NOISE] + 0.5 * spacing
    g = h - 1 if h > 0 else beams - 1
    j = i + 1 if i + 1 < beams else 0
    twice = 2.0 * math.cos(settings[ANGLE_STEP])
    if is_hit[g] and ranges[g] > 0.0 and ranges[h] > 0.0:
        inverse = twice / ranges[h] - 1.0 / ranges[g]
        if inverse > 0.0 and abs(1.0 / inverse - ranges[i]) <= slack:
            return True
    if is_hit[j] and ranges[j] > 0.0 and ranges[i] > 0.0:
        inverse = twice / ranges[i] - 1.0 / ranges[j]
        if inverse > 0.0 and abs(1.0 / inverse - ranges[h]) <= slack:
            return True
    return False


@kernel
def cut_clusters(
    ranges: Floats, is_hit: Flags, owner: Integers, settings: Floats, members: Integers, begins: Integers
) -> int:
    """Cut the unclaimed hits into clusters; returns how many.

    Cluster k is beams members[begins[k] : begins[k + 1]], counter-clockwise.
    """
    beams = len(ranges)
    is_full = settings[IS_FULL_CIRCLE] > 0.0
    first = 0
    if is_full:
        for i in range(beams):  # begin at a cut, so that no cluster is cut by the first beam
            h = i - 1 if i > 0 else beams - 1
            if owner[i] < 0 and owner[h] < 0 and not is_one_surface(ranges, is_hit, i, settings):
                first = i
                break
    clusters, filled = 0, 0
    begins[0] = 0
    for step in range(beams):
        i = first + step if first + step < beams else first + step - beams
        if not is_hit[i] or owner[i] >= 0:
            continue
        h = i - 1 if i > 0 else beams - 1
        joins = filled > begins[clusters] and step > 0 and (i > 0 or is_full)
        if joins and members[filled - 1] == h and is_one_surface(ranges, is_hit, i, settings):
            members[filled] = i
            filled += 1
            continue
        if filled > begins[clusters]:
            clusters += 1
            begins[clusters] = filled
        members[filled] = i
        filled += 1
    if filled > begins[clusters]:
        clusters += 1
        begins[clusters] = filled
    return clusters


@inlined
def extent_of(hits: Hits, begin: int, end: int) -> float:
    """Diagonal of the box about a cluster's hits [m]."""
    x, y, members = hits.x, hits.y, hits.members
    left, right = x[members[begin]], x[members[begin]]
    low, high = y[members[begin]], y[members[begin]]
    for k in range(begin + 1, end):
        left, right = min(left, x[members[k]]), max(right, x[members[k]])
        low, high = min(low, y[members[k]]), max(high, y[members[k]])
    return math.hypot(right - left, high - low)


@inlined
def edge_kind(ranges: Floats, beam: int, step: int, settings: Floats) -> int:
    """What ends a cluster at `beam`: 1 its own outline, 0 another thing before it, -1 the end of what is in range."""
    beams = len(ranges)
    after = beam + step
    if after < 0 or after >= beams:
        if settings[IS_FULL_CIRCLE] == 0.0:
            return -1
        after = after % beams
    if ranges[after] >= settings[RANGE]:
        return 1 if ranges[beam] < settings[RANGE] - OPEN_END else -1
    return 1 if ranges[after] > ranges[beam] + JUMP else 0


@inlined
def edges_of(hits: Hits, begin: int, end: int) -> tuple[int, int]:
    """`edge_kind` of the last and of the first beam of a cluster: what ends it on its left and on its right."""
    left = edge_kind(hits.ranges, hits.members[end - 1], 1, hits.settings)
    return left, edge_kind(hits.ranges, hits.members[begin], -1, hits.settings)


@kernel
def fit_disc(
    hits: Hits, begin: int, end: int, radius: float, spread: float, shape: float, is_radius_fixed: bool, fit: Floats
) -> None:
    """Fit a disc to beams members[begin:end] by three Gauss-Newton steps.

    Args:
        radius, spread: what is known of the radius [m].
        shape: variance of the outline about a circle [m^2].
        is_radius_fixed: whether the radius is as given.
        fit: where to write the result (FIT,).
    """
    x, y, angles, members, settings = hits.x, hits.y, hits.bearings, hits.members, hits.settings
    left, right = edges_of(hits, begin, end)
    count = end - begin
    sx, sy = 0.0, 0.0
    for k in range(begin, end):
        sx += x[members[k]]
        sy += y[members[k]]
    sx, sy = sx / count, sy / count
    away = math.hypot(sx, sy)
    if away < 1e-6:
        sx, sy, away = 1e-6, 0.0, 1e-6
    cx, cy, r = sx + 0.8 * radius * sx / away, sy + 0.8 * radius * sy / away, radius
    half = 0.5 * settings[ANGLE_STEP]
    beta_left, beta_right = angles[members[end - 1]] + half, angles[members[begin]] - half
    lx, ly = math.sin(beta_left), -math.cos(beta_left)
    rx, ry = -math.sin(beta_right), math.cos(beta_right)
    noise = settings[NOISE] * settings[NOISE]
    weight = 1.0 / (noise + count * shape)  # hits on one outline depart from a circle together
    edge = (away * settings[ANGLE_STEP]) ** 2 / 12.0 + noise + shape
    prior = 1.0 / (spread * spread)
    axx, axy, ayy, axr, ayr, arr = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(3):
        axx, axy, ayy, axr, ayr, arr = 1e-6, 0.0, 1e-6, 0.0, 0.0, prior
        bx, by, br = 0.0, 0.0, prior * (radius - r)
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
        for side in range(2):
            if (left if side == 0 else right) != 1:
                continue
            nx, ny = (lx, ly) if side == 0 else (rx, ry)
            gap = r - (nx * cx + ny * cy)
            axx += nx * nx / edge
            axy += nx * ny / edge
            ayy += ny * ny / edge
            axr -= nx / edge
            ayr -= ny / edge
            arr += 1.0 / edge
            bx += nx * gap / edge
            by += ny * gap / edge
            br -= gap / edge
        # Where nothing tells the bearing, the middle of what is seen does, to within the radius.
        tx, ty = -sy / away, sx / away
        loose = 1.0 / (r * r + edge)
        gap = -(tx * cx + ty * cy)
        axx += loose * tx * tx
        axy += loose * tx * ty
        ayy += loose * ty * ty
        bx += loose * tx * gap
        by += loose * ty * gap
        if is_radius_fixed:
            determinant = axx * ayy - axy * axy
            cx += (ayy * bx - axy * by) / determinant
            cy += (axx * by - axy * bx) / determinant
            continue
        # 3 x 3 by Schur's complement of the radius
        pxx, pxy, pyy = axx - axr * axr / arr, axy - axr * ayr / arr, ayy - ayr * ayr / arr
        qx, qy = bx - axr * br / arr, by - ayr * br / arr
        determinant = pxx * pyy - pxy * pxy
        dx, dy = (pyy * qx - pxy * qy) / determinant, (pxx * qy - pxy * qx) / determinant
        cx += dx
        cy += dy
        r = min(max(r + (br - axr * dx - ayr * dy) / arr, LEAST_RADIUS), MOST_RADIUS)
    determinant = axx * ayy - axy * axy
    fit[FX], fit[FY], fit[FR] = cx, cy, r
    square = 0.0
    for k in range(begin, end):
        square += (math.hypot(x[members[k]] - cx, y[members[k]] - cy) - r) ** 2
    fit[SHAPE] = max(square / count - noise, LEAST_SHAPE * LEAST_SHAPE)
    fit[ZXX], fit[ZXY], fit[ZYY] = ayy / determinant, -axy / determinant, axx / determinant
    # variance of the radius: 1 / (arr - a' A^-1 a)
    inner = (ayy * axr * axr - 2.0 * axy * axr * ayr + axx * ayr * ayr) / determinant
    fit[FR_VARIANCE] = 1.0 / max(arr - inner, 1e-6)
    pxx, pxy, pyy = axx - axr * axr / arr, axy - axr * ayr / arr, ayy - ayr * ayr / arr
    determinant = pxx * pyy - pxy * pxy
    fit[MXX], fit[MXY], fit[MYY] = pyy / determinant, -pxy / determinant, pxx / determinant


@kernel
def join_claims(
    state: Floats,
    numbers: Integers,
    hits: Hits,
    begins: Integers,
    clusters: int,
    owner: Integers,
    counts: Integers,
    fit: Floats,
) -> None:
    """Give a cluster that is mostly one mover's to it as a whole, where it is one disc.

    A mover that was seen in part at first grows so; another one that goes along is a piece of it.
    """
    x, y, members = hits.x, hits.y, hits.members
    for c in range(clusters):
        begin, end = begins[c], begins[c + 1]
        if end - begin < ENOUGH_HITS or extent_of(hits, begin, end) > WALL_EXTENT:
            continue
        counts[:TRACKS] = 0
        main = -1
        for k in range(begin, end):
            m = owner[members[k]]
            if m >= 0:
                counts[m] += 1
                if main < 0 or counts[m] > counts[main] or (counts[m] == counts[main] and m < main):
                    main = m
        if main < 0 or 2 * counts[main] < end - begin or counts[main] == end - begin:
            continue
        radius, spread = state[main, RADIUS], math.sqrt(state[main, RADIUS_VARIANCE])
        fit_disc(hits, begin, end, radius, spread, NEW_SHAPE**2, False, fit)
        is_disc = fit[FR] <= radius + 2.0 * spread
        for k in range(begin, end):
            gap = math.hypot(x[members[k]] - fit[FX], y[members[k]] - fit[FY]) - fit[FR]
            is_disc = is_disc and abs(gap) <= OUT_OF_ROUND
        if not is_disc:
            continue
        for k in range(begin, end):
            m = owner[members[k]]
            if m >= 0 and m != main:
                if math.hypot(state[m, VX] - state[main, VX], state[m, VY] - state[main, VY]) > SAME_COURSE:
                    continue
                if math.hypot(state[m, X] - state[main, X], state[m, Y] - state[main, Y]) > fit[FR]:
                    continue
                numbers[m, ID] = 0
            owner[members[k]] = main


@inlined
def mahalanobis(dx: float, dy: float, xx: float, xy: float, yy: float) -> float:
    """Squared length of (dx, dy) by a covariance."""
    return (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)


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
def beam_toward(x: float, y: float, pose: Floats, settings: Floats) -> float:
    """Number among the beams of a scan, with a fraction, of the way to a place of the odometry frame."""
    bearing = wrap(math.atan2(y - pose[1], x - pose[0]) - pose[2]) - settings[FIRST_ANGLE]
    if settings[IS_FULL_CIRCLE] > 0.0 and bearing < 0.0:
        bearing += 2.0 * math.pi
    return float(bearing / settings[ANGLE_STEP])


@inlined
def is_free(x: float, y: float, ranges: Floats, pose: Floats, settings: Floats) -> bool:
    """Whether a scan saw past a place of the odometry frame, with both beams beside it and by a margin.

    The margin grows with the distance between the beams: a corner may have stood out between them.
    """
    beams = len(ranges)
    distance = math.hypot(x - pose[0], y - pose[1])
    far = distance + JUMP + 3.0 * settings[NOISE] + 0.5 * distance * settings[ANGLE_STEP]
    if far >= settings[RANGE]:
        return False
    low = int(math.floor(beam_toward(x, y, pose, settings)))
    high = low + 1
    if settings[IS_FULL_CIRCLE] > 0.0:
        low, high = low % beams, high % beams
    elif low < 0 or high >= beams:
        return False
    return bool(ranges[low] > far and ranges[high] > far)


@inlined
def scan_of_age(scan_poses: Floats, now: float, age: float) -> int:
    """Which of the scans kept is the youngest at least `age` old, -1 where none is."""
    best, best_age = -1, math.inf
    for k in range(SCANS):
        old = now - scan_poses[k, 3]
        if age - 1e-6 <= old < best_age:
            best, best_age = k, old
    return best


@kernel
def weigh_evidence(
    state: Floats,
    numbers: Integers,
    wx: Floats,
    wy: Floats,
    ranges: Floats,
    pose: Floats,
    owner: Integers,
    scans: Floats,
    scan_points: Floats,
    scan_poses: Floats,
    scan_owners: Integers,
    settings: Floats,
    counts: Integers,
    hits: Integers,
) -> None:
    """Count for each track its hits in space that was free, and its old hits in space that is free now.

    A still thing has neither, but for some at its corners. EVIDENCE rises by one in an update that shows motion and
    falls where none does.
    """
    beams = len(ranges)
    counts[:] = 0
    hits[:] = 0
    for i in range(beams):
        if owner[i] >= 0:
            hits[owner[i]] += 1
    for lag in range(len(LAGS)):
        k = scan_of_age(scan_poses, pose[3], LAGS[lag])
        if k < 0:
            break
        for i in range(beams):
            m = owner[i]
            if m >= 0 and is_free(wx[i], wy[i], scans[k], scan_poses[k], settings):
                counts[m] += 1
            mark = scan_owners[k, i]
            if mark <= 0:
                continue
            m = mark % TRACKS
            if numbers[m, ID] != mark // TRACKS:
                continue
            if is_free(scan_points[k, 0, i], scan_points[k, 1, i], ranges, pose, settings):
                counts[m] += 1
    for m in range(TRACKS):
        if numbers[m, ID] > 0:
            change = 1.0 if counts[m] >= max(1.0, EVIDENT_SHARE * hits[m]) else -0.5
            state[m, EVIDENCE] = min(max(state[m, EVIDENCE] + change, 0.0), 5.0)


@inlined
def departure(s: Floats, fit: Floats, px: float, py: float) -> float:
    """Squared Mahalanobis distance of a measured place from where a track expects it."""
    dx, dy = fit[FX] + px - s[X], fit[FY] + py - s[Y]
    return mahalanobis(dx, dy, s[PXX] + fit[ZXX], s[PXY] + fit[ZXY], s[PYY] + fit[ZYY])


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


@inlined
def begin_track(
    s: Floats, n: Integers, fit: Floats, history: Floats, px: float, py: float, now: float, number: int
) -> None:
    """Begin a track with a disc fitted to a new cluster."""
    s[:] = 0.0
    s[X], s[Y] = fit[FX] + px, fit[FY] + py
    s[PXX], s[PXY], s[PYY] = fit[ZXX], fit[ZXY], fit[ZYY]
    s[VXX] = s[VYY] = NEW_SPEED * NEW_SPEED
    s[RADIUS], s[RADIUS_VARIANCE] = fit[FR], fit[FR_VARIANCE]
    s[BORN] = s[SEEN] = now
    n[:] = 0
    n[ID], n[HITS], n[CENTRES] = number, 1, 1
    history[0, 0], history[0, 1], history[0, 2] = s[X], s[Y], now


@kernel
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


@inlined
def worst_track(state: Floats, numbers: Integers, px: float, py: float, distance: float) -> int:
    """A place for a new track at a distance [m]: free, or that of the farthest still thing out of sight, else -1."""
    worst, far = -1, distance
    for m in range(TRACKS):
        if numbers[m, ID] == 0:
            return m
        away = math.hypot(state[m, X] - px, state[m, Y] - py)
        if numbers[m, IS_MOVING] == 0 and numbers[m, CLUSTER] < 0 and away > far:
            worst, far = m, away
    return worst


@inlined
def is_seen_empty(s: Floats, ranges: Floats, pose: Floats, settings: Floats) -> bool:
    """Whether the beam toward a track's centre goes past it."""
    beams = len(ranges)
    distance = math.hypot(s[X] - pose[0], s[Y] - pose[1])
    if distance > settings[RANGE]:
        return True  # out of reach, it is let go as soon
    beam = int(round(beam_toward(s[X], s[Y], pose, settings)))
    if settings[IS_FULL_CIRCLE] > 0.0:
        beam = beam % beams
    elif beam < 0 or beam >= beams:
        return False
    return bool(ranges[beam] > distance)


@inlined
def is_mover(s: Floats, n: Integers) -> bool:
    """Whether a track moves: its speed is significant and the space it takes and leaves says so too."""
    speed = math.hypot(s[VX], s[VY])
    if n[IS_MOVING] > 0:
        return s[EVIDENCE] > 0.0 and speed > 0.5 * LEAST_SPEED
    significance = mahalanobis(s[VX], s[VY], s[VXX], s[VXY], s[VYY])
    # the more there is of the one, the less is needed of the other
    needed = GATE - s[EVIDENCE] + 1.0
    return n[IS_CONFIRMED] > 0 and speed > LEAST_SPEED and significance > needed and s[EVIDENCE] >= 1.0


@inlined
def bits(value: int) -> int:
    """How many of the last five updates were hits."""
    total = 0
    for k in range(5):
        total += (value >> k) & 1
    return total


@kernel
def close_update(
    state: Floats, numbers: Integers, ranges: Floats, pose: Floats, settings: Floats, owner: Integers
) -> None:
    """Confirm tracks, tell movers, and let go of tracks that are gone or double."""
    for m in range(TRACKS):
        n, s = numbers[m], state[m]
        if n[ID] == 0:
            continue
        hits = bits(n[HITS])
        if hits >= 3:
            n[IS_CONFIRMED] = 1
        unseen = pose[3] - s[SEEN]
        if unseen > 0.0:
            limit = HIDDEN_AWAY
            if is_seen_empty(s, ranges, pose, settings):
                limit = MOVER_SEEN_AWAY if n[IS_MOVING] > 0 else SEEN_AWAY
            if unseen > limit or (n[IS_CONFIRMED] == 0 and (n[HITS] & 7) == 0):
                n[ID] = 0  # it has no hits in this scan
                continue
        n[IS_MOVING] = 1 if is_mover(s, n) else 0
        for other in range(m):
            o, t = numbers[other], state[other]
            if o[ID] == 0:
                continue
            near = 0.5 * max(s[RADIUS], t[RADIUS])
            if abs(s[X] - t[X]) < near and math.hypot(s[X] - t[X], s[Y] - t[Y]) < near:
                keeps_other = t[SEEN] > s[SEEN] or (t[SEEN] == s[SEEN] and o[ID] < n[ID])
                lost, kept = (m, other) if keeps_other else (other, m)
                numbers[lost, ID] = 0
                for i in range(len(owner)):
                    if owner[i] == lost:
                        owner[i] = kept
                if keeps_other:
                    break


@inlined
def keep_scan(
    numbers: Integers,
    ranges: Floats,
    wx: Floats,
    wy: Floats,
    pose: Floats,
    owner: Integers,
    scans: Floats,
    scan_points: Floats,
    scan_poses: Floats,
    scan_owners: Integers,
    counters: Integers,
) -> None:
    """Keep the scan unless the last one kept is as good as of the same time."""
    if counters[1] > 0 and pose[3] - scan_poses[(counters[1] - 1) % SCANS, 3] < SCAN_SPACING:
        return
    k = counters[1] % SCANS
    counters[1] += 1
    for i in range(len(ranges)):
        scans[k, i], scan_points[k, 0, i], scan_points[k, 1, i] = ranges[i], wx[i], wy[i]
        scan_owners[k, i] = numbers[owner[i], ID] * TRACKS + owner[i] if owner[i] >= 0 else 0
    for column in range(4):
        scan_poses[k, column] = pose[column]


@inlined
def nearest_track(state: Floats, numbers: Integers, fit: Floats, pose: Floats) -> tuple[float, int]:
    """Squared Mahalanobis distance and place of the free track nearest to a disc; GATE and -1 where none is within it."""
    best, best_track = GATE, -1
    x, y = fit[FX] + pose[0], fit[FY] + pose[1]
    for m in range(TRACKS):
        if numbers[m, ID] == 0 or numbers[m, CLUSTER] >= 0:
            continue
        s = state[m]
        dx, dy = x - s[X], y - s[Y]
        if dx * dx + dy * dy > NEAR_GATE * NEAR_GATE:
            continue
        square = mahalanobis(dx, dy, s[PXX] + fit[MXX], s[PXY] + fit[MXY], s[PYY] + fit[MYY])
        if square < best:
            best, best_track = square, m
    return best, best_track


@kernel
def associate(
    state: Floats,
    numbers: Integers,
    fits: Floats,
    is_thing: Flags,
    clusters: int,
    pose: Floats,
    chosen: Integers,
    nearest: Integers,
    squares: Floats,
) -> None:
    """Give each cluster at most one track, the pairs of least Mahalanobis distance first.

    Args:
        fits: a disc for each cluster (K, FIT).
        is_thing: whether the cluster may be a track's measurement (K,).
        chosen: where to write the track of each cluster, -1 none (K,).
        nearest, squares: scratch (K,).
    """
    for c in range(clusters):
        chosen[c] = -1
        if is_thing[c]:
            squares[c], nearest[c] = nearest_track(state, numbers, fits[c], pose)
    while True:
        best, best_cluster = GATE, -1
        for c in range(clusters):
            if is_thing[c] and chosen[c] < 0 and squares[c] < best:
                best, best_cluster = squares[c], c
        if best_cluster < 0:
            return
        track = nearest[best_cluster]
        chosen[best_cluster] = track
        numbers[track, CLUSTER] = best_cluster
        for c in range(clusters):  # whose nearest track is taken looks for another
            if is_thing[c] and chosen[c] < 0 and squares[c] < GATE and nearest[c] == track:
                squares[c], nearest[c] = nearest_track(state, numbers, fits[c], pose)


@kernel
def update_tracks(
    ranges: Floats,
    angles: Floats,
    pose: Floats,
    settings: Floats,
    state: Floats,
    numbers: Integers,
    history: Floats,
    scans: Floats,
    scan_points: Floats,
    scan_poses: Floats,
    scan_owners: Integers,
    counters: Integers,
    owner: Integers,
    work: Floats,
    fits: Floats,
    lists: Integers,
    flags: Flags,
) -> None:
    """One update of a memory.

    Args:
        ranges: the scan (B,) [m].
        angles: bearings of the beams from the heading (B,) [rad].
        pose: odometry x, y, heading, the time and the time since the last update [s] (5,).
        settings: constants of the scanner (SETTINGS,).
        state, numbers, history: the tracks (TRACKS, STATE), (TRACKS, NUMBERS), (TRACKS, HISTORY, 3).
        scans, scan_points, scan_poses, scan_owners: past scans (SCANS, B), the places of their hits (SCANS, 2, B), their
            poses and times (SCANS, 4), and whose their hits were (SCANS, B).
        counters: number of the last track, and how many scans were kept (2,).
        owner: where to write the place of the track that each hit belongs to, -1 none (B,).
        work, fits, lists, flags: scratch (6, B), (B, FIT), (5, 2 B + TRACKS), (2, B).
    """
    beams = len(ranges)
    px, py, now = pose[0], pose[1], pose[3]
    x, y, wx, wy, bearings = work[0], work[1], work[2], work[3], work[4]
    members, begins, chosen, counts = lists[0], lists[1], lists[2], lists[3]
    hits = Hits(x, y, bearings, ranges, members, settings)
    is_hit, is_thing = flags[0], flags[1]
    for i in range(beams):
        bearings[i] = pose[2] + angles[i]
        x[i], y[i] = ranges[i] * math.cos(bearings[i]), ranges[i] * math.sin(bearings[i])
        wx[i], wy[i] = x[i] + px, y[i] + py
        is_hit[i] = ranges[i] < settings[RANGE]
    predict_tracks(state, numbers, pose[4])
    for m in range(TRACKS):
        numbers[m, CLUSTER] = -1
        numbers[m, HITS] = (numbers[m, HITS] << 1) & 31
    owner[:] = -1
    clusters = cut_clusters(ranges, is_hit, owner, settings, members, begins)
    claim_beams(state, numbers, wx, wy, is_hit, owner)
    join_claims(state, numbers, hits, begins, clusters, owner, counts, fits[0])
    for m in range(TRACKS):
        if numbers[m, ID] == 0 or numbers[m, IS_MOVING] == 0:
            continue
        count = gather_claimed(owner, m, settings[IS_FULL_CIRCLE] > 0.0, members)
        if count == 0:
            continue
        fit_disc(hits, 0, count, state[m, RADIUS], 1.0, NEW_SHAPE**2, True, fits[0])
        dx, dy = fits[0, FX] + px - state[m, X], fits[0, FY] + py - state[m, Y]
        if math.hypot(dx, dy) > LOST and departure(state[m], fits[0], px, py) > 3.0 * GATE:
            for k in range(count):
                owner[members[k]] = -1
            continue
        numbers[m, CLUSTER] = 0
        refit(state[m], hits, 0, count, fits[0])
        measure(state[m], numbers[m], fits[0], history[m], px, py, now)
    clusters = cut_clusters(ranges, is_hit, owner, settings, members, begins)
    for c in range(clusters):
        begin, end = begins[c], begins[c + 1]
        left, right = edges_of(hits, begin, end)
        # What is cut off on both sides is a piece of something behind, and says nothing about its own ends.
        is_thing[c] = (left == 1 or right == 1) and extent_of(hits, begin, end) <= WALL_EXTENT
        if is_thing[c]:
            fit_disc(hits, begin, end, NEW_RADIUS, NEW_RADIUS_SPREAD, NEW_SHAPE**2, False, fits[c])
            # A disc about the scanner is a recess of the walls.
            is_thing[c] = math.hypot(fits[c, FX], fits[c, FY]) > fits[c, FR]
    associate(state, numbers, fits, is_thing, clusters, pose, chosen, lists[4], work[5])
    for c in range(clusters):
        if not is_thing[c]:
            continue
        begin, end, m = begins[c], begins[c + 1], chosen[c]
        if m >= 0:
            refit(state[m], hits, begin, end, fits[c])
            measure(state[m], numbers[m], fits[c], history[m], px, py, now)
        else:
            m = worst_track(state, numbers, px, py, math.hypot(fits[c, FX], fits[c, FY]))
            if m < 0:
                continue
            counters[0] += 1
            spread = math.sqrt(fits[c, FR_VARIANCE])
            fit_disc(hits, begin, end, fits[c, FR], spread, fits[c, SHAPE], True, fits[c])
            begin_track(state[m], numbers[m], fits[c], history[m], px, py, now, counters[0])
        for k in range(begin, end):
            owner[members[k]] = m
    weigh_evidence(
        state,
        numbers,
        wx,
        wy,
        ranges,
        pose,
        owner,
        scans,
        scan_points,
        scan_poses,
        scan_owners,
        settings,
        counts,
        lists[4],
    )
    close_update(state, numbers, ranges, pose, settings, owner)
    keep_scan(numbers, ranges, wx, wy, pose, owner, scans, scan_points, scan_poses, scan_owners, counters)
