"""All policies on one map, side by side: one picture of their ways and one film of them on their way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from bug_gym.config import Scenario
from bug_gym.drawing.canvas import Canvas
from bug_gym.drawing.clips import grid, save_gif, save_png, together
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.pictures import film, portrait
from bug_gym.evaluation.rollout import Rollout

FRAMES = 36
"""Most frames of the film; a longer episode is shown faster."""


def draw_gallery(
    scenario: Scenario, policies: Sequence[PolicyEntry], *, seed: int, size: int, png: Path, gif: Path | None
) -> None:
    """Drive each policy through the world of a seed; write the picture, and the film where one is asked for."""
    entry = ScenarioEntry(scenario.name, scenario, range(seed, seed + 1))

    def canvas_of(policy: PolicyEntry) -> tuple[Rollout, Canvas]:
        rollout = Rollout(policy, entry, [seed], slots=1)
        return rollout, Canvas(rollout.simulation, size=size, title=policy.label)

    save_png(png, grid([portrait(*canvas_of(policy)) for policy in policies]))
    if gif is None:
        return
    steps = max(len_of(policy, entry, seed) for policy in policies)
    every = max(1, math.ceil(steps / FRAMES))
    films = [film(*canvas_of(policy), every=every, scan=False) for policy in policies]
    save_gif(gif, together(films), 1.0 / (scenario.time.step * min(every, 4)))


def len_of(policy: PolicyEntry, entry: ScenarioEntry, seed: int) -> int:
    """Steps of the episode of a policy."""
    ((row, *_),) = Rollout(policy, entry, [seed], slots=1).worlds()
    return row.steps
