"""Compiled work on whole pictures, which pygame's own calls take several times as long for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bug_gym.compiling import kernel

Packed = npt.NDArray[np.uint32]
"""Pixels (H, W) as 0x00RRGGBB."""


@kernel
def halve(large: Packed, small: Packed) -> None:
    """Average each 2 x 2 pixels of `large` (2H, 2W) into one of `small` (H, W), to the nearest whole number."""
    for line in range(small.shape[0]):
        above, below = large[2 * line], large[2 * line + 1]
        for column in range(small.shape[1]):
            a, b, c, d = above[2 * column], above[2 * column + 1], below[2 * column], below[2 * column + 1]
            # Red and blue at once: a sum of four needs two bits more, and eight lie between them.
            both = (a & 0xFF00FF) + (b & 0xFF00FF) + (c & 0xFF00FF) + (d & 0xFF00FF)
            green = ((a >> 8) & 0xFF) + ((b >> 8) & 0xFF) + ((c >> 8) & 0xFF) + ((d >> 8) & 0xFF)
            small[line, column] = (((both + 0x20002) >> 2) & 0xFF00FF) | (((green + 2) >> 2) << 8)


@kernel
def unpack(packed: Packed, rgb: npt.NDArray[np.uint8]) -> None:
    """Write pixels (H, W) as bytes (H, W, 3)."""
    for line in range(packed.shape[0]):
        for column in range(packed.shape[1]):
            pixel = packed[line, column]
            rgb[line, column, 0] = pixel >> 16
            rgb[line, column, 1] = pixel >> 8
            rgb[line, column, 2] = pixel
