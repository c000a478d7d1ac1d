"""Training of a predictor by PPO of stable-baselines3: many answers are tried to each question.

An answer is measured against the others to its question (leave one out: Kool et al. 2019, "Buy 4 REINFORCE samples, get
a baseline for free!"), so that no network has to know what a question is worth; and what was tried at a horizon is
judged by the cost at that horizon.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import RolloutBufferSamples, Schedule
from stable_baselines3.common.vec_env import VecNormalize
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices
from torch import nn

from bug_gym.agents.learning.models import load_weights
from bug_gym.agents.prediction.features import ANSWERS, HORIZONS, WIDTH
from bug_gym.agents.prediction.learned import WEIGHTS, read_config
from bug_gym.agents.prediction.network import Answering, Curve, costs_at_horizons
from bug_gym.agents.prediction.samples import Samples, with_mirrored
from bug_gym.agents.prediction.settings import PredictorSettings
from bug_gym.agents.sb3 import ArrayVecEnv


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


class _EpochEnds(BaseCallback):
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
        load_weights(settings.start_from / WEIGHTS, model, read_config(settings.start_from)["sha256"][WEIGHTS])
    curve = Curve(model, validation)
    ppo.learn(settings.epochs * len(data.features), callback=_EpochEnds(settings, curve, policy.log_std))
    curve.add(ppo.num_timesteps)
    model.load_state_dict(curve.best)
    return model, curve
