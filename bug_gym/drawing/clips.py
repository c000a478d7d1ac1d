"""Frames put together and written to files: PNG, GIF, MP4."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from itertools import chain
from pathlib import Path
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from types import ModuleType

import numpy as np

from bug_gym.checks import install_command
from bug_gym.drawing.gif import Frame as Frame  # for others
from bug_gym.drawing.gif import encoded, taken
from bug_gym.files import replaced_when_done, writable

PNG, GIF, MP4 = ".png", ".gif", ".mp4"
"""What names of pictures and films end in."""

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
    """Write frames as an endless GIF, in the 255 colours that are painted most often.

    Raises:
        ValueError: no frame, frames of different sizes, fps that is not positive, or a path that does not end in .gif.
    """
    writable(path, [GIF])
    clip = taken(same_size(frames, fps))
    with replaced_when_done(path) as partial, partial.open("wb") as file:
        file.writelines(encoded(clip, fps))


def save_mp4(path: str | Path, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as H.264 in MP4; an odd side gets one more line of pixels.

    Raises:
        ValueError: no frame, frames of different sizes, fps that is not positive, or a path that does not end in .mp4.
        OSError: ffmpeg cannot write it, as on a full disk.
    """
    try:
        import imageio_ffmpeg  # comes with moviepy
    except ImportError as error:
        raise ImportError(f"writing MP4 needs moviepy: {install_command('render')}") from error
    writable(path, [MP4])
    checked = same_size(frames, fps)
    first = even_sided(next(checked))
    height, width, _ = first.shape
    rate = Fraction(fps).limit_denominator()
    taken_in = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(rate), "-i", "-"]
    # veryfast: half the time, and a file that is a twentieth larger
    given_out = ["-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "10", "-preset", "veryfast"]
    with replaced_when_done(path) as partial:
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", *taken_in, *given_out, str(partial)]
        if said := _handed_to(command, chain([first], map(even_sided, checked))):
            raise OSError(f"{path} cannot be written: {said}")


def _handed_to(command: Sequence[str], frames: Iterable[Frame]) -> str:
    """Hand frames to a process and let it end; what it has said if it failed, else ""."""
    # In a session of its own: Ctrl-C is for us, who end it then. What it says goes to a file, which it never waits for.
    with (
        TemporaryFile() as told,
        Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=told, start_new_session=True) as process,
    ):
        assert process.stdin is not None
        try:
            for frame in frames:
                try:
                    process.stdin.write(frame.data)
                except BrokenPipeError:
                    break
            with suppress(BrokenPipeError):
                process.stdin.close()
            code = process.wait()
        except BaseException:
            process.kill()
            with suppress(BrokenPipeError):
                process.stdin.close()
            raise
        told.seek(0)
        lines = told.read().decode(errors="replace").splitlines()
    return (lines[-1] if lines else f"ffmpeg ended with exit code {code}") if code else ""


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
