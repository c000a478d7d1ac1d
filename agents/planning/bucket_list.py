"""The open list of A*: what is far from its turn waits unsorted in buckets, and only the nearest bucket is a heap.

Source: the calendar of Dial (1969), "Algorithm 360: shortest-path forest with topological ordering", with buckets that
are wider than one key and sorted when their turn comes, as in Denardo and Fox (1979), "Shortest-route methods: 1.
reaching, pruning, and buckets".

Where the keys of what is put in lie a bounded step above the first one, buckets form a ring. The heap holds a handful of
entries instead of thousands, and the order is that of one heap over all. Keys are not changed: what has become better is
put in once more, and whoever takes out what is of no use any more knows it by its key.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bug_gym.agents.planning.grid import UNIT, Nodes
from bug_gym.agents.planning.open_list import is_before
from bug_gym.compiling import called, inlined, kernel
from bug_gym.kernels.layout import Integers

RING = 2048
"""Buckets; with the narrowest ones they reach over eight cells, twice what the keys of neighbours can differ by."""
NARROWEST = 22
"""Binary digits of a key that a bucket does not look at: 1/256 of a cell."""
NONE = -1
HELD, HEAPED, TURN, UNUSED, FREED = range(5)
"""Of `counts`: entries in the list; those of them in the heap; the bucket whose turn it is, counted from key 0; entries
that have never waited; the first of those that have and do not any more."""
ROUND = 8
"""Entries for which there must be room before a cell is expanded."""
LAST_NODE = 2**31 - 1


class BucketList(NamedTuple):
    """Room for n entries; an entry is two keys, of which the second one ends in the node."""

    heap: Integers
    """Entries (n, 2) up to the bucket whose turn it is, as a binary heap."""
    waiting: Integers
    """Entries (n, 2) of the others, in no order."""
    following: Nodes
    """Index of the entry (n,) that waits in the same bucket, or was freed, before each."""
    buckets: Nodes
    """Index of the entry (RING,) that came last into each bucket."""
    counts: Integers
    width: int
    """Binary digits of the first key that lie within a bucket."""


def bucket_list(weights: Integers | None = None, room: int = 4096) -> BucketList:
    """An empty list.

    Args:
        weights: what the ground of each cell costs (k,), None: the same everywhere. Dear ground needs wide buckets.
        room: entries; see `grown`.
    """
    most = 1 if weights is None else -(-int(weights.max()) // UNIT)
    return BucketList(
        np.empty((room, 2), dtype=np.int64),
        np.empty((room, 2), dtype=np.int64),
        np.empty(room, dtype=np.int32),
        np.full(RING, NONE, dtype=np.int32),
        np.array([0, 0, 0, 0, NONE], dtype=np.int64),
        NARROWEST + (most - 1).bit_length(),
    )


def grown(opened: BucketList) -> BucketList:
    """The same list with twice the room."""
    heap, waiting, following = (
        np.concatenate([part, np.empty_like(part)]) for part in (opened.heap, opened.waiting, opened.following)
    )
    return opened._replace(heap=heap, waiting=waiting, following=following)


@kernel
def has_room(opened: BucketList) -> bool:
    """Whether what is found from one more cell can be put in."""
    count: int = opened.counts[HELD]
    return count + ROUND <= len(opened.heap)


@inlined
def second_key(left: int, node: int) -> int:
    """Two keys as one: what is left, to 2^-16 of a cell, and the node; among equals the last one comes first.

    Sums a + b sqrt(2) that differ do so by more than that where no side has more than 20,000 cells; if one has, cells come
    among their equals in an order that is not quite that of what is left, and ways are no longer for it.
    """
    return (min(left >> 14, 2**31 - 1) << 32) | (LAST_NODE - node)


@inlined
def node_of(second: int) -> int:
    """The node in a second key."""
    return LAST_NODE - (second & (2**32 - 1))


@called
def put_in(opened: BucketList, first: int, second: int) -> None:
    """Put an entry in; its first key is at most half the ring above the first one of the list."""
    counts = opened.counts
    bucket = first >> opened.width
    if counts[HELD] == 0:
        counts[TURN] = bucket
    counts[HELD] += 1
    if bucket <= counts[TURN]:
        rise_in(opened.heap, counts[HEAPED], first, second)
        counts[HEAPED] += 1
        return
    index = counts[FREED]
    if index == NONE:
        index = counts[UNUSED]
        counts[UNUSED] += 1
    else:
        counts[FREED] = opened.following[index]
    opened.waiting[index, 0], opened.waiting[index, 1] = first, second
    at = bucket & (RING - 1)
    opened.following[index] = opened.buckets[at]
    opened.buckets[at] = index


@called
def come_round(opened: BucketList) -> bool:
    """Bring the first entry to the top of the heap; False where the list is empty."""
    counts = opened.counts
    if counts[HEAPED] > 0:
        return True
    if counts[HELD] == 0:
        return False
    turn = counts[TURN] + 1
    while opened.buckets[turn & (RING - 1)] == NONE:
        turn += 1
    counts[TURN] = turn
    index = np.int64(opened.buckets[turn & (RING - 1)])
    opened.buckets[turn & (RING - 1)] = NONE
    filled = 0
    while index != NONE:
        rise_in(opened.heap, filled, opened.waiting[index, 0], opened.waiting[index, 1])
        filled += 1
        after = np.int64(opened.following[index])
        opened.following[index] = counts[FREED]
        counts[FREED] = index
        index = after
    counts[HEAPED] = filled
    return True


@called
def drop_top(opened: BucketList) -> None:
    """Take out the first entry, which has come to the top."""
    counts = opened.counts
    last = counts[HEAPED] - 1
    counts[HEAPED] = last
    counts[HELD] -= 1
    if last > 0:
        sink_in(opened.heap, last, opened.heap[last, 0], opened.heap[last, 1])


@called
def rise_in(heap: Integers, index: int, first: int, second: int) -> None:
    """Write an entry where it belongs above a free place."""
    while index > 0:
        above = (index - 1) >> 1
        if not is_before(first, second, heap[above, 0], heap[above, 1]):
            break
        heap[index, 0], heap[index, 1] = heap[above, 0], heap[above, 1]
        index = above
    heap[index, 0], heap[index, 1] = first, second


@called
def sink_in(heap: Integers, count: int, first: int, second: int) -> None:
    """Write an entry where it belongs below the top, which is free."""
    index = 0
    while True:
        below = 2 * index + 1
        if below >= count:
            break
        beside = min(below + 1, count - 1)
        below += is_before(heap[beside, 0], heap[beside, 1], heap[below, 0], heap[below, 1])
        if not is_before(heap[below, 0], heap[below, 1], first, second):
            break
        heap[index, 0], heap[index, 1] = heap[below, 0], heap[below, 1]
        index = below
    heap[index, 0], heap[index, 1] = first, second
