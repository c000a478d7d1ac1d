"""What is left of a predictor's training: a folder that can be read whatever becomes of it, and the command that makes it."""

from __future__ import annotations

import shlex
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

import torch

from bug_gym.agents.learning.folder import TRAINED_FOLDER
from bug_gym.agents.prediction import training
from bug_gym.agents.prediction.features import ANSWERS, WIDTH
from bug_gym.agents.prediction.learned import CONFIG, read_config
from bug_gym.agents.prediction.samples import Samples
from bug_gym.agents.prediction.settings import THREADS, PredictorSettings
from bug_gym.agents.prediction.training import TRAININGS, main, train

SMALL = PredictorSettings("supervised", worlds=1, validation_worlds=1, test_worlds=1, epochs=2)


def drifting(count: int, seed: int) -> Samples:
    """Movers that all come to go 0.3 m/s faster than they do."""
    features = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, WIDTH)).astype(np.float32)
    return Samples(features, np.tile(np.array([0.2, 0.0], dtype=np.float32), (count, ANSWERS // 2)))


@pytest.fixture(autouse=True)
def _threads() -> None:
    torch.set_num_threads(THREADS)


@pytest.fixture
def gathered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples that need no driving."""
    monkeypatch.setattr(training, "gather_for", lambda *_, **__: (drifting(500, 0), drifting(100, 1)))
    monkeypatch.setattr(training, "gather_held_out", lambda *_, **__: {})


@pytest.mark.parametrize("kind", sorted(TRAININGS))
def test_a_training_that_diverges_says_so_in_a_line_and_writes_no_predictor(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    far = drifting(200, 0)
    far.features[:] *= np.inf  # beyond all numbers, as what a network that has diverged makes of them
    monkeypatch.setattr(training, "gather_for", lambda *_, **__: (far, drifting(100, 1)))
    monkeypatch.setattr(training, "gather_held_out", lambda *_, **__: {})
    with pytest.raises(SystemExit) as left:
        main([kind, "--out", str(tmp_path / "own"), "--rate", "1e9", "--epochs", "1"])
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{kind} (seed 0) has diverged" in line and "rate is 1000000000.0, try a smaller one" in line
    assert not (tmp_path / "own" / CONFIG).exists()


def test_a_model_is_there_before_it_is_trained_with_other_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = TRAININGS["supervised"]

    def stopped(settings: PredictorSettings, *samples: Samples) -> Any:
        if settings.seed == 1:
            raise KeyboardInterrupt
        return own(settings, *samples)

    monkeypatch.setitem(TRAININGS, "supervised", stopped)
    with pytest.raises(KeyboardInterrupt):
        train(SMALL, tmp_path, drifting(500, 0), drifting(100, 1), repeats=[1])
    assert read_config(tmp_path)["repeats"] == {}


def command_of(card: str) -> list[str]:
    """The words behind the name of the module in the command that a card tells."""
    (line,) = [line for line in card.splitlines() if line.startswith("- Made again by `")]
    words = shlex.split(line.split("`")[1])
    assert words[:3] == ["python", "-m", "bug_gym.agents.prediction.training"]
    return words[3:]


@pytest.mark.parametrize(
    "own",
    [
        [],
        ["--rate", "0.002", "--epochs", "2", "--seed", "3", "--worlds", "2", "--validation-worlds", "3"],
        ["--test-worlds", "4", "--seeds", "2", "--epochs", "1", "--threads", "1"],
        ["--start-from", str(TRAINED_FOLDER / "rl_predictor"), "--epochs", "1"],
    ],
)
def test_the_command_on_a_card_has_all_that_the_training_had(own: list[str], tmp_path: Path, gathered: None) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    main(["supervised", "--out", str(first), *own])
    words = command_of((first / "card.md").read_text(encoding="utf-8"))
    main([str(again) if word == "FOLDER" else word for word in words])
    one, other = read_config(first), read_config(again)
    for key in ("settings", "sha256"):
        assert one[key] == other[key]
    assert one["repeats"].keys() == other["repeats"].keys()
    assert one["machine"]["threads"] == other["machine"]["threads"]


def test_a_card_tells_no_command_where_none_says_all(tmp_path: Path) -> None:
    settings = replace(SMALL, hidden=(16,), batch=100)
    assert asdict(settings)["batch"] != PredictorSettings.batch
    train(settings, tmp_path, drifting(500, 0), drifting(100, 1))
    card = (tmp_path / "card.md").read_text(encoding="utf-8")
    assert "Made again by" not in card and f"with the settings in {CONFIG}" in card


@pytest.mark.parametrize("name", ["rl_predictor", "supervised_predictor"])
def test_shipped_cards_tell_the_command_that_made_them(name: str) -> None:
    kind, *words = command_of((TRAINED_FOLDER / name / "card.md").read_text(encoding="utf-8"))
    settings = read_config(TRAINED_FOLDER / name)["settings"]
    assert settings == {**asdict(PredictorSettings("ppo")), "kind": kind, "hidden": [256, 256]}
    assert words == ["--seeds", "3", "--out", "FOLDER"]
