"""Training of a predictor by the gradient of a loss: supervision, and REINFORCE.

Supervision takes the gradient of the cost itself. REINFORCE (Williams 1992) knows only the costs of the answers that it
tried; it tries them in pairs to either side of the network's own, so that what both have in common cancels.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch

from bug_gym.agents.learning.models import load_weights
from bug_gym.agents.prediction.features import HORIZONS
from bug_gym.agents.prediction.learned import WEIGHTS, read_config
from bug_gym.agents.prediction.network import Answering, Curve, costs_at_horizons, network
from bug_gym.agents.prediction.samples import Samples, with_mirrored
from bug_gym.agents.prediction.settings import PredictorSettings

Loss = Callable[[torch.Tensor, torch.Tensor, float], torch.Tensor]
"""Of the network's answers and the right ones (n, ANSWERS), after a share of the training."""


def descend(settings: PredictorSettings, training: Samples, validation: Samples, loss: Loss) -> tuple[Answering, Curve]:
    """Train by the gradient of a loss."""
    torch.manual_seed(settings.seed)
    model = Answering(network(settings.hidden))
    if settings.start_from is not None:
        load_weights(settings.start_from / WEIGHTS, model, read_config(settings.start_from)["sha256"][WEIGHTS])
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
