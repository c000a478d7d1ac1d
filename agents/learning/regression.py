"""What offline algorithms share: the actor, which is PPO's network, its regression onto actions, and critics.

The actor answers with the mean of a Gaussian, cut to [-1, 1] in play. It is the network of stable-baselines3's PPO, key for
key, so that a PPO training can begin with a cloned model and the other way round.

What came of an action is, to a critic, what came of some steps from it on (`n_steps`), as recorded: with steps of 0.1 s what
lies one second ahead would else be ten targets away, each of which follows slowly. That looks at more than the one action; what
was worth a second of good driving is then known soon, at the price that the seconds are those of who drove.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import gymnasium as gym
import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents.learning.settings import PolicyKwargs

LEAST_LOG_STD = -2.0
"""Lowest logarithm of the standard deviation of actions; below it, the last bits of an action would decide."""


class Batch(NamedTuple):
    """Some steps (b,) of recorded episodes."""

    features: torch.Tensor
    """What the network sees, encoded (b, F)."""
    actions: torch.Tensor
    """(b, 2)."""
    rewards: torch.Tensor
    """(b,), scaled; of several steps their discounted sum."""
    following: torch.Tensor
    """Features of what came of it, or of those steps (b, F)."""
    goes_on: torch.Tensor
    """What `following` counts for (b,), beside the discount of one step: 0 where the episode terminated, 1 after one step."""


class Learner(Protocol):
    """An algorithm: it changes the actor's weights, batch by batch."""

    @property
    def optimizers(self) -> Sequence[torch.optim.Optimizer]:
        """Whose step sizes a training sets."""
        ...

    def update(self, batch: Batch) -> None:
        """Take one gradient step of each of its networks."""
        ...


def is_discrete(actor: ActorCriticPolicy) -> bool:
    """Whether the actor answers with the number of an action."""
    return isinstance(actor.action_space, gym.spaces.Discrete)


def mean_action(actor: ActorCriticPolicy, features: torch.Tensor) -> torch.Tensor:
    """The actor's answer (b, 2) before it is cut to [-1, 1]; logarithms of odds (b, A) where actions are discrete."""
    answer: torch.Tensor = actor.action_net(actor.mlp_extractor.forward_actor(features))
    return answer


def actor_parameters(actor: ActorCriticPolicy) -> list[torch.nn.Parameter]:
    """The weights that an action depends on, and its standard deviation where it has one."""
    spread = [] if is_discrete(actor) else [actor.log_std]
    return [*actor.mlp_extractor.policy_net.parameters(), *actor.action_net.parameters(), *spread]


def value_parameters(actor: ActorCriticPolicy) -> list[torch.nn.Parameter]:
    """The weights of the value that PPO begins with."""
    return [*actor.mlp_extractor.value_net.parameters(), *actor.value_net.parameters()]


def value(actor: ActorCriticPolicy, features: torch.Tensor) -> torch.Tensor:
    """What the actor's own critic, PPO's, makes of some features (b,)."""
    found: torch.Tensor = actor.value_net(actor.mlp_extractor.forward_critic(features))[:, 0]
    return found


def regression_loss(
    actor: ActorCriticPolicy, features: torch.Tensor, actions: torch.Tensor, weights: torch.Tensor | None = None
) -> torch.Tensor:
    """Mean negative logarithm of what the actor gives some actions, weighted by (b,).

    Of actions (b, 2) it is the density of a Gaussian; of numbers (b,) of discrete actions the probability, which can be high
    for two ways round an obstacle and low for the one between them.
    """
    if is_discrete(actor):
        losses = torch.nn.functional.cross_entropy(mean_action(actor, features), actions, reduction="none")
        return (losses if weights is None else weights * losses).mean()
    log_std = torch.clamp(actor.log_std, min=LEAST_LOG_STD)
    errors = (actions - mean_action(actor, features)) * torch.exp(-log_std)
    losses = (0.5 * errors.square() + log_std).sum(dim=1)
    return (losses if weights is None else weights * losses).mean()


def near_moves(moves: NDArray[np.floating], width: float) -> torch.Tensor:
    """What an answer is worth to each discrete action (A, A), a row an answer: 1 to itself, less to others by their distance.

    Of actions that move the robot alike the first has it all. A differential robot turns on the spot for every heading far
    from its own: 108 of 128 actions are two moves. Counted apart, they share their probability and lose to an action that is
    less likely; counted as two among the 20 that drive on, they win against driving on, which is one meaning in many numbers.
    With answers that are worth something to their neighbours, the likeliest action is the one that most answers come near to.

    Soft labels as of Diaz and Marathe 2019 (Soft labels for ordinal regression, section 3), but for their softmax: answers
    with many neighbours are to weigh more.

    Args:
        moves: the actions as numbers (A, 2).
        width: standard deviation of the bell over their distance [1].
    """
    _, first, which = np.unique(moves, axis=0, return_index=True, return_inverse=True)
    square = ((moves[:, None] - moves[None]) ** 2).sum(axis=2)
    is_first = first[which.reshape(-1)] == np.arange(len(moves))
    return torch.from_numpy(np.where(is_first, np.exp(-0.5 * square / width**2), 0.0).astype(np.float32))


def layers(inputs: int, kwargs: PolicyKwargs) -> torch.nn.Sequential:
    """A network of one output, with the hidden layers of the actor."""
    kind = {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}[kwargs.activation_fn]
    widths = [inputs, *kwargs.net_arch]
    hidden = [(torch.nn.Linear(a, b), kind()) for a, b in zip(widths[:-1], widths[1:], strict=True)]
    return torch.nn.Sequential(*(part for pair in hidden for part in pair), torch.nn.Linear(widths[-1], 1))


class TwinCritics(torch.nn.Module):
    """Two independent judges of features and action, of which the lower is believed: TD3's clipped double Q-learning.

    Args:
        features: how many.
        kwargs: of the network.
    """

    def __init__(self, features: int, kwargs: PolicyKwargs) -> None:
        super().__init__()
        self.first, self.second = (layers(features + 2, kwargs) for _ in range(2))

    def forward(self, features: torch.Tensor, actions: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Both values (b,) of actions (b, 2)."""
        both = torch.cat([features, actions], dim=1)
        first, second = self.first(both)[:, 0], self.second(both)[:, 0]
        return first, second

    def error(self, features: torch.Tensor, actions: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        """Mean squared error of both against the same target (b,)."""
        first, second = self.forward(features, actions)
        return (first - target).square().mean() + (second - target).square().mean()


def target_of(network: torch.nn.Module) -> torch.nn.Module:
    """A copy that follows a network slowly and takes no gradient."""
    return copy.deepcopy(network).requires_grad_(False)


@torch.no_grad()
def follow(target: torch.nn.Module, network: torch.nn.Module, tau: float) -> None:
    """Move a target by a share of the way to its network."""
    for slow, fast in zip(target.parameters(), network.parameters(), strict=True):
        slow.lerp_(fast, tau)


def descend(optimizer: torch.optim.Optimizer, loss: torch.Tensor) -> None:
    """One gradient step."""
    optimizer.zero_grad()
    torch.autograd.backward(loss)
    optimizer.step()
