"""Trainings that diverge: the numbers of a network become none, and a line says of which training, when, and at what rate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

from bug_gym.agents.learning.settings import AnySettings


class NotFiniteError(ArithmeticError):
    """Weights of a network are NaN or infinite."""


def require_finite(network: torch.nn.Module) -> None:
    """Refuse a network with weights that are no numbers; not all that is computed with them would fail.

    Raises:
        NotFiniteError: it has some.
    """
    lost = [name for name, value in network.state_dict().items() if not bool(torch.isfinite(value).all())]
    if lost:
        raise NotFiniteError(f"{len(lost)} of {len(network.state_dict())} tensors are not finite, {lost[0]} the first")


@contextmanager
def told_when_diverged(settings: AnySettings, seed: int, steps: Callable[[], int]) -> Iterator[None]:
    """Have a training that diverges say so; of torch's distributions one hears all numbers that came.

    Args:
        settings: of the training.
        seed: of it.
        steps: tells how many of its steps are done.

    Raises:
        ValueError: it has diverged.
    """
    try:
        yield
    except (ValueError, NotFiniteError) as error:
        if not tells_divergence(error):
            raise
        what = f"{settings.name} ({settings.algo}, seed {seed})"
        when = f"after {steps():,} of {settings.n_timesteps:,} steps"
        why = f"its network answers with NaN or infinity; learning_rate is {settings.learning_rate}, try a smaller one"
        raise ValueError(f"{what} has diverged {when}: {why}") from error


def tells_divergence(error: ValueError | NotFiniteError) -> bool:
    """Whether an error is about numbers that are none: ours, or one of torch's distributions about their parameters."""
    if isinstance(error, NotFiniteError):
        return True
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    return frame is not None and str(frame.tb_frame.f_globals.get("__name__")).startswith("torch.distributions.")
