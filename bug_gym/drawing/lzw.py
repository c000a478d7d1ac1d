"""The compression of GIF (Lempel, Ziv and Welch; GIF89a, appendix F), compiled."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bug_gym.compiling import called, kernel

BITS = 8
"""Bits of a pixel."""
CLEAR, END = 1 << BITS, (1 << BITS) + 1
"""Codes that are no pixels: forget all runs, and the end."""
FULL = 4096
"""Codes there can be: 12 bits hold no more."""

Bytes = npt.NDArray[np.uint8]
Table = npt.NDArray[np.int64]


def room_for(pixels: int) -> int:
    """Bytes that so many pixels take at most: twelve bits each, a code to forget all runs for each table, and the rest."""
    return 2 * pixels + 64


@called
def _put(code: int, size: int, out: Bytes, bit: int) -> int:
    """Write a code of some bits, the lowest first, from a bit on; returns the bit after it."""
    first, rest = bit >> 3, code << (bit & 7)  # 12 bits and 7 before them lie in three bytes
    out[first] |= np.uint8(rest & 0xFF)
    out[first + 1] |= np.uint8(rest >> 8 & 0xFF)
    out[first + 2] |= np.uint8(rest >> 16)
    return bit + size


@kernel
def compress(pixels: Bytes, table: Table, stamp: int, out: Bytes) -> tuple[int, int]:
    """Write pixels (n,) as codes.

    Args:
        pixels: at least one.
        table: (256, FULL) what a next pixel makes of a run: the code of the longer run, and above it the stamp it was
            made under. What other stamps have left counts as nothing, so that forgetting costs nothing. Long runs of one
            pixel are neighbours in it.
        stamp: above all that the table has seen.
        out: zeros, `room_for` so many pixels.

    Returns:
        How many bytes were written, and the last stamp.
    """
    size, new = BITS + 1, END + 1
    bit = _put(CLEAR, size, out, 0)
    run = int(pixels[0])
    for number in range(1, pixels.shape[0]):
        pixel = int(pixels[number])
        known = int(table[pixel, run])
        if known >> 12 == stamp:
            run = known & 0xFFF
            continue
        bit = _put(run, size, out, bit)
        if new < FULL:
            table[pixel, run] = stamp << 12 | new
            if new == 1 << size:  # whoever reads this is one code behind
                size += 1
            new += 1
        else:
            bit = _put(CLEAR, size, out, bit)
            size, new = BITS + 1, END + 1
            stamp += 1
        run = pixel
    bit = _put(run, size, out, bit)
    if new == 1 << size and size < 12:
        size += 1
    bit = _put(END, size, out, bit)
    return (bit + 7) >> 3, stamp
