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


NOTHING = np.uint32(0xFFFFFFFF)
"""No colour: stands where no frame has been yet."""


@kernel
def take_changes(
    frame: npt.NDArray[np.uint8],
    last: npt.NDArray[np.uint32],
    places: npt.NDArray[np.uint32],
    colors: npt.NDArray[np.uint32],
    counts: npt.NDArray[np.int32],
) -> int:
    """Write down where a frame (H, W, 3) differs from the last one (H W,), which becomes it.

    Args:
        frame: the frame.
        last: pixels as 0x00RRGGBB, or NOTHING.
        places: (H W,) numbers of the pixels that differ.
        colors: (H W,) their new colours.
        counts: (2^24,) how often each colour has come; these are added.

    Returns:
        How many differ.
    """
    found, place = 0, 0
    for line in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            red, green, blue = frame[line, column, 0], frame[line, column, 1], frame[line, column, 2]
            color = np.uint32(red) << np.uint32(16) | np.uint32(green) << np.uint32(8) | np.uint32(blue)
            if color != last[place]:
                last[place] = color
                places[found], colors[found] = place, color
                counts[color] += 1
                found += 1
            place += 1
    return found


@kernel
def find_nearest(colors: npt.NDArray[np.int64], palette: npt.NDArray[np.int64], nearest: npt.NDArray[np.uint8]) -> None:
    """Write for each of some colours 0xRRGGBB (n,) the number of the colour of a palette (k, 3) that comes nearest to it.

    Args:
        colors: the colours.
        palette: red, green, blue.
        nearest: (2^24,) numbers by colour.
    """
    for number in range(colors.shape[0]):
        color = colors[number]
        least, best = 1 << 30, 0
        for one in range(palette.shape[0]):
            red, green, blue = palette[one, 0], palette[one, 1], palette[one, 2]
            gap = (red - (color >> 16)) ** 2 + (green - (color >> 8 & 255)) ** 2 + (blue - (color & 255)) ** 2
            if gap < least:
                least, best = gap, one
        nearest[color] = best


@kernel
def apply_changes(
    places: npt.NDArray[np.uint32],
    colors: npt.NDArray[np.uint32],
    nearest: npt.NDArray[np.uint8],
    last: npt.NDArray[np.uint8],
    shown: npt.NDArray[np.uint8],
    box: npt.NDArray[np.int64],
) -> None:
    """Write the next frame in the numbers of a palette, where it is not like the last one.

    Args:
        places: numbers of the pixels that differ (n,).
        colors: their new colours (n,).
        nearest: (2^24,) numbers of the palette by colour.
        last: (H, W) the last frame in numbers, which becomes the next one.
        shown: (H, W), a number that is no colour all over; what differs is written into it.
        box: first and last line, first and last column of what differs; the last ones are -1 where nothing does.
    """
    width = last.shape[1]
    box[0], box[1], box[2], box[3] = last.shape[0], -1, width, -1
    for number in range(places.shape[0]):
        line, column = np.int64(places[number]) // width, np.int64(places[number]) % width
        color = nearest[colors[number]]
        if color != last[line, column]:
            last[line, column] = color
            shown[line, column] = color
            box[0], box[1] = min(box[0], line), max(box[1], line)
            box[2], box[3] = min(box[2], column), max(box[3], column)
