"""Training of predictors: each kind learns what can be learnt, and the folder that it writes is played as it was."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution

from bug_gym.agents.learning.folder import TRAINED_FOLDER, open_graph
from bug_gym.agents.prediction import make_predictor, training
from bug_gym.agents.prediction.card import write_predictor
from bug_gym.agents.prediction.descent import tried_slopes
from bug_gym.agents.prediction.features import ANSWERS, HORIZONS, KALMAN_ERRORS, TOP_SPEED, WIDTH, cost_of, errors_of
from bug_gym.agents.prediction.learned import CONFIG, GRAPH, WEIGHTS, LearnedPredictor
from bug_gym.agents.prediction.network import Answering, Curve, costs_at_horizons, network
from bug_gym.agents.prediction.ppo import AnswerBuffer, AnswerVecEnv, TriedAnswers, gains_over_others
from bug_gym.agents.prediction.samples import Samples, with_mirrored
from bug_gym.agents.prediction.settings import PredictorSettings
from bug_gym.agents.prediction.training import TRAININGS, gather, main, train
from bug_gym.config import load
from bug_gym.view import Sensors

Kind = Literal["ppo", "reinforce", "supervised"]
KINDS = get_args(Kind)

QUICK = PredictorSettings("ppo", hidden=(32,), epochs=10, batch=256, rollout=1)


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
    settings = replace(QUICK, kind=kind, epochs=1)
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


def test_a_card_shows_how_much_a_seed_does(tmp_path: Path) -> None:
    settings = replace(QUICK, kind="supervised", epochs=2)
    samples = drifting(1000, 0), drifting(100, 1)
    train(settings, tmp_path, *samples, repeats=[1])
    record = json.loads((tmp_path / CONFIG).read_text(encoding="utf-8"))
    _, other = TRAININGS["supervised"](replace(settings, seed=1), *samples)
    costs = [point["cost"] for point in other.points]
    assert [point["cost"] for point in record["repeats"]["1"]] == costs
    text = (tmp_path / "card.md").read_text(encoding="utf-8")
    assert f"{record['curve'][-1]['cost']:.3f} | {costs[-1]:.3f} |" in text
    # No command says a batch, or a rollout.
    assert f"with the settings in {CONFIG}" in text and "Made again by" not in text


def test_a_card_judges_by_worlds_that_the_training_did_not_see(tmp_path: Path) -> None:
    settings = replace(QUICK, kind="supervised", epochs=3)
    unseen = drifting(200, 2)
    train(settings, tmp_path, drifting(1000, 0), drifting(100, 1), held_out={"drifting": unseen})
    judged = json.loads((tmp_path / CONFIG).read_text(encoding="utf-8"))["held_out"]["drifting"]
    predictor = LearnedPredictor(Sensors.of(load("dynamic")), tmp_path)
    assert judged["tracks"] == len(unseen.features)
    assert judged["errors"] == pytest.approx(
        errors_of(predictor.answer(unseen.features), unseen.answers).mean(axis=0), abs=1e-4
    )
    assert judged["filter_errors"] == pytest.approx(0.2 * TOP_SPEED * HORIZONS, abs=1e-4)
    first = f"{judged['errors'][0]:.3f} ({judged['filter_errors'][0]:.3f})"
    assert f"| drifting | {first} |" in (tmp_path / "card.md").read_text(encoding="utf-8")


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    settings = replace(QUICK, kind="supervised", epochs=1)
    model, curve = TRAININGS["supervised"](settings, drifting(1000, 0), drifting(100, 1))
    write_predictor(tmp_path, settings, model, curve, (1000, 100))
    with pytest.raises(ValueError, match="cannot be read into this network: .* has the shape"):
        TRAININGS["supervised"](
            replace(settings, hidden=(16,), start_from=tmp_path), drifting(100, 0), drifting(100, 1)
        )


def test_a_reward_is_by_how_much_the_answers_beat_the_filter() -> None:
    samples = drifting(50, 0)
    env = AnswerVecEnv(samples, 8, 0, tries=2)
    env.reset()
    right_and_filters = np.stack([samples.answers[0], np.zeros(ANSWERS, dtype=np.float32)])
    _, rewards, ended, _ = env.step(np.tile(right_and_filters, (8, 1, 1)))
    by_filter = errors_of(np.zeros((1, ANSWERS)), samples.answers[:1])
    assert env.gains[:, 0] == pytest.approx(np.tile(by_filter / KALMAN_ERRORS, (8, 1)), abs=1e-5)
    assert env.gains[:, 1] == pytest.approx(np.zeros((8, len(HORIZONS))))
    assert rewards == pytest.approx(np.full(8, 0.5 * cost_of(by_filter)[0]), abs=1e-5) and ended.all()


def others_mean(rewards: list[float], index: int) -> float:
    """Of all but one: the plain way."""
    others = rewards[:index] + rewards[index + 1 :]
    return sum(others) / len(others)


@pytest.mark.parametrize("tries", [2, 3, 8])
def test_an_answer_is_judged_by_the_others_to_its_question(tries: int) -> None:
    gains = np.random.default_rng(0).normal(size=(5, 6, tries, len(HORIZONS))).astype(np.float32)
    expected = np.empty_like(gains)
    for step, row, index, horizon in np.ndindex(gains.shape):
        own = float(gains[step, row, index, horizon])
        expected[step, row, index, horizon] = own - others_mean(gains[step, row, :, horizon].tolist(), index)
    found = gains_over_others(gains)
    assert found == pytest.approx(expected, abs=1e-5)
    assert found.sum(axis=2) == pytest.approx(np.zeros((5, 6, len(HORIZONS))), abs=1e-5)


def test_judging_by_the_others_biases_no_gradient() -> None:
    rng = np.random.default_rng(0)
    noise, slope = rng.normal(size=(100_000, 4, 2)), np.array([1.0, -2.0])
    worths = rng.normal(scale=10.0, size=(100_000, 1))  # of the questions: what the baseline has to take away
    gains = gains_over_others((worths + noise @ slope)[..., None].astype(np.float32))
    estimate = (gains * noise).mean(axis=(0, 1))
    # Each of 400,000 terms deviates by about 3, their mean by 0.005.
    assert estimate == pytest.approx(slope, abs=0.03)


def test_the_likelihood_of_an_answer_is_that_of_its_horizons() -> None:
    rng = np.random.default_rng(0)
    means, tried = (torch.from_numpy(rng.uniform(-1.0, 1.0, shape)) for shape in ((5, ANSWERS), (5, 3, ANSWERS)))
    tries = TriedAnswers(3).proba_distribution(means, torch.full((ANSWERS,), -1.0))
    plain = DiagGaussianDistribution(ANSWERS)
    expected = [plain.proba_distribution(means, torch.full((ANSWERS,), -1.0)).log_prob(tried[:, k]) for k in range(3)]
    for given in (tried, tried.flatten(start_dim=1)):
        found = tries.log_prob(given)
        assert found.shape == (5, 3, len(HORIZONS))
        assert found.sum(dim=2).numpy() == pytest.approx(torch.stack(expected, dim=1).numpy())


def test_the_buffer_keeps_what_each_answer_gained() -> None:
    env = AnswerVecEnv(drifting(5000, 0), 4, 0, tries=2)  # so many that none is asked twice
    buffer = AnswerBuffer(3, env.observation_space, env.action_space, device="cpu", n_envs=4, env=env)
    asked, gains = env.reset(), []
    nothing, likelihoods = torch.zeros(4), torch.zeros(4, 2, len(HORIZONS))
    for answers in np.random.default_rng(0).uniform(-1.0, 1.0, (3, 4, 2, ANSWERS)).astype(np.float32):
        following, rewards, ended, _ = env.step(answers)
        buffer.add(asked, answers, rewards, ended, nothing, likelihoods)
        gains.append(env.gains)
        asked = np.asarray(following)
    buffer.compute_returns_and_advantage(nothing, ended)
    samples = next(buffer.get(12))
    order = [
        int(np.flatnonzero((buffer.observations == asked).all(axis=1))[0]) for asked in samples.observations.numpy()
    ]
    # SB3 puts the steps of a row one after the other.
    expected = np.stack(gains, axis=1).reshape(12, 2, len(HORIZONS))
    assert samples.advantages.numpy() == pytest.approx(gains_over_others(expected)[order])
    assert samples.returns.numpy() == pytest.approx(expected.mean(axis=(1, 2))[order])


@pytest.mark.parametrize("tries", [0, 1, 3])
def test_answers_that_nothing_judges_are_refused(tries: int) -> None:
    with pytest.raises(ValueError, match=f"tries: got {tries}, expected an even number"):
        replace(QUICK, tries=tries)


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
    main(["ppo", "--out", str(out), "--worlds", "1", "--validation-worlds", "1", "--test-worlds", "1", "--epochs", "1"])
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


COMMAND = ["supervised", "--worlds", "1", "--validation-worlds", "1", "--test-worlds", "1", "--epochs", "1"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--threads", "0"], "threads must be at least 1, got 0"),
        (["--seeds", "0"], "seeds must be at least 1, got 0"),
        (["--seed", "-1"], "a seed is an integer from 0 to 2**63 - 1, got -1"),
        (["--seed", str(2**63 - 2), "--seeds", "3"], f"got {2**63}"),
        (["--rate", "-1"], "rate must be a number above 0, got -1.0"),
        (["--rate", "nan"], "rate must be a number above 0, got nan"),
        (["--rate", "1e38"], "rate must be at most 1e+09, got 1e+38"),
        (["--worlds", "0"], "worlds must be at least 1, got 0"),
        (["--validation-worlds", "0"], "validation_worlds must be at least 1, got 0"),
        (["--test-worlds", "0"], "test_worlds must be at least 1, got 0"),
        (["--epochs", "0"], "epochs must be at least 1, got 0"),
        (["--start-from", "/nonexist"], "no trained predictor in /nonexist: it has no predictor.json"),
        (["--out", "file"], "file: File exists"),
        (["--out", "file/below"], "file/below: Not a directory"),
        (["--out", "trained"], "trained holds another predictor: epochs was 2, is now 1"),
        (["--start-from", "damaged"], "damaged/predictor.safetensors is damaged"),
        (["--real", "nothing.csv"], "nothing.csv"),
    ],
)
def test_what_cannot_be_is_told_in_a_line_before_anything_is_gathered(
    words: list[str],
    said: str,
    quick: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def gathered(*arguments: Any, **named: Any) -> Any:
        raise AssertionError("something is gathered")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(training, "gather", gathered)
    Path("file").touch()
    for name in ("trained", "damaged"):
        shutil.copytree(quick, name)
    Path("damaged", WEIGHTS).write_bytes(b"none")
    with pytest.raises(SystemExit) as left:
        main([*COMMAND, "--out", "new", *words])
    assert left.value.code == 2 and not Path("new").exists()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("python -m bug_gym.agents.prediction.training: error: ") and said in line


def test_a_seed_that_no_generator_of_ppo_takes_is_refused() -> None:
    with pytest.raises(ValueError, match=r"a seed of PPO is below 2\*\*32, got 4294967296"):
        replace(QUICK, seed=2**32)
    assert replace(QUICK, kind="supervised", seed=2**32).seed == 2**32


def test_a_folder_is_kept_to_one_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def gathered(settings: Any, **named: Any) -> Any:
        with pytest.raises(SystemExit):
            main([*COMMAND, "--out", str(tmp_path / "new")])
        return drifting(1000, 0), drifting(100, 1)

    monkeypatch.setattr(training, "gather_for", gathered)
    monkeypatch.setattr(training, "gather_held_out", lambda *_, **__: {})
    main([*COMMAND, "--out", str(tmp_path / "new")])
    assert "new is in use: process " in capsys.readouterr().err and (tmp_path / "new" / CONFIG).is_file()


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A predictor of two epochs."""
    out = tmp_path_factory.mktemp("quick")
    settings = PredictorSettings("supervised", worlds=1, validation_worlds=1, test_worlds=1, epochs=2)
    train(settings, out, drifting(300, 0), drifting(100, 1))
    return out
