"""Which hits are whose: movers claim those at their outlines, then each cluster goes to the track nearest to it.

Near a wall the hits on a mover can't be told from the wall's by their ranges, so a mover takes what lies at its
predicted outline before the rest is cut into clusters. Clusters and tracks are paired within a gate, the pairs of least
Mahalanobis distance first.
"""

from __future__ import annotations

import math

from bug_gym.agents.tracking.clusters import extent_of
from bug_gym.agents.tracking.discs import NEW_SHAPE, fit_disc
from bug_gym.agents.tracking.filter import GATE, mahalanobis
from bug_gym.agents.tracking.layout import (
    CLUSTER,
    FR,
    FX,
    FY,
    ID,
    IS_MOVING,
    MXX,
    MXY,
    MYY,
    POSE_X,
    POSE_Y,
    PXX,
    PXY,
    PYY,
    RADIUS,
    RADIUS_VARIANCE,
    TRACKS,
    VX,
    VY,
    Clusters,
    Hits,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Floats, Integers

CLAIM, MOST_CLAIM = 0.1, 0.3  # how far from a mover's predicted outline a hit may be its: at least, and at most [m]
WALL_EXTENT = 2.4  # a cluster longer than this is a wall [m]
NEAR_GATE = 1.5  # no cluster farther than this from a track's place is its next measurement [m]
OUT_OF_ROUND = 0.1  # how far a hit of one thing lies from its circle [m]
ENOUGH_HITS = 6  # to tell one disc from two
SAME_COURSE = 0.4  # velocities of two pieces of one thing differ by no more [m/s]


@called
def claim_beams(memory: Memory, scan: Scan) -> None:
    """Give hits at the predicted outline of a mover to it: near a wall its points can't be told by their ranges."""
    state, numbers, owner = memory.state, memory.numbers, scan.owner
    for m in range(TRACKS):
        if numbers[m, ID] == 0 or numbers[m, IS_MOVING] == 0:
            continue
        s = state[m]
        slack = min(CLAIM + 1.5 * math.sqrt(max(s[PXX], s[PYY])), MOST_CLAIM)
        reach = s[RADIUS] + slack
        for i in range(len(owner)):
            if not scan.is_hit[i]:
                continue
            dx, dy = scan.place_x[i] - s[X], scan.place_y[i] - s[Y]
            square = dx * dx + dy * dy
            if square > reach * reach:
                continue
            if owner[i] >= 0:
                other = state[owner[i]]
                if abs(math.hypot(scan.place_x[i] - other[X], scan.place_y[i] - other[Y]) - other[RADIUS]) <= abs(
                    math.sqrt(square) - s[RADIUS]
                ):
                    continue
            owner[i] = m


@called
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


@called
def join_claims(
    memory: Memory, hits: Hits, begins: Integers, clusters: int, owner: Integers, counts: Integers, fit: Floats
) -> None:
    """Give a cluster that is mostly one mover's to it as a whole, where it is one disc.

    A mover that was seen in part at first grows so; another one that goes along is a piece of it.
    """
    for c in range(clusters):
        begin, end = begins[c], begins[c + 1]
        if end - begin < ENOUGH_HITS or extent_of(hits, begin, end) > WALL_EXTENT:
            continue
        main = main_owner(hits.members, begin, end, owner, counts)
        if main >= 0 and is_disc_of(memory.state[main], hits, begin, end, fit):
            take_over(memory, hits.members, begin, end, main, fit[FR], owner)


@inlined
def main_owner(members: Integers, begin: int, end: int, owner: Integers, counts: Integers) -> int:
    """The mover that most of a cluster's hits belong to, where that is half of them and not all; else -1."""
    counts[:TRACKS] = 0
    main = -1
    for k in range(begin, end):
        m = owner[members[k]]
        if m >= 0:
            counts[m] += 1
            if main < 0 or counts[m] > counts[main] or (counts[m] == counts[main] and m < main):
                main = m
    if main < 0 or 2 * counts[main] < end - begin or counts[main] == end - begin:
        return -1
    return main


@inlined
def is_disc_of(s: Floats, hits: Hits, begin: int, end: int, fit: Floats) -> bool:
    """Whether a cluster is one disc, and not larger than a track may be; `fit` gets the disc."""
    x, y, members = hits.x, hits.y, hits.members
    radius, spread = s[RADIUS], math.sqrt(s[RADIUS_VARIANCE])
    fit_disc(hits, begin, end, radius, spread, NEW_SHAPE**2, False, fit)
    is_disc = fit[FR] <= radius + 2.0 * spread
    for k in range(begin, end):
        gap = math.hypot(x[members[k]] - fit[FX], y[members[k]] - fit[FY]) - fit[FR]
        is_disc = is_disc and abs(gap) <= OUT_OF_ROUND
    return bool(is_disc)


@inlined
def take_over(
    memory: Memory, members: Integers, begin: int, end: int, main: int, radius: float, owner: Integers
) -> None:
    """Give a cluster's hits to the track `main`, and end those that are pieces of it."""
    state, numbers = memory.state, memory.numbers
    for k in range(begin, end):
        m = owner[members[k]]
        if m >= 0 and m != main:
            if math.hypot(state[m, VX] - state[main, VX], state[m, VY] - state[main, VY]) > SAME_COURSE:
                continue
            if math.hypot(state[m, X] - state[main, X], state[m, Y] - state[main, Y]) > radius:
                continue
            numbers[m, ID] = 0
        owner[members[k]] = main


@inlined
def nearest_track(memory: Memory, fit: Floats, pose: Floats) -> tuple[float, int]:
    """Squared Mahalanobis distance and place of the free track nearest to a disc; GATE and -1 where none is within it."""
    best, best_track = GATE, -1
    x, y = fit[FX] + pose[POSE_X], fit[FY] + pose[POSE_Y]
    for m in range(TRACKS):
        if memory.numbers[m, ID] == 0 or memory.numbers[m, CLUSTER] >= 0:
            continue
        s = memory.state[m]
        dx, dy = x - s[X], y - s[Y]
        if dx * dx + dy * dy > NEAR_GATE * NEAR_GATE:
            continue
        square = mahalanobis(dx, dy, s[PXX] + fit[MXX], s[PXY] + fit[MXY], s[PYY] + fit[MYY])
        if square < best:
            best, best_track = square, m
    return best, best_track


@called
def associate(memory: Memory, clusters: Clusters, count: int, pose: Floats) -> None:
    """Give each of `count` clusters at most one track, the pairs of least Mahalanobis distance first."""
    is_thing, chosen, nearest, squares = clusters.is_thing, clusters.chosen, clusters.nearest, clusters.squares
    for c in range(count):
        chosen[c] = -1
        if is_thing[c]:
            squares[c], nearest[c] = nearest_track(memory, clusters.fits[c], pose)
    while True:
        best, best_cluster = GATE, -1
        for c in range(count):
            if is_thing[c] and chosen[c] < 0 and squares[c] < best:
                best, best_cluster = squares[c], c
        if best_cluster < 0:
            return
        track = nearest[best_cluster]
        chosen[best_cluster] = track
        memory.numbers[track, CLUSTER] = best_cluster
        for c in range(count):  # whose nearest track is taken looks for another
            if is_thing[c] and chosen[c] < 0 and squares[c] < GATE and nearest[c] == track:
                squares[c], nearest[c] = nearest_track(memory, clusters.fits[c], pose)
