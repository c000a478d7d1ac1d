"""All policies on one map, side by side: one picture of their ways and one film of them on their way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from bug_gym.config import Scenario
from bug_gym.rendering import Canvas, Frame, save_gif, save_png
from bug_gym.rollout import Rollout, film, portrait
from bug_gym.suites import PolicyEntry, ScenarioEntry

COLUMNS = 5
FRAMES = 150
"""Most frames of the film; a longer episode is shown faster."""


def grid(frames: Sequence[Frame], columns: int = COLUMNS) -> Frame:
    """Frames (h, w, 3) of one size in rows of `columns`, the rest white."""
    columns = min(columns, len(frames))
    rows = math.ceil(len(frames) / columns)
    height, width, _ = frames[0].shape
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for number, frame in enumerate(frames):
        row, column = divmod(number, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = frame
    return sheet


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
    films = [film(*canvas_of(policy), every=every) for policy in policies]
    save_gif(gif, together(films), 1.0 / (scenario.time.step * min(every, 4)))


def len_of(policy: PolicyEntry, entry: ScenarioEntry, seed: int) -> int:
    """Steps of the episode of a policy."""
    ((row, *_),) = Rollout(policy, entry, [seed], slots=1).worlds()
    return row.steps


def together(films: Sequence[Iterator[Frame]]) -> Iterator[Frame]:
    """The films side by side until the last has ended; one that has ended stands still."""
    last = [next(one) for one in films]
    going = list(range(len(films)))
    yield grid(last)
    while going:
        for number in list(going):
            frame = next(films[number], None)
            if frame is None:
                going.remove(number)
            else:
                last[number] = frame
        yield grid(last)
