"""How fast PPO learns Dynamic: success in validation worlds over the time of one core, and a gate by steps."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from typing import Any

from bug_gym.agents.learning.settings import load_settings
from bug_gym.checks import needed_from
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.result import Curves, Reproduction, Settings, Table

SEEDS = 3
STEPS = 1_500_000
GATE = 0.9
"""Success that 1.5 million steps have to reach, by the plan of the project."""
WORLDS = 500
CHANGES = {"n_timesteps": STEPS, "eval_freq": 95_000, "eval_episodes": WORLDS, "test_episodes": WORLDS}


def reproduce(settings: Settings) -> Reproduction:
    """Train a model for each seed, validating often."""
    with needed_from("train", "ppo-curve"):
        from bug_gym.agents.learning.training import train  # needs the extra `train`

    training = load_settings("ppo_dynamic", CHANGES)
    curves = []
    for seed in range(settings.seeds or SEEDS):
        with tempfile.TemporaryDirectory() as folder:
            points = train(
                training, Path(folder), seed=seed, threads=1, tensorboard=False, progress=settings.progress
            ).points
        curves.append(
            [{"steps": point.steps, "seconds": point.cpu_seconds, "success": point.success} for point in points]
        )
    last = [curve[-1]["success"] for curve in curves]
    seconds_of = [[point["seconds"] for point in curve] for curve in curves]
    seconds = [round(mean(points), 1) for points in zip(*seconds_of, strict=True)]
    return Reproduction(
        "ppo-curve",
        [
            Table(
                "PPO on Dynamic",
                ["seed", "steps", "seconds of one core", "success [%]", "90 % after [s]", "98 % after [s]"],
                [_row(seed, curve) for seed, curve in enumerate(curves)],
            )
        ],
        [
            f"{WORLDS} validation worlds at each point; validation does not count as time.",
            f"The step size falls to 0 at {STEPS:,} steps: this is a whole training, not the beginning of a longer one.",
        ],
        {"curves": curves, "gate": GATE},
        min(last) >= GATE,
        [
            Curves(
                "PPO on BugGym/Dynamic-v0",
                "training [s of one core]",
                "success in validation worlds",
                seconds,
                {
                    f"seed {seed}": [_with_interval(point["success"]) for point in curve]
                    for seed, curve in enumerate(curves)
                },
            )
        ],
    )


def _with_interval(success: float) -> tuple[float, float, float]:
    return (success, *wilson_interval(round(success * WORLDS), WORLDS))


def _row(seed: int, curve: Sequence[dict[str, Any]]) -> list[str]:
    last = curve[-1]
    first = [next((point["seconds"] for point in curve if point["success"] >= share), None) for share in (0.9, 0.98)]
    times = ["-" if time is None else f"{time:.0f}" for time in first]
    return [str(seed), f"{last['steps']:,}", f"{last['seconds']:.0f}", f"{100 * last['success']:.1f}", *times]
