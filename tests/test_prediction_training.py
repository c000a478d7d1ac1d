"""Training of predictors: each kind learns what can be learnt, and the folder that it writes is played as it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
pytest.importorskip("onnxruntime")

from bug_gym.agents.learned_prediction import CONFIG, GRAPH, LearnedPredictor  # noqa: E402
from bug_gym.agents.model_folder import open_graph  # noqa: E402
from bug_gym.agents.prediction_data import Samples  # noqa: E402
from bug_gym.agents.prediction_features import ANSWERS, WIDTH, cost_of, errors_of  # noqa: E402
from bug_gym.agents.prediction_training import (  # noqa: E402
    TRAININGS,
    Answering,
    AnswerVecEnv,
    Curve,
    PredictorSettings,
    main,
    network,
    torch_cost,
    with_mirrored,
    write_predictor,
)
from bug_gym.config import load  # noqa: E402
from bug_gym.observation import Sensors  # noqa: E402

Kind = Literal["rl", "supervised"]
KINDS = get_args(Kind)

QUICK = PredictorSettings("rl", hidden=(32,), epochs=10, batch=256, answers=60_000, rows=512, rollout=1, ppo_batch=256)


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
    assert torch_cost(torch.from_numpy(given), torch.from_numpy(right)).item() == pytest.approx(
        cost_of(errors_of(given, right)).mean()
    )


def test_a_reward_is_by_how_much_the_answer_beats_the_filter() -> None:
    samples = drifting(50, 0)
    env = AnswerVecEnv(samples, 8, 0)
    env.reset()
    _, rewards, ended, _ = env.step(np.tile(samples.answers[0], (8, 1)))
    filters = cost_of(errors_of(np.zeros((1, ANSWERS)), samples.answers[:1]))[0]
    assert rewards == pytest.approx(np.full(8, filters), abs=1e-6) and ended.all()
    env.step(np.zeros((8, ANSWERS), dtype=np.float32))
    assert env.step(np.zeros((8, ANSWERS), dtype=np.float32))[1] == pytest.approx(np.zeros(8))


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
    main(["rl", "--out", str(tmp_path), "--worlds", "1", "--validation-worlds", "1", "--answers", "16384"])
    assert {path.name for path in tmp_path.iterdir()} >= {GRAPH, CONFIG, "card.md"}
    assert "rl_predictor" in (tmp_path / "card.md").read_text(encoding="utf-8")
