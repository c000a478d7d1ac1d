"""Behaviour cloning: do what was recorded, by supervision (Pomerleau 1991).

A Gaussian's mean is fitted to the actions by maximum likelihood. Filtered cloning keeps the episodes of the highest returns
only (the "%BC" of Chen et al. 2021, section 5), which needs rewards but no critic. PPO's value is fitted beside it, for a PPO
training that begins with the clone: to the rewards up to the end of the episode and, where that was cut off and would have gone
on, what the value itself makes of its last observation, as PPO has it there.
"""

from __future__ import annotations

import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents.learning.regression import (
    Batch,
    actor_parameters,
    descend,
    mean_action,
    regression_loss,
    value,
    value_parameters,
)


class Cloning:
    """Behaviour cloning.

    Args:
        actor: what learns.
        gamma: discount of a step.
        worth: of discrete actions: what an answer is worth to each (A, A), see `near_moves`; None: to itself alone.
    """

    def __init__(self, actor: ActorCriticPolicy, gamma: float, worth: torch.Tensor | None = None) -> None:
        self.actor, self.gamma, self.worth = actor, gamma, worth
        self.optimizers = [torch.optim.Adam([*actor_parameters(actor), *value_parameters(actor)])]

    def update(self, batch: Batch) -> None:
        """One gradient step."""
        with torch.no_grad():
            target = batch.rewards + self.gamma * batch.goes_on * value(self.actor, batch.following)
        error = (value(self.actor, batch.features) - target).square().mean()
        descend(self.optimizers[0], self._error(batch) + error)

    def _error(self, batch: Batch) -> torch.Tensor:
        if self.worth is None:
            return regression_loss(self.actor, batch.features, batch.actions)
        return torch.nn.functional.cross_entropy(mean_action(self.actor, batch.features), self.worth[batch.actions])


class WithDriver:
    """Two clones of the same answers: one is kept, the other drives where DAgger asks the expert again.

    The one that drives learns the numbers of actions apart, each answer for itself, and so errs more. That is what it is for:
    it comes to more places where the one that is kept may be lost, as noise in the driver does (DART, Laskey et al. 2017).
    Along its own ways alone the better driver learnt less (docs/trials.md).

    Args:
        kept: whose actor is what a training is for.
        driver: learns as it did without `near_moves`, from a copy of that actor.
    """

    def __init__(self, kept: Cloning, driver: Cloning) -> None:
        self.kept, self.driver = kept, driver
        self.optimizers = [*kept.optimizers, *driver.optimizers]

    def update(self, batch: Batch) -> None:
        """One gradient step of both."""
        self.kept.update(batch)
        self.driver.update(batch)
