"""Seeds of trainings: none of them learns in the worlds that models are chosen by."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

from bug_gym.agents.learning.offline import train_offline
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.training import SEED_BLOCK, first_world, train, train_seeds
from bug_gym.cli import main
from bug_gym.held_out import TRAINING_SEEDS, VALIDATION_SEEDS

SAME = (VALIDATION_SEEDS - TRAINING_SEEDS) // SEED_BLOCK
"""The seed whose training worlds would begin with the first one of validations."""
LAST = (2**63 - TRAINING_SEEDS) // SEED_BLOCK - 1
"""The greatest seed whose worlds all have seeds."""


def quick(algo: str) -> Any:
    """A training of two updates."""
    own: dict[str, Any] = {"n_envs": 4, "n_steps": 8, "n_timesteps": 64} if algo == "ppo" else {"expert": "go_to_goal"}
    return load_settings({"algo": algo, "scenarios": ["dynamic"], "eval_episodes": 4, "test_episodes": 4, **own})


@pytest.mark.parametrize("seed", [0, 1, SAME - 1, SAME + 100, 20_261_130, LAST])
def test_no_training_learns_in_the_worlds_of_validations(seed: int) -> None:
    worlds = range(first_world(seed), first_world(seed) + SEED_BLOCK)
    chosen_by = range(VALIDATION_SEEDS, VALIDATION_SEEDS + 10_000_000)  # a training validates in no more
    assert worlds.start >= chosen_by.stop or worlds.stop <= chosen_by.start
    assert worlds.stop <= 2**63


@pytest.mark.parametrize(
    ("seed", "said"),
    [
        (SAME, f"seed {SAME}: the worlds of its training would be those of validations"),
        (SAME + 9, f"seed {SAME + 9}: the worlds of its training would be those of validations"),
        (LAST + 1, f"a training's seed is at most {LAST}, got {LAST + 1}"),
        (-1, "a seed is an integer from 0 to 2\\*\\*63 - 1, got -1"),
    ],
)
def test_a_seed_that_would_is_refused_before_anything_is_written(seed: int, said: str, tmp_path: Path) -> None:
    for algo, work in (("ppo", train), ("dagger", train_offline)):
        with pytest.raises(ValueError, match=said):
            work(quick(algo), tmp_path / "model", seed=seed)
    with pytest.raises(ValueError, match=said):
        train_seeds(quick("ppo"), tmp_path / "model", seeds=(0, seed))
    assert not (tmp_path / "model").exists()


def test_the_command_says_so_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "dagger_hd_bug", "--seed", str(SAME), "--out", str(tmp_path / "model")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "would be those of validations" in line and not (tmp_path / "model").exists()
