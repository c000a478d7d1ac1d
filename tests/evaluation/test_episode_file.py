"""Files of episodes hold what Minari's own writer would have put into them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from bug_gym.evaluation.episode_file import SMALL, EpisodeFile

minari = pytest.importorskip("minari", reason="minari comes with the extra `data`")
h5py = pytest.importorskip("h5py", reason="h5py comes with the extra `data`")
pytest.importorskip("PIL", reason="Pillow comes with the extra `data`")

from minari.data_collector import EpisodeBuffer  # noqa: E402  Minari is an extra
from minari.dataset.minari_storage import MinariStorage  # noqa: E402  likewise

SPACE = gym.spaces.Dict({"ranges": gym.spaces.Box(0, 1, (5,)), "goal": gym.spaces.Box(0, 1, (2,))})
ACTIONS = gym.spaces.Box(-1, 1, (2,))
LENGTHS = (1, 3, SMALL // 4, 3)
"""Steps of episodes: arrays in their headers and beside them, some of a shape that was there before."""


def episode(steps: int) -> dict[str, Any]:
    """An episode with all kinds of arrays that datasets have."""
    draw = np.random.default_rng(steps)
    looks = steps + 1
    return {
        "observations": {
            name: draw.random((looks, *(space.shape or ())), dtype=np.float32) for name, space in SPACE.spaces.items()
        },
        "actions": draw.random((looks, 4), dtype=np.float32)[1:, ::2],  # not one piece of memory
        "rewards": draw.random(steps),
        "terminations": draw.random(steps) < 0.5,
        "truncations": draw.random(steps) < 0.5,
        "infos": {
            "outcome": draw.integers(0, 5, looks, dtype=np.int8),
            "collision": draw.random(looks) < 0.5,
            "mode": draw.choice(np.array([b"towards_goal", b""], dtype="S32"), looks),
        },
    }


def write(path: Path) -> None:
    with EpisodeFile(path) as file:
        for number, steps in enumerate(LENGTHS):
            file.add({"seed": 7 + number, "total_steps": steps, "policy": f"bug{number} ∞"}, episode(steps))


def storage(folder: Path) -> Any:
    return MinariStorage.new(folder, SPACE, ACTIONS, data_format="hdf5")


def content(path: Path) -> list[tuple[Any, ...]]:
    """All that is in a file: places, types, shapes, values, and what is said of groups."""
    found: list[tuple[Any, ...]] = []

    def visit(name: str, item: Any) -> None:
        told = sorted((key, type(value), value) for key, value in item.attrs.items())
        array = (item.dtype, item.shape, item[()].tobytes()) if isinstance(item, h5py.Dataset) else ()
        found.append((name, told, *array))

    with h5py.File(path, "r") as file:
        found.append(tuple(file))
        file.visititems(visit)
    return found


def test_a_file_holds_what_minari_would_have_written(tmp_path: Path) -> None:
    write(tmp_path / "ours.hdf5")
    theirs = storage(tmp_path / "theirs")
    theirs.update_episodes(EpisodeBuffer(seed=7 + n, **episode(steps)) for n, steps in enumerate(LENGTHS))
    theirs.update_episode_metadata({"policy": f"bug{n} ∞"} for n in range(len(LENGTHS)))
    assert content(tmp_path / "ours.hdf5") == content(tmp_path / "theirs" / "main_data.hdf5")


def test_the_same_episodes_give_the_same_bytes_a_second_later(tmp_path: Path) -> None:
    write(tmp_path / "now")
    time.sleep(1.1)  # times in HDF5 are whole seconds
    write(tmp_path / "later")
    assert (tmp_path / "now").read_bytes() == (tmp_path / "later").read_bytes()


def test_minari_adds_its_own_episodes_to_a_file(tmp_path: Path) -> None:
    both = storage(tmp_path / "both")
    write(tmp_path / "both" / "main_data.hdf5")
    both.update_metadata({"total_episodes": len(LENGTHS), "total_steps": sum(LENGTHS)})
    both.update_episodes([EpisodeBuffer(seed=11, **episode(2))])
    assert both.total_episodes == len(LENGTHS) + 1
    (*_, last) = both.get_episodes(range(both.total_episodes))
    assert last["id"] == len(LENGTHS) and np.array_equal(last["actions"], episode(2)["actions"])


def test_a_file_that_was_there_is_gone(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"something")
    with EpisodeFile(tmp_path / "file"):
        pass
    assert content(tmp_path / "file") == [()]
