"""Checkpoints of PPO: a training that was killed goes on from its last one, and ends with the same model bit for bit.

All that the rest of a training depends on is written at the border of a rollout, as plain numbers and tensors. SB3's own
rollouts are shuffled by the process's generator, so ours have a generator of their own.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Callable, Generator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples

from bug_gym.agents.learning.folder import Entered, Point, sha256
from bug_gym.agents.learning.progress import Progress
from bug_gym.agents.learning.vec_envs import TrainingEnv
from bug_gym.files import replaced_when_done

CHECKPOINT = "checkpoint.pt"
"""File of a training's folder that it goes on from."""
MAGIC = b"bug_gym checkpoint, sha256 of what follows: "
"""What it begins with, before the checksum and a line break; then comes what torch has written."""
LIBRARIES = ("stable_baselines3", "numpy", "numba")
"""Whose versions belong to its identity, beside that of torch."""
CODE = ("torch", *LIBRARIES, "bug_gym_source")
"""Of its identity what tells which code has saved it: what goes on with other code ends with another model."""


class Rollouts(RolloutBuffer):
    """SB3's rollouts, shuffled by a generator of their own: it depends on how often it was asked and on nothing else."""

    def __init__(self, *args: Any, seed: int, **kwargs: Any) -> None:
        self.seed, self.rounds = seed, 0
        self.on_batch: Callable[[], None] = lambda: None  # called when a batch has been learnt from
        super().__init__(*args, **kwargs)

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """All samples in a random order, in batches."""
        names = ("observations", "actions", "values", "log_probs", "advantages", "returns")
        if not self.generator_ready:
            for name in names:
                setattr(self, name, self.swap_and_flatten(getattr(self, name)))
            self.generator_ready = True
        arrays = [torch.from_numpy(getattr(self, name)) for name in names]
        parts = [*arrays[:2], *(array.flatten() for array in arrays[2:])]
        order = torch.from_numpy(np.random.default_rng((self.seed, self.rounds)).permutation(len(parts[0])))
        self.rounds += 1
        for some in torch.split(order, batch_size or len(order)):
            yield RolloutBufferSamples(*(part[some] for part in parts))
            self.on_batch()


def save_checkpoint(path: Path, model: PPO, env: TrainingEnv, progress: Progress, identity: Mapping[str, Any]) -> None:
    """Write all that the rest of a PPO training depends on; a kill leaves the old file or the new one."""
    buffer = model.rollout_buffer
    assert isinstance(buffer, Rollouts)
    state = {
        "identity": dict(identity),
        "policy": model.policy.state_dict(),
        "optimizer": model.policy.optimizer.state_dict(),
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "rounds": buffer.rounds,
        "last_obs": model._last_obs,
        "last_episode_starts": model._last_episode_starts,
        "env": env.save(),
        "torch": torch.get_rng_state(),
        "points": [asdict(point) for point in progress.points],
        "best": progress.best,
        "best_point": None if progress.best_point is None else asdict(progress.best_point),
        "entered": [entered.model_dump() for entered in progress.entered],
        "seconds": progress.seconds,
        "cpu_seconds": progress.cpu_seconds,
    }
    buffered = io.BytesIO()
    torch.save(_as_tensors(state), buffered)
    content = buffered.getvalue()
    with replaced_when_done(path) as partial, partial.open("wb") as file:
        file.write(MAGIC + sha256(content).encode() + b"\n")
        file.write(content)


def load_checkpoint(path: Path, identity: Mapping[str, Any]) -> dict[str, Any]:
    """What `save_checkpoint` wrote; it is read as data, no code in it is run.

    Raises:
        ValueError: it is damaged, or of another training.
    """
    head, _, content = path.read_bytes().partition(b"\n")
    if head != MAGIC + sha256(content).encode():
        raise ValueError(f"{path} is damaged: it does not begin with the checksum of its content")
    try:
        state: dict[str, Any] = _as_arrays(torch.load(io.BytesIO(content), weights_only=True))
    except (RuntimeError, EOFError, ValueError, KeyError, pickle.UnpicklingError) as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if not isinstance(state, dict) or not isinstance(state.get("identity"), dict):
        raise ValueError(f"{path} is damaged: it holds no checkpoint")
    for name, value in identity.items():
        if state["identity"].get(name) != value:
            raise ValueError(f"{path} {_told_other(name, state['identity'].get(name), value)}")
    return state


def _told_other(name: str, was: Any, now: Any) -> str:
    """What tells a checkpoint from a training that would go on from it, and what to do, as an error goes on."""
    change = f"{name} was {was}, is now {now}"
    if name in CODE:
        return f"was saved by other code ({change}), it goes on with that alone: give a new --out, or remove it to begin again"
    return f"is of another training: {change}{f'; --threads {was} goes on with it' if name == 'threads' else ''}"


def restore(model: PPO, env: TrainingEnv, state: Mapping[str, Any]) -> Progress:
    """Bring a new model and env to where a checkpoint was saved."""
    model.policy.load_state_dict(state["policy"])
    model.policy.optimizer.load_state_dict(state["optimizer"])
    model.num_timesteps, model._n_updates = state["num_timesteps"], state["n_updates"]
    buffer = model.rollout_buffer
    assert isinstance(buffer, Rollouts)
    buffer.rounds = state["rounds"]
    env.reset()  # which gives every row an episode to put the saved one into
    env.restore(state["env"])
    model._last_obs, model._last_episode_starts = state["last_obs"], state["last_episode_starts"]
    torch.set_rng_state(state["torch"])
    best_point = state["best_point"]
    return Progress(
        [Point(**point) for point in state["points"]],
        state["best"],
        None if best_point is None else Point(**best_point),
        [Entered(**entered) for entered in state["entered"]],
        state["seconds"],
        state["cpu_seconds"],
    )


_ARRAY = "numpy"


def _as_tensors(value: Any) -> Any:
    """The value with arrays as marked tensors: torch reads tensors without running code."""
    if isinstance(value, np.ndarray):
        return (_ARRAY, torch.from_numpy(np.ascontiguousarray(value)))
    if isinstance(value, dict):
        return {key: _as_tensors(item) for key, item in value.items()}
    return [_as_tensors(item) for item in value] if isinstance(value, list) else value


def _as_arrays(value: Any) -> Any:
    if isinstance(value, tuple) and len(value) == 2 and value[0] == _ARRAY:
        return value[1].numpy()
    if isinstance(value, dict):
        return {key: _as_arrays(item) for key, item in value.items()}
    return [_as_arrays(item) for item in value] if isinstance(value, list) else value
