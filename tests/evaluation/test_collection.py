"""Datasets: what a policy does, recorded side by side, is what a lone env gives; Minari reads it; a stop costs nothing."""

from __future__ import annotations

import json
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import TRAINED_FOLDER
from bug_gym.cli import main
from bug_gym.config import load
from bug_gym.evaluation import collection, minari_files
from bug_gym.evaluation.collection import collect
from bug_gym.evaluation.demonstrations import ENDINGS, Demonstrations, Extras, demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.minari_files import open_dataset
from bug_gym.files import released
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

SHORT = {"lidar.beams": 32, "time.limit": 12.0}
"""What keeps episodes and files small."""
SEEDS = range(5, 11)
OPEN = {"name": "open", "world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}, "lidar": {"beams": 8}}
FOLDER = "bug_gym/dynamic"
CODE = "https://example.org/code/tree/abc"


def short(seeds: range = SEEDS) -> ScenarioEntry:
    return ScenarioEntry("dynamic", load("dynamic", SHORT), seeds)


def collected(out: Path, policies: Any = ("bug2", "random"), **arguments: Any) -> list[str]:
    arguments = {"episodes": len(SEEDS), "seed": SEEDS[0], "expert": "bug2", "overrides": SHORT, **arguments}
    return collect("dynamic", list(policies), out, **arguments)


def files_of(out: Path) -> dict[str, bytes]:
    """All that lies in a folder but for what keeps it to one process."""
    paths = [path for path in out.rglob("*") if path.is_file() and not path.name.startswith(".")]
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in paths}


# ------------------------------------------------------------------------------------------------ demonstrations


@pytest.mark.parametrize("name", ["bug2", "random", "ppo_dynamic"])
def test_recorded_actions_give_what_was_recorded_in_a_lone_env(name: str) -> None:
    if name == "ppo_dynamic":
        pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")
    overrides = {} if name == "ppo_dynamic" else SHORT  # a model is for one robot
    scenario = ScenarioEntry("dynamic", load("dynamic", overrides), range(5, 8))
    found = demonstrate(PolicyEntry.of(name), scenario, scenario.seeds)
    env = gym.make("BugGym/Dynamic-v0", overrides=overrides, observation="flat")
    assert found.seeds.tolist() == list(scenario.seeds)
    for episode in found.episodes():
        seen, info = env.reset(seed=int(episode.seeds[0]))
        assert np.array_equal(seen, episode.observations[0])
        for number, action in enumerate(episode.actions):
            seen, reward, terminated, truncated, info = env.step(action)
            assert np.array_equal(seen, episode.observations[number + 1]) and reward == episode.rewards[number]
            assert (terminated or truncated) == (number == len(episode.actions) - 1)
        assert info["outcome"] == ENDINGS[episode.outcomes[0]]


def test_actions_and_states_are_those_of_the_policy_asked_alone() -> None:
    found = demonstrate(PolicyEntry.of("bug2"), short(), SEEDS, Extras(modes=True))
    assert (~np.isnan(found.points)).any(axis=(0, 2)).all()  # it has hit and left something
    env = gym.make("BugGym/Dynamic-v0", overrides=SHORT)
    policy = make_policy("bug2", env)
    for episode in found.episodes():
        seen, _ = env.reset(seed=int(episode.seeds[0]))
        state: Any = None
        for recorded, mode, points in zip(episode.actions, episode.modes, episode.points, strict=True):
            action, state = policy.predict(seen, state)
            assert np.array_equal(action, recorded) and state[0].mode.encode() == mode
            for point, places in zip(points, (state[0].hits, state[0].leaves), strict=True):
                last = places[-1] if places else (np.nan, np.nan)
                assert np.array_equal(point, np.array(last, dtype=np.float32), equal_nan=True)
            seen, *_ = env.step(action)


class LosesItsWay(ScriptedPolicy):
    """Fails on its way."""

    def start(self) -> Memory:
        return Memory()

    def act(self, view: View, memory: Memory) -> Velocity:
        if view.pose[0] > 0.5:
            raise ZeroDivisionError("lost")
        return 1.0, 0.0


def test_what_a_policy_raises_is_told_with_policy_scenario_and_seeds_as_an_evaluation_does() -> None:
    scenario = ScenarioEntry("open", load(OPEN), SEEDS)
    with pytest.raises(ZeroDivisionError, match="lost") as error:
        demonstrate(PolicyEntry.of(LosesItsWay), scenario, SEEDS)
    (note,) = error.value.__notes__
    assert note == f"policy LosesItsWay, scenario open, seeds {', '.join(map(str, SEEDS))}"


def test_more_worlds_than_rows_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    together = demonstrate(PolicyEntry.of("bug2"), short(), SEEDS)
    monkeypatch.setattr("bug_gym.evaluation.demonstrations.SLOTS", 2)
    in_turn = demonstrate(PolicyEntry.of("bug2"), short(), SEEDS)
    for name, values in vars(together).items():
        assert np.array_equal(values, getattr(in_turn, name)), name


def test_the_random_policy_does_something_else_in_each_world() -> None:
    found = list(demonstrate(PolicyEntry.of("random"), short(), SEEDS).episodes())
    assert len({episode.actions[:5].tobytes() for episode in found}) == len(SEEDS)


@dataclass
class Count(Memory):
    """How many decisions there were."""

    decisions: int = 0


class GivesUp(ScriptedPolicy):
    """Goes ahead, and gives up at its fourth decision."""

    def start(self) -> Count:
        return Count()

    def act(self, view: View, memory: Count) -> Velocity:
        memory.decisions += 1
        memory.verdict = "stuck" if memory.decisions == 4 else ""
        return (1.0, 0.0)


def test_a_policy_that_gives_up_stands_for_one_step_and_its_episode_is_truncated(tmp_path: Path) -> None:
    scenario = ScenarioEntry("open", load(OPEN), range(2))
    entry = PolicyEntry.of(GivesUp(Sensors.of(scenario.scenario)))
    found = demonstrate(entry, scenario, scenario.seeds)
    assert found.steps.tolist() == [4, 4]
    assert [ENDINGS[code] for code in found.outcomes] == ["gave_up", "gave_up"]
    assert (found.actions.reshape(2, 4, 2)[:, :3] != found.actions[3]).any(axis=2).all()


def test_blocks_are_read_as_they_were_written_and_a_damaged_one_is_told_of(tmp_path: Path) -> None:
    found = demonstrate(PolicyEntry.of("bug2"), short(), SEEDS[:2], Extras(modes=True, shortest_path=True))
    path = tmp_path / "000000.npz"
    found.write(path)
    again = Demonstrations.read(path, SEEDS[:2])
    for name, values in vars(found).items():
        np.testing.assert_array_equal(values, getattr(again, name), err_msg=name)
    with pytest.raises(ValueError, match="is of other worlds, expected seeds 0 to 1"):
        Demonstrations.read(path, range(2))
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ValueError, match="000000.npz is damaged .*without it, its episodes are driven again"):
        Demonstrations.read(path, SEEDS[:2])


# ------------------------------------------------------------------------------------------------ with Minari


@pytest.fixture(scope="module")
def minari() -> Any:
    """The package, with what its files need."""
    pytest.importorskip("h5py", reason="h5py comes with the extra `data`")
    return pytest.importorskip("minari", reason="minari comes with the extra `data`")


@pytest.fixture(scope="module")
def root(minari: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of datasets."""
    out: Path = tmp_path_factory.mktemp("datasets")
    extras = Extras(modes=True, shortest_path=True)
    names = collected(out, extras=extras, signature=collection.Signature("Jane Doe", "jane@example.org", CODE))
    forms = ("", "_flat")
    assert names == [f"{FOLDER}/{name}{form}-v0" for name in ("bug2", "random", "mixed") for form in forms]
    return out


@pytest.fixture
def known(root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder, as Minari's own."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    return root


@pytest.mark.parametrize("name", ["bug2-v0", "random_flat-v0"])
def test_minari_replays_each_episode_in_the_env_that_it_recovers(name: str, known: Path, minari: Any) -> None:
    dataset = minari.load_dataset(f"{FOLDER}/{name}")
    env = dataset.recover_environment()
    assert (env.observation_space, env.action_space) == (dataset.observation_space, dataset.action_space)
    metadata = dataset.storage.get_episode_metadata(dataset.episode_indices)
    for episode, about in zip(dataset.iterate_episodes(), metadata, strict=True):
        seen, info = env.reset(seed=about["seed"], options={"shortest_path": True})
        assert (episode.infos["shortest_path_length"] == info["shortest_path_length"]).all()
        for number in range(len(episode)):
            assert same(seen, at(episode.observations, number))
            assert ENDINGS[episode.infos["outcome"][number]] == info["outcome"] == "running"
            seen, reward, terminated, truncated, info = env.step(episode.actions[number])
            assert reward == episode.rewards[number]
            assert terminated == episode.terminations[number] and truncated == episode.truncations[number]
        assert same(seen, at(episode.observations, len(episode)))
        assert ENDINGS[episode.infos["outcome"][-1]] == info["outcome"]
        assert episode.infos["collision"].tolist() == [False] * len(episode) + [info["collision"]]
        for name, shape in (("mode", ()), ("hit_point", (2,)), ("leave_point", (2,))):
            values = episode.infos[name]
            assert values.shape == (len(episode) + 1, *shape)
            assert np.array_equal(values[-1], values[-2], equal_nan=name != "mode")


def at(observations: Any, number: int) -> Any:
    """One of the observations of an episode."""
    if isinstance(observations, dict):
        return {name: values[number] for name, values in observations.items()}
    return observations[number]


def same(one: Any, other: Any) -> bool:
    """Whether two observations are equal, bit for bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)
    return np.array_equal(one, other)


def test_metadata_are_complete(known: Path, minari: Any) -> None:
    dataset = minari.load_dataset(f"{FOLDER}/bug2-v0")
    told = dataset.storage.metadata
    assert (told["algorithm_name"], told["expert_policy"]) == ("bug2", "bug2")
    assert (told["author"], told["author_email"]) == ({"Jane Doe"}, {"jane@example.org"})
    assert told["code_permalink"] == CODE
    assert told["requirements"] == [f"bug-gym=={bug_gym.__version__}"]
    assert told["num_episodes_average_score"] == told["total_episodes"] == len(SEEDS)
    assert told["outcomes"] == list(ENDINGS) and "seeds 5 to 10" in told["description"]
    assert told["total_steps"] == sum(len(episode) for episode in dataset)
    assert set(minari.list_local_datasets()) >= {f"{FOLDER}/bug2-v0", f"{FOLDER}/mixed_flat-v0"}


def test_the_random_policy_scores_0_and_the_expert_1(known: Path, minari: Any) -> None:
    for name, score in (("random", 0.0), ("bug2", 1.0)):
        dataset = minari.load_dataset(f"{FOLDER}/{name}_flat-v0")
        returns = np.array([episode.rewards.sum() for episode in dataset])
        assert minari.get_normalized_score(dataset, returns).mean() == pytest.approx(score, abs=1e-9)


@pytest.mark.parametrize("policies", [["bug2", "random"], ["bug2"]])
def test_scores_are_of_the_first_worlds_however_blocks_lie(
    policies: list[str], minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "BLOCK", 2)
    monkeypatch.setattr(collection, "SCORED", 3)
    (name, *_) = collected(tmp_path, policies, forms=["flat"])
    told = open_dataset(tmp_path / name).storage.metadata
    floor = demonstrate(PolicyEntry.of("random"), short(SEEDS[:3]), SEEDS[:3])
    assert (told["ref_min_score"], told["num_episodes_average_score"]) == (floor.returns().mean(), 3)


def test_known_returns_save_driving_and_change_no_byte(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments: dict[str, Any] = {"episodes": 2, "seed": 1, "overrides": None, "expert": "hd_bug_map", "forms": ["flat"]}
    with monkeypatch.context() as patched:
        driven = stopped_after(99, patched)
        collected(tmp_path / "known", ["bug2"], **arguments)
    assert [name for name, _ in driven] == ["bug2"]
    monkeypatch.setattr(collection, "known_returns", lambda *_: None)
    driven = stopped_after(99, monkeypatch)
    collected(tmp_path / "driven", ["bug2"], **arguments)
    assert sorted(name for name, _ in driven) == ["bug2", "hd_bug_map", "random"]
    assert files_of(tmp_path / "known") == files_of(tmp_path / "driven")


def test_the_mixed_dataset_has_all_episodes_and_says_whose_they_are(known: Path, minari: Any) -> None:
    mixed = minari.load_dataset(f"{FOLDER}/mixed-v0")
    about = list(mixed.storage.get_episode_metadata(mixed.episode_indices))
    assert [one["policy"] for one in about] == ["bug2"] * len(SEEDS) + ["random"] * len(SEEDS)
    parts = [minari.load_dataset(f"{FOLDER}/{name}-v0") for name in ("bug2", "random")]
    for one, other in zip(mixed, (episode for part in parts for episode in part), strict=True):
        assert np.array_equal(one.actions, other.actions) and np.array_equal(one.rewards, other.rewards)


# ------------------------------------------------------------------------------------------------ the folder


def stopped_after(blocks: int, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Have the work be interrupted after some blocks; returns a list that takes those that are driven."""
    driven: list[Any] = []

    def drive(source: Any, path: Path, seeds: range) -> None:
        if len(driven) == blocks:
            raise KeyboardInterrupt
        original(source, path, seeds)
        driven.append((source.name, seeds))

    original = collection._drive_block
    monkeypatch.setattr(collection, "_drive_block", drive)
    return driven


def test_the_same_seed_gives_the_same_bytes_stopped_or_not(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "BLOCK", 2)
    collected(tmp_path / "whole")
    with monkeypatch.context() as patched:
        first = stopped_after(2, patched)
        with pytest.raises(KeyboardInterrupt):
            collected(tmp_path / "stopped")
    second = stopped_after(99, monkeypatch)
    collected(tmp_path / "stopped")
    assert (len(first), len(second)) == (2, 4)  # nothing was driven twice
    assert files_of(tmp_path / "whole") == files_of(tmp_path / "stopped")
    assert not (tmp_path / "stopped" / collection.KEPT).exists()
    collected(tmp_path / "stopped")  # all is there
    assert len(second) == 4
    collected(tmp_path / "another", seed=SEEDS[0] + 1)
    name = f"{FOLDER}/bug2-v0/data/main_data.hdf5"
    assert files_of(tmp_path / "another")[name] != files_of(tmp_path / "whole")[name]


def test_blocks_are_kept_until_every_run_that_needs_them_is_done(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "BLOCK", 2)
    blocks = tmp_path / collection.KEPT / "dynamic"
    asked: dict[str, Any] = {"episodes": 4, "expert": "random", "forms": ["flat"]}
    with monkeypatch.context() as patched:
        stopped_after(3, patched)
        with pytest.raises(KeyboardInterrupt):
            collected(tmp_path, ["bug1", "bug2"], **asked)
    kept = files_of(blocks)
    assert {"bug1", "bug2"} <= {Path(name).parent.name for name in kept if name.endswith(".npz")}
    for _ in range(2):  # the second one finds its datasets
        collected(tmp_path, ["go_to_goal"], **asked)
        assert {name: files_of(blocks).get(name) for name in kept} == kept
        assert not (blocks / "go_to_goal").exists()
    collected(tmp_path, ["bug2"], **asked)  # whose blocks the mixed dataset needs, too
    assert {name for name in kept if name.startswith("bug")} <= set(files_of(blocks))
    with monkeypatch.context() as patched:
        driven = stopped_after(99, patched)
        collected(tmp_path, ["bug1", "bug2"], **asked)
    assert "bug2" not in [name for name, _ in driven]
    assert not (tmp_path / collection.KEPT).exists()


def test_blocks_of_another_run_of_the_same_policy_are_kept(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, Any] = {"expert": "bug2", "episodes": 2}
    collected(tmp_path, ["bug2"], forms=["flat"], **asked)
    with monkeypatch.context() as patched:
        patched.setattr(collection, "_write", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            collected(tmp_path, ["bug2"], forms=["dict"], extras=Extras(modes=True), **asked)
    kept = files_of(tmp_path / collection.KEPT)
    assert kept
    collected(tmp_path, ["bug2"], forms=["flat"], **asked)  # all is there
    assert files_of(tmp_path / collection.KEPT) == kept


def test_several_workers_write_the_same_bytes(minari: Any, tmp_path: Path) -> None:
    for workers in (1, 2):
        collected(tmp_path / str(workers), ["bug2"], workers=workers, episodes=2)
    assert files_of(tmp_path / "1") == files_of(tmp_path / "2")


def test_a_stop_while_datasets_are_written_leaves_whole_ones(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []

    def write(*arguments: Any) -> None:
        if len(written) == 1:
            arguments = (*arguments[:-1], torn(arguments[-1]))
        written.append(arguments[2])
        original(*arguments)

    def torn(blocks: Any) -> Iterator[Any]:
        yield next(iter(blocks))
        raise KeyboardInterrupt

    original = minari_files.write_dataset
    with monkeypatch.context() as patched:
        patched.setattr(collection, "write_dataset", write)
        with pytest.raises(KeyboardInterrupt):
            collected(tmp_path, forms=["flat"])
    assert written == [f"{FOLDER}/bug2_flat-v0", f"{FOLDER}/random_flat-v0"]
    assert [path.name for path in (tmp_path / FOLDER).iterdir() if path.is_dir()] == ["bug2_flat-v0"]
    names = collected(tmp_path, forms=["flat"])
    assert [open_dataset(tmp_path / name).total_episodes for name in names] == [6, 6, 12]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed": 6}, "bug2-v0 holds another run: first_seed was 5, is now 6"),
        ({"overrides": {**SHORT, "lidar.beams": 17}}, "bug2-v0 holds another run: digest was "),
        ({"policies": ["bug2"], "expert": "bug1"}, 'bug2-v0 holds another run: expert was "bug2", is now "bug1"'),
        ({"forms": ["image"]}, "observations lie as dict or flat, got 'image'"),
        ({"policies": ["bug2", ("mixed", "bug1")]}, "datasets would both be called mixed"),
        ({"policies": [("bug 2", "bug2"), ("bug_2", "bug1")]}, "datasets would both be called bug_2"),
        ({"episodes": 0}, "at least one episode"),
    ],
)
def test_bad_input_is_told_in_one_line(changes: dict[str, Any], message: str, root: Path) -> None:
    before = files_of(root)
    with pytest.raises(ValueError, match=message) as told:
        collected(root, **{"extras": Extras(modes=True, shortest_path=True), **changes})
    assert "\n" not in str(told.value)
    assert files_of(root) == before


def test_scenarios_without_datasets_are_told_of(minari: Any, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="moving_target has a moving target and no shortest path"):
        collect("moving_target", ["bug2"], tmp_path, expert="bug2", extras=Extras(shortest_path=True))
    with pytest.raises(ValueError, match="datasets are of one robot, warehouse_team has "):
        collect("warehouse_team", ["bug2"], tmp_path, expert="bug2")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def copy(minari: Any, tmp_path: Path) -> Path:
    """A dataset to damage."""
    (name,) = collected(tmp_path, ["bug2"], episodes=2, forms=["flat"])
    return tmp_path / name


def test_a_dataset_is_opened_for_its_scenario_and_version_only(copy: Path) -> None:
    assert open_dataset(copy, load("dynamic", SHORT)).total_episodes == 2
    with pytest.raises(ValueError, match="is of the scenario dynamic .*, expected static "):
        open_dataset(copy, load("static"))
    path = copy / "data" / "metadata.json"
    path.write_text(path.read_text().replace(f'"version": "{released(bug_gym.__version__)}"', '"version": "0.0.9"'))
    with pytest.raises(ValueError, match="was collected with bug-gym 0.0.9, this is"):
        open_dataset(copy)


def test_torn_files_are_told_of(copy: Path) -> None:
    main_file, metadata = copy / "data" / "main_data.hdf5", copy / "data" / "metadata.json"
    whole = main_file.read_bytes()
    main_file.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(ValueError, match="bug2_flat-v0 is damaged: .*truncated"):
        open_dataset(copy)
    with pytest.raises(ValueError, match="bug2_flat-v0 is damaged"):  # and is not taken for done
        collected(copy.parents[2], ["bug2"], episodes=2, forms=["flat"])
    main_file.write_bytes(whole)
    told = json.loads(metadata.read_text())
    metadata.write_text(json.dumps({**told, "total_episodes": 1}))
    with pytest.raises(ValueError, match="has 2 episodes, its metadata tell of 1"):
        open_dataset(copy)
    metadata.write_text(metadata.read_text()[:-9])
    with pytest.raises(ValueError, match="metadata.json is damaged"):
        open_dataset(copy)
    metadata.unlink()
    with pytest.raises(ValueError, match="no dataset in"):
        open_dataset(copy)


def test_a_signature_that_comes_too_late_is_told_of(copy: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The dataset is there already, unsigned; what is asked for beside it is written with the signature."""
    signed = {"episodes": 2, "forms": ["flat", "dict"], "signature": collection.Signature("Jane Doe", None, CODE)}
    collected(copy.parents[2], ["bug2"], **signed)
    (told,) = [one.getMessage() for one in caplog.records if "already" in one.getMessage()]
    assert told.startswith(f"author, code_permalink not written into what was there already: {FOLDER}/bug2_flat-v0;")
    shutil.rmtree(copy)
    caplog.clear()
    collected(copy.parents[2], ["bug2"], **signed)
    collected(copy.parents[2], ["bug2"], **signed)
    assert not [one for one in caplog.records if "already" in one.getMessage()]


def test_the_command_writes_what_the_function_does(
    minari: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    sets = [part for key, value in SHORT.items() for part in ("--set", f"{key}={value}")]
    arguments = ["--policies", "bug2:turn=right", "--episodes", "2", "--observations", " flat", "--expert", "bug2"]
    monkeypatch.chdir(tmp_path)
    assert main(["collect", "dynamic", *arguments, "--out", "of the command", *sets]) == 0
    first, last = capsys.readouterr().out.splitlines()
    assert first == f"{FOLDER}/bug2_turn_right_flat-v0"
    assert shlex.split(last)[0] == f"MINARI_DATASETS_PATH={tmp_path / 'of the command'}"
    entry = PolicyEntry("bug2:turn=right", "bug2", {"turn": "right"})
    collected(tmp_path / "function", [entry], episodes=2, seed=0, forms=["flat"])
    assert files_of(tmp_path / "of the command") == files_of(tmp_path / "function")


def test_the_random_policy_may_be_the_expert_on_the_command_line_too(tmp_path: Path) -> None:
    words = [
        "collect",
        "dynamic",
        "--policies",
        "random",
        "--expert",
        "random",
        "--episodes",
        "1",
        "--set",
        "time.limit=1",
    ]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert (tmp_path / FOLDER / "random-v0").is_dir()


def test_datasets_and_blocks_of_another_source_of_the_package_are_not_gone_on_with(
    minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "BLOCK", 2)
    collected(tmp_path / "whole")
    with monkeypatch.context() as patched:
        stopped_after(2, patched)
        with pytest.raises(KeyboardInterrupt):
            collected(tmp_path / "stopped")
    before = [files_of(tmp_path / name) for name in ("whole", "stopped")]
    monkeypatch.setattr(collection, "source_digest", lambda: "another" * 10)
    told = (
        r"holds what another source of bug_gym has made, whose code has changed since \((of\.\w+\.)?bug_gym_source was "
    )
    for name in ("whole", "stopped"):
        with pytest.raises(ValueError, match=told):
            collected(tmp_path / name)
    assert [files_of(tmp_path / name) for name in ("whole", "stopped")] == before


def test_a_dataset_of_a_policy_whose_code_was_changed_is_not_gone_on_with(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    code = "from bug_gym.agents.bugs.bug2 import Bug2\n\nclass Mine(Bug2):\n    pass\n"
    for number, text in enumerate((code, code, f"{code}# another one\n")):
        path.write_text(text, encoding="utf-8")
        arguments: Any = {"expert": "random", "episodes": 1, "overrides": {"time.limit": 1.0, "lidar.beams": 16}}
        if number < 2:
            collect("dynamic", [f"{path}:Mine"], tmp_path / "out", **arguments)
        else:
            with pytest.raises(ValueError, match=r"holds another run: policy_code was"):
                collect("dynamic", [f"{path}:Mine"], tmp_path / "out", **arguments)


@pytest.mark.parametrize(
    ("policy", "models"),
    [
        (PolicyEntry("learned", "./model/"), ("ppo_static", "ppo_dynamic")),
        (PolicyEntry("learned", "hd_bug", {"predictor": "./model"}), ("rl_predictor", "supervised_predictor")),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_a_dataset_is_not_gone_on_with_where_another_model_lies_at_the_same_place(
    policy: PolicyEntry, models: tuple[str, str], minari: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")
    monkeypatch.chdir(tmp_path)
    asked: Any = {"expert": "random", "episodes": 1, "forms": ["flat"], "overrides": {"time.limit": 1.0}}
    driven = stopped_after(99, monkeypatch)
    shutil.copytree(TRAINED_FOLDER / models[0], "model")
    collect("dynamic", [policy], "out", **asked)
    before, count = files_of(Path("out")), len(driven)
    collect("dynamic", [policy], "out", **asked)
    shutil.rmtree("model")
    shutil.copytree(TRAINED_FOLDER / models[1], "model")
    with pytest.raises(ValueError, match=r"learned_flat-v0 holds another run: policy_code was "):
        collect("dynamic", [policy], "out", **asked)
    assert files_of(Path("out")) == before and len(driven) == count


@pytest.mark.parametrize(
    "change",
    [
        {"steps": np.array([1, 2, 3])},
        {"steps": np.zeros(2, dtype=np.int64)},
        {"steps": np.array(["a", "b"])},
        {"actions": np.zeros((3, 2), dtype=np.float32)},
        {"actions": np.zeros(5)},
        {"rewards": np.array(7.0)},
        {"outcomes": np.array([0, 99], dtype=np.int8)},
        {"observations": np.zeros(5, dtype=np.float32)},
        {"seeds": np.array(["x" * 5000])},
        {"seeds": np.array([{}], dtype=object)},
        {"shortest": np.zeros(3)},
        {"points": np.zeros((3, 2, 2), dtype=np.float32)},
        {"points": np.zeros(())},
    ],
    ids=repr,
)
def test_a_block_whose_arrays_are_not_those_of_episodes_is_damaged(change: dict[str, Any], tmp_path: Path) -> None:
    whole = demonstrate(PolicyEntry.of("go_to_goal"), short(range(2)), range(2))
    arrays = {field.name: getattr(whole, field.name) for field in fields(whole)}
    np.savez(tmp_path / "a.npz", **arrays)
    assert Demonstrations.read(tmp_path / "a.npz", range(2)).steps.tolist() == whole.steps.tolist()
    np.savez(tmp_path / "b.npz", **arrays | change)
    with pytest.raises(ValueError, match=r"b\.npz is damaged") as told:
        Demonstrations.read(tmp_path / "b.npz", range(2))
    assert len(str(told.value)) < 500 and "\n" not in str(told.value)
