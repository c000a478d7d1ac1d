"""Implicit Q-learning (Kostrikov, Nair and Levine 2021): values of good recorded actions, without asking about others.

The value of a state is an upper expectile of what its recorded actions were worth (equation 5), an action's worth its reward
and the value of what came of it (equation 6), and the actor is fitted to the recorded actions, each weighted by
exp(beta * advantage) (equation 7), at most 100 as in the authors' code.

What came of an action is what came of some steps from it on (`n_steps`), see bug_gym.agents.learning.regression.
"""

from __future__ import annotations

import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents.learning.regression import (
    Batch,
    TwinCritics,
    actor_parameters,
    descend,
    follow,
    regression_loss,
    target_of,
    value,
    value_parameters,
)
from bug_gym.agents.learning.settings import IQLSettings

MOST_WEIGHT = 100.0
"""No action weighs more than this."""


def expectile_loss(differences: torch.Tensor, expectile: float) -> torch.Tensor:
    """Mean of |expectile - 1(d < 0)| d^2 over differences d (b,): what lies above weighs `expectile`, below the rest."""
    weights = torch.where(differences < 0.0, 1.0 - expectile, expectile)
    return (weights * differences.square()).mean()


class IQL:
    """Implicit Q-learning; the value is PPO's own critic, so that a PPO training can begin with it.

    Args:
        actor: what learns.
        settings: of the training.
    """

    def __init__(self, actor: ActorCriticPolicy, settings: IQLSettings) -> None:
        self.actor, self.settings = actor, settings
        self.critics = TwinCritics(actor.features_dim, settings.policy_kwargs)
        self.targets = target_of(self.critics)
        self._of_value = torch.optim.Adam(value_parameters(actor))
        self._of_critics = torch.optim.Adam(self.critics.parameters())
        self._of_actor = torch.optim.Adam(actor_parameters(actor))
        self.optimizers = [self._of_value, self._of_critics, self._of_actor]

    def update(self, batch: Batch) -> None:
        """One gradient step of the value, the actor and the critics, in the order of the authors' code."""
        settings = self.settings
        with torch.no_grad():
            worth = torch.minimum(*self.targets(batch.features, batch.actions))
        differences = worth - value(self.actor, batch.features)
        descend(self._of_value, expectile_loss(differences, settings.expectile))
        with torch.no_grad():
            advantages = worth - value(self.actor, batch.features)
            weights = torch.exp(settings.beta * advantages).clamp(max=MOST_WEIGHT)
            target = batch.rewards + settings.gamma * batch.goes_on * value(self.actor, batch.following)
        descend(self._of_actor, regression_loss(self.actor, batch.features, batch.actions, weights))
        descend(self._of_critics, self.critics.error(batch.features, batch.actions, target))
        follow(self.targets, self.critics, settings.tau)
