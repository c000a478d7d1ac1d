"""Datasets as what trainings learn from: read as they were driven, found by name, refused where they do not fit."""

from __future__ import annotations

import json
import shutil
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("minari", reason="minari comes with the extra `data`")

import minari

import bug_gym
from bug_gym.agents.learning.settings import load_settings
from bug_gym.cli import main
from bug_gym.config import load
from bug_gym.evaluation import datasets
from bug_gym.evaluation.collection import collect
from bug_gym.evaluation.datasets import episodes_for, read_episodes
from bug_gym.evaluation.demonstrations import ENDINGS, demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.held_out import TRAINING_SEEDS

SHORT = {"time.limit": 6.0}
SCENARIO = load("dynamic", SHORT)
SEEDS = range(TRAINING_SEEDS, TRAINING_SEEDS + 4)
TRAINING = {"algo": "bc", "scenarios": ["dynamic"], "overrides": SHORT}


def settings_of(policies: list[str], **changes: Any) -> Any:
    return load_settings({**TRAINING, "data": {"policies": policies, "episodes": len(SEEDS)}, **changes}, trust=True)


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the datasets of two policies."""
    out = tmp_path_factory.mktemp("datasets")
    collect("dynamic", ["bug2", "random"], out, overrides=SHORT, expert="bug2", episodes=len(SEEDS), seed=SEEDS[0])
    return out


@pytest.mark.parametrize("form", ["", "_flat"])
def test_a_dataset_is_read_as_it_was_driven(form: str, collected: Path) -> None:
    found = read_episodes(collected / f"bug_gym/dynamic/bug2{form}-v0", SCENARIO)
    driven = demonstrate(PolicyEntry.of("bug2"), ScenarioEntry("dynamic", SCENARIO, SEEDS), SEEDS)
    for name in ("observations", "actions", "rewards", "steps"):
        assert np.array_equal(getattr(found, name), getattr(driven, name))
    ends = [ENDINGS[code] for code in driven.outcomes]
    assert found.terminated.tolist() == [end in ("success", "collision") for end in ends]
    assert found.scores() == pytest.approx(driven.returns())
    assert found.origin["policy"] == "bug2" and found.origin["digest"] == SCENARIO.digest


def test_what_is_not_there_is_collected_once_in_worlds_of_trainings(tmp_path: Path) -> None:
    settings = settings_of(["bug2", "random"])
    found = episodes_for(settings, root=tmp_path)
    assert len(found.steps) == 2 * len(SEEDS) and list(found.origin["of"]) == ["bug2", "random"]
    assert found.origin["first_seed"] == TRAINING_SEEDS
    made_at = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.hdf5")}
    again = episodes_for(settings, root=tmp_path)
    assert np.array_equal(again.observations, found.observations)
    assert made_at == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.hdf5")}
    alone = episodes_for(settings_of(["bug2"]), root=tmp_path)
    assert np.array_equal(alone.actions, found.actions[: len(alone.actions)])


def test_a_dataset_of_other_worlds_is_collected_beside_the_first(tmp_path: Path) -> None:
    settings = [settings_of(["bug2"], overrides={**SHORT, "world.obstacles": count}) for count in (3, 5)]
    found = [episodes_for(one, root=tmp_path) for one in settings]
    assert found[0].origin["digest"] != found[1].origin["digest"]
    places = sorted(path.name.rpartition("-")[0] for path in tmp_path.iterdir())
    assert places == [f"bug2-{len(SEEDS)}"] * 2
    made_at = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.hdf5")}
    for one, before in zip(settings, found, strict=True):
        assert episodes_for(one, root=tmp_path).origin == before.origin
    assert made_at == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.hdf5")}


def test_a_dataset_of_many_policies_lies_in_a_folder_whose_name_a_disk_can_hold(tmp_path: Path) -> None:
    policies = [f"bug2:turn={turn}:clearance=0.4{number:02}" for turn in ("left", "right") for number in range(5)]
    assert len("+".join(policies)) > 255
    others = [*policies[:-1], "random"]
    for number, some in enumerate((policies, others), start=1):
        found = episodes_for(settings_of(some, data={"policies": some, "episodes": 1}), root=tmp_path)
        assert len(found.steps) == len(some) and len(list(tmp_path.iterdir())) == number


def test_a_dataset_of_a_changed_policy_or_version_is_collected_beside_the_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = tmp_path / "own.py"
    for place, line in (("one", "x = 1"), ("two", "x = 2")):
        text = f"from bug_gym.agents.bugs.bug2 import Bug2\n\n{line}\n\n\nclass Own(Bug2):\n    pass\n"
        own.write_text(text, encoding="utf-8")
        told = episodes_for(settings_of([f"{own}:Own"]), root=tmp_path / "found").origin
        assert told["policy_code"], place
    assert len(list((tmp_path / "found").iterdir())) == 2
    first = datasets._digest(SCENARIO, [])
    monkeypatch.setattr(datasets, "source_digest", lambda: "of another commit")
    second = datasets._digest(SCENARIO, [])
    monkeypatch.setattr(bug_gym, "__version__", "99.0.0")
    assert len({first, second, datasets._digest(SCENARIO, [])}) == 3


def test_a_dataset_is_found_by_minaris_name(collected: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(collected))
    found = episodes_for(settings_of(["bug2"]), "bug_gym/dynamic/mixed_flat-v0")
    assert len(found.steps) == 2 * len(SEEDS)
    assert len(minari.load_dataset("bug_gym/dynamic/mixed_flat-v0")) == 2 * len(SEEDS)


def torn(folder: Path) -> Path:
    """Cuts the file of a dataset."""
    path = folder / "data" / "main_data.hdf5"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return folder


def with_metadata(folder: Path, **changes: Any) -> Path:
    path = folder / "data" / "metadata.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    told["bug_gym"] |= changes
    path.write_text(json.dumps(told), encoding="utf-8")
    return folder


def with_numbers(folder: Path, name: str, values: Any) -> Path:
    """Replaces an array of the first episode."""
    import h5py

    with h5py.File(folder / "data" / "main_data.hdf5", "a") as file:
        del file["episode_0"][name]
        file["episode_0"][name] = values
    return folder


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (torn, "damaged"),
        (lambda folder: with_metadata(folder, version="0.0.1"), "0.0.1"),
        (lambda folder: with_metadata(folder, digest="00"), "scenario dynamic 00, expected dynamic"),
        (lambda folder: with_numbers(folder, "observations", np.zeros((3, 5), np.float32)), "expected"),
        (lambda folder: with_numbers(folder, "rewards", np.full(3, np.nan)), "expected|not finite"),
        (lambda folder: folder / "nothing", "no dataset"),
    ],
)
def test_a_dataset_that_does_not_fit_is_refused_in_a_line(
    spoil: Any, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    own = {"overrides": SHORT, "forms": ("flat",), "expert": "bug2"}
    collect("dynamic", ["bug2"], tmp_path, episodes=len(SEEDS), seed=SEEDS[0], **own)  # type: ignore[arg-type]
    folder = spoil(tmp_path / "bug_gym" / "dynamic" / "bug2_flat-v0")
    with pytest.raises(ValueError, match=said):
        episodes_for(settings_of(["bug2"]), folder)
    words = ["train", "bc_hd_bug", "--set", f"overrides={json.dumps(SHORT)}", "--dataset", str(folder)]
    assert main(words) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and not (tmp_path / "results" / "train").exists()


def test_a_dataset_of_another_scenario_or_of_another_observation_is_refused(collected: Path) -> None:
    folder = collected / "bug_gym/dynamic/bug2_flat-v0"
    others: list[dict[str, Any]]
    others = [{"scenarios": ["static"]}, {"overrides": {**SHORT, "lidar.beams": 32}}, {"overrides": {}}]
    for changes in others:
        with pytest.raises(ValueError, match=r"is of the scenario dynamic \w+, expected"):
            episodes_for(settings_of(["bug2"], **changes), folder)


@pytest.mark.filterwarnings("ignore:`eval_env` is set to None")
def test_a_dataset_of_minaris_own_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env = gym.make("BugGym/Dynamic-v0", overrides=SHORT, observation="flat")
    buffer = minari.data_collector.EpisodeBuffer(
        observations=np.zeros((3, 71), np.float32), actions=np.zeros((2, 2), np.float32), rewards=[0.0, 0.0],
        terminations=[False, False], truncations=[False, True], infos={},
    )  # fmt: skip
    minari.create_dataset_from_buffers("other/mine-v0", [buffer], env=env, algorithm_name="mine", author="me",
                                       author_email="me@example.org", code_permalink="https://example.org",
                                       description="of somebody else")  # fmt: skip
    with pytest.raises(ValueError, match="does not say what it was collected of"):
        episodes_for(settings_of(["bug2"]), "other/mine-v0")


def test_minaris_collector_wraps_a_live_env_as_far_as_its_extra_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Minari 0.5.4 appends steps with jax, of its extra `create`; the env itself passes through its wrapper."""
    env = minari.DataCollector(gym.make("BugGym/DynamicFlat-v0", overrides=SHORT))
    assert env.observation_space.shape == (71,)
    if find_spec("jax") is None:
        env.reset(seed=3)
        with pytest.raises(ImportError, match=r"minari\[create\]"):
            env.step(np.zeros(2, dtype=np.float32))
        return
    seen, _ = env.reset(seed=3)
    for _ in range(5):
        seen, *_ = env.step(np.zeros(2, dtype=np.float32))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    dataset = env.create_dataset("collected/live-v0", algorithm_name="still", author="me", author_email="me@example.org",
                                 code_permalink="https://example.org", description="of a live env")  # fmt: skip
    assert np.array_equal(dataset[0].observations[-1], seen)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda folder: with_metadata(folder, episodes="many"),
        lambda folder: with_metadata(folder, episodes=[]),
        lambda folder: with_numbers(folder, "terminations", np.zeros(0, bool)),
        lambda folder: (folder / "data" / "main_data.hdf5").write_bytes(b"none"),
        lambda folder: (folder / "data" / "main_data.hdf5").unlink(),
        lambda folder: (folder / "data" / "metadata.json").write_text("[" * 100_000),
        lambda folder: with_key(folder, observation_space="garbage"),
        lambda folder: with_key(folder, env_spec=5),
        lambda folder: with_key(folder, minari_version="99.0.0"),
        lambda folder: promise(folder, 10**9),
    ],
)
def test_a_damaged_dataset_is_told_by_its_folder(spoil: Any, tmp_path: Path, collected: Path) -> None:
    folder = tmp_path / "some"
    shutil.copytree(collected / "bug_gym/dynamic/bug2_flat-v0", folder)
    spoil(folder)
    with pytest.raises(ValueError, match=r"some\S* is damaged"):
        read_episodes(folder, SCENARIO)


def with_key(folder: Path, **changes: Any) -> None:
    path = folder / "data" / "metadata.json"
    path.write_text(json.dumps(json.loads(path.read_text(encoding="utf-8")) | changes), encoding="utf-8")


def promise(folder: Path, rows: int) -> None:
    """An array of so many rows, of which none is in the file."""
    import h5py

    with h5py.File(folder / "data" / "main_data.hdf5", "a") as file:
        del file["episode_0"]["actions"]
        file["episode_0"].create_dataset("actions", shape=(rows, 2), dtype="f4", chunks=(1000, 2))
