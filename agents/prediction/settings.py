"""How a predictor is trained, as data."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bug_gym.agents.prediction.samples import LAWS, STREET
from bug_gym.checks import checked_count, checked_seed, checked_time
from bug_gym.limits import HEAVY

PPO_SEEDS = 2**32
"""Seeds that PPO can have, those of NumPy's generator that stable-baselines3 seeds."""
THREADS = 2
"""Of torch, and processes that drive in the worlds, unless the command line says another number."""
ON_COMMAND_LINE = ("seed", "worlds", "validation_worlds", "test_worlds", "epochs", "rate", "real", "start_from")
"""Settings that the command line can say."""


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
        for name in ("worlds", "validation_worlds", "epochs", "batch", "rollout"):
            checked_count(name, getattr(self, name))
        checked_count("test_worlds", self.test_worlds, least=1 if self.real is None else 0)
        if checked_time("rate", self.rate) > HEAVY:
            raise ValueError(f"rate must be at most {HEAVY:g}, got {self.rate}")
        if checked_seed(self.seed) >= PPO_SEEDS and self.kind == "ppo":
            raise ValueError(f"a seed of PPO is below 2**32, got {self.seed}")
        if self.tries < 2 or self.tries % 2:
            raise ValueError(f"tries: got {self.tries}, expected an even number of answers")

    @property
    def sources(self) -> tuple[str | Path, ...]:
        """What it learns from, as samples.world_of takes it."""
        return (*LAWS, STREET) if self.real is None else (self.real,)
