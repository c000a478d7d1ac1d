"""Frames put together, and what is in the files that they are written to."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, grid, save_gif, save_mp4, save_png, together
from bug_gym.drawing.lzw import CLEAR, END, FULL, compress, room_for
from bug_gym.simulation import Simulation


@pytest.fixture(scope="module")
def clip() -> list[Frame]:
    """Seven frames that all differ."""
    simulation = Simulation("two_boxes")
    simulation.reset(seeds=[0])
    canvas = Canvas(simulation, size=200)
    frames = []
    for _ in range(7):
        frames.append(canvas.draw())
        simulation.step([[[0.0, -1.0]]])
    return frames


def test_a_png_holds_the_frame(clip: list[Frame], tmp_path: Path) -> None:
    from PIL import Image

    save_png(tmp_path / "frame.png", clip[0])
    with Image.open(tmp_path / "frame.png") as image:
        np.testing.assert_array_equal(np.asarray(image), clip[0])


def test_a_gif_has_all_frames_and_runs_at_the_rate(clip: list[Frame], tmp_path: Path) -> None:
    from PIL import Image

    save_gif(tmp_path / "clip.gif", clip, fps=10.0)
    with Image.open(tmp_path / "clip.gif") as image:
        assert getattr(image, "n_frames", 1) == len(clip)
        assert image.info["duration"] == 100
        assert image.info["loop"] == 0
        for number, frame in enumerate(clip):
            image.seek(number)
            same = (np.asarray(image.convert("RGB")) == frame).all(axis=2)
            assert same.mean() > 0.99


@pytest.mark.parametrize("odd", [0, 1])
def test_an_mp4_has_all_frames_and_runs_at_the_rate(clip: list[Frame], tmp_path: Path, odd: int) -> None:
    import imageio_ffmpeg

    path = tmp_path / "clip.mp4"
    save_mp4(path, [frame[odd:, odd:] for frame in clip], fps=10.0)
    height, width, _ = clip[0].shape
    reader = imageio_ffmpeg.read_frames(str(path))
    facts = next(reader)
    frames = [np.frombuffer(data, dtype=np.uint8).reshape(height, width, 3) for data in reader]
    assert facts["size"] == (width, height)
    assert facts["fps"] == 10.0
    assert len(frames) == len(clip)
    # The codec loses a little; a frame still looks most like its own original.
    for number, frame in enumerate(frames):
        errors = [np.abs(frame[: height - odd, : width - odd].astype(float) - own[odd:, odd:]).mean() for own in clip]
        assert int(np.argmin(errors)) == number


@pytest.mark.parametrize("save", [save_gif, save_mp4])
def test_a_clip_that_breaks_off_leaves_the_old_file(save: Any, clip: list[Frame], tmp_path: Path) -> None:
    def broken() -> Iterator[Frame]:
        yield from clip[:2]
        raise RuntimeError("the episode broke")

    path = tmp_path / f"clip.{save.__name__[-3:]}"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="broke"):
        save(path, broken(), 10.0)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    assert path.read_text() == "old"


FULL_DISK = """
import sys, resource
import numpy as np
from bug_gym.drawing.clips import save_gif, save_mp4
frames = np.random.default_rng(0).integers(0, 256, (12, 64, 64, 3), dtype=np.uint8)
{before}
resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
try:
    {save}(sys.argv[1], iter(frames), 10.0)
except OSError as error:
    print("refused:", error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of the size of files are POSIX")
@pytest.mark.parametrize("save", ["save_gif", "save_mp4"])
def test_a_film_that_the_disk_has_no_room_for_is_refused(save: str, tmp_path: Path) -> None:
    """ffmpeg is a process of its own, which may find it out after the last frame."""
    path = tmp_path / f"clip.{save[-3:]}"
    path.write_text("old")
    code = FULL_DISK.format(save=save, before="import imageio_ffmpeg" if save == "save_mp4" else "")
    run = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True, timeout=120
    )
    (line,) = run.stdout.splitlines()
    assert line.startswith("refused: ") and str(path) in line and run.stderr == ""
    assert [file.name for file in tmp_path.iterdir()] == [path.name] and path.read_text() == "old"


def test_a_gif_shows_a_frame_no_longer_than_its_format_can(clip: list[Frame], tmp_path: Path) -> None:
    """As of a world whose step is 1,000 s."""
    save_gif(tmp_path / "slow.gif", clip[:2], 1e-9)
    with pytest.importorskip("PIL.Image").open(tmp_path / "slow.gif") as image:
        assert image.info["duration"] == 655_350


@pytest.mark.parametrize("save", [save_gif, save_mp4])
@pytest.mark.parametrize(
    ("lengths", "fps", "message"),
    [([], 10.0, "at least one frame"), ([10, 12], 10.0, "frame 1 has shape"), ([10], 0.0, "fps must be positive")],
)
def test_a_clip_that_cannot_be_is_refused(
    save: Any, lengths: list[int], fps: float, message: str, tmp_path: Path
) -> None:
    frames = [np.zeros((length, 16, 3), dtype=np.uint8) for length in lengths]
    with pytest.raises(ValueError, match=message):
        save(tmp_path / f"clip.{save.__name__[-3:]}", frames, fps)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("step", [0.05, 0.1])
def test_recorded_video_runs_in_real_time(step: float, tmp_path: Path) -> None:
    import gymnasium as gym
    import imageio_ffmpeg

    env = gym.make("BugGym/Navigation-v0", scenario="empty", overrides={"time.step": step}, render_mode="rgb_array")
    recorded = gym.wrappers.RecordVideo(env, str(tmp_path / "video"), disable_logger=True)
    recorded.reset(seed=0)
    steps = 12
    for _ in range(steps):
        recorded.step(np.zeros(2, dtype=np.float32))
    recorded.close()  # type: ignore[no-untyped-call]  # gymnasium leaves it without types
    (path,) = tmp_path.glob("video/*.mp4")
    facts = next(imageio_ffmpeg.read_frames(str(path)))
    assert facts["fps"] == pytest.approx(1.0 / step)
    assert facts["duration"] == pytest.approx((steps + 1) * step, abs=1.5 * step)


def plain(color: int, height: int = 4, width: int = 6) -> Frame:
    return np.full((height, width, 3), color, dtype=np.uint8)


def test_frames_of_a_grid_keep_their_pixels_row_by_row() -> None:
    sheet = grid([plain(1), plain(2), plain(3)], columns=2)
    assert sheet.shape == (8, 12, 3)
    for color, top, left in ((1, 0, 0), (2, 0, 6), (3, 4, 0), (255, 4, 6)):
        assert (sheet[top : top + 4, left : left + 6] == color).all()


def test_frames_that_fit_into_one_row_leave_no_gap() -> None:
    assert grid([plain(1), plain(2)], columns=5).shape == (4, 12, 3)


def test_films_run_together_until_the_last_has_ended() -> None:
    short, long = [plain(1), plain(2)], [plain(11), plain(12), plain(13), plain(14)]
    shown = [(int(sheet[0, 0, 0]), int(sheet[0, -1, 0])) for sheet in together([iter(short), iter(long)])]
    assert shown == [(1, 11), (2, 12), (2, 13), (2, 14)]


# ---------------------------------------------------------------------------------------------- GIF


def unpacked_runs(data: bytes) -> list[int]:
    """The pixels of GIF's compressed bytes, by the book: runs as lists, bits one by one."""
    bits = [byte >> number & 1 for byte in data for number in range(8)]
    pixels: list[int] = []
    runs: list[list[int]] = []
    size, at, before = 9, 0, None
    while True:
        code = sum(bit << number for number, bit in enumerate(bits[at : at + size]))
        at += size
        if code == END:
            assert 0 <= len(bits) - at < 8  # all of the last code is there, and nothing after it
            return pixels
        if code == CLEAR:
            runs, size, before = [[number] for number in range(CLEAR)] + [[], []], 9, None
            continue
        run = runs[code] if code < len(runs) else [*(before or []), (before or [])[0]]
        if before is not None and len(runs) < FULL:
            runs.append([*before, run[0]])
        if len(runs) == 1 << size and size < 12:
            size += 1
        pixels += run
        before = run


@pytest.mark.parametrize("colors", [1, 2, 3, 256])
@pytest.mark.parametrize("count", [1, 2, *range(250, 260), 5000, 40_000])
def test_compressed_pixels_are_read_back_by_the_book(colors: int, count: int) -> None:
    """Noise of 256 colours fills the table of runs several times over."""
    random = np.random.default_rng(count)
    table, stamp = np.zeros((256, FULL), dtype=np.int64), 0
    for _ in range(2):  # the table is used again, without being emptied
        pixels = random.integers(colors, size=count).astype(np.uint8)
        out = np.zeros(room_for(count), dtype=np.uint8)
        size, stamp = compress(pixels, table, stamp + 1, out)
        assert unpacked_runs(out[:size].tobytes()) == pixels.tolist()


def test_a_gif_of_few_colours_holds_every_frame_to_the_bit_and_one_in_which_nothing_happens(tmp_path: Path) -> None:
    from PIL import Image

    random = np.random.default_rng(3)
    frames = [random.integers(2, size=(40, 30, 3)).astype(np.uint8) * 255 for _ in range(3)]
    frames[2] = frames[1].copy()
    frames.append(frames[2].copy())
    frames[3][11:14, 5:9] = 0
    save_gif(tmp_path / "clip.gif", frames, fps=20.0)
    with Image.open(tmp_path / "clip.gif") as image:
        assert getattr(image, "n_frames", 1) == 4 and image.info["duration"] == 50
        for number, frame in enumerate(frames):
            image.seek(number)
            np.testing.assert_array_equal(np.asarray(image.convert("RGB")), frame)


def test_only_what_has_changed_is_written(tmp_path: Path) -> None:
    still = np.random.default_rng(3).integers(200, size=(60, 60, 3)).astype(np.uint8)
    moved = still.copy()
    moved[50:52, 50:52] = 255
    sizes = []
    for name, frames in (("one", [still]), ("many", [still, *[moved, still] * 50])):
        save_gif(tmp_path / f"{name}.gif", frames, fps=10.0)
        sizes.append((tmp_path / f"{name}.gif").stat().st_size)
    assert sizes[1] - sizes[0] < 100 * 40


def test_a_palette_is_of_the_colours_that_are_painted_most_and_the_rest_goes_to_the_nearest(tmp_path: Path) -> None:
    from PIL import Image

    frame = np.zeros((30, 30, 3), dtype=np.uint8)
    frame[:20, :, 0] = np.arange(600).reshape(20, 30) % 254 + 1  # 254 reds, each twice at least, and black
    frame[29, 29] = (100, 1, 0)
    save_gif(tmp_path / "clip.gif", [frame], fps=10.0)
    shown = np.asarray(Image.open(tmp_path / "clip.gif").convert("RGB"))
    assert shown[29, 29].tolist() == [100, 0, 0]
    np.testing.assert_array_equal(shown[:29], frame[:29])
