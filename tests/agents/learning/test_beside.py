"""What the file of a training names by its place lies beside it, and belongs to what its model is made of."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

from bug_gym.agents.learning.folder import CONFIG, TRAINED_FOLDER
from bug_gym.agents.learning.settings import DaggerSettings, FromData, load_settings
from bug_gym.agents.learning.sweep_settings import load_sweep
from bug_gym.agents.learning.training import require_same, train
from bug_gym.config import ScenarioError

SMALL: dict[str, Any] = {
    "algo": "ppo",
    "scenarios": ["dynamic"],
    "n_envs": 8,
    "batch_size": 32,
    "eval_episodes": 4,
    "test_episodes": 4,
    "n_timesteps": 64,
    "n_steps": 4,
}
EXPERT = """from bug_gym.agents.floors.go_to_goal import GoToGoal


class Mine(GoToGoal):
    pass
"""


def written(path: Path, data: dict[str, Any]) -> Path:
    """A YAML file with some data."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


@pytest.mark.parametrize("named", ["models/first/", "./models/first"])
def test_the_model_that_a_training_starts_from_lies_beside_its_file(
    named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = written(tmp_path / "trainings" / "mine.yaml", {**SMALL, "start_from": named})
    first = tmp_path / "trainings" / "models" / "first"
    shutil.copytree(TRAINED_FOLDER / "ppo_dynamic", first)
    monkeypatch.chdir(tmp_path)
    began = load_settings("trainings/mine.yaml").start_from
    assert began is not None and Path(began).resolve() == first
    monkeypatch.chdir(file.parent)
    began = load_settings("mine.yaml").start_from
    assert began is not None and "/" in began and Path(began).resolve() == first
    assert load_settings("mine.yaml", {"start_from": "./models/first"}).start_from == "./models/first"  # a caller's


def test_a_place_beside_the_file_is_no_name_of_a_shipped_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path / "mine.yaml", {**SMALL, "start_from": "./ppo_rush"})
    monkeypatch.chdir(tmp_path)
    assert load_settings("mine.yaml").start_from == "./ppo_rush"


@pytest.mark.parametrize("named", ["ppo_rush", "hf://user/first"])
def test_names_of_models_stay_names(named: str, tmp_path: Path) -> None:
    assert load_settings(written(tmp_path / "mine.yaml", {**SMALL, "start_from": named})).start_from == named


def test_a_model_in_nobodys_home_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="~nobody-of-this-name/first"):
        load_settings(written(tmp_path / "mine.yaml", {**SMALL, "start_from": "~nobody-of-this-name/first"}))


@pytest.mark.parametrize(
    ("named", "meant"),
    [
        ("bug2:turn=left", "bug2:turn=left"),
        ("mine.py:Mine", "{}/mine.py:Mine"),
        ("mine.py:Mine:clearance=0.3", "{}/mine.py:Mine:clearance=0.3"),
        ("mine:Mine", "mine:Mine"),
        ("models/first", "{}/models/first"),
        ("hd_bug:predictor=./mine/", 'hd_bug:predictor="{}/mine"'),
    ],
)
def test_policies_that_a_training_names_by_place_lie_beside_its_file(named: str, meant: str, tmp_path: Path) -> None:
    about = {"scenarios": ["dynamic"], "eval_episodes": 4, "test_episodes": 4}
    asks = written(tmp_path / "asks.yaml", {"algo": "dagger", "expert": named, **about})
    learns = written(tmp_path / "learns.yaml", {"algo": "bc", "data": {"policies": [named], "episodes": 4}, **about})
    asking, learning = load_settings(asks, trust=True), load_settings(learns, trust=True)
    assert isinstance(asking, DaggerSettings) and asking.expert == meant.format(tmp_path)
    assert isinstance(learning, FromData) and learning.data.policies == (meant.format(tmp_path),)


def test_models_that_a_sweep_chooses_from_lie_beside_its_file(tmp_path: Path) -> None:
    written(tmp_path / "base.yaml", SMALL)
    sweep = load_sweep(
        written(tmp_path / "sweep.yaml", {"training": "base.yaml", "space": {"start_from": ["./a", "ppo_dynamic"]}})
    )
    assert sweep.space["start_from"] == (f"{tmp_path}/a", "ppo_dynamic")


def test_another_model_at_the_place_that_is_begun_with_makes_another_training(tmp_path: Path) -> None:
    first = tmp_path / "first"
    shutil.copytree(TRAINED_FOLDER / "ppo_dynamic", first)
    asked = {**SMALL, "start_from": str(first)}
    train(load_settings(asked), tmp_path / "model", threads=1, tensorboard=False)
    require_same(tmp_path / "model", load_settings(asked), [0])
    shutil.copy(TRAINED_FOLDER / "ppo_static" / CONFIG, first / CONFIG)
    with pytest.raises(ValueError, match="is of another training: start_from has changed since"):
        require_same(tmp_path / "model", load_settings(asked), [0])


def test_another_text_of_the_expert_makes_another_training(tmp_path: Path) -> None:
    digests = []
    for number, text in enumerate((EXPERT, EXPERT, EXPERT + "\n# another one\n")):
        (tmp_path / f"place_{number}").mkdir()
        file = tmp_path / f"place_{number}" / "mine.py"
        file.write_text(text, encoding="utf-8")
        settings = {"algo": "dagger", "scenarios": ["dynamic"], "expert": f"{file}:Mine"}
        digests.append(load_settings(settings, trust=True).made_of["expert"])
    assert digests[0] == digests[1] != digests[2]
