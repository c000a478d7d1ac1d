"""Training of predictors: each kind learns what can be learnt, and the folder that it writes is played as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

import gymnasium as gym
import torch

from bug_gym.agents.learned_prediction import CONFIG, GRAPH, LearnedPredictor
from bug_gym.agents.model_folder import TRAINED_FOLDER, open_graph
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction_data import Samples
from bug_gym.agents.prediction_features import ANSWERS, WIDTH, cost_of, errors_of
from bug_gym.agents.prediction_training import (
    TRAININGS,
    Answering,
    AnswerVecEnv,
    Curve,
    GroupBuffer,
    PredictorSettings,
    costs_at_horizons,
    gains_over_others,
    gather,
    main,
    network,
    tried_slopes,
    with_mirrored,
    write_predictor,
)
from bug_gym.config import load
from bug_gym.observation import Sensors

Kind = Literal["ppo", "reinforce", "supervised"]
KINDS = get_args(Kind)

QUICK = PredictorSettings("ppo", hidden=(32,), epochs=10, batch=256, answers=60_000, rows=512, rollout=1, ppo_batch=256)


def drifting(count: int, seed: int) -> Samples:
    """Movers that all come to go 0.3 m/s faster than they do; a mirror image of one is another."""
    features = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, WIDTH)).astype(np.float32)
    answers = np.tile(np.array([0.2, 0.0], dtype=np.float32), (count, ANSWERS // 2))
    return Samples(features, answers)


@pytest.mark.parametrize("kind", KINDS)
def test_what_can_be_learnt_is_learnt(kind: Kind) -> None:
    settings = replace(QUICK, kind=kind)
    _, curve = TRAININGS[kind](settings, drifting(2000, 0), drifting(500, 1))
    costs = [point["cost"] for point in curve.points]
    assert min(costs) < 0.25 * costs[0]


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_gives_the_same_model(kind: Kind) -> None:
    settings = replace(QUICK, kind=kind, epochs=1, answers=4096)
    models = [TRAININGS[kind](settings, drifting(1000, 0), drifting(100, 1))[0] for _ in range(2)]
    first, second = (model.state_dict() for model in models)
    assert all(torch.equal(first[name], second[name]) for name in first)


def test_a_network_begins_with_the_filters_answers() -> None:
    with torch.no_grad():
        answers = Answering(network((32, 32)))(torch.from_numpy(drifting(100, 0).features))
    assert answers.abs().max() < 0.05


def test_the_gradients_cost_is_the_cost() -> None:
    rng = np.random.default_rng(0)
    given, right = rng.uniform(-1.0, 1.0, (2, 50, ANSWERS))
    costs = costs_at_horizons(torch.from_numpy(given), torch.from_numpy(right)).mean(dim=1)
    assert costs.numpy() == pytest.approx(cost_of(errors_of(given, right)))


def test_the_costs_of_tried_answers_tell_the_gradient() -> None:
    torch.manual_seed(0)
    given, right = torch.zeros(1, ANSWERS), torch.linspace(0.2, 0.5, ANSWERS)[None]
    slopes = tried_slopes(given, right, noise=0.01, pairs=20_000)
    given.requires_grad_()
    (expected,) = torch.autograd.grad(costs_at_horizons(given, right).mean(), given)
    # The estimate's deviation is about the gradient over the root of the pairs.
    assert torch.linalg.vector_norm(slopes - expected) < 0.05 * torch.linalg.vector_norm(expected)


def test_a_training_begins_with_the_weights_that_it_is_given(tmp_path: Path) -> None:
    settings = replace(QUICK, kind="supervised")
    model, curve = TRAININGS["supervised"](settings, drifting(2000, 0), drifting(500, 1))
    write_predictor(tmp_path, settings, model, curve, (2000, 500))
    for kind in KINDS:
        _, further = TRAININGS[kind](
            replace(settings, kind=kind, start_from=tmp_path, epochs=1), drifting(1000, 2), drifting(500, 1)
        )
        assert further.points[0]["cost"] == min(point["cost"] for point in curve.points)


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    settings = replace(QUICK, kind="supervised", epochs=1)
    model, curve = TRAININGS["supervised"](settings, drifting(1000, 0), drifting(100, 1))
    write_predictor(tmp_path, settings, model, curve, (1000, 100))
    with pytest.raises(ValueError, match="cannot be read into this network"):
        TRAININGS["supervised"](
            replace(settings, hidden=(16,), start_from=tmp_path), drifting(100, 0), drifting(100, 1)
        )


def test_a_reward_is_by_how_much_the_answer_beats_the_filter() -> None:
    samples = drifting(50, 0)
    env = AnswerVecEnv(samples, 8, 0, group=1)
    env.reset()
    _, rewards, ended, _ = env.step(np.tile(samples.answers[0], (8, 1)))
    filters = cost_of(errors_of(np.zeros((1, ANSWERS)), samples.answers[:1]))[0]
    assert rewards == pytest.approx(np.full(8, filters), abs=1e-6) and ended.all()
    env.step(np.zeros((8, ANSWERS), dtype=np.float32))
    assert env.step(np.zeros((8, ANSWERS), dtype=np.float32))[1] == pytest.approx(np.zeros(8))


def test_the_rows_of_a_group_are_asked_the_same() -> None:
    env = AnswerVecEnv(drifting(50, 0), 12, 0, group=4)
    first = env.reset()
    second, rewards, _, _ = env.step(np.tile(np.linspace(0.0, 0.1, 4, dtype=np.float32)[:, None], (3, ANSWERS)))
    for questions in (first, second):
        groups = np.asarray(questions).reshape(3, 4, WIDTH)
        assert np.array_equal(groups, groups[:, :1].repeat(4, axis=1))
        assert not np.array_equal(groups[0], groups[1])
    assert rewards.reshape(3, 4).std(axis=1).min() > 0.0


@pytest.mark.parametrize("group", [0, 5])
def test_rows_that_make_no_groups_are_refused(group: int) -> None:
    with pytest.raises(ValueError, match="expected a divisor of the 12 rows"):
        AnswerVecEnv(drifting(50, 0), 12, 0, group=group)


def others_mean(rewards: list[float], index: int) -> float:
    """Of all but one: the plain way."""
    others = [reward for other, reward in enumerate(rewards) if other != index]
    return sum(others) / len(others)


@pytest.mark.parametrize("group", [2, 3, 8])
def test_an_answer_is_judged_by_the_others_to_its_question(group: int) -> None:
    rewards = np.random.default_rng(0).normal(size=(5, 6 * group)).astype(np.float32)
    expected = [
        [
            float(reward) - others_mean(one.tolist(), index)
            for one in row.reshape(6, group)
            for index, reward in enumerate(one)
        ]
        for row in rewards
    ]
    gains = gains_over_others(rewards, group)
    assert gains == pytest.approx(np.array(expected), abs=1e-5)
    assert gains.reshape(-1, group).sum(axis=1) == pytest.approx(np.zeros(30), abs=1e-5)


def test_judging_by_the_others_biases_no_gradient() -> None:
    rng = np.random.default_rng(0)
    noise, slope = rng.normal(size=(100_000, 4, 2)), np.array([1.0, -2.0])
    worths = rng.normal(scale=10.0, size=(100_000, 1))  # of the questions: what the baseline has to take away
    gains = gains_over_others((worths + noise @ slope).astype(np.float32), 4)
    estimate = (gains[..., None] * noise).mean(axis=(0, 1))
    # Each of 400,000 terms deviates by about 3, their mean by 0.005.
    assert estimate == pytest.approx(slope, abs=0.03)


def test_the_buffer_judges_each_step_of_a_rollout_within_its_groups() -> None:
    space = gym.spaces.Box(-1.0, 1.0, (1,), dtype=np.float32)
    buffer = GroupBuffer(2, space, space, n_envs=4, group=2)
    rewards = np.array([[1.0, 3.0, 0.0, 0.5], [2.0, 2.0, -1.0, 1.0]], dtype=np.float32)
    ended, nothing = np.ones(4, dtype=np.bool_), torch.zeros(4)
    for row in rewards:
        buffer.add(np.zeros((4, 1)), np.zeros((4, 1)), row, ended, nothing, nothing)
    buffer.compute_returns_and_advantage(nothing, ended)
    assert buffer.advantages.tolist() == [[-2.0, 2.0, -0.5, 0.5], [0.0, 0.0, -2.0, 2.0]]
    assert buffer.returns.tolist() == rewards.tolist()


def test_an_answer_without_others_is_refused() -> None:
    with pytest.raises(ValueError, match="expected at least 2"):
        TRAININGS["ppo"](replace(QUICK, group=1), drifting(100, 0), drifting(100, 1))


def test_mirroring_twice_changes_nothing() -> None:
    samples = drifting(20, 0)
    twice = with_mirrored(with_mirrored(samples))
    assert np.array_equal(twice.features[-20:], samples.features)
    assert np.array_equal(twice.answers[-20:], samples.answers)


def test_the_graph_answers_as_the_network_does(tmp_path: Path) -> None:
    model, samples = Answering(network((32,))), drifting(100, 0)
    for weights in model.parameters():
        torch.nn.init.normal_(weights)
    curve = Curve(model, samples)
    curve.add(0)
    write_predictor(tmp_path, QUICK, model, curve, (0, 100))
    predictor = LearnedPredictor(Sensors.of(load("dynamic")), tmp_path)
    graph = open_graph(tmp_path / GRAPH, predictor.config["sha256"][GRAPH])
    (answers,) = graph.run(None, {"observation": samples.features})
    with torch.no_grad():
        expected = model(torch.from_numpy(samples.features)).numpy()
    assert answers == pytest.approx(expected, abs=1e-5)
    assert np.abs(answers).max() == 1.0


@pytest.mark.slow
def test_the_command_trains_and_writes_a_predictor(tmp_path: Path) -> None:
    out = tmp_path / "own_predictor"
    main(["ppo", "--out", str(out), "--worlds", "1", "--validation-worlds", "1", "--answers", "16384"])
    assert {path.name for path in out.iterdir()} >= {GRAPH, CONFIG, "card.md"}
    assert "# own_predictor" in (out / "card.md").read_text(encoding="utf-8")


def street(path: Path, people: int) -> Path:
    """A recording of people who walk to and fro in five lanes, each for 16 s at 1 m/s."""
    lines = ["time_s,pedestrian,x_m,y_m"]
    for who in range(people):
        lines += [f"{2.0 * who + 0.4 * k:.1f},{who},{(-1) ** who * (0.4 * k - 8.0):.1f},{who % 5}" for k in range(41)]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return path


def test_a_recording_is_learnt_from_with_the_same_command(tmp_path: Path) -> None:
    out, recording = tmp_path / "own", street(tmp_path / "street.csv", 20)
    begin = ["--real", str(recording), "--start-from", str(TRAINED_FOLDER / "rl_predictor")]
    few = ["--worlds", "2", "--validation-worlds", "1", "--epochs", "1", "--threads", "1"]
    main(["reinforce", "--out", str(out), *begin, *few])
    card = (out / "card.md").read_text(encoding="utf-8")
    assert "begun from rl_predictor" in card and "street.csv" in card
    assert isinstance(make_predictor(f"{out}/", Sensors.of(load("dynamic"))), LearnedPredictor)


def test_worlds_where_nothing_is_tracked_teach_nothing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="nothing was tracked"):
        gather([street(tmp_path / "street.csv", 20)], [])
