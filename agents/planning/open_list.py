"""The open list of all searches: nodes under two keys, the least first.

A binary heap (Williams 1964) that knows where each node is, so that keys can be changed and nodes taken out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.compiling import called, inlined
from bug_gym.kernels.layout import Integers


class OpenList(NamedTuple):
    """Room for n nodes."""

    entries: Integers
    """The heap (n, 3): first key, second key, node."""
    place: NDArray[np.int32]
    """Where each node (n,) is in the heap, counted from 1; 0: it is not in the list."""
    filled: Integers
    """How many are in it (1,)."""


def open_list(nodes: int) -> OpenList:
    """An empty list of nodes numbered from 0."""
    # Only what is used of the entries takes memory.
    return OpenList(np.empty((nodes, 3), dtype=np.int64), np.zeros(nodes, dtype=np.int32), np.zeros(1, dtype=np.int64))


@called
def put(heap: OpenList, first: int, second: int, node: int) -> None:
    """Put a node into the list, or give it other keys."""
    place = heap.place[node]
    if place == 0:
        heap.filled[0] += 1
        rise(heap, heap.filled[0] - 1, first, second, node)
        return
    index = place - 1
    if is_before(first, second, heap.entries[index, 0], heap.entries[index, 1]):
        rise(heap, index, first, second, node)
    else:
        sink(heap, index, first, second, node)


@called
def take(heap: OpenList, node: int) -> None:
    """Take a node out of the list, where it is in it."""
    index = heap.place[node] - 1
    if index < 0:
        return
    heap.place[node] = 0
    last = heap.filled[0] - 1
    heap.filled[0] = last
    if index == last:
        return
    first, second, moved = heap.entries[last, 0], heap.entries[last, 1], heap.entries[last, 2]
    above = (index - 1) >> 1
    if index > 0 and is_before(first, second, heap.entries[above, 0], heap.entries[above, 1]):
        rise(heap, index, first, second, moved)
    else:
        sink(heap, index, first, second, moved)


@called
def spend_first(heap: OpenList) -> int:
    """The first node, which counts as not in the list any more; its entry stays until put_next or drop_spent."""
    node: int = heap.entries[0, 2]
    heap.place[node] = 0
    heap.entries[0, 0] = -1  # nothing rises above it
    return node


@called
def put_next(heap: OpenList, first: int, second: int, node: int, is_spent: bool) -> bool:
    """Put a node into a list whose first entry may be spent.

    What is found from a node mostly comes next: in its entry it has a short way down, instead of all the way up from below
    after another entry had all the way down. Returns whether the first entry is spent still.
    """
    if is_spent and heap.place[node] == 0:
        sink(heap, 0, first, second, node)
        return False
    put(heap, first, second, node)
    return is_spent


@called
def drop_spent(heap: OpenList) -> None:
    """Take the first entry out of a list, which is spent."""
    last = heap.filled[0] - 1
    heap.filled[0] = last
    if last > 0:
        sink(heap, 0, heap.entries[last, 0], heap.entries[last, 1], heap.entries[last, 2])


@inlined
def is_before(first: int, second: int, other_first: int, other_second: int) -> bool:
    """Whether keys come before others; without a branch, which the processor would have to guess."""
    return (first < other_first) | ((first == other_first) & (second < other_second))


@called
def rise(heap: OpenList, index: int, first: int, second: int, node: int) -> None:
    """Write an entry where it belongs above a free place of the heap."""
    entries, place = heap.entries, heap.place
    while index > 0:
        above = (index - 1) >> 1
        if not is_before(first, second, entries[above, 0], entries[above, 1]):
            break
        entries[index, 0], entries[index, 1], entries[index, 2] = (
            entries[above, 0],
            entries[above, 1],
            entries[above, 2],
        )
        place[entries[index, 2]] = index + 1
        index = above
    entries[index, 0], entries[index, 1], entries[index, 2] = first, second, node
    place[node] = index + 1


@called
def sink(heap: OpenList, index: int, first: int, second: int, node: int) -> None:
    """Write an entry where it belongs below a free place of the heap."""
    entries, place, count = heap.entries, heap.place, heap.filled[0]
    while True:
        below = 2 * index + 1
        if below >= count:
            break
        beside = min(below + 1, count - 1)
        below += is_before(entries[beside, 0], entries[beside, 1], entries[below, 0], entries[below, 1])
        if not is_before(entries[below, 0], entries[below, 1], first, second):
            break
        entries[index, 0], entries[index, 1], entries[index, 2] = (
            entries[below, 0],
            entries[below, 1],
            entries[below, 2],
        )
        place[entries[index, 2]] = index + 1
        index = below
    entries[index, 0], entries[index, 1], entries[index, 2] = first, second, node
    place[node] = index + 1
