"""Training of learned predictors: by reinforcement, and the same network by supervision.

All see the same samples of the same worlds (prediction_data), and all are judged by the same cost: the distance of
the predicted from the true place at each horizon, over what the Kalman filter's is there. Reinforcement learns from the
costs of the answers that it tried (a contextual bandit: an episode is one question), supervision from the cost's
gradient. Reinforcement tries many answers to each question, and judges what was tried at a horizon by the cost at that
horizon. There are two of this kind. PPO of stable-baselines3 measures an answer against the others to its question (leave
one out: Kool et al. 2019, "Buy 4 REINFORCE samples, get a baseline for free!"), so that no network has to know what a
question is worth. REINFORCE (Williams 1992) tries them in pairs to either side of the network's own, so that what both
have in common cancels. The model that did best in the validation worlds is kept.

    python -m bug_gym.agents.prediction_training ppo --out results/rl_predictor
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import torch
from joblib import Parallel, delayed
from numpy.typing import NDArray
from safetensors.torch import save
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import RolloutBufferSamples, Schedule
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices
from torch import nn

from bug_gym.agents.learning.folder import read_record, sha256
from bug_gym.agents.learning.models import load_weights, write_graph
from bug_gym.agents.prediction.features import (
    ANSWERS,
    HORIZONS,
    KALMAN_ERRORS,
    TOP_SPEED,
    WIDTH,
    cost_of,
    errors_of,
    mirrored_answers,
    mirrored_features,
)
from bug_gym.agents.prediction.learned import CONFIG, GRAPH, WEIGHTS
from bug_gym.agents.prediction.samples import LAWS, STREET, Samples, samples_of, world_of
from bug_gym.agents.sb3 import ArrayVecEnv
from bug_gym.files import machine, replaced_when_done
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS

PACKAGES = ("stable_baselines3", "torch", "onnx", "safetensors")
"""Packages whose versions are kept with a model."""


@dataclass(frozen=True)
class PredictorSettings:
    """How a predictor is trained."""

    kind: Literal["ppo", "reinforce", "supervised"]
    """By PPO, by REINFORCE, or by the cost's gradient."""
    worlds: int = 600
    """Training worlds of each motion law, or crossings of the recorded pedestrians."""
    validation_worlds: int = 25
    """The same for validation."""
    test_worlds: int = 50
    """Held-out worlds of each law, by which the card judges it."""
    real: Path | None = None
    """Recorded pedestrians to learn from instead of the laws."""
    start_from: Path | None = None
    """Folder of a predictor whose weights it begins with; None: from scratch."""
    hidden: tuple[int, ...] = (256, 256)
    """Widths of the network's layers; `train` takes those of `start_from` where there is one."""
    seed: int = 0
    """Of the weights, the order of the samples, and PPO's noise."""
    epochs: int = 15
    """Times that the samples are gone through, each of them as it is and mirrored; PPO draws as many."""
    batch: int = 2048
    """Samples of a gradient."""
    rate: float = 1e-3
    """Learning rate at first; it falls to 0, for PPO linearly, else as a cosine."""
    tries: int = 16
    """Answers that reinforcement tries to a question."""
    rollout: int = 4
    """Batches that PPO collects before it learns from them."""
    clip_range: float = 1.0
    """By what share PPO lets the likelihood of what it tried change; with little noise it changes soon."""
    max_grad_norm: float = 10.0
    """Length that PPO's gradients are cut to; they grow as the noise shrinks."""
    log_std: float = -2.5
    """Logarithm of the noise of tried answers at first, of each number."""
    last_log_std: float = -4.0
    """The same at the end; between them it falls evenly."""

    def __post_init__(self) -> None:
        if self.tries < 2 or self.tries % 2:
            raise ValueError(f"tries: got {self.tries}, expected an even number of answers")

    @property
    def sources(self) -> tuple[str | Path, ...]:
        """What it learns from, as prediction_data.world_of takes it."""
        return (*LAWS, STREET) if self.real is None else (self.real,)


def gather(sources: Sequence[str | Path], seeds: Sequence[int], *, workers: int = 1) -> Samples:
    """The samples of a world of each source (see prediction_data.world_of) and seed.

    Raises:
        ValueError: not one mover was tracked in them.
    """
    asked = [(source, seed) for seed in seeds for source in sources]
    found = Parallel(n_jobs=workers)(delayed(samples_of)(world_of(source, seed), seed) for source, seed in asked)
    if not any(len(samples.features) for samples in found):
        raise ValueError(f"nothing was tracked in {len(asked)} worlds of {', '.join(map(str, sources))}")
    return Samples(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def gather_for(settings: PredictorSettings, *, workers: int = 1) -> tuple[Samples, Samples]:
    """The samples of a training and of its validation."""
    training = range(TRAINING_SEEDS, TRAINING_SEEDS + settings.worlds)
    validation = range(VALIDATION_SEEDS, VALIDATION_SEEDS + settings.validation_worlds)
    return (
        gather(settings.sources, training, workers=workers),
        gather(settings.sources, validation, workers=workers),
    )


def gather_held_out(settings: PredictorSettings, *, workers: int = 1) -> dict[str, Samples]:
    """The samples of worlds that neither training nor validation saw, by motion law; of a recording none are left."""
    if settings.real is not None:
        return {}
    seeds = range(TEST_SEEDS, TEST_SEEDS + settings.test_worlds)
    return {str(law): gather([law], seeds, workers=workers) for law in settings.sources}


def with_mirrored(samples: Samples) -> Samples:
    """The samples and their mirror images."""
    return Samples(
        np.concatenate([samples.features, mirrored_features(samples.features)]),
        np.concatenate([samples.answers, mirrored_answers(samples.answers)]),
    )


class AnswerVecEnv(ArrayVecEnv):
    """Samples as episodes of one step: an action is some answers, the reward by how much they beat the Kalman filter's.

    What each answer gains at each horizon stands in `gains` (rows, tries, HORIZONS); a reward is the mean of a row.

    Args:
        samples: what is asked, in an order drawn from `seed`.
        rows: how many are asked side by side.
        seed: of the order.
        tries: how many answers each of them gets.
    """

    def __init__(self, samples: Samples, rows: int, seed: int, *, tries: int) -> None:
        self.render_mode = None
        observation = gym.spaces.Box(-3.0, 3.0, (WIDTH,), dtype=np.float32)
        super().__init__(rows, observation, gym.spaces.Box(-1.0, 1.0, (tries, ANSWERS), dtype=np.float32))
        self.samples = samples
        self.gains: NDArray[np.float32] = np.zeros((rows, tries, len(HORIZONS)), dtype=np.float32)
        self._rng = np.random.default_rng(seed)
        self._asked = np.zeros(rows, dtype=np.int64)
        self._given = np.zeros((rows, tries, ANSWERS), dtype=np.float32)

    def _ask(self) -> NDArray[np.float32]:
        self._asked = self._rng.integers(len(self.samples.features), size=self.num_envs)
        return self.samples.features[self._asked]

    def reset(self) -> NDArray[np.float32]:
        """The first questions."""
        return self._ask()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Take the answers of the next `step_wait`."""
        self._given = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Rewards of the answers, and the next questions."""
        right = torch.from_numpy(self.samples.answers[self._asked])[:, None]
        costs = costs_at_horizons(torch.from_numpy(self._given), right)
        self.gains = (costs_at_horizons(torch.zeros_like(right), right) - costs).numpy()
        ended = np.ones(self.num_envs, dtype=np.bool_)
        return self._ask(), self.gains.mean(axis=(1, 2)), ended, [{} for _ in range(self.num_envs)]

    def close(self) -> None:
        """Nothing is held."""

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Never: infos hold nothing."""
        return [False for _ in self._get_indices(indices)]


class Answering(nn.Module):
    """A network (n, WIDTH) -> (n, ANSWERS) in [-1, 1]."""

    def __init__(self, layers: nn.Module) -> None:
        super().__init__()
        self.layers = layers

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """The answers."""
        return torch.clamp(self.layers(features), -1.0, 1.0)


def network(hidden: Sequence[int]) -> nn.Sequential:
    """Layers of the widths given, with rectifiers between; its first answers are near 0, the filter's."""
    widths = [WIDTH, *hidden]
    layers: list[nn.Module] = []
    for before, after in zip(widths, widths[1:], strict=False):
        layers += [nn.Linear(before, after), nn.ReLU()]
    last = nn.Linear(widths[-1], ANSWERS)
    nn.init.uniform_(last.weight, -1e-3, 1e-3)
    nn.init.zeros_(last.bias)
    return nn.Sequential(*layers, last)


def validation_errors(model: nn.Module, samples: Samples) -> NDArray[np.float64]:
    """Mean distances (HORIZONS,) of a model's predicted places from the true ones [m]."""
    with torch.no_grad():
        given = model(torch.from_numpy(samples.features)).numpy()
    means: NDArray[np.float64] = errors_of(given, samples.answers).mean(axis=0)
    return means


class Curve:
    """Validations of a training; keeps the weights that did best."""

    def __init__(self, model: nn.Module, samples: Samples) -> None:
        self.model, self.samples = model, samples
        self.begun, self.cpu_begun = time.perf_counter(), time.process_time()
        self.points: list[dict[str, Any]] = []
        self.best: dict[str, torch.Tensor] = {}
        self.best_errors: NDArray[np.float64] = np.full(len(HORIZONS), np.inf)

    def add(self, step: int) -> None:
        """Validate after so many samples."""
        errors = validation_errors(self.model, self.samples)
        cost = float(cost_of(errors[None])[0])
        self.points.append(
            {
                "samples": step,
                "seconds": round(time.perf_counter() - self.begun, 1),
                "cpu_seconds": round(time.process_time() - self.cpu_begun, 1),
                "cost": round(cost, 4),
                "errors": [round(error, 4) for error in errors.tolist()],
            }
        )
        if cost < cost_of(self.best_errors[None])[0]:
            self.best_errors = errors
            self.best = {name: value.detach().clone() for name, value in self.model.state_dict().items()}


Loss = Callable[[torch.Tensor, torch.Tensor, float], torch.Tensor]
"""Of the network's answers and the right ones (n, ANSWERS), after a share of the training."""


def descend(settings: PredictorSettings, training: Samples, validation: Samples, loss: Loss) -> tuple[Answering, Curve]:
    """Train by the gradient of a loss."""
    torch.manual_seed(settings.seed)
    model = Answering(network(settings.hidden))
    if settings.start_from is not None:
        load_weights(settings.start_from / WEIGHTS, model)
    data = with_mirrored(training)
    features, answers = torch.from_numpy(data.features), torch.from_numpy(data.answers)
    batch = min(settings.batch, len(features))
    batches = len(features) // batch
    optimizer = torch.optim.Adam(model.parameters(), settings.rate)
    steps = settings.epochs * batches
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    curve = Curve(model, validation)
    curve.add(0)
    for epoch in range(1, settings.epochs + 1):
        for chosen in torch.randperm(len(features))[: batches * batch].reshape(batches, -1):
            optimizer.zero_grad()
            torch.autograd.backward(loss(model.layers(features[chosen]), answers[chosen], schedule.last_epoch / steps))
            optimizer.step()
            schedule.step()
        curve.add(epoch * batches * batch)
    model.load_state_dict(curve.best)
    return model, curve


def costs_at_horizons(given: torch.Tensor, right: torch.Tensor) -> torch.Tensor:
    """The terms (..., HORIZONS) whose mean is prediction_features.cost_of, of answers (..., ANSWERS)."""
    gaps = given - right
    squares = gaps.square().reshape(*gaps.shape[:-1], len(HORIZONS), 2)
    distances = torch.sqrt(squares.sum(dim=-1) + 1e-12)
    return distances * torch.as_tensor(TOP_SPEED * HORIZONS / KALMAN_ERRORS, dtype=distances.dtype)


def train_supervised(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """Train by the gradient of the cost."""
    return descend(settings, training, validation, lambda given, right, done: costs_at_horizons(given, right).mean())


def train_reinforce(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """Train by the costs of tried answers; their noise shrinks geometrically."""

    def loss(given: torch.Tensor, right: torch.Tensor, done: float) -> torch.Tensor:
        noise = math.exp(settings.log_std + done * (settings.last_log_std - settings.log_std))
        slopes = tried_slopes(given.detach(), right, noise=noise, pairs=settings.tries // 2)
        return (slopes * given).sum(dim=1).mean()

    return descend(settings, training, validation, loss)


def tried_slopes(given: torch.Tensor, right: torch.Tensor, *, noise: float, pairs: int) -> torch.Tensor:
    """By how much the expected cost of a noisy answer grows with each number of the answer (n, ANSWERS).

    It is REINFORCE's estimate, from the costs of answers on either side; what was tried at one horizon is judged by the
    cost at that horizon.

    Args:
        given: the answers (n, ANSWERS) about which others are tried.
        right: the right answers (n, ANSWERS), which only the costs know.
        noise: standard deviation of each number.
        pairs: how many pairs of answers are tried.
    """
    way = noise * torch.randn(pairs, *given.shape)
    above, below = (costs_at_horizons(torch.clamp(given + sign * way, -1.0, 1.0), right) for sign in (1.0, -1.0))
    gains = (0.5 * (above - below) / len(HORIZONS)).repeat_interleave(2, dim=-1)
    slopes: torch.Tensor = (gains * way).mean(dim=0) / noise**2
    return slopes


class TriedAnswers(DiagGaussianDistribution):
    """Independent answers to each question about the network's own; each of their horizons has its own likelihood."""

    def __init__(self, tries: int) -> None:
        super().__init__(ANSWERS)
        self.tries = tries

    def proba_distribution(self, mean_actions: torch.Tensor, log_std: torch.Tensor) -> TriedAnswers:
        """About the network's answers (n, ANSWERS)."""
        return super().proba_distribution(mean_actions[:, None].expand(-1, self.tries, -1), log_std)

    def log_prob(self, actions: torch.Tensor) -> torch.Tensor:
        """Of tried answers (n, tries, ANSWERS), or flat: (n, tries, HORIZONS)."""
        normal: Any = self.distribution  # torch's distributions are untyped
        each: torch.Tensor = normal.log_prob(actions.reshape(-1, self.tries, ANSWERS))
        return each.reshape(-1, self.tries, len(HORIZONS), 2).sum(dim=-1)


class AnsweringPolicy(ActorCriticPolicy):
    """A policy of stable-baselines3 whose actions are TriedAnswers."""

    action_space: gym.spaces.Box

    def _build(self, lr_schedule: Schedule) -> None:
        self.action_dist = TriedAnswers(self.action_space.shape[0])
        super()._build(lr_schedule)


def gains_over_others(gains: NDArray[np.float32]) -> NDArray[np.float32]:
    """By how much each answer's gains (..., tries, HORIZONS) are above the mean of the others' to its question."""
    tries = gains.shape[-2]
    others: NDArray[np.float32] = (gains.sum(axis=-2, keepdims=True) - gains) / (tries - 1)
    return gains - others


class AnswerBuffer(RolloutBuffer):
    """PPO's rollouts, with a likelihood and an advantage of each answer at each horizon.

    PPO's loss is a mean over its elements, whatever they are: so each of them has its own ratio and is clipped by itself.
    An answer is judged by the others to its question. They know nothing of its noise, so that nothing is biased.

    Args:
        env: whose gains are judged.
    """

    def __init__(self, *args: Any, env: AnswerVecEnv, **kwargs: Any) -> None:
        self.env = env
        super().__init__(*args, **kwargs)

    def reset(self) -> None:
        """Forget all."""
        super().reset()
        shape = (self.buffer_size, *self.env.gains.shape)
        self.gains, self.log_probs = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)

    def add(self, *args: Any, **kwargs: Any) -> None:
        """Keep one step of all rows, and what its answers gained."""
        self.gains[self.pos] = self.env.gains
        super().add(*args, **kwargs)

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: NDArray[np.bool_]) -> None:
        """Advantages of episodes of one step; what the value network says is not asked."""
        self.advantages, self.returns = gains_over_others(self.gains), self.rewards

    def _get_samples(self, batch_inds: NDArray[np.int64], env: VecNormalize | None = None) -> RolloutBufferSamples:
        parts = (self.observations, self.actions, self.values, self.log_probs, self.advantages, self.returns)
        observations, actions, values, log_probs, advantages, returns = (
            self.to_torch(part[batch_inds]) for part in parts
        )
        return RolloutBufferSamples(observations, actions, values.flatten(), log_probs, advantages, returns.flatten())


class _Progress(BaseCallback):
    """Validates PPO after each epoch, and shrinks its noise."""

    def __init__(self, settings: PredictorSettings, curve: Curve, log_std: torch.Tensor) -> None:
        super().__init__()
        self.settings, self.curve, self.log_std = settings, curve, log_std

    def _on_rollout_start(self) -> None:
        settings = self.settings
        done = self.num_timesteps / self.locals["total_timesteps"]
        self.log_std.fill_(settings.log_std + done * (settings.last_log_std - settings.log_std))
        if done >= len(self.curve.points) / settings.epochs:
            self.curve.add(self.num_timesteps)

    def _on_step(self) -> bool:
        return True


def train_ppo(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """Train by PPO of stable-baselines3; its value network learns nothing, as AnswerBuffer doesn't ask it."""
    data = with_mirrored(training)
    env = AnswerVecEnv(data, min(settings.batch, len(data.features)), settings.seed, tries=settings.tries)
    ppo = PPO(
        AnsweringPolicy,
        env,
        learning_rate=lambda left: settings.rate * left,
        n_steps=settings.rollout,
        batch_size=env.num_envs,
        n_epochs=1,
        clip_range=settings.clip_range,
        max_grad_norm=settings.max_grad_norm,
        vf_coef=0.0,
        rollout_buffer_class=AnswerBuffer,
        rollout_buffer_kwargs={"env": env},
        policy_kwargs={"net_arch": {"pi": list(settings.hidden), "vf": []}, "activation_fn": nn.ReLU},
        seed=settings.seed,
        device="cpu",
    )
    policy = ppo.policy
    assert isinstance(policy, AnsweringPolicy)
    policy.log_std.requires_grad_(False)
    model = Answering(nn.Sequential(*policy.mlp_extractor.policy_net, policy.action_net))
    if settings.start_from is not None:
        load_weights(settings.start_from / WEIGHTS, model)
    curve = Curve(model, validation)
    ppo.learn(settings.epochs * len(data.features), callback=_Progress(settings, curve, policy.log_std))
    curve.add(ppo.num_timesteps)
    model.load_state_dict(curve.best)
    return model, curve


TRAININGS = {"ppo": train_ppo, "reinforce": train_reinforce, "supervised": train_supervised}
"""What trains by `kind`."""


HOW = {
    "ppo": "PPO of stable-baselines3, each answer judged by the others to its question",
    "reinforce": "REINFORCE, answers tried in pairs on either side",
    "supervised": "supervision by the gradient of the cost",
}
"""What a card says of them."""


def train(
    settings: PredictorSettings,
    out: Path,
    training: Samples,
    validation: Samples,
    *,
    held_out: Mapping[str, Samples] | None = None,
    repeats: Sequence[int] = (),
) -> None:
    """Train a predictor and write it into a folder; one that begins with another's weights has its layers.

    Args:
        settings: what it learns, and how.
        out: the folder.
        training: what it learns from.
        validation: what the best weights are chosen by.
        held_out: what it is judged by in the end, by name.
        repeats: other seeds to train with, to see how much depends on the seed; only their curves are kept.
    """
    if settings.start_from is not None:
        begun = read_record(settings.start_from / CONFIG, "predictor", {"settings"})["settings"]
        settings = replace(settings, hidden=tuple(begun["hidden"]))
    model, curve = TRAININGS[settings.kind](settings, training, validation)
    curves = {seed: TRAININGS[settings.kind](replace(settings, seed=seed), training, validation)[1] for seed in repeats}
    counts = len(training.features), len(validation.features)
    repeated = {seed: one.points for seed, one in curves.items()}
    write_predictor(out, settings, model, curve, counts, held_out=held_out, repeats=repeated)


def write_predictor(
    folder: Path,
    settings: PredictorSettings,
    model: Answering,
    curve: Curve,
    samples: tuple[int, int],
    *,
    held_out: Mapping[str, Samples] | None = None,
    repeats: Mapping[int, list[dict[str, Any]]] | None = None,
) -> None:
    """Write a model and what made it into a folder.

    Args:
        folder: where to.
        settings: how it was trained.
        model: the network.
        curve: of its training.
        samples: how many there were for training and for validation.
        held_out: others, by name, that it is judged by.
        repeats: curves of the same training with other seeds.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_graph(folder / GRAPH, model.eval(), (WIDTH,))
    with replaced_when_done(folder / WEIGHTS) as partial:
        partial.write_bytes(save({name: value.contiguous() for name, value in model.state_dict().items()}))
    record = {
        "kind": settings.kind,
        "width": WIDTH,
        "horizons": HORIZONS.tolist(),
        "errors": [round(error, 4) for error in curve.best_errors.tolist()],
        "settings": asdict(settings),
        "sources": [source.name if isinstance(source, Path) else source for source in settings.sources],
        "samples": {"training": samples[0], "validation": samples[1]},
        "held_out": {name: judged(model, some) for name, some in (held_out or {}).items()},
        "curve": curve.points,
        "repeats": {str(seed): points for seed, points in (repeats or {}).items()},
        "machine": machine() | {"threads": torch.get_num_threads()} | {name: version(name) for name in PACKAGES},
        "sha256": {name: sha256((folder / name).read_bytes()) for name in (GRAPH, WEIGHTS)},
    }
    with replaced_when_done(folder / CONFIG) as partial:
        partial.write_text(json.dumps(record, indent=1, default=str) + "\n", encoding="utf-8")
    with replaced_when_done(folder / "card.md") as partial:
        partial.write_text(card(folder.name, record), encoding="utf-8")


def judged(model: nn.Module, samples: Samples) -> dict[str, Any]:
    """Number of samples, and mean errors [m] (HORIZONS,) of a model's predictions and of the Kalman filter's in them."""
    by_filter = errors_of(np.zeros_like(samples.answers), samples.answers).mean(axis=0)
    by_model = validation_errors(model, samples)
    return {
        "tracks": len(samples.features),
        "errors": [round(error, 4) for error in by_model.tolist()],
        "filter_errors": [round(error, 4) for error in by_filter.tolist()],
    }


def card(name: str, record: dict[str, Any]) -> str:
    """What people want to know of a predictor, as Markdown."""
    last, settings, made_on = record["curve"][-1], record["settings"], record["machine"]
    count, tried = record["samples"], last["samples"]
    begun = f", begun from {Path(settings['start_from']).name}" if settings["start_from"] else ""
    seeds = f" --seeds {1 + len(record['repeats'])}" if record["repeats"] else ""
    each = "" if settings["kind"] == "supervised" else f", {settings['tries']} answers to each"
    columns = " | ".join(f"{horizon:g} s" for horizon in record["horizons"])
    rule = "|---" * (1 + len(record["horizons"])) + "|"
    lines = [
        f"# {name}",
        "",
        "- Task: where a tracked mover will be after 0.8, 1.6, 3.2 and 4.8 s (BugGym/Prediction-v0)",
        f"- Algorithm: {HOW[settings['kind']]}; layers {list(settings['hidden'])}{begun}",
        f"- Worlds: {settings['worlds']} for training and {settings['validation_worlds']} for validation of each of "
        f"{', '.join(record['sources'])}; {count['training']:,} and {count['validation']:,} tracks in them",
        f"- {tried:,} samples{each}, in {last['seconds'] / 60:.1f} minutes ({last['cpu_seconds'] / 60:.1f} CPU minutes), "
        f"seed {settings['seed']}, on {made_on['cpu']}, {made_on['threads']} thread(s)",
        f"- Made again by `python -m bug_gym.agents.prediction_training {settings['kind']}{seeds} --out FOLDER`",
        "",
    ]
    if record["held_out"]:
        lines += [
            f"Mean distance [m] of the predicted from the true place in {settings['test_worlds']} worlds each that neither "
            "training nor validation saw, and the Kalman filter's after it; `bug-gym reproduce predictors` asks all of "
            "them at more times, with intervals.",
            "",
            f"| worlds | {columns} |",
            rule,
        ]
        for source, one in record["held_out"].items():
            pairs = zip(one["errors"], one["filter_errors"], strict=True)
            lines.append(f"| {source} | {' | '.join(f'{error:.3f} ({filters:.3f})' for error, filters in pairs)} |")
        lines.append("")
    lines += [
        "The same in the validation worlds, as it learned; the first line is about the Kalman filter's where the training "
        "begins from scratch.",
        "",
        f"| samples | {columns} |",
        rule,
    ]
    for point in record["curve"]:
        lines.append(f"| {point['samples']:,} | {' | '.join(f'{error:.3f}' for error in point['errors'])} |")
    if record["repeats"]:
        curves = {settings["seed"]: record["curve"], **record["repeats"]}
        title = (
            f"The same over prediction_features.KALMAN_ERRORS, in the mean; the model is of seed {settings['seed']}:"
        )
        lines += ["", title, "", f"| samples | {' | '.join(f'seed {seed}' for seed in curves)} |"]
        lines += ["|---" * (1 + len(curves)) + "|"]
        for points in zip(*curves.values(), strict=True):
            lines.append(
                f"| {points[0]['samples']:,} | {' | '.join(format(point['cost'], '.3f') for point in points)} |"
            )
    return "\n".join([*lines, ""])


def main(arguments: Sequence[str] | None = None) -> None:
    """Train a predictor as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m bug_gym.agents.prediction_training", description=main.__doc__)
    parser.add_argument("kind", choices=sorted(TRAININGS))
    parser.add_argument("--out", type=Path, required=True, help="folder for the model")
    parser.add_argument("--seed", type=int, default=PredictorSettings.seed, help="of the model")
    parser.add_argument(
        "--seeds", type=int, default=1, help="how many times it is trained, to see how much a seed does"
    )
    parser.add_argument("--worlds", type=int, default=PredictorSettings.worlds, help="training worlds of each law")
    parser.add_argument("--validation-worlds", type=int, default=PredictorSettings.validation_worlds)
    parser.add_argument(
        "--test-worlds", type=int, default=PredictorSettings.test_worlds, help="held-out worlds of each law"
    )
    parser.add_argument("--epochs", type=int, default=PredictorSettings.epochs)
    parser.add_argument("--rate", type=float, default=PredictorSettings.rate, help="learning rate at first")
    parser.add_argument("--real", type=Path, help="recorded pedestrians (csv) to learn from instead of the laws")
    parser.add_argument("--start-from", type=Path, help="folder of a predictor to train on")
    parser.add_argument("--threads", type=int, default=2)
    options = vars(parser.parse_args(arguments))
    out, threads, seeds = options.pop("out"), options.pop("threads"), options.pop("seeds")
    torch.set_num_threads(threads)
    settings = PredictorSettings(**options)
    repeats = range(settings.seed + 1, settings.seed + seeds)
    samples = gather_for(settings, workers=threads)
    train(settings, out, *samples, held_out=gather_held_out(settings, workers=threads), repeats=repeats)


if __name__ == "__main__":
    main()
