"""Training of learned predictors: by reinforcement (PPO of stable-baselines3), and the same network by supervision.

Both see the same samples of the same worlds (prediction_data), and both are judged by the same cost: the distance of
the predicted from the true place at each horizon, over what the Kalman filter's is there. The one learns from the
reward of the answers that it tried (a contextual bandit: an episode is one answer), the other from the cost's
gradient. The model that did best in the validation worlds is kept.

    python -m bug_gym.agents.prediction_training rl --out results/rl_predictor
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
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
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices
from torch import nn

from bug_gym.benchmark import machine
from bug_gym.clips import replaced_when_done
from bug_gym.held_out import TRAINING_SEEDS, VALIDATION_SEEDS

from .learned_prediction import CONFIG, GRAPH, WEIGHTS
from .model_folder import sha256
from .models import write_graph
from .prediction_data import LAWS, STREET, Samples, law_world, samples_of
from .prediction_features import (
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

PACKAGES = ("stable_baselines3", "torch", "onnx", "safetensors")
"""Packages whose versions are kept with a model."""


@dataclass(frozen=True)
class PredictorSettings:
    """How a predictor is trained."""

    kind: Literal["rl", "supervised"]
    """By PPO, or by the cost's gradient."""
    worlds: int = 600
    """Training worlds of each motion law."""
    validation_worlds: int = 25
    """Validation worlds of each motion law."""
    hidden: tuple[int, ...] = (128, 128)
    """Widths of the network's layers."""
    seed: int = 0
    """Of the weights, the order of the samples, and PPO's noise."""
    epochs: int = 8
    """Times that supervision goes through the samples, each of them as it is and mirrored."""
    batch: int = 2048
    """Samples of one of supervision's gradients."""
    rate: float = 1e-3
    """Supervision's learning rate at first; it falls to 0 as a cosine."""
    answers: int = 8_000_000
    """Answers that PPO tries."""
    rows: int = 4096
    """Answers that PPO tries side by side."""
    rollout: int = 4
    """Answers in each row from one of PPO's updates to the next."""
    ppo_batch: int = 2048
    """Answers of one of PPO's gradients."""
    ppo_epochs: int = 2
    """Times that an update of PPO goes through its answers."""
    ppo_rate: float = 1e-3
    """PPO's learning rate at first; it falls to 0 linearly."""
    log_std: float = -2.5
    """Logarithm of the noise of PPO's answers at first, of each number."""


def gather(first_seed: int, worlds: int, *, workers: int = 1) -> Samples:
    """The samples of `worlds` worlds of each law, and of as many streets."""
    seeds = range(first_seed, first_seed + worlds)
    asked = [(law, seed) for seed in seeds for law in LAWS] + [(STREET, seed) for seed in seeds]
    found = Parallel(n_jobs=workers)(delayed(samples_of)(law_world(law, seed), seed) for law, seed in asked)
    return Samples(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def with_mirrored(samples: Samples) -> Samples:
    """The samples and their mirror images."""
    return Samples(
        np.concatenate([samples.features, mirrored_features(samples.features)]),
        np.concatenate([samples.answers, mirrored_answers(samples.answers)]),
    )


class AnswerVecEnv(VecEnv):
    """Samples as episodes of one step: the action is the answer, the reward by how much it beats the Kalman filter's.

    Args:
        samples: what is asked, in an order drawn from `seed`.
        rows: how many are asked side by side.
        seed: of the order.
    """

    def __init__(self, samples: Samples, rows: int, seed: int) -> None:
        self.render_mode = None
        observation = gym.spaces.Box(-3.0, 3.0, (WIDTH,), dtype=np.float32)
        super().__init__(rows, observation, gym.spaces.Box(-1.0, 1.0, (ANSWERS,), dtype=np.float32))
        self.samples = samples
        self._filter_costs = cost_of(errors_of(np.zeros_like(samples.answers), samples.answers))
        self._rng = np.random.default_rng(seed)
        self._asked = np.zeros(rows, dtype=np.int64)
        self._given = np.zeros((rows, ANSWERS), dtype=np.float32)

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
        cost = cost_of(errors_of(self._given, self.samples.answers[self._asked]))
        rewards = (self._filter_costs[self._asked] - cost).astype(np.float32)
        ended = np.ones(self.num_envs, dtype=np.bool_)
        return self._ask(), rewards, ended, [{} for _ in range(self.num_envs)]

    def close(self) -> None:
        """Nothing is held."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of this env, once for each row."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of this env."""
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Always an AttributeError: the rows are rows of arrays."""
        raise AttributeError(f"a row of {type(self).__name__} has no method {method_name!r}")

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Never."""
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


def train_supervised(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """Train by the gradient of the cost."""
    torch.manual_seed(settings.seed)
    model = Answering(network(settings.hidden))
    data = with_mirrored(training)
    features, answers = torch.from_numpy(data.features), torch.from_numpy(data.answers)
    batches = len(features) // settings.batch
    optimizer = torch.optim.Adam(model.parameters(), settings.rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs * batches)
    curve = Curve(model, validation)
    curve.add(0)
    for epoch in range(1, settings.epochs + 1):
        for chosen in torch.randperm(len(features))[: batches * settings.batch].reshape(batches, -1):
            loss = torch_cost(model.layers(features[chosen]), answers[chosen])
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
            schedule.step()
        curve.add(epoch * batches * settings.batch)
    model.load_state_dict(curve.best)
    return model, curve


def torch_cost(given: torch.Tensor, answers: torch.Tensor) -> torch.Tensor:
    """The mean of prediction_features.cost_of, with a gradient."""
    gaps = (given - answers).reshape(len(given), len(HORIZONS), 2)
    distances = torch.sqrt(gaps.square().sum(dim=2) + 1e-12)
    scale = TOP_SPEED * HORIZONS / KALMAN_ERRORS
    return (distances * torch.as_tensor(scale, dtype=distances.dtype)).mean()


class _Validation(BaseCallback):
    """Validates PPO from time to time."""

    def __init__(self, curve: Curve, every: int) -> None:
        super().__init__()
        self.curve, self.every = curve, every

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= len(self.curve.points) * self.every:
            self.curve.add(self.num_timesteps)

    def _on_step(self) -> bool:
        return True


def train_rl(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """Train by PPO with a discount of 0: one answer, one reward."""
    env = AnswerVecEnv(with_mirrored(training), settings.rows, settings.seed)
    ppo = PPO(
        "MlpPolicy",
        env,
        learning_rate=lambda left: settings.ppo_rate * left,
        n_steps=settings.rollout,
        batch_size=settings.ppo_batch,
        n_epochs=settings.ppo_epochs,
        gamma=0.0,
        gae_lambda=0.0,
        policy_kwargs={
            "net_arch": {"pi": list(settings.hidden), "vf": [32]},
            "activation_fn": nn.ReLU,
            "log_std_init": settings.log_std,
        },
        seed=settings.seed,
        device="cpu",
    )
    policy = ppo.policy
    assert isinstance(policy, ActorCriticPolicy)
    model = Answering(nn.Sequential(*policy.mlp_extractor.policy_net, policy.action_net))
    curve = Curve(model, validation)
    ppo.learn(settings.answers, callback=_Validation(curve, settings.answers // 40))
    curve.add(ppo.num_timesteps)
    model.load_state_dict(curve.best)
    return model, curve


TRAININGS = {"rl": train_rl, "supervised": train_supervised}
"""What trains by `kind`."""


def write_predictor(
    folder: Path, settings: PredictorSettings, model: Answering, curve: Curve, samples: tuple[int, int]
) -> None:
    """Write a model and what made it into a folder; `samples`: how many of training and of validation."""
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
        "laws": [*LAWS, STREET],
        "samples": {"training": samples[0], "validation": samples[1]},
        "curve": curve.points,
        "machine": machine() | {"threads": torch.get_num_threads()} | {name: version(name) for name in PACKAGES},
        "sha256": {name: sha256((folder / name).read_bytes()) for name in (GRAPH, WEIGHTS)},
    }
    with replaced_when_done(folder / CONFIG) as partial:
        partial.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    with replaced_when_done(folder / "card.md") as partial:
        partial.write_text(card(record), encoding="utf-8")


def card(record: dict[str, Any]) -> str:
    """What people want to know of a predictor, as Markdown."""
    last, settings, made_on = record["curve"][-1], record["settings"], record["machine"]
    how = "PPO of stable-baselines3 with a discount of 0, one answer an episode" if settings["kind"] == "rl" else "Adam"
    count, tried = record["samples"], last["samples"]
    lines = [
        f"# {settings['kind']}_predictor",
        "",
        "- Task: where a tracked mover will be after 0.8, 1.6, 3.2 and 4.8 s (BugGym/Prediction-v0)",
        f"- Algorithm: {how}; layers {list(settings['hidden'])}",
        f"- Worlds: {settings['worlds']} for training and {settings['validation_worlds']} for validation of each law of "
        f"{', '.join(record['laws'])}; {count['training']:,} and {count['validation']:,} tracks in them",
        f"- {tried:,} samples in {last['seconds'] / 60:.1f} minutes ({last['cpu_seconds'] / 60:.1f} CPU minutes), seed "
        f"{settings['seed']}, on {made_on['cpu']}, {made_on['threads']} thread(s)",
        f"- Made again by `python -m bug_gym.agents.prediction_training {settings['kind']} --out FOLDER`",
        "",
        "Mean distance [m] of the predicted from the true place in the validation worlds; the first line is the Kalman "
        "filter's, from which the training begins. Held-out results: `bug-gym reproduce predictors`.",
        "",
        f"| samples | {' | '.join(f'{horizon:g} s' for horizon in record['horizons'])} |",
        "|---" * (1 + len(record["horizons"])) + "|",
    ]
    for point in record["curve"]:
        lines.append(f"| {point['samples']:,} | {' | '.join(f'{error:.3f}' for error in point['errors'])} |")
    return "\n".join([*lines, ""])


def main(arguments: Sequence[str] | None = None) -> None:
    """Train a predictor as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m bug_gym.agents.prediction_training", description=main.__doc__)
    parser.add_argument("kind", choices=sorted(TRAININGS))
    parser.add_argument("--out", type=Path, required=True, help="folder for the model")
    parser.add_argument("--seed", type=int, default=PredictorSettings.seed)
    parser.add_argument("--worlds", type=int, default=PredictorSettings.worlds, help="training worlds of each law")
    parser.add_argument("--validation-worlds", type=int, default=PredictorSettings.validation_worlds)
    parser.add_argument("--answers", type=int, default=PredictorSettings.answers, help="answers that PPO tries")
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args(arguments)
    settings = PredictorSettings(
        options.kind,
        worlds=options.worlds,
        validation_worlds=options.validation_worlds,
        answers=options.answers,
        seed=options.seed,
    )
    torch.set_num_threads(options.threads)
    training = gather(TRAINING_SEEDS, settings.worlds, workers=options.threads)
    validation = gather(VALIDATION_SEEDS, settings.validation_worlds, workers=options.threads)
    model, curve = TRAININGS[settings.kind](settings, training, validation)
    write_predictor(options.out, settings, model, curve, (len(training.features), len(validation.features)))


if __name__ == "__main__":
    main()
