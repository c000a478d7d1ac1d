"""GIF (GIF89a): one palette for the whole film, and of each frame only what has changed."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.drawing import lzw, pixels

SAME = 255
"""The number of the palette that is no colour, but shows what was there before."""
COLORS = 1 << 24
"""Colours that a frame may have."""
LONGEST_DELAY = 0xFFFF
"""Longest time that the format can show a frame [s / 100], eleven minutes."""

Frame = NDArray[np.uint8]
"""RGB pixels (H, W, 3)."""


class Clip(NamedTuple):
    """Frames of one size, each as what has changed since the one before."""

    height: int
    width: int
    changes: list[bytes]
    """Of each frame: places and new colours of its pixels, compressed; a minute of whole frames would take a gigabyte."""
    counts: NDArray[np.int32]
    """How often each colour (2^24,) was painted."""


def taken(frames: Iterable[Frame]) -> Clip:
    """The frames, taken down as they come."""
    clip: Clip | None = None
    last = places = colors = np.zeros(0, dtype=np.uint32)
    for frame in frames:
        if clip is None:
            clip = Clip(frame.shape[0], frame.shape[1], [], np.zeros(COLORS, dtype=np.int32))
            last = np.full(clip.height * clip.width, pixels.NOTHING)
            places, colors = np.empty_like(last), np.empty_like(last)
        count = pixels.take_changes(np.ascontiguousarray(frame), last, places, colors, clip.counts)
        clip.changes.append(zlib.compress(np.stack([places[:count], colors[:count]]).tobytes(), level=1))
    if clip is None:
        raise ValueError("a clip needs at least one frame")
    return clip


def encoded(clip: Clip, fps: float) -> Iterator[bytes]:
    """The pieces of the file, which repeats without end."""
    palette = popular(clip.counts)
    nearest = np.zeros(COLORS, dtype=np.uint8)
    pixels.find_nearest(np.flatnonzero(clip.counts), palette, nearest)
    yield b"GIF89a" + struct.pack("<HHBBB", clip.width, clip.height, 0xF7, 0, 0)
    yield np.pad(palette, ((0, 256 - len(palette)), (0, 0))).astype(np.uint8).tobytes()
    yield b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
    delay = min(max(1, round(100.0 / fps)), LONGEST_DELAY)
    last = np.full((clip.height, clip.width), SAME, dtype=np.uint8)
    table, stamp, box = np.zeros((256, lzw.FULL), dtype=np.int64), 0, np.zeros(4, dtype=np.int64)
    for letters in clip.changes:
        places, colors = np.frombuffer(zlib.decompress(letters), dtype=np.uint32).reshape(2, -1)
        shown = np.full_like(last, SAME)
        pixels.apply_changes(places, colors, nearest, last, shown, box)
        top, bottom, left, right = box.tolist() if box[1] >= 0 else (0, 0, 0, 0)  # a frame has a pixel at least
        part = np.ascontiguousarray(shown[top : bottom + 1, left : right + 1])
        out = np.zeros(lzw.room_for(part.size), dtype=np.uint8)
        size, stamp = lzw.compress(part.ravel(), table, stamp + 1, out)
        yield b"\x21\xf9\x04" + struct.pack("<BHBB", 0x05, delay, SAME, 0)  # leaves what it does not paint
        yield b"\x2c" + struct.pack("<HHHHBB", left, top, part.shape[1], part.shape[0], 0, lzw.BITS)
        yield in_blocks(out[:size].tobytes())
    yield b"\x3b"


def popular(counts: NDArray[np.int32]) -> NDArray[np.int64]:
    """The colours (k, 3), 255 at most, that were painted most often."""
    colors = np.flatnonzero(counts)
    best = colors[np.argsort(-counts[colors], kind="stable")[:SAME]]
    return np.stack([best >> 16, best >> 8 & 255, best & 255], axis=1).astype(np.int64)


def in_blocks(data: bytes) -> bytes:
    """Bytes in blocks of 255 at most, each behind its length, and an empty one."""
    blocks = (data[first : first + 255] for first in range(0, len(data), 255))
    return b"".join(bytes([len(block)]) + block for block in blocks) + b"\x00"
