"""Episodes that somebody drove by hand, in a file: the scenario, and the seed and actions of each. They replay bit for bit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

import bug_gym
from bug_gym.config import Scenario, checked, dump, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.files import from_json, replaced_when_done
from bug_gym.limits import DATA, read_file
from bug_gym.schema.values import Count, Number, Part
from bug_gym.task import OUTCOMES

JSON = ".json"
"""What names of such files end in."""
SUBJECT = "episodes driven by hand"
"""What they say they hold."""
LET_GO = "let go"
"""Verdict of an episode that nobody drove to its end."""

Lever = Annotated[float, Field(ge=-1.0, le=1.0)]


class DrivenEpisode(Part):
    """One episode, as it was driven."""

    seed: Count
    """Of the world."""
    actions: tuple[tuple[Lever, Lever], ...] = Field(min_length=1)
    """One a step, as `NavigationEnv` takes them."""
    outcome: str
    """How it ended; "running" where nobody drove it to its end."""
    time: Number
    """When [s]."""
    pose: tuple[Number, Number, Number]
    """Where: x, y [m], heading [rad]. A replay ends there, to the last bit."""


class DrivenEpisodes(Part):
    """What a file of them says."""

    holds: str
    """SUBJECT."""
    version: str
    """Of the package that they were driven with."""
    scenario: dict[str, Any]
    """Where, as data."""
    episodes: tuple[DrivenEpisode, ...] = Field(min_length=1)
    """In the order in which they were driven."""


def write_driven(path: Path, scenario: Scenario, episodes: Sequence[DrivenEpisode]) -> None:
    """Write episodes of a scenario into a file, in place of what it held."""
    data = DrivenEpisodes(holds=SUBJECT, version=bug_gym.__version__, scenario=dump(scenario), episodes=tuple(episodes))
    with replaced_when_done(path) as partial:
        partial.write_text(json.dumps(data.model_dump(), allow_nan=False) + "\n", encoding="utf-8")


def read_driven(path: Path, *, trust: bool = False) -> tuple[Scenario, tuple[DrivenEpisode, ...]]:
    """What `write_driven` wrote.

    Raises:
        ValueError: no such file, or one that holds something else.
    """
    if not path.is_file():
        raise ValueError(f"no file {path}")
    try:
        data = from_json(read_file(path, DATA))
    except ValueError as error:
        raise ValueError(f"{path} is damaged: {error}") from None
    if not isinstance(data, dict) or data.get("holds") != SUBJECT:
        raise ValueError(f"{path} holds no {SUBJECT}: `bug-gym play --record` writes such files")
    found = checked(DrivenEpisodes, data, f"{path} is damaged")
    return load(found.scenario, trust=trust), found.episodes


def as_driven(rollout: Rollout, actions: Sequence[NDArray[np.float32]] | NDArray[np.float32]) -> DrivenEpisode:
    """The episode of a rollout's first world, as it stands now.

    Args:
        rollout: of one robot.
        actions: what it was told (2,), one a step.
    """
    world = rollout.simulation.world
    x, y, heading = world.pose[0, 0].tolist()
    return DrivenEpisode(
        seed=int(world.seed[0]),
        actions=tuple((float(first), float(second)) for first, second in actions),
        outcome=OUTCOMES[int(world.outcome[0, 0])],
        time=float(world.time[0]),
        pose=(x, y, heading),
    )


# ---------------------------------------------------------------------------------------------------------------------
# Driven again
# ---------------------------------------------------------------------------------------------------------------------


class _Tape(NamedTuple):
    """Where a replay is."""

    step: int
    verdict: str


class Again:
    """A policy that does what somebody did, step by step, whatever it sees."""

    def __init__(self, episode: DrivenEpisode) -> None:
        self._actions = np.array(episode.actions, dtype=np.float32)

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """The next action (1, 2); behind the last one the verdict LET_GO."""
        begins = state is None or (episode_start is not None and bool(np.any(episode_start)))
        step = 0 if begins or state is None else state[0].step + 1
        is_over = step >= len(self._actions)
        action = np.zeros(2, dtype=np.float32) if is_over else self._actions[step]
        return action[None], (_Tape(step, LET_GO if is_over else ""),)


def again(scenario: Scenario, episode: DrivenEpisode) -> Rollout:
    """A rollout that drives an episode once more."""
    seeds = range(episode.seed, episode.seed + 1)
    return Rollout(PolicyEntry.of(("by hand", Again(episode))), ScenarioEntry(scenario.name, scenario, seeds), seeds)


def require_same_end(scenario: Scenario, episode: DrivenEpisode) -> None:
    """Drive an episode once more, and refuse it where it does not end as it did.

    Raises:
        ValueError: file, package, scenario's files or machine are not those that it was driven with.
    """
    rollout = again(scenario, episode)
    while not rollout.is_over:
        rollout.advance()
    now = as_driven(rollout, np.array(episode.actions, dtype=np.float32))
    if now != episode:
        raise ValueError(
            f"seed {episode.seed} was driven to {_end(episode)}, now it ends with {_end(now)}: it is not what was "
            "recorded, or other code or another machine computes it otherwise"
        )


def _end(episode: DrivenEpisode) -> str:
    x, y, _ = episode.pose
    return f"{episode.outcome} after {episode.time:g} s at ({x!r}, {y!r})"
