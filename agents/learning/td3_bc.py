"""TD3+BC (Fujimoto and Gu 2021): TD3, whose actor also stays near the recorded actions.

The actor climbs lambda Q(s, pi(s)) - (pi(s) - a)^2 with lambda = alpha over the mean of |Q| in the batch (their equation 5),
so that alpha means the same whatever the scale of rewards. Inputs are scaled by the encoding of observations instead of by
the mean and deviation of the data set. The actor is PPO's network, whose mean is cut to [-1, 1] instead of squashed.

What came of an action is what came of some steps from it on (`n_steps`), see bug_gym.agents.learning.regression.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents.learning.regression import (
    Batch,
    TwinCritics,
    actor_parameters,
    descend,
    follow,
    mean_action,
    target_of,
)
from bug_gym.agents.learning.settings import TD3BCSettings


def actor_loss(values: torch.Tensor, answers: torch.Tensor, actions: torch.Tensor, alpha: float) -> torch.Tensor:
    """What the actor descends.

    Args:
        values: what the critic makes of its answers (b,).
        answers: of the actor (b, 2), not cut.
        actions: recorded (b, 2).
        alpha: weight of the values against that distance.
    """
    scale = alpha / values.detach().abs().mean().clamp(min=1e-9)
    return -scale * values.mean() + (answers - actions).square().mean()


def held(answers: torch.Tensor) -> torch.Tensor:
    """Answers cut to [-1, 1]; beyond, the gradient passes only where it leads back (after Hausknecht and Stone 2016).

    A plain cut would leave an answer that has gone too far where it is; with all of the gradient it would go on for ever.
    """
    cut: torch.Tensor = _Held.apply(answers)  # type: ignore[no-untyped-call]
    return cut


class _Held(torch.autograd.Function):
    """See `held`."""

    @staticmethod
    def forward(ctx: Any, answers: torch.Tensor) -> torch.Tensor:
        """The answers, cut."""
        ctx.save_for_backward(answers)
        return answers.clamp(-1.0, 1.0)

    @staticmethod
    def backward(ctx: Any, *slopes: torch.Tensor) -> torch.Tensor:
        """The gradient, but for what leads farther away."""
        (answers,), (slope,) = ctx.saved_tensors, slopes
        return torch.where((answers.abs() > 1.0) & (answers * slope < 0.0), 0.0, slope)


class TD3BC:
    """TD3+BC.

    Args:
        actor: what learns.
        settings: of the training.
    """

    def __init__(self, actor: ActorCriticPolicy, settings: TD3BCSettings) -> None:
        self.actor, self.settings = actor, settings
        self.critics = TwinCritics(actor.features_dim, settings.policy_kwargs)
        self.target_critics, self.target_actor = target_of(self.critics), target_of(actor)
        self._of_critics = torch.optim.Adam(self.critics.parameters())
        self._of_actor = torch.optim.Adam(actor_parameters(actor))
        self.optimizers = [self._of_critics, self._of_actor]
        self._updates = 0

    def update(self, batch: Batch) -> None:
        """One gradient step of the critics, and every few of them one of the actor."""
        settings = self.settings
        descend(self._of_critics, self.critics.error(batch.features, batch.actions, self._target(batch)))
        self._updates += 1
        if self._updates % settings.policy_delay:
            return
        answers = mean_action(self.actor, batch.features)
        values, _ = self.critics(batch.features, held(answers))
        descend(self._of_actor, actor_loss(values, answers, batch.actions, settings.alpha))
        follow(self.target_critics, self.critics, settings.tau)
        follow(self.target_actor, self.actor, settings.tau)

    @torch.no_grad()
    def _target(self, batch: Batch) -> torch.Tensor:
        """What the critics are to say (b,): of the next action, a little blurred, the lower value."""
        settings = self.settings
        noise = (settings.policy_noise * torch.randn_like(batch.actions)).clamp(
            -settings.noise_clip, settings.noise_clip
        )
        assert isinstance(self.target_actor, ActorCriticPolicy)
        following = (mean_action(self.target_actor, batch.following).clamp(-1.0, 1.0) + noise).clamp(-1.0, 1.0)
        values = torch.minimum(*self.target_critics(batch.following, following))
        return batch.rewards + settings.gamma * batch.goes_on * values
