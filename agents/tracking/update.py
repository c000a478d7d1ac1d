"""The compiled step of a tracker: a scan comes in, clusters are cut, discs fitted and associated, tracks filtered.

One call works on one robot's memory. Places are in the odometry frame [m].
"""

from __future__ import annotations

import math

from bug_gym.agents.tracking.association import WALL_EXTENT, associate, claim_beams, gather_claimed, join_claims
from bug_gym.agents.tracking.clusters import cut_clusters, edges_of, extent_of, split_clusters
from bug_gym.agents.tracking.discs import NEW_RADIUS, NEW_RADIUS_SPREAD, NEW_SHAPE, fit_disc
from bug_gym.agents.tracking.evidence import keep_scan, weigh_evidence
from bug_gym.agents.tracking.filter import GATE, departure, measure, predict_tracks, refit
from bug_gym.agents.tracking.layout import (
    BEARINGS,
    BEGINS,
    CHOSEN,
    CLUSTER,
    COUNTS,
    DISC,
    FR,
    FR_VARIANCE,
    FX,
    FY,
    HEADING,
    HIDDEN_ENDS,
    HIT_FLAGS,
    HIT_X,
    HIT_Y,
    HITS,
    ID,
    IN_RUN,
    IS_CONFIRMED,
    IS_FULL_CIRCLE,
    IS_MOVING,
    LAST_ID,
    MEMBERS,
    NEAREST,
    NOW,
    OWN_ENDS,
    PASSED,
    PLACE_X,
    PLACE_Y,
    POSE_X,
    POSE_Y,
    RADIUS,
    RANGE,
    SHAPE,
    SHAPE_VARIANCE,
    SQUARES,
    THING_FLAGS,
    TOWARD,
    TRACKS,
    VY,
    WHOLE,
    Clusters,
    Hits,
    Memory,
    Scan,
    X,
    Y,
)
from bug_gym.agents.tracking.lifetime import begin_track, close_update, worst_track
from bug_gym.agents.tracking.motion import Weighing
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Flags, Floats, Integers

LOST = 0.35  # what is farther than this from a mover's course, and far out of the gate, is another thing [m]


@kernel
def update_tracks(
    ranges: Floats,
    angles: Floats,
    pose: Floats,
    settings: Floats,
    owner: Integers,
    memory: Memory,
    floats: Floats,
    fits: Floats,
    integers: Integers,
    flags: Flags,
    weighing: Weighing,
    movers: Floats,
) -> int:
    """One update of a memory; how many things are there and move.

    Args:
        ranges: the scan (B,) [m].
        angles: bearings of the beams from the heading (B,) [rad].
        pose: where the robot is, and when (POSE,).
        settings: constants of the scanner (SETTINGS,).
        owner: where to write the place of the track that each hit belongs to, -1 none (B,).
        memory: the tracks, and past scans.
        floats, fits, integers, flags: working memory (FLOAT_ROWS, B), (B + 1, FIT), (INTEGER_ROWS, 2 B + TRACKS),
            (FLAG_ROWS, B).
        weighing: the robot's velocity, and what weighs what this update tells of each track's motion.
        movers: room for what moves, odometry frame (TRACKS, MOVER).
    """
    members, counts, nearest = integers[MEMBERS], integers[COUNTS], integers[NEAREST]
    hits = Hits(floats[HIT_X], floats[HIT_Y], floats[BEARINGS], ranges, members, settings)
    scan = Scan(ranges, floats[PLACE_X], floats[PLACE_Y], flags[HIT_FLAGS], owner, pose, settings)
    clusters = Clusters(integers[BEGINS], flags[THING_FLAGS], fits, integers[CHOSEN], nearest, floats[SQUARES])
    place_hits(hits, scan, angles)
    predict_tracks(memory, pose[PASSED])
    begin_update(memory, owner)
    count = cut_clusters(scan, members, clusters.begins)
    claim_beams(memory, scan)
    join_claims(memory, hits, clusters.begins, count, owner, counts, fits[0])
    follow_movers(memory, scan, hits, fits[0])
    count = split_clusters(hits, clusters.begins, cut_clusters(scan, members, clusters.begins))
    fit_things(hits, clusters, count)
    associate(memory, clusters, count, pose)
    take_things(memory, scan, hits, clusters, count)
    weigh_evidence(memory, scan, nearest, floats[TOWARD], floats[IN_RUN], weighing)
    close_update(memory, scan)
    keep_scan(memory, scan)
    return tell_movers(memory, movers)


@inlined
def tell_movers(memory: Memory, movers: Floats) -> int:
    """Write what is there and moves; returns how many these are."""
    count = 0
    for m in range(TRACKS):
        n = memory.numbers[m]
        if n[IS_MOVING] != 0 and n[ID] > 0 and n[IS_CONFIRMED] > 0:
            for column in range(VY + 1):
                movers[count, column] = memory.state[m, column]
            movers[count, DISC] = memory.state[m, RADIUS]
            count += 1
    return count


@inlined
def place_hits(hits: Hits, scan: Scan, angles: Floats) -> None:
    """Write where the hits lie."""
    for i in range(len(scan.ranges)):
        bearing, distance = scan.pose[HEADING] + angles[i], scan.ranges[i]
        x, y = distance * math.cos(bearing), distance * math.sin(bearing)
        hits.bearings[i], hits.x[i], hits.y[i] = bearing, x, y
        scan.place_x[i], scan.place_y[i] = x + scan.pose[POSE_X], y + scan.pose[POSE_Y]
        scan.is_hit[i] = distance < scan.settings[RANGE]


@inlined
def begin_update(memory: Memory, owner: Integers) -> None:
    """No track has been seen yet, and no hit is anybody's."""
    for m in range(TRACKS):
        memory.numbers[m, CLUSTER] = -1
        memory.numbers[m, HITS] = (memory.numbers[m, HITS] << 1) & 31
    owner[:] = -1


@called
def follow_movers(memory: Memory, scan: Scan, hits: Hits, fit: Floats) -> None:
    """Measure each mover by the hits that it has claimed; those of what is no longer on its course are let go."""
    state, numbers, owner = memory.state, memory.numbers, scan.owner
    px, py, now = scan.pose[POSE_X], scan.pose[POSE_Y], scan.pose[NOW]
    for m in range(TRACKS):
        if numbers[m, ID] == 0 or numbers[m, IS_MOVING] == 0:
            continue
        count = gather_claimed(owner, m, scan.settings[IS_FULL_CIRCLE] > 0.0, hits.members)
        if count == 0:
            continue
        fit_disc(hits, 0, count, state[m, RADIUS], 1.0, NEW_SHAPE**2, True, fit)
        dx, dy = fit[FX] + px - state[m, X], fit[FY] + py - state[m, Y]
        if math.hypot(dx, dy) > LOST and departure(state[m], fit, px, py) > 3.0 * GATE:
            for k in range(count):
                owner[hits.members[k]] = -1
            continue
        numbers[m, CLUSTER] = 0
        refit(state[m], hits, 0, count, fit)
        note_shape(state[m], numbers[m], hits, 0, count, fit)
        measure(state[m], numbers[m], fit, memory.history[m], px, py, now)


@called
def fit_things(hits: Hits, clusters: Clusters, count: int) -> None:
    """Tell which clusters are things that may be tracked, and fit a disc to each of these."""
    is_thing, fits = clusters.is_thing, clusters.fits
    for c in range(count):
        begin, end = clusters.begins[c], clusters.begins[c + 1]
        left, right = edges_of(hits, begin, end)
        # What is cut off on both sides is a piece of something behind, and says nothing about its own ends.
        is_thing[c] = (left == 1 or right == 1) and extent_of(hits, begin, end) <= WALL_EXTENT
        if is_thing[c]:
            fit_disc(hits, begin, end, NEW_RADIUS, NEW_RADIUS_SPREAD, NEW_SHAPE**2, False, fits[c])
            # A disc about the scanner is a recess of the walls.
            is_thing[c] = math.hypot(fits[c, FX], fits[c, FY]) > fits[c, FR]


@called
def take_things(memory: Memory, scan: Scan, hits: Hits, clusters: Clusters, count: int) -> None:
    """Measure the tracks of the things that have one, and begin a track for each of the others."""
    state, numbers, history, fits = memory.state, memory.numbers, memory.history, clusters.fits
    px, py, now = scan.pose[POSE_X], scan.pose[POSE_Y], scan.pose[NOW]
    for c in range(count):
        if not clusters.is_thing[c]:
            continue
        begin, end, m = clusters.begins[c], clusters.begins[c + 1], clusters.chosen[c]
        if m >= 0:
            refit(state[m], hits, begin, end, fits[c])
            note_shape(state[m], numbers[m], hits, begin, end, fits[c])
            measure(state[m], numbers[m], fits[c], history[m], px, py, now)
        else:
            m = worst_track(memory, px, py, math.hypot(fits[c, FX], fits[c, FY]))
            if m < 0:
                continue
            memory.counters[LAST_ID] += 1
            spread = math.sqrt(fits[c, FR_VARIANCE])
            fit_disc(hits, begin, end, fits[c, FR], spread, fits[c, SHAPE], True, fits[c])
            begin_track(state[m], numbers[m], fits[c], history[m], px, py, now, memory.counters[LAST_ID])
        for k in range(begin, end):
            scan.owner[hits.members[k]] = m


@inlined
def note_shape(s: Floats, n: Integers, hits: Hits, begin: int, end: int, fit: Floats) -> None:
    """Keep what is seen of a track's outline: how it ends, and how far from a circle it is."""
    left, right = edges_of(hits, begin, end)
    n[OWN_ENDS] = (1 if left == 1 else 0) + (1 if right == 1 else 0)
    n[HIDDEN_ENDS] = (1 if left == 0 else 0) + (1 if right == 0 else 0)
    n[WHOLE] = n[WHOLE] + 1 if n[OWN_ENDS] == 2 else 0
    s[SHAPE_VARIANCE] = fit[SHAPE]
