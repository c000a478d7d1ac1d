"""Frames put together, and what is in the files that they are written to."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import Frame, grid, save_gif, save_mp4, save_png, together
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
