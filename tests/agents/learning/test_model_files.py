"""What lies in the folders of models: damaged, foreign and forged files are told in one line, whatever they are."""

from __future__ import annotations

import io
import json
import pickle
import re
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import CONFIG, GRAPH, TRAINED_FOLDER, WEIGHTS, read_config, sha256
from bug_gym.agents.learning.history import MOST_STEPS, History
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.prediction import learned
from bug_gym.agents.prediction.learned import LearnedPredictor
from bug_gym.cli import main
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.files import one_writer
from bug_gym.view import Sensors

MODEL, PREDICTOR = "ppo_dynamic", "rl_predictor"
SENSORS = Sensors.of(load("dynamic"))


def copy_of(name: str, folder: Path) -> Path:
    return Path(shutil.copytree(TRAINED_FOLDER / name, folder / "model"))


def put(folder: Path, data: bytes, name: str, config: str) -> None:
    """Put other bytes into a file of a model, with the checksum that goes with them."""
    (folder / name).write_bytes(data)
    record = json.loads((folder / config).read_bytes())
    record["sha256"][name] = sha256(data)
    (folder / config).write_text(json.dumps(record))


def change_config(path: Path, keys: list[str | int], value: object) -> None:
    """Put a value at a place of a JSON file."""
    record = json.loads(path.read_bytes())
    place = record
    for key in keys[:-1]:
        place = place[key]
    if value is None and isinstance(keys[-1], str) and keys[-1].startswith("-"):
        del place[keys[-1][1:]]
    else:
        place[keys[-1]] = value
    path.write_text(json.dumps(record))


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# ---------------------------------------------------------------------------------------------- config.json


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (["history"], [10**9], f"history.0: got 1000000000, expected at most {MOST_STEPS}"),
        (["history"], ["4"], "history.0: got '4', expected a whole number"),
        (["history"], [0], "history.0: got 0, expected at least 1"),
        (["history"], 4, "history: got 4, expected a list"),
        (["history"], [1] * 1000, "history"),
        (["robot", "beams"], "64", "robot.beams: got '64', expected a whole number"),
        (["robot", "kinematics"], "flying", "robot.kinematics: got 'flying'"),
        (["robot", "-beams"], None, "robot.beams"),
        (["robot", "wheels"], 4, "robot.wheels"),
        (["robot"], None, "robot: got None"),
        (["action"], "some", "action: got 'some', expected 'continuous' or 'discrete'"),
        (["name"], 3, "name: got 3, expected text"),
        (["seed"], -1, "seed: got -1, expected at least 0"),
        (["seed"], 77, "runs: got those of the seeds 0, .* not of 77"),
        (["runs"], {}, "runs: got those of the seeds none"),
        (["runs", "0", "curve"], [], "runs.0.curve: got .*, expected a list of at least 1"),
        (["runs", "0", "best", "success"], 1.5, "runs.0.best.success: got 1.5, expected at most 1"),
        (["sha256"], {}, "sha256: got checksums of nothing, expected policy.onnx, policy.safetensors"),
        (["sha256", "policy.onnx"], "0", "sha256.policy.onnx: got '0'"),
        (["-settings"], None, "settings: missing"),
        (["extra"], 1, "extra: unknown key"),
    ],
)
def test_a_config_with_a_value_that_cannot_be_is_refused_with_its_key(
    keys: list[str | int], value: object, said: str, tmp_path: Path
) -> None:
    folder = copy_of(MODEL, tmp_path)
    change_config(folder / CONFIG, keys, value)
    with pytest.raises(ValueError, match=f"{CONFIG} is damaged: .*{said}"):
        make_policy(f"{folder}/", "dynamic")


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


def places_in(record: Any, keys: tuple[str | int, ...] = ()) -> list[list[str | int]]:
    """Where something stands in some JSON."""
    items = record.items() if isinstance(record, dict) else enumerate(record) if isinstance(record, list) else ()
    return [place for key, value in items for place in ([[*keys, key], *places_in(value, (*keys, key))])]


CONFIGS = {
    MODEL: (CONFIG, json.loads((TRAINED_FOLDER / MODEL / CONFIG).read_bytes())),
    PREDICTOR: (learned.CONFIG, json.loads((TRAINED_FOLDER / PREDICTOR / learned.CONFIG).read_bytes())),
}


@settings(max_examples=100, deadline=None)
@given(name=st.sampled_from([MODEL, PREDICTOR]), data=st.data(), value=ANYTHING)
def test_whatever_stands_somewhere_in_a_config_the_model_is_made_or_the_file_is_told(
    name: str, data: st.DataObject, value: object
) -> None:
    config, record = CONFIGS[name]
    top = data.draw(st.sampled_from(sorted(record)))
    place = data.draw(st.sampled_from([[top], *([top, *rest] for rest in places_in(record[top])[:50])]))
    with tempfile.TemporaryDirectory() as somewhere:
        folder = copy_of(name, Path(somewhere))
        change_config(folder / config, place, value)
        try:
            made = make_policy(f"{folder}/", "dynamic") if name == MODEL else LearnedPredictor(SENSORS, folder)
            assert made is not None
        except ValueError as error:
            said = str(error)
            assert config in said or "made for another robot" in said or "checksum" in said or "policy.onnx" in said


@settings(max_examples=100, deadline=None)
@given(data=st.binary(max_size=200) | ANYTHING.map(lambda value: json.dumps(value).encode()))
def test_any_bytes_as_a_config_are_told(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as somewhere:
        path = Path(somewhere) / CONFIG
        path.write_bytes(data)
        with pytest.raises(ValueError, match="config.json is damaged: "):
            read_config(path.parent)


@pytest.mark.parametrize("lags", [[MOST_STEPS + 1], [10**9], [0], [3, -1]])
def test_a_history_that_looks_too_far_back_is_refused_before_memory_is_taken(lags: list[int]) -> None:
    with pytest.raises(ValueError, match=f"lags are at least 1 step and at most {MOST_STEPS}"):
        History(RobotModel.of(SENSORS), lags, 1)


# ---------------------------------------------------------------------------------------------- graphs


def broken_graph() -> bytes:
    data = bytearray((TRAINED_FOLDER / MODEL / GRAPH).read_bytes())
    data[: len(data) // 2] = bytes(len(data) // 2)
    return bytes(data)


FOREIGN: dict[str, Callable[[], bytes]] = {
    "nothing": lambda: b"",
    "garbage": lambda: b"not a graph at all",
    "half": lambda: (TRAINED_FOLDER / MODEL / GRAPH).read_bytes()[:20_000],
    "broken": broken_graph,
    "a predictor's": lambda: (TRAINED_FOLDER / PREDICTOR / learned.GRAPH).read_bytes(),
    "a model's with a memory": lambda: (TRAINED_FOLDER / "ppo_rush" / GRAPH).read_bytes(),
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_graph_that_is_none_or_of_something_else_is_refused_when_the_policy_is_made(
    kind: str, tmp_path: Path
) -> None:
    folder = copy_of(MODEL, tmp_path)
    put(folder, FOREIGN[kind](), GRAPH, CONFIG)
    with pytest.raises(
        ValueError, match=r"policy\.onnx (holds no graph|is not a graph for observations of 71|answers)"
    ):
        make_policy(f"{folder}/", "dynamic")


@pytest.mark.parametrize("kind", ["garbage", "a policy's"])
def test_a_predictor_with_another_graph_is_refused(kind: str, tmp_path: Path) -> None:
    folder = copy_of(PREDICTOR, tmp_path)
    data = b"garbage" if kind == "garbage" else (TRAINED_FOLDER / MODEL / GRAPH).read_bytes()
    put(folder, data, learned.GRAPH, learned.CONFIG)
    with pytest.raises(ValueError, match=r"predictor\.onnx (holds no graph|is not a graph)"):
        LearnedPredictor(SENSORS, folder)


def test_the_command_tells_a_foreign_graph_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = copy_of(MODEL, tmp_path)
    put(folder, b"garbage", GRAPH, CONFIG)
    out = tmp_path / "out"
    arguments = ["--scenario", "dynamic", "--policies", f"{folder}/", "--episodes", "1", "--out", str(out)]
    assert main(["evaluate", *arguments]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "policy.onnx holds no graph" in said
    assert not out.exists()


@pytest.mark.parametrize("keys", [["hidden"], ["hidden", 0]])
@pytest.mark.parametrize("value", [10**9, "256", None, [0], True])
def test_layers_that_cannot_be_are_refused(keys: list[str | int], value: object, tmp_path: Path) -> None:
    folder = copy_of(PREDICTOR, tmp_path)
    change_config(folder / learned.CONFIG, ["settings", *keys], value)
    with pytest.raises(ValueError, match=r"predictor\.json is damaged: settings\.hidden: got"):
        learned.read_config(folder)


# ---------------------------------------------------------------------------------------------- weights


def test_weights_are_refused_where_a_bit_of_them_has_changed(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import rebuild

    folder = copy_of(MODEL, tmp_path)
    rebuild(folder)
    data = bytearray((folder / WEIGHTS).read_bytes())
    data[-5] ^= 1
    (folder / WEIGHTS).write_bytes(data)
    with pytest.raises(ValueError, match=r"policy\.safetensors is damaged: its checksum"):
        rebuild(folder)


@pytest.mark.parametrize("data", [b"", b"garbage", b"\xff" * 100, (2).to_bytes(8, "little") + b"{}"])
def test_weights_that_are_none_are_refused(data: bytes, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import rebuild

    folder = copy_of(MODEL, tmp_path)
    put(folder, data, WEIGHTS, CONFIG)
    with pytest.raises(ValueError, match=r"policy\.safetensors cannot be read into this network"):
        rebuild(folder)


def test_of_weights_of_other_layers_the_first_is_told(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.models import load_weights, write_weights

    path = tmp_path / WEIGHTS
    write_weights(path, torch.nn.Sequential(torch.nn.Linear(3, 8), torch.nn.Linear(8, 2)))
    told = f"{path} cannot be read into this network: 0.weight has the shape (8, 3), expected (4, 3)"
    with pytest.raises(ValueError, match=f"^{re.escape(told)}$"):
        load_weights(path, torch.nn.Sequential(torch.nn.Linear(3, 4)), sha256(path.read_bytes()))


# ---------------------------------------------------------------------------------------------- folders of trainings


def tiny(**changes: Any) -> Any:
    """Settings of a training that takes a second."""
    from bug_gym.agents.learning.settings import load_settings  # the extra `train`

    sizes = {"n_envs": 8, "batch_size": 32, "eval_episodes": 4, "test_episodes": 4, "n_timesteps": 64}
    own = {"ppo": {"n_steps": 4}, "sac": {"learning_starts": 40}, "dqn": {"learning_starts": 40}}
    algo = changes.get("algo", "ppo")
    return load_settings({"algo": algo, "scenarios": ["dynamic"], **sizes, **own[algo], **changes})


@pytest.mark.parametrize("algo", ["ppo", "sac", "dqn"])
def test_a_training_of_each_algorithm_refuses_the_folder_of_another_before_it_begins(algo: str, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    for name in (MODEL, "sac_dynamic", "dqn_candidates"):
        folder = copy_of(name, tmp_path / name)
        before = files_in(folder)
        with pytest.raises(ValueError, match="model is of another training: settings"):
            train(tiny(algo=algo), folder, threads=1)
        assert files_in(folder) == before


def test_another_seed_is_another_training_whatever_the_algorithm(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    train(tiny(algo="sac"), tmp_path, threads=1, tensorboard=False)
    before = files_in(tmp_path)
    with pytest.raises(ValueError, match="of another training: seed was 0, is now 1"):
        train(tiny(algo="sac"), tmp_path, seed=1, threads=1, tensorboard=False)
    with pytest.raises(ValueError, match="of another training: settings.gamma was 0.99, is now 0.5"):
        train(tiny(algo="sac", gamma=0.5), tmp_path, threads=1, tensorboard=False)
    assert files_in(tmp_path) == before


def write_scenario(folder: Path, obstacles: int) -> str:
    """A file with a scenario of so many obstacles; returns its path."""
    path = folder / "mine.yaml"
    robot = "robot: {kinematics: differential}\nlidar: {beams: 64, range: 5.0}\n"  # that of `dynamic`
    text = f"name: mine\n{robot}world: {{family: field, obstacles: {obstacles}}}\ntime: {{limit: 2.0}}\n"
    path.write_text(text, encoding="utf-8")
    return path.as_posix()


@pytest.mark.parametrize("key", ["scenarios.0", "curriculum.0.scenarios.0"])
def test_a_scenario_whose_file_has_changed_since_makes_another_training(key: str, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train, train_seeds

    def asked() -> Any:
        if key == "scenarios.0":
            return tiny(scenarios=[write_scenario(tmp_path, obstacles)])
        stages = [{"scenarios": [write_scenario(tmp_path, obstacles)], "success": 1.0}, {"share": 0.5}]
        return tiny(curriculum=stages)

    out, obstacles = tmp_path / "model", 5
    train(asked(), out, threads=1, tensorboard=False)
    before = files_in(out)
    train_seeds(asked(), out, threads=1)  # it is done
    assert files_in(out) == before
    obstacles = 20
    with pytest.raises(ValueError, match=f"model is of another training: {key} has changed since"):
        train_seeds(asked(), out, threads=1)
    assert files_in(out) == before
    config = json.loads((out / CONFIG).read_text(encoding="utf-8"))
    del config["made_of"]
    (out / CONFIG).write_text(json.dumps(config), encoding="utf-8")
    with pytest.raises(ValueError, match="nobody can tell whether scenarios.0 has changed since"):
        train_seeds(asked(), out, threads=1)
    (out / CONFIG).unlink()
    with pytest.raises(ValueError, match=rf"checkpoint.pt is of another training: {key} was"):
        train(asked(), out, threads=1, tensorboard=False)


def test_settings_keep_the_worlds_that_their_files_told_of_when_they_were_read(tmp_path: Path) -> None:
    read = tiny(scenarios=[write_scenario(tmp_path, 5)])
    write_scenario(tmp_path, 20)
    for kept in (read, pickle.loads(pickle.dumps(read)), read.trusting(True)):
        assert [scenario.world.obstacles for scenario in kept.loaded] == [5]


def test_the_folder_of_an_evaluation_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    evaluate("go_to_goal", "empty", episodes=1, out=tmp_path)
    before = files_in(tmp_path)
    with pytest.raises(ValueError, match="holds the rows of an evaluation"):
        train(tiny(), tmp_path, threads=1)
    assert files_in(tmp_path) == before


def test_what_another_training_has_not_ended_is_refused_too(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    train(tiny(), tmp_path, threads=1, tensorboard=False)
    (tmp_path / CONFIG).unlink()
    with pytest.raises(ValueError, match="checkpoint.pt is of another training: SAC leaves no checkpoints"):
        train(tiny(algo="sac"), tmp_path, threads=1, tensorboard=False)


def test_the_best_of_other_seeds_is_not_replaced(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train_seeds

    train_seeds(tiny(), tmp_path, seeds=[0, 1], threads=1)
    with pytest.raises(ValueError, match="agent is of another training: seed was 0, 1, is now 5, 6"):
        train_seeds(tiny(), tmp_path, seeds=[5, 6], threads=1)
    assert not (tmp_path / "seed-5").exists()


def test_a_training_has_its_folder_alone(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    with one_writer(tmp_path), pytest.raises(ValueError, match="is in use: process"):
        train(tiny(), tmp_path, threads=1)


def test_a_training_leaves_the_arithmetic_of_the_process_as_it_was(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    train(tiny(), tmp_path, threads=1, tensorboard=False)
    smallest = np.nextafter(0.0, 1.0)
    assert smallest * np.float64(2.0) > smallest > 0.0


# ---------------------------------------------------------------------------------------------- checkpoints


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What a training has left to go on from."""
    pytest.importorskip("stable_baselines3")
    from bug_gym.agents.learning.training import train

    folder = tmp_path_factory.mktemp("training")
    train(tiny(n_envs=2, batch_size=8), folder, threads=1, tensorboard=False)
    return (folder / "checkpoint.pt").read_bytes()


@settings(max_examples=100, deadline=None)
@given(where=st.integers(0, 2**32), bit=st.integers(0, 7))
def test_a_checkpoint_is_refused_wherever_a_bit_of_it_has_changed(checkpoint: bytes, where: int, bit: int) -> None:
    from bug_gym.agents.learning.checkpoints import load_checkpoint

    data = bytearray(checkpoint)
    data[where % len(data)] ^= 1 << bit
    with tempfile.TemporaryDirectory() as somewhere:
        path = Path(somewhere) / "checkpoint.pt"
        path.write_bytes(data)
        with pytest.raises(ValueError, match="checkpoint.pt is damaged: it does not begin with the checksum"):
            load_checkpoint(path, {})
        path.write_bytes(checkpoint)
        assert load_checkpoint(path, {})["num_timesteps"] >= 64


class Surprise:
    """Makes a file when it is read as a pickle."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("form", ["torch", "pickle"])
def test_a_checkpoint_with_a_right_checksum_runs_no_code(form: str, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    import torch

    from bug_gym.agents.learning.checkpoints import MAGIC, load_checkpoint

    content = io.BytesIO()
    surprise = {"identity": Surprise(tmp_path / "ran")}
    if form == "torch":
        torch.save(surprise, content)
    else:
        pickle.dump(surprise, content, protocol=2)
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(MAGIC + sha256(content.getvalue()).encode() + b"\n" + content.getvalue())
    with pytest.raises(ValueError, match="checkpoint.pt is damaged"):
        load_checkpoint(path, {})
    assert not (tmp_path / "ran").exists()
