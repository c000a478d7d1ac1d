"""Frames put together and written to files: PNG, GIF, MP4."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.checks import install_command
from bug_gym.files import replaced_when_done, writable

PNG, GIF, MP4 = ".png", ".gif", ".mp4"
"""What names of pictures and films end in."""

Frame = NDArray[np.uint8]
"""RGB pixels (H, W, 3)."""

COLUMNS = 5
"""Most frames beside one another in a grid."""


def grid(frames: Sequence[Frame], columns: int = COLUMNS) -> Frame:
    """Frames (h, w, 3) of one size in rows of `columns`, the rest white."""
    columns = min(columns, len(frames))
    rows = math.ceil(len(frames) / columns)
    height, width, _ = frames[0].shape
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for number, frame in enumerate(frames):
        row, column = divmod(number, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = frame
    return sheet


def together(films: Sequence[Iterator[Frame]]) -> Iterator[Frame]:
    """The films side by side until the last has ended; one that has ended stands still."""
    last = [next(one) for one in films]
    going = list(range(len(films)))
    yield grid(last)
    while going:
        for number in list(going):
            frame = next(films[number], None)
            if frame is None:
                going.remove(number)
            else:
                last[number] = frame
        if going:
            yield grid(last)


def save_png(path: str | Path, frame: Frame) -> None:
    """Write a frame as PNG.

    Raises:
        ValueError: a path that does not end in .png.
    """
    image = load_pillow().fromarray(frame)
    with replaced_when_done(writable(path, [PNG])) as partial:
        image.save(partial, format="PNG", optimize=True)


def save_gif(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as an endless GIF, in the 256 most frequent colours of its first, middle and last frame.

    Raises:
        ValueError: no frame, frames of different sizes, fps that is not positive, or a path that does not end in .gif.
    """
    pillow = load_pillow()
    writable(path, [GIF])
    # Frames wait compressed until the palette is known: a minute of film takes a gigabyte.
    clip = [(frame.shape, zlib.compress(frame.tobytes(), level=1)) for frame in same_size(frames, fps)]

    def frame_at(number: int) -> Frame:
        shape, pixels = clip[number]
        return np.frombuffer(zlib.decompress(pixels), dtype=np.uint8).reshape(shape)

    samples = np.stack([frame_at(0), frame_at(len(clip) // 2), frame_at(-1)])
    colors, counts = np.unique(packed(samples), return_counts=True)
    palette = unpacked(colors[np.argsort(-counts, kind="stable")[:256]])

    def images() -> Iterator[Any]:
        for number in range(len(clip)):
            image = pillow.fromarray(in_palette(frame_at(number), palette))
            image.putpalette(palette.astype(np.uint8).tobytes())
            yield image

    rest = images()
    with replaced_when_done(path) as partial:
        next(rest).save(partial, format="GIF", save_all=True, append_images=rest, duration=1000.0 / fps, loop=0)


def packed(frames: Frame) -> NDArray[np.int64]:
    """Colours (..., 3) as one number each."""
    return np.asarray(frames.astype(np.int64) @ np.array([65536, 256, 1]))


def unpacked(colors: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers (k,) as colours (k, 3)."""
    return np.stack([colors >> 16, colors >> 8 & 255, colors & 255], axis=1)


def in_palette(frame: Frame, palette: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Number (H, W) of the colour of a palette (k, 3) that comes nearest to each pixel.

    Pillow's own search puts neighbouring colours together: page and floor would become one.
    """
    colors, where = np.unique(packed(frame), return_inverse=True)
    gaps = np.square(unpacked(colors)[:, None] - palette[None]).sum(axis=2)
    nearest: NDArray[np.uint8] = gaps.argmin(axis=1).astype(np.uint8)
    return nearest[where].reshape(frame.shape[:2])


def save_mp4(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as H.264 in MP4; an odd side gets one more line of pixels.

    Raises:
        ValueError: no frame, frames of different sizes, fps that is not positive, or a path that does not end in .mp4.
    """
    try:
        import imageio_ffmpeg  # comes with moviepy
    except ImportError as error:
        raise ImportError(f"writing MP4 needs moviepy: {install_command('render')}") from error
    writable(path, [MP4])
    checked = same_size(frames, fps)
    first = even_sided(next(checked))
    with replaced_when_done(path) as partial:
        writer = imageio_ffmpeg.write_frames(
            str(partial), (first.shape[1], first.shape[0]), fps=fps, quality=8, macro_block_size=2
        )
        with closing(writer):  # which lets ffmpeg end before the file gets its name, or goes
            writer.send(None)
            for frame in chain([first], map(even_sided, checked)):
                writer.send(frame)


def even_sided(frame: Frame) -> Frame:
    """The frame, its last line and column doubled where their number is odd: video codecs take nothing else."""
    height, width, _ = frame.shape
    return np.ascontiguousarray(np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge"))


def same_size(frames: Iterable[Frame], fps: float) -> Iterator[Frame]:
    """The frames, checked on their way."""
    if not fps > 0.0:
        raise ValueError(f"fps must be positive, got {fps}")
    shape: tuple[int, ...] | None = None
    for number, frame in enumerate(frames):
        shape = shape or frame.shape
        if frame.shape != shape:
            raise ValueError(f"frame {number} has shape {frame.shape}, the first one {shape}")
        yield frame
    if shape is None:
        raise ValueError("a clip needs at least one frame")


def load_pillow() -> ModuleType:
    """Import pillow's Image.

    Raises:
        ImportError: it is not installed; the message names the extra.
    """
    try:
        from PIL import Image
    except ImportError as error:
        raise ImportError(f"writing pictures needs pillow: {install_command('render')}") from error
    return Image
