"""The shipped models in 2,000 worlds each that neither training nor validation saw."""

from __future__ import annotations

from typing import Any

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.learning.folder import model_folder, read_config, trained_names
from bug_gym.evaluation.progress import progress_bar
from bug_gym.held_out import TEST_SEEDS, Played, play
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.simulation import Simulation
from bug_gym.task import OUTCOMES

WORLDS = 2000
TARGETS = {"ppo_static": 0.99, "ppo_dynamic": 0.985, "ppo_moving_target": 0.995, "ppo_rush": 0.88}
"""Least success in the scenario that a model is named after, by the plan of the project."""


def reproduce(settings: Settings) -> Reproduction:
    """Play each model in the scenarios that it was trained in; `seeds` is the number of worlds."""
    worlds = settings.seeds or WORLDS
    names = settings.policies or trained_names()
    tasks = [
        (name, scenario) for name in names for scenario in read_config(model_folder(name))["settings"]["scenarios"]
    ]
    found: dict[str, dict[str, Any]] = {name: {} for name in names}
    episodes: list[Replayable] = []
    with progress_bar(shown=settings.progress) as track:
        for name, scenario in track(tasks, "models", len(tasks)):
            simulation = Simulation(scenario)
            seeds = range(TEST_SEEDS, TEST_SEEDS + worlds)
            played = play(make_policy(name, simulation), simulation.scenario, seeds)
            found[name][scenario] = played.summary()
            episodes += shown(name, scenario, seeds, played)
    missed = [name for name in found if name in TARGETS and _only(found[name])["success"] < TARGETS[name]]
    return Reproduction(
        "learned",
        [
            Table(
                f"Learned policies in {worlds:,} held-out worlds",
                ["policy", "scenario", "success [%]", "95 %", "collision [%]", "timeout [%]", "time [s]"],
                [_row(name, scenario, held) for name in found for scenario, held in found[name].items()],
            )
        ],
        [f"below its target of {100 * TARGETS[name]:g} %: {name}" for name in missed],
        {"worlds": worlds, "models": found, "targets": TARGETS},
        not missed,
        episodes=episodes,
    )


def shown(name: str, scenario: str, seeds: range, played: Played) -> list[Replayable]:
    """The episodes of a model in a scenario, for the page; those of several robots by the first one that failed."""
    worst = played.ended("success").argmin(axis=1)
    ends = [OUTCOMES[number] for number in played.outcome[np.arange(len(seeds)), worst].tolist()]
    return [
        Replayable(name, scenario, seed, end == "success", end, "", name, scenario)
        for seed, end in zip(seeds, ends, strict=True)
    ]


def _only(results: dict[str, Any]) -> dict[str, Any]:
    (result,) = results.values()
    return dict(result)


def _row(name: str, scenario: str, held: dict[str, Any]) -> list[str]:
    shares = [f"{100 * held[outcome]:.1f}" for outcome in ("collision", "timeout")]
    interval = f"{100 * held['low']:.1f} - {100 * held['high']:.1f}"
    time = "-" if held["time"] is None else f"{held['time']:.1f}"
    return [name, scenario, f"{100 * held['success']:.1f}", interval, *shares, time]
